"use strict";
/* What the page was given to what is drawn: packed logs to runs, their frames and strips. */

const Unpack = (() => {
  async function inflate(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }

  async function arrays({ data, parts }) {
    const buffer = await inflate(data);
    const found = {};
    let offset = 0;
    for (const [name, shape, kind] of parts) {
      const size = shape.reduce((a, b) => a * b, 1);
      const Kind = kind === "i1" ? Int8Array : Float32Array;
      found[name] = { values: new Kind(buffer, offset, size), shape };
      offset += size * Kind.BYTES_PER_ELEMENT;
    }
    return found;
  }

  /** Row k of an array (n, m, width) as a list of m lists. */
  function table({ values, shape }, k = 0) {
    const [m, width] = shape.slice(-2);
    return Array.from({ length: m }, (_, i) => {
      const start = (k * m + i) * width;
      return Array.from(values.subarray(start, start + width));
    });
  }

  /** A list cut into parts of these sizes. */
  function parted(list, sizes) {
    let end = 0;
    return Array.from(sizes, (size) => list.slice(end, (end += size)));
  }

  const FIELDS = ["t", "x", "y", "heading", "xr", "yr", "hr", "vd", "wd", "v", "w",
    "clearance", "rmin", "r", "slack", "obstacle"];

  async function run(packed) {
    const found = await arrays(packed);
    const column = (name) => found[name].values;
    const n = column("t").length;
    const [moving, turning] = [found.discs, found.corners].map(({ shape }) => shape[0] > 1);
    const planned = Array.from({ length: n }, (_, k) => [column("xr")[k], column("yr")[k]]);
    const world = { vertices: table(found.vertices), points: table(found.points), walls: table(found.walls), path: planned };
    const way = Array.from({ length: n }, (_, k) => [column("x")[k], column("y")[k]]);

    function frame(k) {
      const made = Object.fromEntries(FIELDS.map((name) => [name, column(name)[k]]));
      const contact = [column("cx")[k], column("cy")[k]];
      return Object.assign(made, {
        status: packed.statuses[column("status")[k]],
        solve_us: 1e6 * column("solve")[k],
        contact: contact.every(Number.isFinite) ? contact : null,
        box: null,  // a log has no rows of a QP
        planes: [],
        discs: table(found.discs, moving ? k : 0),
        polygons: parted(table(found.corners, turning ? k : 0), found.polygons.values),
      });
    }

    /** The step that is nearest to a time; steps may be of any length. */
    function at(t) {
      const times = column("t");
      let [low, high] = [0, n - 1];
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (times[middle] <= t) low = middle;
        else high = middle;
      }
      return t - times[low] < times[high] - t ? low : high;
    }
    return { ...packed, n, column, world, way, frame, at, end: column("t")[n - 1] };
  }

  function span(runs, names, least = Infinity, most = -Infinity) {
    for (const one of runs) {
      for (const name of names) {
        for (const value of one.column(name)) {
          if (Number.isFinite(value)) [least, most] = [Math.min(least, value), Math.max(most, value)];
        }
      }
    }
    return least <= most ? [least, most] : [0, 1];
  }

  function widened([lo, hi], part) {
    const room = part * (hi - lo) || 0.1;
    return [lo - room, hi + room];
  }

  /** Axes that all runs of a group share. */
  function ranges(runs) {
    const [least, most] = span(runs, ["least"], 0, 0);
    const [, zone] = span(runs, ["r"]);
    const [, slowest] = span(runs, ["solve"], 1e-6, 1e-5);
    return {
      v: widened(span(runs, ["v", "vd"]), 0.12),
      w: widened(span(runs, ["w", "wd"]), 0.12),
      clearance: [Math.min(least, 0) - 0.01, Math.max(Math.min(1.05 * most, 5 * zone), 0.1)],
      solve: [0.8, 1.3e6 * slowest],
      t: [Math.min(...runs.map((one) => one.column("t")[0])), Math.max(...runs.map((one) => one.end))],
    };
  }

  /** The strips of a run, in the order in which they are shown. */
  function strips(one, axes, hue) {
    const t = one.column("t");
    const zero = -1e3;
    const wanted = { color: "--desired", dash: [5, 3], width: 1.4 };
    const common = { t, span: axes.t, bands: [], cursor: null };
    return [
      { ...common, title: "v", unit: "m/s", range: axes.v,
        series: [{ name: "desired", values: one.column("vd"), style: wanted }, { name: "chosen", values: one.column("v"), style: { color: hue } }] },
      { ...common, title: "ω", unit: "rad/s", range: axes.w,
        series: [{ name: "desired", values: one.column("wd"), style: wanted }, { name: "chosen", values: one.column("w"), style: { color: hue } }] },
      { ...common, title: "Least clearance", unit: "m", range: axes.clearance,
        series: [{ name: "", values: one.column("least"), style: { color: hue } }],
        bands: [{ from: zero, to: one.column("rmin"), kind: "rmin" }, { from: one.column("rmin"), to: one.column("r"), kind: "r" }] },
      { ...common, title: "Solve time", unit: "µs", range: axes.solve, log: true,
        series: [{ name: "", values: one.column("solve").map((s) => 1e6 * s), style: { color: hue, width: 1 } }] },
    ];
  }

  return { run, ranges, strips };
})();
