"use strict";
/* Robots: as the page is given them, and of corners that somebody writes.
Robots.reals(text)                     base64 of doubles as numbers
Robots.given(data)                     a robot of the page's data
Robots.shaped(outlines, limits, spacing)   one of one's own, points at that spacing
Robots.corners(text)                   outlines, counter-clockwise, or an error */

const Robots = (() => {
  const reals = (text) => new Float64Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);

  function robotOf({ name, outlines, edges, limits, outline, inner }) {
    return { name, outlines, edges: reals(edges), limits: reals(limits), outline: reals(outline), inner };
  }

  /** A robot of one's own: what a footprint knows of its convex parts. */
  function shaped(outlines, limits, spacing) {
    let end = 0;
    const parts = outlines.map((vertices) => part(vertices, spacing, (end += vertices.length)));
    const radius = Math.max(...outlines.flat().map(([x, y]) => Math.hypot(x, y)));
    return {
      name: "own", outlines, edges: parts.flatMap(({ edges }) => edges.flat()), limits: Float64Array.from([...limits.slice(0, 8), radius]),
      outline: parts.flatMap(({ points }) => points.flat()), inner: Math.max(...parts.map(({ inner }) => inner)),
    };
  }

  function part(vertices, spacing, end) {
    const edges = vertices.map(([x, y], i) => {
      const [a, b] = vertices[(i + 1) % vertices.length];
      const length = Math.hypot(a - x, b - y);
      return [x, y, (b - y) / length, -(a - x) / length, length, end];
    });
    const ring = edges.flatMap(([x, y, n_x, n_y, length]) => {
      const count = Math.ceil(length / spacing);
      return Array.from({ length: count }, (_, k) => [x - (n_y * length * k) / count, y + (n_x * length * k) / count]);
    });
    const middle = [0, 1].map((i) => vertices.reduce((sum, one) => sum + one[i], 0) / vertices.length);
    const inside = ring.filter((_, k) => k % 5 === 0).map((one) => one.map((value, i) => 0.5 * (value + middle[i])));
    return { edges, points: [...ring, ...inside], inner: Math.min(...edges.map(([x, y, n_x, n_y]) => x * n_x + y * n_y)) };
  }

  /** Corners as text, one a line: x, y in m, robot frame; an empty line between parts. */
  const corners = (text) => text.trim().split(/\n\s*\n/).map(cornersOf);

  function cornersOf(text) {
    const rows = text.trim().split(/[\n;]+/).map((line) => line.trim().split(/[\s,]+/).map(Number));
    if (rows.length < 3 || rows.some((row) => row.length !== 2 || !row.every(Number.isFinite))) throw new Error("wants three corners or more, x and y in m on a line each");
    const turn = (i) => {
      const [a, b, c] = [0, 1, 2].map((j) => rows[(i + j) % rows.length]);
      return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
    };
    const turns = rows.map((_, i) => turn(i));
    if (turns.every((one) => one < -1e-9)) return rows.reverse();
    if (!turns.every((one) => one > 1e-9)) throw new Error("the corners must be those of a convex polygon, one after the other; an empty line begins another one");
    return rows;
  }

  return { reals, given: robotOf, shaped, corners };
})();
