// A stretch of a scene as player.py packs it, in metres and seconds; y points up.
const summed = (values) => {
  let sum = 0;
  return values.map((value) => (sum += value));
};

// Points of paths from the present on, [point][axis][row], from their second differences, [axis][point][row].
function pathsOf(bends, step_mm) {
  const still = bends[0][0].map(() => 0), points = [[still, still]];
  bends[0].forEach((_, k) => {
    const [last, older] = [points[k], points[Math.max(k - 1, 0)]];
    points.push(bends.map((axis, i) =>
      axis[k].map((bend, row) => 2 * last[i][row] - older[i][row] + (step_mm / 1000) * bend)));
  });
  return points;
}

// Stretches of equal values: {value, begin, end}.
function runsOf(values) {
  const runs = [];
  values.forEach((value, k) => {
    if (!k || value !== values[k - 1]) runs.push({ value, begin: k });
    runs[runs.length - 1].end = k + 1;
  });
  return runs;
}

class Replay {
  static async read({ header, data }) {
    const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
    const text = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Replay(header, await new Response(text).json());
  }

  constructor(header, data) {
    Object.assign(this, { header, map: data.map, paths: {}, modes: {} });
    for (const name of ["seen", "rows"]) {
      const { track, clock, x, y } = data[name], scaled = (values, unit) => summed(values).map((v) => v * unit);
      this[name] = { track: summed(track), time: scaled(clock, 0.01), at: [x, y].map((axis) => scaled(axis, 0.001)) };
    }
    this.speed = data.speed.map((speed) => speed / 100);
    this.heading = data.heading.map((heading) => heading / 10000);
    this.tracks = new Map(runsOf(this.seen.track).map((run) => [run.value, run]));
    const { track, time } = this.rows, order = track.map((_, row) => row).sort((a, b) => time[a] - time[b] || a - b);
    this.frames = runsOf(order.map((row) => time[row]))
      .map(({ value, begin, end }) => ({ time: value, rows: order.slice(begin, end) }));
    for (const [name, bends] of Object.entries(data.paths)) this.paths[name] = pathsOf(bends, header.path_mm);
    for (const [name, modes] of Object.entries(data.modes)) {
      this.modes[name] = modes.map(({ parts, bends }) => ({ parts, paths: pathsOf(bends, header.mode_mm) }));
    }
  }

  // The latest frame of forecasts at a time, or -1.
  frameAt(time) { return this.frames.findLastIndex((frame) => frame.time <= time + 1e-4); }

  // Rows of the forecasts that hold at a time, by track: none of an instant long gone.
  rowsAt(time) {
    const frame = this.frames[this.frameAt(time)];
    const rows = !frame || time - frame.time > this.header.hold_s ? [] : frame.rows;
    return new Map(rows.map((row) => [this.rows.track[row], row]));
  }

  // Who is there, on the line between two detections, with the way behind: {track, x, y, tail}.
  peopleAt(now) {
    const { time, at } = this.seen, people = [], slack = 1e-4;
    for (const [track, { begin, end }] of this.tracks) {
      let after = begin;
      while (after < end && time[after] < now - slack) after++;
      const before = after < end && time[after] <= now + slack ? after : after - 1;
      if (before < begin || after === end || time[after] - time[before] > this.header.gap_s + 0.01) continue;
      const share = after > before ? (now - time[before]) / (time[after] - time[before]) : 0;
      const [x, y] = at.map((axis) => axis[before] + share * (axis[after] - axis[before])), tail = [[x, y]];
      for (let k = before; k >= begin && time[k] >= now - this.header.tail_s; k--) tail.unshift(at.map((axis) => axis[k]));
      people.push({ track, x, y, tail });
    }
    return people;
  }

  // The present and every point of a path ("truth" or a method's) of a row.
  path(name, row) { return this.points(this.paths[name], row); }

  points(paths, row) {
    const [x, y] = this.rows.at.map((axis) => axis[row]);
    return paths.map(([dx, dy]) => [x + dx[row], y + dy[row]]);
  }

  // The likely ones of the weighted paths of a method that gives several: {points, weight}.
  modesOf(name, row) {
    return (this.modes[name] ?? []).filter(({ parts }) => parts[row])
      .map(({ parts, paths }) => ({ points: this.points(paths, row), weight: parts[row] * this.header.weight }));
  }

  // How far a method's forecast of a row is off: over all steps and at the last one, m.
  error(method, row) {
    const path = this.path(method, row), truth = this.path("truth", row);
    const off = truth.map(([x, y], k) => Math.hypot(path[k][0] - x, path[k][1] - y)).slice(1);
    return { mean: off.reduce((sum, e) => sum + e, 0) / off.length, last: off[off.length - 1] };
  }

  // Distance of the nearest person in each cone around a row, counter-clockwise from the heading.
  cones(row) {
    const { cones, range_m } = this.header, nearest = new Array(cones).fill(range_m), turn = 2 * Math.PI;
    const [x, y] = this.rows.at.map((axis) => axis[row]);
    for (const other of this.peopleAt(this.rows.time[row])) {
      if (other.track === this.rows.track[row]) continue;
      const angle = Math.atan2(other.y - y, other.x - x) - this.heading[row] + 2 * turn;
      const cone = Math.floor((angle * cones) / turn) % cones;
      nearest[cone] = Math.min(nearest[cone], Math.hypot(other.x - x, other.y - y));
    }
    return nearest;
  }

  // The map as a picture of one pixel per cell, the largest y on top.
  mapPicture(colour) {
    const [width, height] = this.header.map_cells, picture = new OffscreenCanvas(width, height);
    const brush = picture.getContext("2d");
    brush.fillStyle = colour;
    this.map.forEach((set, k) => {
      if (set) brush.fillRect(k % width, height - 1 - Math.floor(k / width), 1, 1);
    });
    return picture;
  }

  // The obstacle grid around a row, heading up: the map under the centre of each cell.
  gridPicture(row, map) {
    const { grid_cells: side, cell_m, size_m: [width, height] } = this.header;
    const picture = new OffscreenCanvas(side, side), brush = picture.getContext("2d");
    brush.imageSmoothingEnabled = false;
    brush.translate(side / 2, side / 2);
    brush.rotate(this.heading[row] - Math.PI / 2);
    brush.scale(1 / cell_m, 1 / cell_m);
    brush.drawImage(map, -this.rows.at[0][row], this.rows.at[1][row] - height, width, height);
    return picture;
  }
}
