// The replay player. Attributes of its element say what it shows: data-scene, data-time, data-picked, data-playing.
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Fits a canvas to its place on the page and gives a brush in CSS pixels.
function brushOf(canvas) {
  const { width, height } = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  const brush = canvas.getContext("2d");
  brush.scale(ratio, ratio);
  brush.imageSmoothingEnabled = false;
  return { brush, width, height };
}

function arc(brush, x, y, radius, begin = 0, end = 2 * Math.PI) {
  brush.beginPath();
  brush.arc(x, y, radius, begin, end);
}

function element(tag, own, ...children) {
  const made = Object.assign(document.createElement(tag), own);
  made.append(...children);
  return made;
}

class Player {
  constructor(root, payloads, methods) {
    Object.assign(this, { root, payloads, methods, time: 0, picked: null });
    this.plan = root.querySelector(".plan");
    this.on(".play", "click", () => this.play(!this.playing));
    this.on(".scrub", "input", ({ target }) => this.seek(Number(target.value)));
    this.on(".scenes", "change", ({ target }) => this.open(target.value));
    this.on(".methods", "change", ({ target }) => {
      this.drawn[target.checked ? "add" : "delete"](target.value);
      this.draw();
    });
    this.on(".plan", "click", ({ offsetX, offsetY }) => this.pick(this.nearest(offsetX, offsetY)));
    root.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(this.plan);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.refresh());
  }

  part(selector) { return this.root.querySelector(selector); }

  on(selector, event, action) {
    this.part(selector).addEventListener(event, (happened) => this.replay && action(happened));
  }

  async open(name) {
    this.play(false);
    this.asked = name;
    const replay = await Replay.read(this.payloads.get(name)), { header, frames, rows, speed } = replay;
    if (this.asked !== name) return; // another scene was chosen meanwhile
    this.play(false);
    this.replay = replay;
    this.drawn ??= new Set(["truth", header.drawn]);
    this.plan.style.aspectRatio = `${header.size_m[0]} / ${header.size_m[1]}`;
    this.part(".scrub").max = header.duration_s;
    this.root.dataset.scene = name;
    this.offer(["truth", ...header.methods]);
    const fullest = frames.reduce((best, frame) => (frame.rows.length > best.rows.length ? frame : best));
    this.time = fullest.time; // where there is most to see
    this.picked = rows.track[fullest.rows.reduce((best, row) => (speed[row] > speed[best] ? row : best))];
    this.refresh();
  }

  // A switch per path that can be drawn.
  offer(names) {
    this.part(".methods").replaceChildren(...names.map((name) => {
      const [colour, label] = name === "truth" ? ["ink", "true path"] : [`m-${name}`, this.methods[name] ?? name];
      const box = element("input", { type: "checkbox", value: name, checked: this.drawn.has(name) });
      return element("label", { style: `--c: var(--${colour})` }, box, element("span", {}, label));
    }));
  }

  refresh() {
    if (!this.replay) return;
    this.map = this.replay.mapPicture(ink("obstacle"));
    this.draw();
  }

  play(on) {
    this.playing = on;
    this.part(".play").textContent = on ? "❚❚" : "▶";
    this.part(".play").setAttribute("aria-label", on ? "Pause" : "Play");
    this.root.dataset.playing = on;
    if (!on) return;
    const end = this.replay.header.duration_s;
    if (this.time >= end) this.time = 0;
    let last = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      this.seek(this.time + ((now - last) / 1000) * Number(this.part(".speed").value));
      last = now;
      if (this.time >= end) this.play(false);
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.replay.header.duration_s);
    this.draw();
  }

  // Stops at the next (1) or the previous (-1) instant with forecasts.
  step(way) {
    const { frames } = this.replay, next = this.replay.frameAt(this.time) + way;
    this.play(false);
    this.seek(frames[Math.min(Math.max(next, 0), frames.length - 1)].time);
  }

  key(event) {
    const actions = { " ": () => this.play(!this.playing), ArrowRight: () => this.step(1), ArrowLeft: () => this.step(-1),
      n: () => this.pick(this.following()), Escape: () => this.pick(null) };
    if (!this.replay || !(event.key in actions) || event.target.closest("input, select, button")) return;
    event.preventDefault();
    actions[event.key]();
  }

  pick(track) {
    this.picked = track;
    this.draw();
  }

  // The next person, of those with a forecast if there are any.
  following() {
    const rows = this.replay.rowsAt(this.time), everyone = this.replay.peopleAt(this.time).map(({ track }) => track);
    const forecast = everyone.filter((track) => rows.has(track)), here = forecast.length ? forecast : everyone;
    return here.length ? here[(here.indexOf(this.picked) + 1) % here.length] : null;
  }

  // The nearest person to a point of the plan, if one is within a finger's width.
  nearest(column, row) {
    const near = this.replay.peopleAt(this.time)
      .map(({ track, x, y }) => ({ track, off: Math.hypot(this.x(x) - column, this.y(y) - row) }))
      .sort((a, b) => a.off - b.off)[0];
    return near && near.off < 28 ? near.track : null;
  }

  x(metres) { return this.left + this.scale * metres; }

  y(metres) { return this.bottom - this.scale * metres; }

  draw() {
    if (!this.map) return;
    const { brush, width, height } = brushOf(this.plan), { size_m: [wide, high], start_s } = this.replay.header;
    this.scale = Math.min(width / wide, height / high);
    this.left = (width - this.scale * wide) / 2;
    this.bottom = (height + this.scale * high) / 2;
    brush.drawImage(this.map, this.left, this.bottom - this.scale * high, this.scale * wide, this.scale * high);
    const rows = this.replay.rowsAt(this.time), people = this.replay.peopleAt(this.time);
    for (const { tail } of people) this.line(brush, tail, ink("way"), 2);
    for (const row of rows.values()) this.drawPaths(brush, row);
    for (const person of people) this.drawPerson(brush, person, rows.get(person.track));
    this.drawScale(brush, height);
    this.part(".scrub").value = this.time;
    this.part(".clock").textContent = `${(start_s + this.time).toFixed(1)} s`;
    Object.assign(this.root.dataset, { time: this.time.toFixed(2), picked: this.picked ?? "" });
    this.showPicked(rows.get(this.picked), people.some(({ track }) => track === this.picked));
  }

  drawPaths(brush, row) {
    const { replay } = this, picked = replay.rows.track[row] === this.picked;
    if (this.drawn.has("truth")) this.line(brush, replay.path("truth", row), ink("ink"), 1.2, [4, 4]);
    for (const name of replay.header.methods.filter((method) => this.drawn.has(method))) {
      const points = replay.path(name, row), colour = ink(`m-${name}`);
      for (const { points: mode, weight } of replay.modesOf(name, row)) {
        brush.globalAlpha = (picked ? 0.3 : 0.15) + 0.3 * weight;
        this.line(brush, mode, colour, 1 + 7 * weight);
      }
      brush.globalAlpha = 1;
      this.line(brush, points, colour, 1);
      for (const [x, y] of points.slice(1)) this.dot(brush, x, y, picked ? 3.4 : 2.2, colour);
    }
  }

  drawPerson(brush, { track, x, y }, row) {
    const radius = Math.max(4, 0.22 * this.scale), picked = track === this.picked;
    brush.globalAlpha = row === undefined && !picked ? 0.45 : 1;
    this.dot(brush, x, y, radius, ink(picked ? "paper" : "person"));
    brush.globalAlpha = 1;
    if (!picked) return;
    // A ring: colours belong to methods. The number stays legible on paths and obstacles.
    Object.assign(brush, { strokeStyle: ink("ink"), lineWidth: 3 });
    brush.stroke();
    Object.assign(brush, { font: "600 13px system-ui, sans-serif", strokeStyle: ink("paper"), lineWidth: 4, lineJoin: "round" });
    brush.strokeText(track, this.x(x) + radius + 4, this.y(y) - radius);
    brush.fillStyle = ink("ink");
    brush.fillText(track, this.x(x) + radius + 4, this.y(y) - radius);
    if (row === undefined) return;
    const { grid_cells, cell_m } = this.replay.header, side = grid_cells * cell_m * this.scale;
    brush.save();
    brush.translate(this.x(x), this.y(y));
    brush.rotate(-this.replay.heading[row]);
    Object.assign(brush, { strokeStyle: ink("way"), lineWidth: 1.5 });
    brush.strokeRect(-side / 2, -side / 2, side, side); // the ground that the obstacle grid covers
    brush.restore();
  }

  drawScale(brush, height) {
    const bar = 2 * this.scale, fill = (colour, ...box) => { brush.fillStyle = ink(colour); brush.fillRect(...box); };
    fill("paper", 4, height - 24, bar + 40, 20);
    fill("soft", 10, height - 12, bar, 2);
    brush.font = "12px system-ui, sans-serif";
    brush.fillText("2 m", 14 + bar, height - 7);
  }

  dot(brush, x, y, radius, colour) {
    arc(brush, this.x(x), this.y(y), radius);
    brush.fillStyle = colour;
    brush.fill();
  }

  line(brush, points, colour, width, dash = []) {
    Object.assign(brush, { strokeStyle: colour, lineWidth: width });
    brush.setLineDash(dash);
    brush.beginPath();
    for (const [x, y] of points) brush.lineTo(this.x(x), this.y(y));
    brush.stroke();
    brush.setLineDash([]);
  }

  // The panel beside the plan: errors of the selected person's forecasts, and the network's inputs.
  showPicked(row, here) {
    const { replay, picked } = this, none = picked === null;
    this.part(".who").textContent = none ? "No person is selected" : `Person ${picked}`;
    this.part(".about").textContent = none ? "Select a person in the plan."
      : row !== undefined ? `walks at ${replay.speed[row].toFixed(2)} m/s`
      : here ? "has no evaluation window now: its past or future is too short." : "is not in the scene now.";
    const shown = row === undefined ? [] : replay.header.methods;
    this.part(".errors tbody").replaceChildren(...shown.map((name) => {
      const { mean, last } = replay.error(name, row);
      const swatch = element("i", { className: "swatch", style: `--c: var(--m-${name})` });
      const cells = [mean, last].map((error) => element("td", { className: "n" }, error.toFixed(2)));
      return element("tr", {}, element("th", { scope: "row" }, swatch, this.methods[name] ?? name), ...cells);
    }));
    this.drawGrid(row);
    this.drawCones(row);
  }

  drawGrid(row) {
    const { brush, width } = brushOf(this.part(".grid"));
    brush.fillStyle = ink("paper");
    brush.fillRect(0, 0, width, width);
    brush.strokeStyle = ink("rule");
    brush.strokeRect(0.5, 0.5, width - 1, width - 1);
    if (row === undefined) return;
    brush.drawImage(this.replay.gridPicture(row, this.map), 0, 0, width, width);
    this.drawSelf(brush, width / 2);
  }

  drawCones(row) {
    const { brush, width } = brushOf(this.part(".angular")), middle = width / 2, outer = middle - 2;
    Object.assign(brush, { fillStyle: ink("paper"), strokeStyle: ink("rule") });
    for (const part of [1, 2 / 3, 1 / 3]) {
      arc(brush, middle, middle, outer * part);
      if (part === 1) brush.fill();
      brush.stroke();
    }
    if (row === undefined) return;
    const cones = this.replay.cones(row), wide = (2 * Math.PI) / cones.length, range = this.replay.header.range_m;
    Object.assign(brush, { strokeStyle: ink("near"), lineWidth: 4 });
    cones.forEach((distance, k) => {
      const begin = -Math.PI / 2 - k * wide; // up is ahead, counter-clockwise is left
      arc(brush, middle, middle, (outer * distance) / range, begin - wide, begin);
      if (distance < range) brush.stroke();
    });
    this.drawSelf(brush, middle);
  }

  // The person whose inputs are shown, in the middle.
  drawSelf(brush, middle) {
    brush.beginPath();
    for (const [x, y] of [[0, -7.6], [4, 4], [-4, 4]]) brush.lineTo(middle + x, middle + y);
    brush.closePath();
    Object.assign(brush, { fillStyle: ink("near"), strokeStyle: ink("paper"), lineWidth: 2 }); // seen on obstacles, too
    brush.stroke();
    brush.fill();
  }
}
