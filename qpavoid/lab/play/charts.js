"use strict";
/* The (v, ω) plane and the strips over time; the contract stands in panels.js. */

(() => {
  const { begin, color, dot, label, line } = Pen;

  /** Ticks at round numbers in a range, no closer than so many pixels. */
  function ticks([lo, hi], pixels, apart) {
    const wanted = ((hi - lo) * apart) / Math.max(pixels, apart);
    const power = 10 ** Math.floor(Math.log10(wanted));
    const step = power * [1, 2, 5, 10].find((factor) => factor * power >= wanted * 0.999);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const places = [];
    for (let i = Math.ceil(lo / step - 1e-9); i * step <= hi + 1e-9 * step; i++) places.push(i * step);
    return places.map((value) => [value, value.toFixed(digits).replace("-", "−")]);
  }

  /* ---- the (v, ω) plane ------------------------------------------------------ */

  const missing = ([av, aw, b], v, w) => b - av * v - aw * w;

  function active(frame) {
    return frame.planes.filter((row) => {
      const size = Math.abs(row[0] * frame.v) + Math.abs(row[1] * frame.w) + Math.abs(row[2]);
      return Math.abs(missing(row, frame.v, frame.w)) <= 1e-6 + 4e-7 * size;  // float32
    });
  }

  /** The part of a convex polygon of twists where a row is violated, and its edge. */
  function forbidden(row, corners) {
    const [part, edge] = [[], []];
    corners.forEach((here, i) => {
      const next = corners[(i + 1) % corners.length];
      const [a, b] = [missing(row, ...here), missing(row, ...next)];
      if (a > 0) part.push(here);
      if (a > 0 !== b > 0) {
        const s = a / (a - b);
        edge.push([here[0] + s * (next[0] - here[0]), here[1] + s * (next[1] - here[1])]);
        part.push(edge[edge.length - 1]);
      }
    });
    return { part, edge };
  }

  /** The twists that the limits and all rows allow, as a convex polygon. */
  function admissible(frame) {
    const [v1, v2, w1, w2] = frame.box;
    let places = [[v1, w1], [v2, w1], [v2, w2], [v1, w2]];
    for (const [av, aw, b] of frame.planes) places = forbidden([-av, -aw, -b], places).part;
    return places;
  }

  function area(path, places) {
    places.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
    if (places.length) path.closePath();
  }

  /** Short strokes from a line into the side that it forbids. */
  function hatch(g, [[x1, y1], [x2, y2]], [nx, ny], stroke) {
    const length = Math.hypot(x2 - x1, y2 - y1);
    for (let s = 6; s < length; s += 10) {
      const [x, y] = [x1 + (s / length) * (x2 - x1), y1 + (s / length) * (y2 - y1)];
      line(g, [[x, y], [x + 7 * nx, y + 7 * ny]], stroke, 1.2);
    }
  }

  function rows(g, frame, limits, at) {
    const corners = [[limits.v[0], limits.w[0]], [limits.v[1], limits.w[0]], [limits.v[1], limits.w[1]], [limits.v[0], limits.w[1]]];
    const held = new Set(active(frame));
    const tint = new Path2D();
    const cuts = frame.planes.map((row) => [row, forbidden(row, corners)]);
    cuts.forEach(([, { part }]) => area(tint, part.map(at)));
    g.fillStyle = color("--forbidden");
    g.fill(tint);
    for (const [row, { edge }] of cuts) {
      if (edge.length !== 2) continue;
      const bold = held.has(row);
      const stroke = bold ? "--active" : row[3] < 0 ? "--muted" : "--row";
      const ends = edge.map(at);
      line(g, ends, stroke, bold ? 3 : 1, row[3] < 0 ? [6, 3] : []);
      const origin = at([0, 0]);
      const down = at([-row[0], -row[1]]).map((value, i) => value - origin[i]);
      const across = Math.hypot(ends[1][1] - ends[0][1], ends[1][0] - ends[0][0]) || 1;
      let normal = [(ends[1][1] - ends[0][1]) / across, (ends[0][0] - ends[1][0]) / across];
      if (normal[0] * down[0] + normal[1] * down[1] < 0) normal = normal.map((value) => -value);
      if (bold) hatch(g, ends, normal, stroke);
    }
  }

  function marker(g, kind, [x, y]) {
    if (kind === "desired") line(g, [[x - 7, y], [x, y - 7], [x + 7, y], [x, y + 7], [x - 7, y]], "--desired", 2.5);
    if (kind === "aimed") {
      line(g, [[x - 6, y - 6], [x + 6, y + 6]], "--aimed", 2.5);
      line(g, [[x - 6, y + 6], [x + 6, y - 6]], "--aimed", 2.5);
    }
    if (kind === "chosen") dot(g, [x, y], 5.5, "--chosen", "--bg");
  }

  function planeAxes(g, w, h, limits, at) {
    g.strokeStyle = color("--line");
    g.lineWidth = 1;
    g.setLineDash([]);
    for (const [value, text] of ticks(limits.v, w - 48, 45)) {
      const [x] = at([value, 0]);
      line(g, [[x, 8], [x, h - 34]], value ? "--grid" : "--line");
      label(g, text, x, h - 20, "--muted", "center");
    }
    for (const [value, text] of ticks(limits.w, h - 42, 28)) {
      const [, y] = at([0, value]);
      line(g, [[40, y], [w - 8, y]], value ? "--grid" : "--line");
      label(g, text, 36, y + 4, "--muted", "right");
    }
    label(g, "v (m/s)", w - 8, h - 5, "--fg", "right");
    label(g, "ω (rad/s)", 4, h - 5, "--fg");
  }

  /** Twists outside the axes are shown on their edge. */
  function plane(canvas, frame, limits) {
    const { g, w, h } = begin(canvas);
    const at = ([v, omega]) => [
      40 + ((v - limits.v[0]) / (limits.v[1] - limits.v[0])) * (w - 48),
      8 + ((limits.w[1] - omega) / (limits.w[1] - limits.w[0])) * (h - 42),
    ];
    planeAxes(g, w, h, limits, at);
    g.save();
    g.beginPath();
    g.rect(40, 8, w - 48, h - 42);
    g.clip();
    rows(g, frame, limits, at);
    if (frame.box) {
      const free = new Path2D();
      area(free, admissible(frame).map(at));
      g.fillStyle = color("--feasible");
      g.fill(free);
      const [v1, v2, w1, w2] = frame.box;
      line(g, [[v1, w1], [v2, w1], [v2, w2], [v1, w2], [v1, w1]].map(at), "--fg", 1.5, [2, 3]);
    }
    g.restore();
    const inside = (value, [lo, hi]) => Math.min(hi, Math.max(lo, value));
    const shown = (v, omega) => at([inside(v, limits.v), inside(omega, limits.w)]);
    const [desired, chosen] = [shown(frame.vd, frame.wd), shown(frame.v, frame.w)];
    line(g, [desired, chosen], "--desired", 1, [3, 3]);
    marker(g, "desired", desired);
    const aims = Number.isFinite(frame.va) && Math.hypot(frame.va - frame.vd, frame.wa - frame.wd) > 1e-6;
    if (aims) marker(g, "aimed", shown(frame.va, frame.wa));
    marker(g, "chosen", chosen);
  }

  /* ---- strips over time ------------------------------------------------------ */

  const EDGE = { left: 46, right: 10, top: 20, bottom: 20 };
  const BANDS = { r: "--zone-r", rmin: "--zone-rmin" };
  const each = (value, i) => (typeof value === "number" ? value : value[i]);

  function frameOf(w, h, { range: [lo, hi], span: [t0, t1] }) {
    return {
      w, h, lo, hi, t0, t1,
      x: (t) => EDGE.left + ((t - t0) / (t1 - t0)) * (w - EDGE.left - EDGE.right),
      y: (value) => h - EDGE.bottom - ((value - lo) / (hi - lo)) * (h - EDGE.top - EDGE.bottom),
    };
  }

  function band(g, chart, f, { from, to, kind }) {
    const last = chart.t.length - 1;
    const clamp = (value) => f.y(Math.min(f.hi, Math.max(f.lo, value)));
    g.beginPath();
    for (let i = 0; i <= last; i++) g.lineTo(f.x(chart.t[i]), clamp(each(to, i)));
    for (let i = last; i >= 0; i--) g.lineTo(f.x(chart.t[i]), clamp(each(from, i)));
    g.fillStyle = color(BANDS[kind]);
    g.fill();
  }

  function curve(g, chart, f, { values, style }) {
    g.beginPath();
    let pen = false;
    for (let i = 0; i < chart.t.length; i++) {
      const shown = Number.isFinite(values[i]);
      if (shown) g[pen ? "lineTo" : "moveTo"](f.x(chart.t[i]), f.y(values[i]));
      pen = shown;
    }
    g.strokeStyle = color(style.color);
    g.lineWidth = style.width;
    g.setLineDash(style.dash || []);
    g.stroke();
    g.setLineDash([]);
  }

  function stripAxes(g, chart, f) {
    for (const [value, text] of ticks([f.lo, f.hi], f.h - EDGE.top - EDGE.bottom, 14)) {
      line(g, [[EDGE.left, f.y(value)], [f.w - EDGE.right, f.y(value)]], "--grid");
      label(g, text, EDGE.left - 5, f.y(value) + 4, "--muted", "right");
    }
    for (const [value, text] of ticks([f.t0, f.t1], f.w, 50)) {
      line(g, [[f.x(value), f.h - EDGE.bottom], [f.x(value), f.h - EDGE.bottom + 4]], "--line");
      label(g, text, f.x(value), f.h - 4, "--muted", "center");
    }
    line(g, [[EDGE.left, f.h - EDGE.bottom], [f.w - EDGE.right, f.h - EDGE.bottom]], "--line");
    label(g, `${chart.title} (${chart.unit})`, 4, 13, "--fg");
  }

  function legend(g, chart, f) {
    let x = f.w - EDGE.right;
    for (const { name, style } of [...chart.series].reverse()) {
      if (!name) continue;
      x -= g.measureText(name).width;
      label(g, name, x, 13, "--fg");
      line(g, [[x - 24, 9], [x - 5, 9]], style.color, 2, style.dash);
      x -= 36;
    }
  }

  function strip(canvas, chart) {
    const { g, w, h } = begin(canvas);
    const f = frameOf(w, h, chart);
    if (w * h === 0) return;  // not laid out yet
    chart.bands.forEach((one) => band(g, chart, f, one));
    stripAxes(g, chart, f);
    g.save();
    g.beginPath();
    g.rect(EDGE.left, EDGE.top - 2, f.w - EDGE.left, f.h - EDGE.top - EDGE.bottom + 4);
    g.clip();
    chart.series.forEach((one) => curve(g, chart, f, one));
    g.restore();
    legend(g, chart, f);
  }

  Object.assign(Panels, { active, plane, strip });
})();
