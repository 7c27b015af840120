// A stretch of a scene: centimetres and hundredths of a second in, metres and seconds out. y points up.
const ARRAYS = { int16: Int16Array, uint8: Uint8Array };

async function inflated(base64) {
  const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(plain).arrayBuffer();
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

class Replay {
  static async read({ header, data }) {
    return new Replay(header, await inflated(data));
  }

  constructor(header, buffer) {
    Object.assign(this, { header, columns: {}, widths: {} });
    let offset = 0;
    for (const [name, type, shape] of header.columns) {
      const count = shape.reduce((product, size) => product * size, 1);
      const bytes = count * ARRAYS[type].BYTES_PER_ELEMENT;
      this.columns[name] = new ARRAYS[type](buffer.slice(offset, offset + bytes));
      this.widths[name] = count / (shape[0] || 1);
      offset += bytes;
    }
    this.frames = Replay.runs(this.columns.time);
    this.tracks = new Map(Replay.runs(this.columns.seen_track).map((run) => [run.value, run]));
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
    const { seen_time: clock, seen_at: at } = this.columns, now = 100 * time, people = [];
    const point = (k) => [at[2 * k] / 100, at[2 * k + 1] / 100];
    for (const [track, { begin, end }] of this.tracks) {
      let after = begin;
      while (after < end && clock[after] < now - 0.01) after++;
      const before = after < end && clock[after] <= now + 0.01 ? after : after - 1;
      if (before < begin || after === end || clock[after] - clock[before] > 100 * this.header.gap_s + 1) continue;
      const part = after === before ? 0 : (now - clock[before]) / (clock[after] - clock[before]);
      const [a, b] = [point(before), point(after)];
      const [x, y] = [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])];
      const tail = [];
      for (let k = before; k >= begin && clock[k] >= now - 100 * this.header.tail_s; k--) tail.unshift(point(k));
      people.push({ track, x, y, tail: [...tail, [x, y]] });
    }
    return people;
  }

  // The present and every point of a path ("truth" or a method's) of a row.
  path(name, row) {
    const { at } = this.columns, steps = this.columns[name], width = this.widths[name];
    let x = at[2 * row], y = at[2 * row + 1];
    const points = [[x / 100, y / 100]];
    for (let k = row * width; k < (row + 1) * width; k += 2) {
      x += steps[k];
      y += steps[k + 1];
      points.push([x / 100, y / 100]);
    }
    return points;
  }

  heading(row) { return this.columns.heading[row] / 1000; }

  speed(row) { return this.columns.speed[row] / 100; }

  // How far a method's forecast of a row is off: over all steps and at the last one, m.
  error(method, row) {
    const truth = this.path("truth", row).slice(1), path = this.path(`path_${method}`, row).slice(1);
    const off = truth.map(([x, y], k) => Math.hypot(path[k][0] - x, path[k][1] - y));
    return { mean: off.reduce((sum, e) => sum + e, 0) / off.length, last: off[off.length - 1] };
  }

  // The obstacle grid of a row as a picture of one pixel per cell, heading up.
  gridPicture(row, colour) {
    const width = this.widths.grid, side = Math.floor(Math.sqrt(8 * width));
    const bits = this.columns.grid.subarray(row * width, (row + 1) * width);
    return bitPicture(side, side, colour, (column, line) => bit(bits, (side - 1 - line) * side + side - 1 - column));
  }

  // Distance of the nearest person in each cone, m, counter-clockwise from the heading.
  cones(row) {
    const width = this.widths.angular, { range_m: range, angular_levels: levels } = this.header;
    return Array.from(this.columns.angular.subarray(row * width, (row + 1) * width), (v) => (v * range) / levels);
  }

  // The map as a picture of one pixel per cell, the largest y on top.
  mapPicture(colour) {
    const wide = 8 * this.widths.obstacles, bits = this.columns.obstacles;
    const lines = (8 * bits.length) / wide;
    return bitPicture(this.header.map_columns, lines, colour, (column, line) => bit(bits, (lines - 1 - line) * wide + column));
  }
}
