"use strict";
/* Drawing functions of the live page. They know plain frames only.
Load pen.js, panels.js, charts.js in this order.

world = {outlines: [[[x, y]...]...] (robot frame), points: [[x, y]...],
         walls: [[x1, y1, x2, y2]...], path: [[x, y]...] (planned)}
frame = {t, x, y, heading,             pose, world frame, m and rad
         xr, yr, hr,                   reference pose
         vd, wd, va, wa, v, w,         desired, aimed and chosen twist, m/s and rad/s
         clearance, rmin, r,           m
         status, said, slack, solve_us,      word, sentence, m/s, microseconds
         contact: [x, y] | null,       P_r, world frame
         obstacle,                     number of the nearest: points, discs, walls, polygons
         box: [vlo, vhi, wlo, whi] | null,     limits of this step
         planes: [[av, aw, b, obstacle]...],   rows av v + aw w >= b
         plan: [v, w, switch, v, w, end],      two twists and until when, s; or null
         discs: [[x, y, radius]...],
         polygons: [[[x, y]...]...]}          corners, counter-clockwise

Panels.top(canvas, world, frame, {view: {cx, cy, scale}, trail: [[x, y]...],
           color, others: [{outlines, frame, trail, color}...]})
           from above; scale in CSS pixels per m; others: robots beside the first
Panels.toWorld(canvas, view, px, py) -> [x, y]      px, py: CSS pixels in the canvas
Panels.toPixel(canvas, view, x, y) -> [px, py]
Panels.fit(canvas, [xlo, xhi, ylo, yhi]) -> view    that shows the whole box
Panels.foot([x1, y1, x2, y2], [x, y]) -> [x, y]     of a segment, nearest to a place
Panels.plane(canvas, frame, {v: [lo, hi], w: [lo, hi]})      the (v, w) plane
Panels.strip(canvas, {t, series: [{name, values, style}], bands: [{from, to, kind}],
           unit, title, range: [lo, hi], span: [t0, t1]})
           style: {color, dash: [...], width}; from, to: number or array over t;
           kind: "r" | "rmin"
Panels.active(frame) -> [row...]                    rows with equality at (v, w)
Panels.words(frame, world) -> sentences             world: for the names of obstacles
Colours are CSS variables, written "--name", or plain CSS colours. */

const Panels = (() => {
  const { begin, color, dot, label, line } = Pen;

  /* ---- from above ------------------------------------------------------------ */

  const toPixel = (canvas, view, x, y) => [
    canvas.clientWidth / 2 + (x - view.cx) * view.scale,
    canvas.clientHeight / 2 - (y - view.cy) * view.scale,
  ];
  const toWorld = (canvas, view, px, py) => [
    view.cx + (px - canvas.clientWidth / 2) / view.scale,
    view.cy - (py - canvas.clientHeight / 2) / view.scale,
  ];

  function fit(canvas, [xlo, xhi, ylo, yhi]) {
    const scale = Math.min(canvas.clientWidth / (xhi - xlo), canvas.clientHeight / (yhi - ylo));
    return { cx: (xlo + xhi) / 2, cy: (ylo + yhi) / 2, scale };
  }

  function placed(vertices, x, y, heading) {
    const [c, s] = [Math.cos(heading), Math.sin(heading)];
    return vertices.map(([a, b]) => [x + c * a - s * b, y + s * a + c * b]);
  }

  /** Where (x, y) is after driving the twist on for some seconds, in places. */
  function arc(frame, v, w, seconds) {
    let [x, y, heading] = [frame.x, frame.y, frame.heading];
    const places = [[x, y]];
    for (let i = 0; i < 20; i++) {
      const turn = (w * seconds) / 20;
      x += (v * seconds * Math.cos(heading + turn / 2)) / 20;
      y += (v * seconds * Math.sin(heading + turn / 2)) / 20;
      heading += turn;
      places.push([x, y]);
    }
    return places;
  }

  function robot(g, px, world, frame, scale) {
    const path = new Path2D();
    for (const vertices of world.outlines) {
      const outline = placed(vertices, frame.x, frame.y, frame.heading).map(px);
      outline.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
      path.closePath();
    }
    for (const [reach, fill] of [[frame.r, "--zone-r"], [frame.rmin, "--zone-rmin"]]) {
      g.strokeStyle = g.fillStyle = color(fill);
      g.lineWidth = 2 * reach * scale;  // a round stroke is the exact offset
      g.stroke(path);
      g.fill(path);
    }
    return () => {
      g.fillStyle = color("--body");
      g.fill(path);
      g.strokeStyle = color(frame.clearance < 0 ? "--contact" : "--fg");
      g.lineWidth = frame.clearance < 0 ? 3.5 : 1.5;
      g.stroke(path);
      const front = Math.max(...world.outlines.flat().map(([x]) => x));
      const nose = [[0.5, 0.15], [0.75, 0], [0.5, -0.15]].map(([a, b]) => [a * front, b * front]);
      line(g, placed(nose, frame.x, frame.y, frame.heading).map(px), "--fg", 1.5);
      dot(g, px([frame.x, frame.y]), 2.5, "--fg");
    };
  }

  /** Where a plan leads, in places, and the pose at its end. */
  function planned(frame) {
    const [v, w, until, vThen, wThen, end] = frame.plan;
    const pieces = [[v, w, Math.min(until, end)], [vThen, wThen, Math.max(0, end - until)]];
    let [at, places] = [frame, []];
    for (const [speed, turn, seconds] of pieces) {
      const way = arc(at, speed, turn, seconds);
      const [x, y] = way[way.length - 1];
      places = [...places, ...way];
      at = { x, y, heading: at.heading + turn * seconds };
    }
    return { places, at };
  }

  function plan(g, px, world, frame, hue) {
    const { places, at } = planned(frame);
    line(g, places.map(px), hue, 2, [1, 4]);
    for (const vertices of world.outlines) {
      const outline = placed(vertices, at.x, at.y, at.heading).map(px);
      line(g, [...outline, outline[0]], hue, 1, [2, 3]);
    }
  }

  /** A robot beside the first one: its outline, its nose, and its way. */
  function other(g, px, { outlines, frame, trail, color: hue }) {
    line(g, trail.map(px), hue, 2);
    for (const vertices of outlines) {
      const outline = placed(vertices, frame.x, frame.y, frame.heading).map(px);
      line(g, [...outline, outline[0]], hue, 2);
    }
    const front = Math.max(...outlines.flat().map(([x]) => x));
    line(g, placed([[0, 0], [front, 0]], frame.x, frame.y, frame.heading).map(px), hue, 1.5);
  }

  /** Where the obstacle of a number is nearest to a place, and how to draw it. */
  function obstacleOf(world, frame, number) {
    const { points, walls } = world;
    if (number < points.length) return { kind: "point", place: points[number] };
    number -= points.length;
    if (number < frame.discs.length) return { kind: "disc", place: frame.discs[number] };
    number -= frame.discs.length;
    if (number < walls.length) return { kind: "wall", place: walls[number] };
    const polygon = frame.polygons[number - walls.length];
    return polygon ? { kind: "polygon", place: polygon } : null;
  }

  /** Where a segment is nearest to a place. */
  function foot([x1, y1, x2, y2], [x, y]) {
    const [dx, dy] = [x2 - x1, y2 - y1];
    const along = ((x - x1) * dx + (y - y1) * dy) / (dx * dx + dy * dy || 1);
    const s = Math.min(1, Math.max(0, along));
    return [x1 + s * dx, y1 + s * dy];
  }

  function nearestOn({ kind, place }, [x, y]) {
    if (kind === "point") return place;
    if (kind === "disc") {
      const [dx, dy, radius] = [x - place[0], y - place[1], place[2]];
      const far = Math.hypot(dx, dy) || 1;
      return [place[0] + (dx * radius) / far, place[1] + (dy * radius) / far];
    }
    if (kind === "polygon") {
      const feet = place.map((end, i) => foot([...place.at(i - 1), ...end], [x, y]));
      return feet.reduce((a, b) => (Math.hypot(b[0] - x, b[1] - y) < Math.hypot(a[0] - x, a[1] - y) ? b : a));
    }
    return foot(place, [x, y]);
  }

  function drawObstacle(g, px, scale, { kind, place }, fill, wider = 0) {
    if (kind === "wall") {
      const [x1, y1, x2, y2] = place;
      line(g, [px([x1, y1]), px([x2, y2])], fill, 3 + 2 * wider);
    } else if (kind === "polygon") {
      const outline = [...place, place[0]].map(px);
      line(g, outline, fill, 1 + 2 * wider);
      g.fillStyle = color(fill);
      g.fill();
    } else {
      dot(g, px(place), Math.max((place[2] || 0) * scale, 3) + wider, fill);
    }
  }

  function obstacles(g, px, scale, world, frame) {
    const held = new Set(Panels.active(frame).map((row) => row[3]).filter((number) => number >= 0));
    const count = world.points.length + frame.discs.length + world.walls.length + frame.polygons.length;
    for (const number of held) {
      const obstacle = obstacleOf(world, frame, number);
      if (obstacle) drawObstacle(g, px, scale, obstacle, "--active", 4);
    }
    for (let number = 0; number < count; number++) {
      drawObstacle(g, px, scale, obstacleOf(world, frame, number), "--solid");
    }
  }

  function top(canvas, world, frame, { view, trail, color: hue, others }) {
    const { g, w, h } = begin(canvas);
    const px = ([x, y]) => toPixel(canvas, view, x, y);
    const body = robot(g, px, world, frame, view.scale);
    line(g, world.path.map(px), "--fg", 1, [5, 4]);
    line(g, trail.map(px), hue, 2.5);
    obstacles(g, px, view.scale, world, frame);
    others.forEach((one) => other(g, px, one));
    if (frame.plan) plan(g, px, world, frame, hue);
    body();
    line(g, arc(frame, frame.vd, frame.wd, 1).map(px), "--desired", 2, [4, 3]);
    line(g, arc(frame, frame.v, frame.w, 1).map(px), "--chosen", 2.5);
    const target = placed([[0, 0], [0.25, 0]], frame.xr, frame.yr, frame.hr).map(px);
    line(g, target, "--target", 2);
    dot(g, target[0], 4, "--target", "--bg");
    if (frame.contact) {
      const obstacle = obstacleOf(world, frame, frame.obstacle);
      if (obstacle) line(g, [px(frame.contact), px(nearestOn(obstacle, frame.contact))], "--contact", 2);
      dot(g, px(frame.contact), 4, "--contact", "--bg");
    }
    const bar = view.scale > 150 ? 0.5 : 1;
    line(g, [[w - 12 - bar * view.scale, h - 10], [w - 12, h - 10]], "--fg", 2);
    label(g, `${bar} m`, w - 12, h - 16, "--fg", "right");
  }

  /* ---- in words -------------------------------------------------------------- */

  const signed = (value) => (value < 0 ? "−" : "+") + Math.abs(value).toFixed(2);

  /** What an obstacle is called: "disc 2", "wall 1", "point 17". */
  function nameOf(world, frame, number) {
    const points = world.points.length;
    if (number < points) return `point ${number + 1}`;
    if (number < points + frame.discs.length) {
      const [, , radius] = frame.discs[number - points];
      return `${radius ? "disc" : "point"} ${number - points + 1}`;
    }
    const later = number - points - frame.discs.length;
    return later < world.walls.length ? `wall ${later + 1}` : `polygon ${later - world.walls.length + 1}`;
  }

  const differ = (v1, w1, v2, w2) => Math.hypot(v1 - v2, w1 - w2) > 1e-6;
  const twist = (v, w) => `v ${signed(v)} m/s, ω ${signed(w)} rad/s`;

  function driven({ v, w, vd, wd, va, wa }) {
    if (!differ(v, w, vd, wd)) return `Driven: ${twist(v, w)}, as desired.`;
    const aim = Number.isFinite(va) && differ(va, wa, vd, wd) ? ` Having looked ahead, it aims at ${twist(va, wa)}.` : "";
    return `Driven: ${twist(v, w)} instead of ${twist(vd, wd)}.${aim}`;
  }

  function nearest(frame, world) {
    const { clearance, rmin, r, obstacle } = frame;
    if (!Number.isFinite(clearance) || obstacle < 0) return "Nothing is near.";
    const name = nameOf(world, frame, obstacle);
    if (clearance < 0) return `Contact with ${name}, ${(-clearance).toFixed(3)} m deep.`;
    const where = clearance < rmin ? `below r_min ${rmin.toFixed(2)} m`
      : clearance < r ? `within r ${r.toFixed(2)} m` : `r_min ${rmin.toFixed(2)} m`;
    return `Nearest: ${name}, ${clearance.toFixed(3)} m away (${where}).`;
  }

  function holders(frame, world) {
    const rows = Panels.active(frame).map((row) => row[3]);
    const names = [...new Set(rows.filter((number) => number >= 0))].map((number) => nameOf(world, frame, number));
    if (names.length > 3) names.splice(2, names.length, `${names.length - 2} more`);
    const { v, w, box } = frame;
    const edge = box && [v - box[0], box[1] - v, w - box[2], box[3] - w].some((room) => Math.abs(room) < 1e-5);
    if (rows.includes(-1) || edge) names.push("the limits of this step");
    return names.length ? `Held by ${names.join(", ")}.` : "";
  }

  function words(frame, world) {
    const slack = frame.slack > 0 ? `Slack: ${frame.slack.toFixed(3)} m/s.` : "";
    const held = differ(frame.v, frame.w, frame.vd, frame.wd) ? holders(frame, world) : "";
    const limited = frame.status === "tracking" && differ(frame.v, frame.w, frame.vd, frame.wd);
    const why = limited ? "The limits of the robot change the desired twist." : frame.said;
    const parts = [why || frame.status, driven(frame), nearest(frame, world), held, slack];
    return parts.filter(Boolean).join(" ");
  }

  return { top, toWorld, toPixel, fit, foot, words };
})();
