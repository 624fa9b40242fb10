"use strict";
/* The live page: what the server says is drawn, what the user does is sent. */

(() => {
  const $ = (id) => document.getElementById(id);
  const KEPT = 20;  // s of the strips and of the trail
  const STRIPS = 100;  // ms between two drawings of the strips

  let [socket, about, view, chosen] = [null, null, null, null];
  let [last, before, arrived, drawn] = [null, null, 0, null];
  let [added, frames, total, counted, strips] = [0, 0, 0, performance.now(), 0];
  let past = [];

  /* ---- the server ------------------------------------------------------------ */

  function send(message) {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  }

  function connect() {
    socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/live`);
    socket.onopen = () => { document.body.classList.remove("lost"); say(""); };
    socket.onmessage = ({ data }) => {
      const message = JSON.parse(data);
      ({ world: learn, frame: take, error: complain })[message.kind](message);
    };
    socket.onclose = () => {
      document.body.classList.add("lost");
      say("No connection to the server; trying again.");
      setTimeout(connect, 1000);
    };
  }

  const say = (text) => { $("notice").textContent = text; };

  function complain({ about: field, message }) {
    if (!Form.complain($("settings"), field, message)) say(message);
  }

  function learn(message) {
    about = message;
    $("title").textContent = about.title;
    $("controller").replaceChildren(...Object.entries(about.controllers).map(([name, text]) => {
      const option = new Option(name, name, false, name === about.controller);
      option.title = text;
      return option;
    }));
    $("run").textContent = about.running ? "Pause" : "Go on";
    $("drive").textContent = about.driving ? "Park here" : "Drive on";
    $("record").textContent = about.recording ? "Stop recording" : "Restart and record";
    for (const id of ["drive", "add"]) $(id).disabled = about.recording;
    $("save").hidden = about.recording || !about.recorded;
    document.body.classList.toggle("recording", about.recording);
    Form.show($("settings"), about.settings, send);
    choose(chosen);
    say(about.trouble);
  }

  function take(frame) {
    if (past.length && frame.t < past[past.length - 1].t) past = [];
    past.push(frame);
    while (past[0].t < frame.t - KEPT) past.shift();
    [before, last, arrived] = [last, frame, performance.now()];
  }

  /* ---- what is shown --------------------------------------------------------- */

  /** The frame on its way from the one before, where frames come slower than pictures. */
  function between(now) {
    const share = Math.min(1, (now - arrived) / 1000 / about.dt);
    const near = before && before.ids.join() === last.ids.join() && last.t - before.t < 2 * about.dt && last.t > before.t;
    if (about.dt < 0.025 || !near) return last;
    const mix = (a, b) => a + share * (b - a);
    const turn = Math.atan2(Math.sin(last.heading - before.heading), Math.cos(last.heading - before.heading));
    return {
      ...last,
      x: mix(before.x, last.x), y: mix(before.y, last.y), heading: before.heading + share * turn,
      discs: last.discs.map(([x, y, r], i) => [mix(before.discs[i][0], x), mix(before.discs[i][1], y), r]),
      polygons: last.polygons.map((corners, i) => corners.map(([x, y], j) => [mix(before.polygons[i][j][0], x), mix(before.polygons[i][j][1], y)])),
      contact: share < 1 ? null : last.contact,
    };
  }

  function fitView() {
    const places = [...about.world.path, [last.x, last.y], ...last.discs.filter(([x, y]) => Math.hypot(x - last.x, y - last.y) < 6)];
    const reach = [0, 1].map((i) => places.map((place) => place[i]));
    const ends = reach.flatMap((values) => [Math.min(...values) - 1.5, Math.max(...values) + 1.5]);
    view = Panels.fit($("top"), ends);
  }

  function ring(frame, id, width) {
    const i = frame.ids.indexOf(id);
    if (i < 0) return;
    const [x, y, radius] = frame.discs[i];
    const g = $("top").getContext("2d");
    const place = Panels.toPixel($("top"), view, x, y);
    Pen.dot(g, place, Math.max(radius * view.scale, 3) + width, null, "--link");
  }

  function draw(now) {
    requestAnimationFrame(draw);
    if (!about || !last) return;
    if (!view) fitView();
    const frame = between(now);
    if (frame === drawn && !draw.again) return;
    draw.again = false;
    drawn = frame;
    frames += 1;
    total += 1;
    Panels.top($("top"), about.world, frame, { view, trail: past.map(({ x, y }) => [x, y]) });
    ring(frame, chosen, 4);
    frame.held.forEach((id) => ring(frame, id, 7));
    const { v, w } = about.limits;
    Panels.plane($("plane"), last, { v: widened(v), w: widened(w) });
    if (now - strips > STRIPS) { strips = now; drawStrips(); write(now); }
  }

  const widened = ([lo, hi]) => [lo - 0.1 * (hi - lo), hi + 0.1 * (hi - lo)];

  function drawStrips() {
    const column = (name) => past.map((frame) => frame[name]);
    const t = column("t");
    const end = Math.max(KEPT, last.t);
    const common = { t, span: [end - KEPT, end], cursor: null };
    const chosenStyle = { color: "--chosen", width: 2 };
    const desiredStyle = { color: "--desired", dash: [4, 3] };
    Panels.strip($("clearance"), {
      ...common, title: "clearance", unit: "m", range: [-0.05, 1.2],
      series: [{ name: "", values: column("clearance"), style: chosenStyle }],
      bands: [{ from: 0, to: column("r"), kind: "r" }, { from: 0, to: column("rmin"), kind: "rmin" }],
    });
    for (const [id, title, unit, range] of [["v", "v", "m/s", about.limits.v], ["omega", "ω", "rad/s", about.limits.w]]) {
      const letter = id === "v" ? "v" : "w";
      Panels.strip($(id), {
        ...common, title, unit, range: widened(range), bands: [],
        series: [
          { name: "desired", values: column(`${letter}d`), style: desiredStyle },
          { name: "driven", values: column(letter), style: chosenStyle },
        ],
      });
    }
    Panels.strip($("solve"), {
      ...common, title: "controller's step", unit: "µs", log: true, range: [1, 2000], bands: [],
      series: [{ name: "", values: column("solve_us"), style: { color: "--fg", width: 1 } }],
    });
  }

  function write(now) {
    $("status").textContent = last.status;
    $("words").textContent = Panels.words(last, about.world);
    if (now - counted < 1000) return;
    const rate = Math.round((1000 * frames) / (now - counted));
    $("pace").textContent = `t = ${last.t.toFixed(1)} s, ${rate} frames/s${about.recording ? ", recording" : ""}`;
    [frames, counted] = [0, now];
  }

  /* ---- what the user does ---------------------------------------------------- */

  function choose(id) {
    chosen = id;
    draw.again = true;
    const here = last && last.ids.includes(id);
    $("remove").disabled = !here || about.recording;
    $("remove").textContent = here ? `Remove disc ${last.ids.indexOf(id) + 1}` : "Remove disc";
  }

  function addDisc() {
    const angle = 2.4 * added++ + Math.PI / 2;  // golden angle: not where the last one is
    send({ kind: "add", x_m: last.x + 1.6 * Math.cos(angle), y_m: last.y + 1.6 * Math.sin(angle), radius_m: 0.2 });
  }

  const setView = (other) => { view = other; draw.again = true; };
  const zoomBy = (factor) => {
    const canvas = $("top");
    setView(Hands.zoom(canvas, view, factor, [canvas.clientWidth / 2, canvas.clientHeight / 2]));
  };

  $("controller").onchange = (event) => send({ kind: "controller", name: event.target.value });
  $("run").onclick = () => send({ kind: "run", on: !about.running });
  $("restart").onclick = () => send({ kind: "restart" });
  $("drive").onclick = () => send({ kind: "drive", on: !about.driving });
  $("record").onclick = () => send({ kind: "record", on: !about.recording });
  $("add").onclick = addDisc;
  $("remove").onclick = () => { send({ kind: "remove", disc: chosen }); chosen = null; };
  $("fit").onclick = () => { fitView(); draw.again = true; };
  $("nearer").onclick = () => zoomBy(1.25);
  $("farther").onclick = () => zoomBy(0.8);
  addEventListener("resize", () => { draw.again = true; });
  matchMedia("(prefers-color-scheme: dark)").onchange = () => { draw.again = true; };

  window.play = {  // for tests and the curious
    about: () => about,
    frame: () => last,
    frames: () => total,
    onPage: (x, y) => {
      const box = $("top").getBoundingClientRect();
      const [px, py] = Panels.toPixel($("top"), view, x, y);
      return [box.left + px, box.top + py];
    },
  };

  Hands.attach($("top"), () => ({ frame: last, view, chosen, setView, choose }), send);
  connect();
  requestAnimationFrame(draw);
})();
