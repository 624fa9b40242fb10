"use strict";
/* The replay: runs of one scenario side by side, on one time line. */

const Replay = (() => {
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
  const MOST = 4;

  function legend() {
    const item = (hue, mark, text) => {
      const sign = element("span", { class: "mark", "aria-hidden": "true" }, mark);
      sign.style.color = `var(${hue})`;
      return element("span", {}, sign, ` ${text}`);
    };
    return element("p", { class: "legend muted" },
      item("--zone-r", "■", "nearer than r"), item("--zone-rmin", "■", "nearer than r_min"),
      item("--contact", "●", "P_r and the line to its obstacle"), item("--target", "⊷", "reference"),
      item("--fg", "┄", "planned path"), item("--desired", "◇ ┄", "desired twist"),
      item("--chosen", "●", "chosen twist"));
  }

  function card(run, hue) {
    const canvas = (kind) => element("canvas", { class: kind, role: "img" });
    const one = { run, hue, top: canvas("top"), plane: canvas("plane"), strips: [0, 1, 2, 3].map(() => canvas("strip")) };
    one.status = element("span", { class: "status" });
    one.words = element("p", { class: "words", "aria-live": "polite" });
    const line = element("span", { class: "swatch", "aria-hidden": "true" });
    line.style.background = `var(${hue})`;
    one.element = element("article", { class: "card" },
      element("h3", {}, line, ` ${run.method} `, element("span", { class: "muted" }, `(${run.outcome})`)),
      element("div", {}, one.status), one.top, one.words, one.plane, ...one.strips);
    return one;
  }

  class Player {
    constructor(root, groups, leftOut) {
      Object.assign(this, { groups, cards: [], k: 0, playing: false, speed: 1, near: false });
      this.build(root, leftOut);
      this.ready = this.pick(0);
      const redraw = () => this.draw();
      new ResizeObserver(redraw).observe(this.stage);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
    }

    build(root, leftOut) {
      const named = this.groups.map((group, i) => [i, `${group.scenario}${group.seed === null ? "" : `, seed ${group.seed}`}`]);
      const [scenario, select] = choice("Scenario", named, (i) => this.pick(Number(i)));
      const [view] = choice("View", [["all", "whole scene"], ["near", "near the robot"]], (value) => { this.near = value === "near"; this.draw(); });
      const [pace, paceSelect] = choice("Speed", SPEEDS.map((x) => [x, `${x}×`]), (x) => { this.speed = Number(x); });
      paceSelect.value = 1;
      this.select = select;
      this.title = element("p", {});
      this.methods = element("fieldset", { class: "bar methods" });
      this.play = element("button", { type: "button", class: "play", onclick: () => this.toggle() }, "Play");
      this.slider = element("input", { type: "range", min: 0, step: 1, "aria-label": "Time", oninput: () => this.seek(Number(this.slider.value)) });
      this.clock = element("output", { class: "clock" });
      const stepper = (text, by, label) => element("button", { type: "button", "aria-label": label, onclick: () => this.seek(this.k + by) }, text);
      this.stage = element("div", { class: "stage", tabindex: 0, role: "group", "aria-label": "Runs side by side" });
      const left = leftOut ? `${leftOut} further runs are not in this page: no log was kept of them, or it would have grown too large.` : "";
      root.append(element("div", { class: "replay", onkeydown: (event) => this.key(event) },
        element("div", { class: "bar" }, scenario, view, pace), this.methods, this.title,
        element("div", { class: "bar timeline" }, this.play, stepper("‹", -1, "One step back"), stepper("›", 1, "One step on"), this.slider, this.clock),
        this.stage, legend(),
        element("p", { class: "muted" }, "Keys: space plays, ← and → step, with shift ten steps, home and end. Drag on a strip to move in time. ", left)));
    }

    async pick(i, preferred = null) {
      this.pause();
      const group = this.groups[i];
      this.select.value = i;
      this.group = group;
      this.runs = this.runs || new Map();
      if (!this.runs.has(i)) this.runs.set(i, await Promise.all(group.runs.map(Unpack.run)));
      if (this.group !== group) return;
      this.loaded = this.runs.get(i);
      this.axes = Unpack.ranges(this.loaded);
      this.hues = Pen.hues(this.loaded.map((run) => run.controller));
      const room = window.innerWidth < 700 ? 2 : MOST;
      const first = this.loaded.map((_, j) => j).slice(-room);
      if (preferred !== null && !first.includes(preferred)) first.splice(0, 1, preferred);
      this.offer(first);
      this.show(first);
    }

    offer(chosen) {
      const boxes = this.loaded.map((run, j) => element("input", { type: "checkbox", value: j, checked: chosen.includes(j) }));
      const update = (event) => {
        const wanted = boxes.filter((box) => box.checked).map((box) => Number(box.value));
        if (!wanted.length || wanted.length > MOST) event.target.checked = !event.target.checked;
        else this.show(wanted);
      };
      boxes.forEach((box) => box.addEventListener("change", update));
      const labels = boxes.map((box, j) => element("label", {}, box, ` ${this.loaded[j].method}`));
      this.methods.replaceChildren(element("legend", {}, `Methods (up to ${MOST})`), ...labels);
    }

    show(chosen) {
      const { box } = this.group;
      this.cards = chosen.map((j) => card(this.loaded[j], this.hues[j]));
      this.clockRun = this.cards.map((one) => one.run).reduce((a, b) => (b.end > a.end ? b : a));
      for (const one of this.cards) {
        one.charts = Unpack.strips(one.run, this.axes, one.hue);
        one.top.style.aspectRatio = Math.min(1.8, Math.max(0.8, (box[1] - box[0]) / (box[3] - box[2])));
        one.strips.forEach((canvas, i) => this.scrub(canvas, one.charts[i]));
      }
      this.stage.style.setProperty("--columns", this.cards.length);
      this.stage.replaceChildren(...this.cards.map((one) => one.element));
      const { every } = this.clockRun;
      this.title.textContent = this.group.title + (every > 1 ? ` (every ${every} steps of the run are one here)` : "");
      this.slider.max = this.clockRun.n - 1;
      this.seek(Math.min(this.k, this.clockRun.n - 1));
    }

    scrub(canvas, chart) {
      const move = (event) => {
        if (event.buttons || event.type === "pointerdown") {
          const t = Panels.strip.timeAt(canvas, chart, event.offsetX);
          this.seek(this.clockRun.at(t));
        }
      };
      canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); move(event); });
      canvas.addEventListener("pointermove", move);
    }

    seek(k) {
      this.pause();
      this.go(k);
    }

    go(k) {
      this.k = Math.max(0, Math.min(this.clockRun.n - 1, k));
      this.draw();
    }

    toggle() {
      if (this.playing) return this.pause();
      if (this.k >= this.clockRun.n - 1) this.k = 0;
      this.playing = true;
      this.play.textContent = "Pause";
      let [t, before] = [this.clockRun.column("t")[this.k], null];
      const tick = (now) => {
        if (!this.playing) return;
        t += before === null ? 0 : Math.min(0.1, (now - before) / 1000) * this.speed;
        before = now;
        const k = this.clockRun.at(t);
        if (k !== this.k) this.go(k);
        if (k >= this.clockRun.n - 1) this.pause();
        else requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }

    pause() {
      if (!this.playing) return;
      this.playing = false;
      this.play.textContent = "Play";
      this.draw();
    }

    key(event) {
      const tag = event.target.tagName;
      if (tag === "SELECT" || event.target.type === "checkbox" || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === " " && tag === "BUTTON") return;
      const by = event.shiftKey ? 10 : 1;
      const does = {
        " ": () => this.toggle(),
        ArrowLeft: () => this.seek(this.k - by),
        ArrowRight: () => this.seek(this.k + by),
        Home: () => this.seek(0),
        End: () => this.seek(this.clockRun.n - 1),
      }[event.key];
      if (!does) return;
      event.preventDefault();
      does();
    }

    draw() {
      if (!this.cards.length) return;
      const t = this.clockRun.column("t")[this.k];
      this.cards.forEach((one) => this.drawCard(one, t));
      this.cards.forEach((one) => this.tell(one, t));  // last: text changes the layout
      this.slider.value = this.k;
      this.clock.textContent = `${t.toFixed(2)} s, step ${this.k + 1} of ${this.clockRun.n}`;
      this.slider.setAttribute("aria-valuetext", `${t.toFixed(2)} s`);
    }

    drawCard(one, t) {
      const { run, hue } = one;
      const k = run.at(t);
      const frame = (one.frame = run.frame(k));
      const radius = Math.max(...run.world.vertices.map(([x, y]) => Math.hypot(x, y)));
      const view = this.near
        ? { cx: frame.x, cy: frame.y, scale: one.top.clientWidth / (6 * radius) }
        : Panels.fit(one.top, this.group.box);
      Panels.top(one.top, run.world, frame, { view, trail: run.way.slice(0, k + 1), color: hue });
      Panels.plane(one.plane, frame, this.axes);
      one.charts.forEach((chart, i) => Panels.strip(one.strips[i], Object.assign(chart, { cursor: t })));
    }

    tell(one, t) {
      const { run, frame } = one;
      one.status.textContent = t > run.end + 1e-6 ? `ended at ${run.end.toFixed(2)} s` : frame.status;
      one.words.textContent = Panels.words(frame, run.world);
      one.words.setAttribute("aria-live", this.playing ? "off" : "polite");
      if (!this.playing) this.describe(one, frame);
    }

    describe({ top, plane, strips, charts, run }, frame) {
      const name = `${run.method} at ${frame.t.toFixed(2)} s`;
      top.setAttribute("aria-label", `${name}, from above: robot at x ${frame.x.toFixed(2)} m, y ${frame.y.toFixed(2)} m, heading ${frame.heading.toFixed(2)} rad.`);
      plane.setAttribute("aria-label", `${name}, plane of v and ω. ${Panels.words(frame, run.world)}`);
      const k = run.at(frame.t);
      strips.forEach((canvas, i) => {
        const values = charts[i].series.map((one) => `${one.name} ${one.values[k].toPrecision(3)}`);
        canvas.setAttribute("aria-label", `${name}, ${charts[i].title} in ${charts[i].unit}: ${values.join(", ")}.`);
      });
    }
  }

  /** Fill an element with the replay of packed groups of runs. */
  function start(root, { groups, left_out: leftOut }) {
    if (!groups.length) {
      root.append(element("p", {}, 'No log of any run was kept, so there is nothing to replay: put trajectories = "all" into the study and sweep it again.'));
      return null;
    }
    return new Player(root, groups, leftOut);
  }

  return { start };
})();
