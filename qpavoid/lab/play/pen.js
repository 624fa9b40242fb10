"use strict";
/* Lines, dots and labels on canvases that are sharp on every screen; x, y in CSS pixels.
Colours are CSS variables, written "--name", or plain CSS colours. */

const Pen = (() => {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const known = new Map();  // by name and look, for the browser resolves them slowly

  function color(name) {
    if (!name || !name.startsWith("--")) return name || "gray";
    const key = `${name} ${document.documentElement.style.colorScheme} ${dark.matches}`;
    if (!known.has(key)) {
      const probe = document.body.appendChild(document.createElement("i"));
      probe.style.color = `var(${name})`;
      known.set(key, getComputedStyle(probe).color);
      probe.remove();
    }
    return known.get(key);
  }

  function begin(canvas) {
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    const dpr = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(w * dpr) || canvas.height !== Math.round(h * dpr)) {
      canvas.width = Math.round(w * dpr);
      canvas.height = Math.round(h * dpr);
    }
    const g = canvas.getContext("2d");
    g.setTransform(dpr, 0, 0, dpr, 0, 0);
    g.clearRect(0, 0, w, h);
    g.lineJoin = "round";
    g.font = "12px system-ui, sans-serif";
    return { g, w, h };
  }

  function line(g, places, stroke, width = 1, dash = []) {
    g.beginPath();
    places.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
    g.strokeStyle = color(stroke);
    g.lineWidth = width;
    g.setLineDash(dash);
    g.stroke();
    g.setLineDash([]);
  }

  function dot(g, [x, y], radius, fill, edge = null) {
    g.beginPath();
    g.arc(x, y, radius, 0, 2 * Math.PI);
    if (fill) { g.fillStyle = color(fill); g.fill(); }
    if (edge) { g.strokeStyle = color(edge); g.lineWidth = 1.5; g.stroke(); }
  }

  function label(g, text, x, y, fill = "--muted", align = "left") {
    g.fillStyle = color(fill);
    g.textAlign = align;
    g.fillText(text, x, y);
  }

  return { begin, color, dot, label, line };
})();
