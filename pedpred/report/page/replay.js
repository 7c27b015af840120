// A stretch of a scene: centimetres and hundredths of a second in, metres and seconds out. y points up.
// Reverses what player.py packs.
async function inflated(base64) {
  const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(plain).arrayBuffer());
}

// Zigzag integers of seven bits per byte.
function integers(bytes) {
  const found = [];
  for (let k = 0; k < bytes.length; k++) {
    let value = bytes[k] & 127;
    for (let shift = 7; bytes[k] & 128; shift += 7) value |= (bytes[++k] & 127) << shift;
    found.push(value & 1 ? -(value + 1) / 2 : value / 2);
  }
  return found;
}

function summed(values) {
  let sum = 0;
  return values.map((value) => (sum += value));
}

const bit = (bytes, k) => (bytes[k >> 3] >> (k & 7)) & 1;

function bitPicture(columns, lines, colour, isSet) {
  const picture = Object.assign(document.createElement("canvas"), { width: columns, height: lines });
  const brush = picture.getContext("2d");
  brush.fillStyle = colour;
  for (let line = 0; line < lines; line++) {
    for (let column = 0; column < columns; column++) if (isSet(column, line)) brush.fillRect(column, line, 1, 1);
  }
  return picture;
}

// The points of a path in the order in which they are coded.
function pointOrder(steps) {
  const order = [steps];
  while (order.length < steps) {
    const ends = [0, ...order].sort((a, b) => a - b);
    let widest = 0;
    for (let k = 1; k < ends.length - 1; k++) if (ends[k + 1] - ends[k] > ends[widest + 1] - ends[widest]) widest = k;
    order.push((ends[widest] + ends[widest + 1]) >> 1);
  }
  return order;
}

class Replay {
  static async read({ header, data }) {
    return new Replay(header, integers(await inflated(data)));
  }

  constructor(header, values) {
    Object.assign(this, { header, columns: {} });
    let offset = 0;
    for (const [name, shape] of header.columns) {
      const count = shape.reduce((product, size) => product * size, 1);
      this.columns[name] = values.slice(offset, offset + count);
      offset += count;
    }
    const { columns } = this, seen = columns.seen_track.length;
    for (const name of ["seen_track", "seen_time", "track", "time"]) columns[name] = summed(columns[name]);
    this.seen = [summed(columns.seen_at.slice(0, seen)), summed(columns.seen_at.slice(seen))];
    this.frames = Replay.runs(columns.time);
    this.tracks = new Map(Replay.runs(columns.seen_track).map((run) => [run.value, run]));
    this.paths = { truth: this.truths() };
    for (const name of header.methods) this.paths[name] = this.forecasts(columns[`path_${name}`]);
  }

  // Stretches of equal values: {value, begin, end}.
  static runs(values) {
    const found = [];
    for (let k = 0; k < values.length; k++) {
      if (!k || values[k] !== values[k - 1]) found.push({ value: values[k], begin: k });
      found[found.length - 1].end = k + 1;
    }
    return found;
  }

  // Where the straight line between two detections is at a time, cm; held before the first and after the last.
  lineAt(track, now) {
    if (!this.tracks.has(track)) return [0, 0];
    const { begin, end } = this.tracks.get(track), clock = this.columns.seen_time;
    let after = begin;
    while (after < end - 1 && clock[after] < now) after++;
    const before = clock[after] > now && after > begin ? after - 1 : after;
    const part = before === after ? 0 : (now - clock[before]) / (clock[after] - clock[before]);
    return this.seen.map((axis) => axis[before] + part * (axis[after] - axis[before]));
  }

  // The present and the true points of every row: [point][axis][row], cm.
  truths() {
    const { track, time, truth } = this.columns, rows = track.length, { steps, step_s: step } = this.header;
    const found = Array.from({ length: steps + 1 }, () => [[], []]);
    for (let row = 0; row < rows; row++) {
      found.forEach((point, k) => {
        const line = this.lineAt(track[row], time[row] + k * Math.round(100 * step));
        line.forEach((value, axis) => { point[axis][row] = Math.floor(value + 0.5) + truth[(2 * k + axis) * rows + row]; });
      });
    }
    return found;
  }

  // The points of every row of a method, and the present before them: [point][axis][row], cm.
  forecasts(codes) {
    const { track } = this.columns, rows = track.length, { steps, coarse_cm: coarse } = this.header;
    const found = [[new Array(rows).fill(0), new Array(rows).fill(0)]], known = [0];
    pointOrder(steps).forEach((point, rank) => {
      const near = [...known].sort((a, b) => Math.abs(a - point) - Math.abs(b - point) || a - b).slice(0, 3);
      const weights = near.map((node) => near.reduce((w, other) => (other === node ? w : w * ((point - other) / (node - other))), 1));
      found[point] = [0, 1].map((axis) => {
        const last = new Map(), values = [];
        for (let row = 0; row < rows; row++) {
          const code = codes[(2 * rank + axis) * rows + row];
          if (rank) {
            const expected = near.reduce((sum, node, k) => sum + weights[k] * found[node][axis][row], 0);
            values.push(Math.floor(expected + 0.5) + (rank > 1 ? coarse : 1) * code);
          } else {
            last.set(track[row], (last.get(track[row]) ?? 0) + code);
            values.push(last.get(track[row]));
          }
        }
        return values;
      });
      known.push(point);
    });
    const present = this.paths.truth[0];
    return found.map((point) => point.map((values, axis) => values.map((value, row) => value + present[axis][row])));
  }

  // The first of the frames with most forecasts; a replay has at least one.
  fullestFrame() {
    return this.frames.reduce((best, frame) => (frame.end - frame.begin > best.end - best.begin ? frame : best));
  }

  // The latest frame of forecasts at a time, or -1.
  frameAt(time) {
    let low = 0, high = this.frames.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.frames[middle].value <= 100 * time + 0.01) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  // Rows of the forecasts that hold at a time, by track: none of an instant long gone.
  rowsAt(time) {
    const frame = this.frames[this.frameAt(time)], rows = new Map();
    if (!frame || time - frame.value / 100 > this.header.gap_s) return rows;
    for (let row = frame.begin; row < frame.end; row++) rows.set(this.columns.track[row], row);
    return rows;
  }

  // Who is there, on the line between two detections, with the way behind: {track, x, y, tail}.
  peopleAt(time) {
    const clock = this.columns.seen_time, now = 100 * time, people = [];
    const point = (k) => this.seen.map((axis) => axis[k] / 100);
    for (const [track, { begin, end }] of this.tracks) {
      let after = begin;
      while (after < end && clock[after] < now - 0.01) after++;
      const before = after < end && clock[after] <= now + 0.01 ? after : after - 1;
      if (before < begin || after === end || clock[after] - clock[before] > 100 * this.header.gap_s + 1) continue;
      const [x, y] = this.lineAt(track, now).map((value) => value / 100), tail = [];
      for (let k = before; k >= begin && clock[k] >= now - 100 * this.header.tail_s; k--) tail.unshift(point(k));
      people.push({ track, x, y, tail: [...tail, [x, y]] });
    }
    return people;
  }

  // The present and every point of a path ("truth" or a method's) of a row.
  path(name, row) { return this.paths[name].map(([x, y]) => [x[row] / 100, y[row] / 100]); }

  heading(row) { return this.columns.heading[row] / 100; }

  speed(row) { return this.columns.speed[row] / 100; }

  // How far a method's forecast of a row is off: over all steps and at the last one, m.
  error(method, row) {
    const truth = this.path("truth", row).slice(1), path = this.path(method, row).slice(1);
    const off = truth.map(([x, y], k) => Math.hypot(path[k][0] - x, path[k][1] - y));
    return { mean: off.reduce((sum, e) => sum + e, 0) / off.length, last: off[off.length - 1] };
  }

  // The obstacle grid of a row as a picture of one pixel per cell, heading up: the map under each cell's centre.
  gridPicture(row, colour) {
    const { grid_cells: side, cell_m: cell } = this.header, [[x, y]] = this.path("truth", row);
    const cos = Math.cos(this.heading(row)), sin = Math.sin(this.heading(row));
    return bitPicture(side, side, colour, (column, line) => {
      const ahead = (side / 2 - line - 0.5) * cell, left = (side / 2 - column - 0.5) * cell;
      return this.occupied(x + cos * ahead - sin * left, y + sin * ahead + cos * left);
    });
  }

  // Whether a point (m) is in an obstacle; outside the map is free.
  occupied(x, y) {
    const { map_columns: columns, size_m: size } = this.header, cell = size[0] / columns;
    const column = Math.floor(x / cell), line = Math.floor(y / cell), wide = 8 * this.mapBytes;
    const inside = column >= 0 && column < columns && line >= 0 && line < this.mapLines;
    return inside && bit(this.columns.obstacles, line * wide + column);
  }

  get mapLines() { return this.header.columns[0][1][0]; }

  get mapBytes() { return this.header.columns[0][1][1]; }

  // Distance of the nearest person in each cone, m, counter-clockwise from the heading.
  cones(row) {
    const { cones, range_m: range } = this.header, [[x, y]] = this.path("truth", row), turn = 2 * Math.PI;
    const found = new Array(cones).fill(range);
    for (const other of this.peopleAt(this.columns.time[row] / 100)) {
      if (other.track === this.columns.track[row]) continue;
      const angle = Math.atan2(other.y - y, other.x - x) - this.heading(row) + 2 * turn;
      const cone = Math.floor(((angle % turn) * cones) / turn) % cones;
      found[cone] = Math.min(found[cone], Math.hypot(other.x - x, other.y - y));
    }
    return found;
  }

  // The map as a picture of one pixel per cell, the largest y on top.
  mapPicture(colour) {
    const { mapLines: lines, mapBytes: wide } = this;
    return bitPicture(this.header.map_columns, lines, colour,
      (column, line) => bit(this.columns.obstacles, (lines - 1 - line) * 8 * wide + column));
  }
}
