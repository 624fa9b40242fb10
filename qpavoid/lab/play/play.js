"use strict";
/* The live page: robots drive in a scene that hands change; what they do is shown. */

const Play = (() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const KEPT = 20;  // s of the strips
  const TRAIL = 4000;  // places of a trail
  const STRIPS = 100;  // ms between two drawings of strips and words
  const LONGEST = 600;  // s of a recording
  const HUES = { "qp-repulsion": "--other2", "qp-ahead+guide": "--other1" };
  const VIEW = "lidar.field_of_view_rad";
  const CART = [[-0.4, -0.25], [0.4, -0.25], [0.4, 0.25], [-0.4, 0.25]];

  const hue = (method) => HUES[method] || `--${method}`;
  const reduced = matchMedia("(prefers-reduced-motion: reduce)");

  let [module, scene, world, view] = [null, null, null, null];
  let [robot, settings, lidar, station, left] = [null, {}, false, null, null];  // left: places on the way, by method
  let [k, running, speed, focus] = [0, false, 1, null];
  let [recording, history, notes, recorded] = [false, [], [], null];
  let [chosen, sketch, owed, before, shownAt] = [null, null, 0, null, 0];
  let [dirty, frames, trouble] = [true, 0, ""];
  let past = [];
  const pilots = new Map();
  const app = { tool: "move", cross: null, get view() { return view; } };

  const dt = () => scene.dt;
  const time = (step = k) => step * scene.dt;
  const finite = (values) => Object.fromEntries(Object.entries(values).map(([key, value]) => [key, value === null ? Infinity : value]));

  function say(text, wrong = false) {
    $("notice").textContent = text;
    $("notice").classList.toggle("wrong", wrong);
  }

  /* ---- robots ---------------------------------------------------------------- */

  function setup(method) {
    const plan = station ? [...station, 0, 0, ...station, 0, 0] : Robots.reals(scene.plan);
    return {
      module, method, robot, settings, lidar, dt: dt(), plan, lags: scene.lags, entries: data.settings, sizes: data.sizes,
      law: Robots.reals(station ? scene.station : scene.law), start: station || scene.start, guided: scene.guided,
    };
  }

  /** Let these methods drive, the first time or on from where they are. */
  function drive(methods, afresh = false) {
    for (const name of Object.keys(data.methods)) {
      const old = pilots.get(name);
      if (!methods.includes(name)) pilots.delete(name);
      else {
        const made = { robot: new Pilot.Robot(setup(name)), trail: [], least: Infinity, frame: null };
        const from = old || pilots.get(focus);
        if (!afresh && from) made.robot.takeOver(from.robot);
        if (!afresh && old) Object.assign(made, { trail: old.trail, least: old.least });
        pilots.set(name, made);
      }
    }
    const ordered = Object.keys(data.methods).filter((name) => pilots.has(name)).map((name) => [name, pilots.get(name)]);
    pilots.clear();
    ordered.forEach(([name, one]) => pilots.set(name, one));
    if (!pilots.has(focus)) focus = [...pilots.keys()].at(-1);
    look();
  }

  const names = () => [...pilots.keys()];

  /** What everybody would do now, where nothing moves on. */
  function look() {
    world.plan(time(), time(k + 1));
    const seen = world.arrays(time());
    const shown = world.shown(time());
    for (const one of pilots.values()) one.frame = framed(one.robot.peek(seen, time()), shown);
    dirty = true;
  }

  function framed(frame, shown) {
    const status = frame.blocked ? "blocked" : data.statuses[frame.code] || "invalid";
    return { ...frame, ...shown, status, said: data.sentences[status] };
  }

  /* ---- time ------------------------------------------------------------------ */

  function step() {
    world.plan(time(), time(k + 1));
    const seen = world.arrays(time());
    const shown = world.shown(time());
    if (recording && history.length === 0) history.push(Toml.places(world));
    for (const one of pilots.values()) {
      one.frame = framed(one.robot.step(seen, time()), shown);
      one.least = Math.min(one.least, one.frame.clearance);
      one.trail.push([one.frame.x, one.frame.y]);
      if (one.trail.length > TRAIL) one.trail.shift();
    }
    world.move();
    past.push({ t: time(), frames: new Map([...pilots].map(([name, one]) => [name, one.frame])) });
    while (past[0].t < time() - KEPT) past.shift();
    k += 1;
    if (recording) history.push(Toml.places(world));
    if (recording && time() >= LONGEST) endRecording();
    dirty = true;
  }

  function advance(now) {
    const passed = before === null ? 0 : Math.min(0.1, (now - before) / 1000);
    before = now;
    if (!running) return;
    owed += passed * speed;
    const until = performance.now() + 25;
    while (owed >= dt() && performance.now() < until) {
      step();
      owed -= dt();
    }
    owed = Math.min(owed, 2 * dt());
  }

  function run(on) {
    [running, owed, before] = [on, 0, null];
    $("run").textContent = on ? "Pause" : k ? "Go on" : "Start";
    $("run").setAttribute("aria-pressed", on);
    if (!on && world) look();
  }

  function restart() {
    world.restart();
    [k, past] = [0, []];
    drive(names(), true);
    run(running);
  }

  /* ---- what is shown --------------------------------------------------------- */

  function fit() {
    const near = world.things.filter((one) => one.kind !== "point").map((one) => World.anchor(one, time()));
    const here = [...pilots.values()].map(({ frame }) => [frame.x, frame.y]);
    const way = pathOf();
    const places = [...way, ...here, ...near.filter(([x, y]) => here.some(([a, b]) => Math.hypot(x - a, y - b) < 6))];
    const ends = [0, 1].flatMap((i) => {
      const values = places.map((place) => place[i]);
      return [Math.min(...values) - 1.2, Math.max(...values) + 1.2];
    });
    setView(Panels.fit($("top"), ends));
  }

  function pathOf() {
    if (station) return [station.slice(0, 2)];
    if (scene.way) return scene.way;
    const plan = Robots.reals(scene.plan);
    const every = Math.max(1, Math.floor(plan.length / 5 / 400));
    const places = [];
    for (let i = 0; i < plan.length / 5; i += every) places.push([plan[5 * i], plan[5 * i + 1]]);
    return (scene.way = [...places, [...plan.slice(-5, -3)]]);
  }

  const setView = (other) => { view = other; dirty = true; };

  /** A frame among the obstacles of which its robot knows, and these as panels want them. */
  function known({ frame, robot: pilot }) {
    const { points, walls } = world.shown(time());
    const seen = lidar ? pilot.perceived(frame) : { points, walls };
    return [{ ...frame, ...seen }, { outlines: robot.outlines, path: pathOf(), points: seen.points, walls: seen.walls }];
  }

  function drawTop(one) {
    const canvas = $("top");
    const [frame, shown] = known(one);
    const others = names().filter((name) => name !== focus).map((name) => {
      const { frame, trail } = pilots.get(name);
      return { outlines: robot.outlines, frame, trail, color: hue(name) };
    });
    Panels.top(canvas, shown, frame, { view, trail: one.trail, color: hue(focus), others });
    const g = canvas.getContext("2d");
    const px = ([x, y]) => Panels.toPixel(canvas, view, x, y);
    if (lidar) drawSenses(g, px, frame);
    const thing = world.find(chosen);
    if (thing) mark(g, px, thing, "--link", 3);
    if (sketch) Pen.line(g, sketch.map(px), "--link", 3, [6, 4]);
    if (app.cross) {
      const [x, y] = px(app.cross);
      Pen.line(g, [[x - 10, y], [x + 10, y]], "--link", 2);
      Pen.line(g, [[x, y - 10], [x, y + 10]], "--link", 2);
    }
  }

  function mark(g, px, thing, hue, width) {
    if (thing.kind === "wall") Pen.line(g, [px([thing.x1, thing.y1]), px([thing.x2, thing.y2])], hue, 2 * width + 1);
    else if (thing.kind === "cart") {
      const corners = World.cornersOf(thing, time()).map(px);
      Pen.line(g, [...corners, corners[0]], hue, width);
    } else Pen.dot(g, px([thing.x, thing.y]), Math.max(thing.radius * view.scale, 3) + width + 1, null, hue);
  }

  /** Velocities over all else; below it the scan, what is there, and the ever-free space. */
  function drawSenses(g, px, { x, y, discs, velocities, scan, free }) {
    discs.forEach(([a, b], i) => {
      const [v_x, v_y] = velocities[i];
      const tip = [a + v_x, b + v_y];
      const barbs = [-0.4, 0.4].map((turn) => [tip[0] - 0.25 * (v_x * Math.cos(turn) - v_y * Math.sin(turn)), tip[1] - 0.25 * (v_x * Math.sin(turn) + v_y * Math.cos(turn))]);
      Pen.line(g, [[a, b], tip, barbs[0], tip, barbs[1]].map(px), "--active", 2.5);
    });
    g.globalCompositeOperation = "destination-over";
    world.things.forEach((thing) => mark(g, px, thing, "--muted", 1));
    Pen.line(g, [[x, y], ...scan, [x, y]].map(px), "--link", 0.7);
    const cells = new Path2D();
    for (const [left, low, length, width] of free) cells.rect(...px([left, low]), length * view.scale, -width * view.scale);
    g.fillStyle = Pen.color("--grid");
    g.fill(cells);
    g.globalCompositeOperation = "source-over";
  }

  function drawStrips() {
    const t = past.map((one) => one.t);
    const end = Math.max(KEPT, time());
    const series = (key) => names().map((name) => ({
      name: "", style: { color: hue(name), width: name === focus ? 2.2 : 1.4 },
      values: past.map(({ frames: at }) => (at.has(name) ? at.get(name)[key] : NaN)),
    }));
    const of = (key) => past.map(({ frames: at }) => (at.get(focus) || pilots.get(focus).frame)[key]);
    const common = { t, span: [end - KEPT, end], bands: [] };
    const limits = Ranges.axes(robot);
    const desired = (key) => ({ name: "desired", values: of(key), style: { color: "--fg", dash: [4, 3], width: 1.2 } });
    if (!t.length) Object.assign(common, { t: [0] });
    Panels.strip($("clearance"), {
      ...common, title: "clearance", unit: "m", range: [-0.05, 1.2], series: series("clearance"),
      bands: t.length ? [{ from: 0, to: of("r"), kind: "r" }, { from: 0, to: of("rmin"), kind: "rmin" }] : [],
    });
    Panels.strip($("v"), { ...common, title: "v", unit: "m/s", range: limits.v, series: [desired("vd"), ...series("v")] });
    Panels.strip($("omega"), { ...common, title: "ω", unit: "rad/s", range: limits.w, series: [desired("wd"), ...series("w")] });
  }

  function draw(now) {
    requestAnimationFrame(draw);
    try {
      advance(now);
    } catch (error) {
      run(false);
      say(`Paused: ${error.message}`, true);
    }
    if (!dirty) return;
    const one = pilots.get(focus);
    if (!view) fit();
    dirty = false;
    frames += 1;
    drawTop(one);
    Panels.plane($("plane"), one.frame, $("close").checked ? Ranges.near(one.frame) : Ranges.axes(robot));
    if (running && now - shownAt < STRIPS) return void (dirty = true);
    shownAt = now;
    drawStrips();
    tell(one.frame);
  }

  const fixed = (value, digits = 2) => (Number.isFinite(value) ? value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−") : "–");

  function tell(frame) {
    $("clock").textContent = `${time().toFixed(2)} s`;
    $("focus").textContent = focus;
    $("focus").title = data.methods[focus];
    $("swatch").style.background = `var(${hue(focus)})`;
    $("status").textContent = frame.status;
    $("words").textContent = Panels.words(...known(pilots.get(focus)));
    $("words").setAttribute("aria-live", running ? "off" : "polite");
    for (const [name, row] of tableRows) {
      const one = pilots.get(name);
      row.box.checked = Boolean(one);
      row.element.toggleAttribute("aria-current", name === focus);
      row.element.classList.toggle("touched", Boolean(one) && one.least < 0);
      const away = one && Math.hypot(one.frame.xr - one.frame.x, one.frame.yr - one.frame.y);
      const cells = one ? [one.frame.status, fixed(one.frame.v), fixed(one.frame.w), fixed(one.frame.clearance, 3), fixed(one.least, 3), fixed(away)] : ["", "", "", "", "", ""];
      cells.forEach((text, i) => { row.cells[i].textContent = text; });
    }
    const there = `${focus} at ${frame.t.toFixed(2)} s`;
    $("top").setAttribute("aria-label", `The scene from above, ${there}: robot at x ${fixed(frame.x)} m, y ${fixed(frame.y)} m; ${world.things.length} obstacles. Arrow keys move a cross or what is chosen.`);
    $("plane").setAttribute("aria-label", `Plane of v and ω, ${there}: ${frame.planes.length} rows, ${Panels.active(frame).length} active, desired ${fixed(frame.vd)} m/s and ${fixed(frame.wd)} rad/s, chosen ${fixed(frame.v)} m/s and ${fixed(frame.w)} rad/s.`);
    for (const [id, key, unit] of [["clearance", "clearance", "m"], ["v", "v", "m/s"], ["omega", "w", "rad/s"]]) {
      $(id).setAttribute("aria-label", `${id} over the last ${KEPT} s; now ${names().map((name) => `${name} ${fixed(pilots.get(name).frame[key], 3)} ${unit}`).join(", ")}`);
    }
  }

  /* ---- hands ----------------------------------------------------------------- */

  const editable = (what) => {
    if (recording) say(`${what} when the recording is over.`, true);
    return !recording;
  };

  Object.assign(app, {
    setView,
    at(place, reach) {
      const off = (one) => World.distance(one, place, time());
      const near = world.things.filter((one) => one.kind !== "point" && off(one) < reach);
      return near.sort((a, b) => off(a) - off(b))[0] || null;
    },
    grab(thing, [x, y]) {
      choose(thing);
      const [a, b] = World.anchor(thing, time());
      return [a - x, b - y];
    },
    drag(thing, place) {
      if (running && thing.kind !== "wall") world.pull(thing, place, time());
      else if (editable("Move what stands")) { world.place(thing, place, time()); look(); }
    },
    drop(thing) { thing.target = null; },
    draw(from, to, done) {
      sketch = done ? null : [from, to];
      dirty = true;
      if (done && editable("Draw a wall")) choose(add({ kind: "wall", x1: from[0], y1: from[1], x2: to[0], y2: to[1] }));
    },
    put([x, y]) {
      if (!editable("Add something")) return;
      const thing = app.tool === "cart" ? { kind: "cart", corners: CART.map(([a, b]) => [x + a, y + b]) } : { kind: "disc", x, y, radius: 0.2 };
      choose(add(thing));
    },
    erase(thing) {
      if (!editable("Remove something")) return;
      world.remove(thing.id);
      choose(null);
      look();
    },
    choose,
    nudge([dx, dy]) {
      const thing = world.find(chosen);
      if (!thing) {
        const [x, y] = app.cross || [view.cx, view.cy];
        app.cross = [x + dx, y + dy];
        setView(view);
        return;
      }
      const [x, y] = thing.target || World.anchor(thing, time());
      app.drag(thing, [x + dx, y + dy]);
    },
  });

  function add(thing) {
    const made = world.add(thing);
    look();
    if ([...pilots.values()].some(({ frame }) => frame.clearance <= 0 && frame.obstacle === world.numbered().indexOf(made))) {
      world.remove(made.id);
      look();
      say("An obstacle cannot be put onto a robot.", true);
      return null;
    }
    say("");
    return made;
  }

  function choose(thing) {
    chosen = thing ? thing.id : null;
    $("chosen").hidden = !thing;
    if (thing) {
      const number = world.of(thing.kind).indexOf(thing) + 1;
      $("chosen-name").textContent = `${thing.kind} ${number}`;
      $("chosen-size").hidden = thing.kind !== "disc";
      if (thing.kind === "disc") $("radius").value = thing.radius;
    }
    dirty = true;
  }

  function chooseNext(by) {
    const all = world.things.filter((one) => one.kind !== "point");
    if (!all.length) return;
    const i = all.findIndex((one) => one.id === chosen);
    choose(all[(i + by + all.length + (i < 0 && by < 0 ? 1 : 0)) % all.length]);
    $("top").focus();
  }

  function pick(tool) {
    app.tool = tool;
    for (const button of document.querySelectorAll(".tools button")) {
      const on = button.value === tool;
      button.setAttribute("aria-checked", on);
      button.tabIndex = on ? 0 : -1;
    }
    $("hint").textContent = `${Words.HINTS[tool]} Keys: arrows and Enter do the same.`;
    $("top").style.cursor = tool === "move" ? "grab" : "crosshair";
  }

  /* ---- recordings ------------------------------------------------------------ */

  function record() {
    if (recording) return endRecording();
    restart();
    [recording, history, notes, recorded] = [true, [], [`methods: ${names().join(", ")}`], null];
    told();
    run(true);
  }

  function endRecording() {
    recorded = recording ? scenario() : recorded;
    recording = false;
    run(false);
    told();
    say(`Recorded ${time().toFixed(2)} s. Save it and run it: qpavoid run recording.toml --controller ${focus}`);
  }

  function told() {
    document.body.classList.toggle("recording", recording);
    $("recording").textContent = recording ? "Stop recording" : "Record";
    $("record").setAttribute("aria-pressed", recording);
    for (const id of ["drive", "scene", "reset"]) $(id).disabled = recording;
    $("drive").textContent = station ? "Drive on" : "Park here";
  }

  /** The scene as a scenario file: as recorded, or as it stands now. */
  function scenario() {
    const begun = history.length > 1;
    const now = begun ? history : [Toml.places(world)];
    const [x_m, y_m, heading_rad] = station || scene.start;
    const start = { x_m, y_m, heading_rad };
    const made = { ...scene.document, title: `${scene.title}, ${begun ? "recorded" : "played"}`, start };
    made.duration_s = begun ? time(history.length - 1) : scene.duration;
    made.dt_s = dt();
    if (station) Object.assign(made, { reference: { kind: "station", pose: start }, tracking: { ...made.tracking, station_keeping: true } });
    for (const section of ["lidar", "perception"]) made[section] = { ...scene.document[section] };
    for (const { section, key } of data.settings) {
      const name = `${section}.${key}`;
      if (settings[name] !== finite(scene.settings)[name]) made[section] = { ...made[section], [key]: settings[name] };
    }
    if (!lidar) ["lidar", "perception"].forEach((section) => delete made[section]);
    made.robot = { ...made.robot, ...robotTable() };
    made.obstacles = Toml.obstacles(world, now, dt());
    const left = scene.left_out.length ? [`not played: ${scene.left_out.join(", ")}`] : [];
    return Toml.write(made, [begun ? "Recorded with qpavoid play." : "Made with qpavoid play.", ...left, ...notes]);
  }

  function robotTable() {
    const usual = Robots.reals(scene.robot.limits);
    const said = {};
    if (robot.name !== scene.robot.name) {
      const preset = Object.keys(data.robots).find((name) => data.robots[name].name === robot.name);
      if (preset) said.preset = preset;
      else said.footprint_m = robot.outlines;
    }
    data.limits.forEach(({ key }, i) => {
      if (robot.limits[i] !== usual[i] && !(key === "track_m" && robot.limits[i] === 0)) said[key] = robot.limits[i];
    });
    return said;
  }

  function save() {
    const text = recorded || scenario();
    const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: "application/toml" })), download: "recording.toml" });
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  /* ---- settings -------------------------------------------------------------- */

  const misfit = (one) => Form.misfit({ ...one, dt: dt() }, data.ordered);

  function change(key, value) {
    if (key.startsWith("robot.")) return changeLimit(key, value);
    const changed = { ...settings, [key]: value };
    const why = misfit(changed);
    if (why) return why;
    settings = changed;
    changedBy(`${key} = ${value}`);
    return "";
  }

  function changeLimit(key, value) {
    const i = data.limits.findIndex((one) => key === `robot.${one.key}`);
    const limits = Float64Array.from(robot.limits);
    limits[i] = value;
    const [v1, v2, w1, w2, , , wheels, track] = limits;
    if (!(v1 < v2) && !(w1 < w2)) return "leaves no twist but zero";
    if (wheels < Infinity && !(track > 0)) return "wheel_speed wants a track";
    robot = { ...robot, limits };
    changedBy(`${key} = ${value}`);
    return "";
  }

  function changedBy(note) {
    if (recording) notes.push(`${time().toFixed(2)} s: ${note}`);
    drive(names());
    showForm();
  }

  function limitValues(limits) {
    return Object.fromEntries(data.limits.map(({ key }, i) => [`robot.${key}`, limits[i]]));
  }

  function showForm() {
    const usual = { ...finite(scene.settings), ...limitValues(Robots.reals(scene.robot.limits)) };
    Form.show($("settings"), { ...settings, ...limitValues(robot.limits) }, usual);
    const degrees = Math.round((settings[VIEW] * 180) / Math.PI);
    [$("sees").value, $("view").value, $("degrees").textContent] = [lidar ? "lidar" : "truth", degrees, `${degrees}°`];
    $("field").hidden = !lidar;
  }

  function sense(on) {
    lidar = on;
    changedBy(`sees ${on ? "by LiDAR" : "true obstacles"}`);
  }

  function robotForm() {
    const options = [["scene", "of the scene"], ...Object.entries(data.robots).map(([key, one]) => [key, one.name]), ["own", "own footprint"]];
    const select = element("select", { id: "robot" }, ...options.map(([value, text]) => element("option", { value }, text)));
    const text = element("textarea", { id: "footprint", rows: 5, spellcheck: "false" });
    const alarm = element("span", { class: "wrong", role: "alert" });
    const own = element("label", { class: "wide" }, element("span", {}, "corners ", element("span", { class: "muted" }, "(x, y in m, a line each, an empty one between parts; the origin is the middle of the axle)")), text, alarm);
    own.hidden = true;
    const use = (made, note) => { robot = made; alarm.textContent = ""; changedBy(`robot = ${note}`); };
    select.addEventListener("change", () => {
      own.hidden = select.value !== "own";
      text.value = robot.outlines.map((part) => part.map((one) => one.map((x) => Number(x.toFixed(4))).join(", ")).join("\n")).join("\n\n");
      if (select.value === "scene") use(Robots.given(scene.robot), "scene");
      else if (select.value !== "own") use(Robots.given(data.robots[select.value]), select.value);
    });
    text.addEventListener("change", () => {
      try {
        use(Robots.shaped(Robots.corners(text.value), robot.limits, data.sizes.spacing), "own");
      } catch (error) {
        alarm.textContent = error.message;
      }
    });
    const part = element("details", { open: true }, element("summary", {}, "Robot"), element("label", { class: "wide" }, element("span", {}, "footprint and limits"), select), own);
    return { part, reset() { select.value = "scene"; own.hidden = true; } };
  }

  /* ---- putting it together --------------------------------------------------- */

  const tableRows = new Map();

  function methodTable() {
    Object.entries(data.methods).forEach(([name, what], i) => {
      const box = element("input", { type: "checkbox", "aria-label": `${name} drives`, "data-key": String(i + 1), onchange: () => toggle(name) });
      const mark = element("span", { class: "swatch", "aria-hidden": "true" });
      mark.style.background = `var(${hue(name)})`;
      const show = element("button", { type: "button", title: what, onclick: () => look1(name) }, name);
      const cells = Array.from({ length: 6 }, () => element("td"));
      const row = element("tr", {}, element("th", { scope: "row" }, element("div", {}, box, mark, show)), ...cells);
      tableRows.set(name, { element: row, cells, box });
      $("rows").append(row);
    });
  }

  function toggle(name) {
    const wanted = pilots.has(name) ? names().filter((one) => one !== name) : [...names(), name];
    if (!wanted.length) return void (dirty = true);
    if (!pilots.has(name)) focus = pilots.has(focus) ? focus : name;
    if (recording) notes.push(`${time().toFixed(2)} s: methods: ${wanted.join(", ")}`);
    drive(wanted);
  }

  function look1(name) {
    if (!pilots.has(name)) toggle(name);
    focus = name;
    dirty = true;
  }

  function load(i) {
    scene = data.scenes[i];
    [settings, robot, station] = [finite(scene.settings), Robots.given(scene.robot), null];
    lidar = scene.lidar;
    world = new World.Scene(scene.obstacles);
    [view, chosen, recorded, history, notes, k, past] = [null, null, null, [], [], 0, []];
    drive(names().length ? names() : data.chosen, true);
    $("close").checked = Number.isFinite(robot.limits[4]);  // else hardly to be seen
    robotPart.reset();
    showForm();
    choose(null);
    told();
    document.title = `${scene.title} – qpavoid play`;
    $("left-out").textContent = scene.left_out.length ? `Of this scene it leaves out: ${scene.left_out.join(", ")}.` : "";
    run(running);
  }

  /** Keep the present pose as a station; or drive on from where the way was left. */
  function park() {
    const places = new Map([...pilots].map(([name, { robot: one }]) => [name, one.place]));
    const on = left;
    [station, left] = station ? [null, null] : [pilots.get(focus).robot.pose, places];
    drive(names());
    for (const [name, { robot: one }] of pilots) Object.assign(one, { place: station ? 0 : (on && on.get(name)) || 0, mode: 0 });
    told();
    look();
  }

  function keyboard(event) {
    const { target, key } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || $("keys").open) return;
    if (/^(INPUT|SELECT|TEXTAREA)$/.test(target.tagName) && target.type !== "checkbox") return;
    if (key === " " && /^(BUTTON|SUMMARY|INPUT)$/.test(target.tagName)) return;
    if (key === "[" || key === "]") chooseNext(key === "]" ? 1 : -1);
    else {
      const wanted = key === "Backspace" ? "Delete" : key.length === 1 ? key.toLowerCase() : key;
      const found = [...document.querySelectorAll("[data-key]")].find((one) => one.dataset.key === wanted);
      if (!found || found.disabled || (found.id === "remove" && $("chosen").hidden)) return;
      if (found.tagName === "SELECT") found.focus();
      else found.click();
    }
    event.preventDefault();
  }

  function theme() {
    const root = document.documentElement;
    const dark = root.style.colorScheme ? root.style.colorScheme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.style.colorScheme = dark ? "light" : "dark";
    dirty = true;
  }

  function legend() {
    const item = (color, sign, text) => {
      const made = element("span", { "aria-hidden": "true" }, sign);
      made.style.color = `var(${color})`;
      return element("span", {}, made, ` ${text}`);
    };
    $("legend").append(item("--chosen", "■", "allowed now"), item("--row", "■", "forbidden by a row"), item("--active", "▨", "active row"), item("--fg", "⋯", "limits of this step"),
      item("--desired", "◇", "desired"), item("--aimed", "✕", "aimed at"), item("--chosen", "●", "driven"));
  }

  const robotPart = robotForm();

  function wire() {
    $("scene").append(...data.scenes.map((one, i) => element("option", { value: i }, one.title)));
    $("scene").onchange = () => load(Number($("scene").value));
    $("run").onclick = () => run(!running);
    $("step").onclick = () => { run(false); step(); look(); };
    $("reset").onclick = () => restart();
    $("speed").onchange = () => { speed = Number($("speed").value); };
    $("drive").onclick = park;
    $("sees").onchange = () => sense($("sees").value === "lidar");
    $("view").oninput = () => change(VIEW, (Number($("view").value) * Math.PI) / 180);
    $("record").onclick = record;
    $("save").onclick = save;
    $("fit").onclick = fit;
    const zoomBy = (factor) => setView(Hands.zoom($("top"), view, factor, [$("top").clientWidth / 2, $("top").clientHeight / 2]));
    $("nearer").onclick = () => zoomBy(1.25);
    $("farther").onclick = () => zoomBy(0.8);
    $("theme").onclick = theme;
    $("close").onchange = () => { dirty = true; };
    $("help").onclick = () => $("keys").showModal();
    $("remove").onclick = () => { const thing = world.find(chosen); if (thing) app.erase(thing); };
    $("radius").onchange = () => {
      const [thing, radius] = [world.find(chosen), Number($("radius").value)];
      if (thing && radius >= 0 && radius <= 5 && editable("Change a radius")) { thing.radius = radius; look(); }
    };
    $("defaults").onclick = () => { [settings, robot] = [finite(scene.settings), Robots.given(scene.robot)]; robotPart.reset(); changedBy("settings of the scene"); };
    const tools = document.querySelector(".tools");
    tools.append(...Words.TOOLS.map(([value, text, key]) => element("button", { type: "button", role: "radio", value, "data-key": key, onclick: () => pick(value) }, text)));
    tools.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      const i = Words.TOOLS.findIndex(([value]) => value === app.tool);
      pick(Words.TOOLS[(i + by + Words.TOOLS.length) % Words.TOOLS.length][0]);
      document.querySelector('.tools [aria-checked="true"]').focus();
      event.preventDefault();
    });
    $("key-list").append(...Words.KEYS.flatMap(([key, what]) => [element("dt", {}, element("kbd", {}, key)), element("dd", {}, what)]));
    document.addEventListener("keydown", keyboard);
    const again = () => { dirty = true; };
    new ResizeObserver(again).observe($("top"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
    Hands.attach($("top"), app);
    Form.make($("settings"), [...data.limits, ...data.settings], change, [robotPart.part]);
    if (location.hash.includes("embed")) document.body.classList.add("embedded");
  }

  async function start() {
    methodTable();
    legend();
    wire();
    pick("move");
    module = await Pilot.program(data.program);
    load(0);
    run(!reduced.matches && !location.hash.includes("paused"));
    requestAnimationFrame(draw);
  }

  start().catch((error) => say(`This browser cannot run the page: ${error.message}`, true));

  return {  // for tests and the curious
    advance(steps) { for (let i = 0; i < steps; i++) step(); look(); },
    frames: () => frames, time: () => (scene ? time() : 0), running: () => running,
    last: (name) => past.at(-1).frames.get(name), toggle, known: (name = focus) => known(pilots.get(name))[0],
    kept: (name) => past.map(({ frames: at }) => at.get(name)), things: () => world.things, methods: names,
    restart, run, misfit,
    onPage(x, y) {
      const box = $("top").getBoundingClientRect();
      const [px, py] = Panels.toPixel($("top"), view, x, y);
      return [box.left + $("top").clientLeft + px, box.top + $("top").clientTop + py];
    },
  };
})();
window.play = Play;
