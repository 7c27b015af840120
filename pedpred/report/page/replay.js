// A stretch of a scene: millimetres and hundredths of a second in, metres and seconds out. y points up.
function bitPicture(columns, lines, colour, isSet) {
  const picture = Object.assign(document.createElement("canvas"), { width: columns, height: lines });
  const brush = picture.getContext("2d");
  brush.fillStyle = colour;
  for (let line = 0; line < lines; line++) {
    for (let column = 0; column < columns; column++) if (isSet(column, line)) brush.fillRect(column, line, 1, 1);
  }
  return picture;
}

function summed(values) {
  let sum = 0;
  return values.map((value) => (sum += value));
}

// Points of paths, [point][axis][row], from their second differences, [axis][point][row]; the present comes first.
function pathsOf(bends, step, rows) {
  const still = new Array(rows).fill(0), points = [[still, still]];
  bends[0].forEach((_, k) => {
    const [last, older] = [points[k], points[Math.max(k - 1, 0)]];
    points.push(bends.map((axis, i) => axis[k].map((bend, row) => 2 * last[i][row] - older[i][row] + step * bend)));
  });
  return points;
}

class Replay {
  // Unpacks what player.py packs: JSON, compressed by gzip, in base 64.
  static async read({ header, data }) {
    const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
    const text = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Replay(header, await new Response(text).json());
  }

  constructor(header, data) {
    Object.assign(this, { header, map: data.map, paths: {}, modes: {} });
    for (const name of ["seen", "rows"]) {
      const { track, clock, x, y } = data[name];
      this[name] = { track: summed(track), clock: summed(clock), at: [x, y].map(summed) };
    }
    const { rows, seen } = this, { vx, vy, heading } = data.rows;
    rows.velocity = [vx, vy].map(summed);
    rows.heading = summed(heading).map((tenths) => (tenths + 0.5) * 1e-4);
    this.tracks = new Map(Replay.runs(seen.track).map((run) => [run.value, run]));
    const order = rows.track.map((_, row) => row).sort((a, b) => rows.clock[a] - rows.clock[b] || a - b);
    this.frames = Replay.runs(order.map((row) => rows.clock[row]))
      .map(({ value, begin, end }) => ({ value, rows: order.slice(begin, end) }));
    for (const [name, bends] of Object.entries(data.paths)) this.paths[name] = pathsOf(bends, header.path_mm, rows.track.length);
    for (const [name, modes] of Object.entries(data.modes)) {
      this.modes[name] = modes.map(({ parts, bends }) => {
        const places = summed(parts.map((part) => (part > 0 ? 1 : 0)));
        return { parts, places, points: pathsOf(bends, header.mode_mm, places[places.length - 1]) };
      });
    }
    const places = summed(data.missed.places);
    this.missed = new Map(places.map((place, k) => [place, data.missed.by[k]]));
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

  // Where the straight line between two detections is at a time, mm; held before the first and after the last.
  lineAt(track, now) {
    if (!this.tracks.has(track)) return [0, 0];
    const { begin, end } = this.tracks.get(track), { clock, at } = this.seen;
    let after = begin;
    while (after < end - 1 && clock[after] < now) after++;
    const before = Math.max(after - 1, begin), span = Math.max(clock[after] - clock[before], 1);
    const way = Math.min(Math.max(now - clock[before], 0), clock[after] - clock[before]);
    return at.map((axis) => Math.floor((2 * (axis[before] * (span - way) + axis[after] * way) + span) / (2 * span)));
  }

  // The first of the frames with most forecasts; a replay has at least one.
  fullestFrame() {
    return this.frames.reduce((best, frame) => (frame.rows.length > best.rows.length ? frame : best));
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
    if (!frame || time - frame.value / 100 > this.header.hold_s) return rows;
    for (const row of frame.rows) rows.set(this.rows.track[row], row);
    return rows;
  }

  // Who is there, on the line between two detections, with the way behind: {track, x, y, tail}.
  peopleAt(time) {
    const { clock, at } = this.seen, now = 100 * time, people = [];
    const point = (k) => at.map((axis) => axis[k] / 1000);
    for (const [track, { begin, end }] of this.tracks) {
      let after = begin;
      while (after < end && clock[after] < now - 0.01) after++;
      const before = after < end && clock[after] <= now + 0.01 ? after : after - 1;
      if (before < begin || after === end || clock[after] - clock[before] > 100 * this.header.gap_s + 1) continue;
      const [x, y] = this.lineAt(track, now).map((value) => value / 1000), tail = [];
      for (let k = before; k >= begin && clock[k] >= now - 100 * this.header.tail_s; k--) tail.unshift(point(k));
      people.push({ track, x, y, tail: [...tail, [x, y]] });
    }
    return people;
  }

  // The present and every point of a path ("truth" or a method's) of a row, m.
  path(name, row) { return this.points(this.paths[name], row, row); }

  // Points of the path of a row, which stands at a place among all paths.
  points(paths, place, row) {
    const [x, y] = this.rows.at.map((axis) => axis[row]);
    return paths.map(([dx, dy]) => [(x + dx[place]) / 1000, (y + dy[place]) / 1000]);
  }

  // The likely ones of the weighted paths of a method that gives several: {points, weight}.
  modesOf(name, row) {
    return (this.modes[name] ?? []).filter(({ parts }) => parts[row] > 0)
      .map(({ parts, places, points }) =>
        ({ points: this.points(points, places[row] - 1, row), weight: parts[row] * this.header.weight }));
  }

  heading(row) { return this.rows.heading[row]; }

  speed(row) { return Math.hypot(...this.rows.velocity.map((axis) => axis[row])) / 1000; }

  // How far a method's forecast of a row is off: over all steps and at the last one, m.
  error(method, row) {
    const truth = this.path("truth", row).slice(1), path = this.path(method, row).slice(1);
    const off = truth.map(([x, y], k) => Math.hypot(path[k][0] - x, path[k][1] - y));
    return { mean: off.reduce((sum, e) => sum + e, 0) / off.length, last: off[off.length - 1] };
  }

  // The obstacle grid that the network gets of a row, [forward][left] in one array: the map under each cell's
  // centre, and what that differs by from the exact pose.
  grid(row) {
    const { grid_cells: side, cell_m: cell, map_cell_m: own, map_cells: [columns, lines], cones } = this.header;
    const scale = 1 / own, step = cell * scale, [x, y] = this.rows.at.map((axis) => (axis[row] / 1000) * scale);
    const cos = Math.cos(this.heading(row)) * step, sin = Math.sin(this.heading(row)) * step;
    return Array.from({ length: side * side }, (_, k) => {
      const ahead = Math.floor(k / side) + 0.5 - side / 2, left = (k % side) + 0.5 - side / 2;
      const column = Math.floor(x + cos * ahead - sin * left), line = Math.floor(y + sin * ahead + cos * left);
      const inside = column >= 0 && column < columns && line >= 0 && line < lines;
      return (inside ? this.map[line * columns + column] : 0) + (this.missed.get(row * (side * side + cones) + k) ?? 0);
    });
  }

  // Distance of the nearest person in each cone that the network gets, m, counter-clockwise from the heading; of
  // those detected at the time, where they are tracked if that is known, and what that differs by.
  cones(row) {
    const { cones, range_m: range, levels, grid_cells: side } = this.header, { track, clock, at } = this.rows;
    const nearest = new Array(cones).fill(range * range), rows = this.rowsAt(clock[row] / 100), turn = 2 * Math.PI;
    for (const [other, { begin, end }] of this.tracks) {
      const here = this.seen.clock.indexOf(clock[row], begin);
      if (other === track[row] || here < 0 || here >= end) continue;
      const place = rows.has(other) ? at.map((axis) => axis[rows.get(other)]) : this.seen.at.map((axis) => axis[here]);
      const [dx, dy] = place.map((value, axis) => value / 1000 - at[axis][row] / 1000), square = dx * dx + dy * dy;
      const cone = Math.floor(((Math.atan2(dy, dx) - this.heading(row) + 2 * turn) * cones) / turn) % cones;
      nearest[cone] = Math.min(nearest[cone], square);
    }
    const first = row * (side * side + cones) + side * side;
    return nearest.map((square, k) => {
      const shown = Math.floor(Math.fround(Math.sqrt(square)) * (levels / range) + 0.5);
      return ((shown + (this.missed.get(first + k) ?? 0)) / levels) * range;
    });
  }

  gridPicture(row, colour) {
    const side = this.header.grid_cells, cells = this.grid(row);
    return bitPicture(side, side, colour, (column, line) => cells[(side - 1 - line) * side + side - 1 - column]);
  }

  // The map as a picture of one pixel per cell, the largest y on top.
  mapPicture(colour) {
    const [columns, lines] = this.header.map_cells;
    return bitPicture(columns, lines, colour, (column, line) => this.map[(lines - 1 - line) * columns + column]);
  }
}
