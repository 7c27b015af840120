// The replay player. Attributes of its element say what it shows: data-scene, data-time, data-picked, data-playing.
class Player {
  constructor(root, payloads, methods) {
    Object.assign(this, { root, payloads, methods, time: 0, playing: false, picked: null, pace: 1 });
    const part = (selector) => root.querySelector(selector);
    this.plan = part(".plan");
    this.parts = { play: part(".play"), scrub: part(".scrub"), clock: part(".clock"), who: part(".who"),
      about: part(".about"), errors: part(".errors tbody"), grid: part(".grid"), angular: part(".angular") };
    this.listen(part);
  }

  listen(part) {
    const { play, scrub } = this.parts;
    play.addEventListener("click", () => this.play(!this.playing));
    scrub.addEventListener("input", () => this.seek(Number(scrub.value)));
    part(".speed").addEventListener("change", (event) => { this.pace = Number(event.target.value); });
    part(".scenes").addEventListener("change", (event) => this.open(event.target.value));
    part(".methods").addEventListener("change", ({ target }) => {
      this.drawn[target.checked ? "add" : "delete"](target.value);
      this.draw();
    });
    this.plan.addEventListener("click", (event) => this.pickAt(event.offsetX, event.offsetY));
    this.root.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(this.plan);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.refresh());
  }

  async open(name) {
    this.play(false);
    this.asked = name;
    const replay = await Replay.read(this.payloads.get(name));
    if (this.asked !== name) return; // another scene was chosen meanwhile
    this.play(false);
    this.replay = replay;
    const { header } = replay;
    this.drawn ??= new Set(["truth", header.drawn]);
    this.plan.style.aspectRatio = `${header.size_m[0]} / ${header.size_m[1]}`;
    this.parts.scrub.max = header.duration_s;
    this.root.dataset.scene = name;
    this.offer(header.methods);
    const fullest = this.replay.fullestFrame(); // opens where there is most to see
    this.time = fullest.value / 100;
    const fastest = fullest.rows.reduce((best, row) => (this.replay.speed(row) > this.replay.speed(best) ? row : best));
    this.picked = this.replay.rows.track[fastest];
    this.refresh();
  }

  // A switch per path that can be drawn.
  offer(methods) {
    const bar = this.root.querySelector(".methods");
    bar.replaceChildren(...["truth", ...methods].map((name) => {
      const label = document.createElement("label"), box = document.createElement("input");
      const text = document.createElement("span");
      Object.assign(box, { type: "checkbox", value: name, checked: this.drawn.has(name) });
      text.textContent = name === "truth" ? "true path" : this.methods[name]?.label ?? name;
      label.style.setProperty("--c", name === "truth" ? "var(--ink)" : `var(--m-${name})`);
      label.append(box, text);
      return label;
    }));
  }

  refresh() {
    if (!this.replay) return;
    this.map = this.replay.mapPicture(ink("obstacle"));
    this.draw();
  }

  play(asked) {
    const on = asked && Boolean(this.replay);
    this.playing = on;
    this.parts.play.textContent = on ? "❚❚" : "▶";
    this.parts.play.setAttribute("aria-label", on ? "Pause" : "Play");
    this.root.dataset.playing = on;
    if (!on) return;
    if (this.time >= this.replay.header.duration_s) this.time = 0;
    let last = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      this.seek(this.time + ((now - last) / 1000) * this.pace);
      last = now;
      if (this.time >= this.replay.header.duration_s) this.play(false);
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  seek(time) {
    if (!this.replay) return;
    this.time = Math.min(Math.max(time, 0), this.replay.header.duration_s);
    this.draw();
  }

  step(frames) {
    const { frames: all } = this.replay, next = this.replay.frameAt(this.time) + frames;
    this.play(false);
    this.seek(all[Math.min(Math.max(next, 0), all.length - 1)].value / 100);
  }

  key(event) {
    const ways = { ArrowRight: 1, ArrowLeft: -1 }, control = event.target.closest("input, select, button");
    if (control || !this.replay) return;
    if (event.key === " ") this.play(!this.playing);
    else if (event.key in ways && event.shiftKey) this.seek(this.time + 5 * ways[event.key]);
    else if (event.key in ways) this.step(ways[event.key]);
    else if (event.key === "n") this.pick(this.following());
    else if (event.key === "Escape") this.pick(null);
    else return;
    event.preventDefault();
  }

  // The next person, of those with a forecast if there are any.
  following() {
    const everybody = this.replay.peopleAt(this.time).map((person) => person.track), rows = this.replay.rowsAt(this.time);
    const forecast = everybody.filter((track) => rows.has(track)), here = forecast.length ? forecast : everybody;
    return here.length ? here[(here.indexOf(this.picked) + 1) % here.length] : null;
  }

  pick(track) {
    this.picked = track;
    this.draw();
  }

  // The nearest person to a point of the plan, if one is within a finger's width.
  pickAt(column, row) {
    if (!this.replay) return;
    const near = this.replay.peopleAt(this.time)
      .map((person) => ({ ...person, off: Math.hypot(this.x(person.x) - column, this.y(person.y) - row) }))
      .sort((a, b) => a.off - b.off)[0];
    this.pick(near && near.off < 28 ? near.track : null);
  }

  x(metres) { return this.left + this.scale * metres; }

  y(metres) { return this.bottom - this.scale * metres; }

  draw() {
    if (!this.replay || !this.map) return;
    const { brush, width, height } = brushOf(this.plan), [wide, high] = this.replay.header.size_m;
    this.scale = Math.min(width / wide, height / high);
    this.left = (width - this.scale * wide) / 2;
    this.bottom = (height + this.scale * high) / 2;
    brush.imageSmoothingEnabled = false;
    brush.drawImage(this.map, this.left, this.bottom - this.scale * high, this.scale * wide, this.scale * high);
    const rows = this.replay.rowsAt(this.time), people = this.replay.peopleAt(this.time);
    for (const person of people) this.line(brush, person.tail, { colour: ink("way"), width: 2 });
    for (const row of rows.values()) this.drawPaths(brush, row);
    for (const person of people) this.drawPerson(brush, person, rows.get(person.track));
    this.drawBar(brush, height);
    this.show(rows, people);
  }

  drawPaths(brush, row) {
    const picked = this.replay.rows.track[row] === this.picked;
    for (const name of this.drawn) {
      if (name === "truth") {
        this.line(brush, this.replay.path(name, row), { colour: ink("ink"), width: 1.2, dash: [4, 4] });
      } else if (this.replay.paths[name]) {
        const points = this.replay.path(name, row), colour = ink(`m-${name}`);
        for (const mode of this.replay.modesOf(name, row)) {
          brush.globalAlpha = (picked ? 0.3 : 0.15) + 0.3 * mode.weight;
          this.line(brush, mode.points, { colour, width: 1 + 7 * mode.weight });
        }
        brush.globalAlpha = 1;
        this.line(brush, points, { colour, width: 1 });
        brush.fillStyle = colour;
        for (const [x, y] of points.slice(1)) this.dot(brush, x, y, picked ? 3.4 : 2.2);
      }
    }
  }

  drawPerson(brush, { track, x, y }, row) {
    const radius = Math.max(4, 0.22 * this.scale), picked = track === this.picked;
    brush.fillStyle = ink(picked ? "paper" : "person");
    brush.globalAlpha = row === undefined && !picked ? 0.45 : 1;
    this.dot(brush, x, y, radius);
    brush.globalAlpha = 1;
    if (!picked) return;
    // A ring: colours belong to methods. The number stays legible on paths and obstacles.
    Object.assign(brush, { strokeStyle: ink("ink"), lineWidth: 3 });
    brush.stroke();
    Object.assign(brush, { font: "600 13px system-ui, sans-serif", strokeStyle: ink("paper"), lineWidth: 4, lineJoin: "round" });
    brush.strokeText(String(track), this.x(x) + radius + 4, this.y(y) - radius);
    brush.fillStyle = ink("ink");
    brush.fillText(String(track), this.x(x) + radius + 4, this.y(y) - radius);
    if (row !== undefined) this.drawReach(brush, x, y, this.replay.heading(row));
  }

  // The square that the obstacle grid covers.
  drawReach(brush, x, y, heading) {
    const { grid_cells: cells, cell_m: cell } = this.replay.header, half = (cells * cell) / 2;
    brush.save();
    brush.translate(this.x(x), this.y(y));
    brush.rotate(-heading);
    Object.assign(brush, { strokeStyle: ink("way"), lineWidth: 1.5 });
    brush.strokeRect(-half * this.scale, -half * this.scale, 2 * half * this.scale, 2 * half * this.scale);
    brush.restore();
  }

  drawBar(brush, height) {
    brush.fillStyle = ink("paper");
    brush.fillRect(4, height - 24, 2 * this.scale + 40, 20);
    brush.fillStyle = ink("soft");
    brush.fillRect(10, height - 12, 2 * this.scale, 2);
    brush.font = "12px system-ui, sans-serif";
    brush.fillText("2 m", 14 + 2 * this.scale, height - 7);
  }

  dot(brush, x, y, radius) {
    brush.beginPath();
    brush.arc(this.x(x), this.y(y), radius, 0, 2 * Math.PI);
    brush.fill();
  }

  line(brush, points, { colour, width, dash = [] }) {
    brush.strokeStyle = colour;
    brush.lineWidth = width;
    brush.setLineDash(dash);
    brush.beginPath();
    for (const [x, y] of points) brush.lineTo(this.x(x), this.y(y));
    brush.stroke();
    brush.setLineDash([]);
  }

  show(rows, people) {
    const { scrub, clock } = this.parts, { header } = this.replay;
    scrub.value = this.time;
    clock.textContent = `${(header.start_s + this.time).toFixed(1)} s`;
    Object.assign(this.root.dataset, { time: this.time.toFixed(2), picked: this.picked ?? "" });
    const row = rows.get(this.picked), here = people.some(({ track }) => track === this.picked);
    const state = `${header.name} ${this.picked} ${row} ${here} ${document.documentElement.clientWidth} ${ink("ink")}`;
    if (state !== this.shown) this.showPerson(row, here);
    this.shown = state;
  }

  showPerson(row, here) {
    const { who, about, errors, grid, angular } = this.parts;
    who.textContent = this.picked === null ? "No person is selected" : `Person ${this.picked}`;
    about.textContent = this.picked === null ? "Select a person in the plan."
      : row !== undefined ? `walks at ${this.replay.speed(row).toFixed(2)} m/s`
      : here ? "has no evaluation window now: its past or future is too short." : "is not in the scene now.";
    errors.replaceChildren(...(row === undefined ? [] : this.replay.header.methods.map((name) => this.errorRow(name, row))));
    drawGrid(grid, this.replay, row);
    drawAngular(angular, this.replay, row);
  }

  errorRow(name, row) {
    const { mean, last } = this.replay.error(name, row), line = document.createElement("tr");
    const head = Object.assign(document.createElement("th"), { scope: "row" });
    const swatch = Object.assign(document.createElement("i"), { className: "swatch" });
    swatch.style.setProperty("--c", `var(--m-${name})`);
    head.append(swatch, this.methods[name]?.label ?? name);
    const cells = [mean, last].map((error) =>
      Object.assign(document.createElement("td"), { className: "n", textContent: error.toFixed(2) }));
    line.append(head, ...cells);
    return line;
  }
}
