"use strict";
/* Mouse, fingers and keys on the view from above.
Hands.attach(canvas, look, send)    look() -> {frame, view, setView(view), choose(id)}
Hands.zoom(canvas, view, factor, [px, py]) -> view */

const Hands = (() => {
  const NEAR = 24;  // CSS pixels from its rim at which a disc can be taken
  const RENEW = 100;  // ms; the server lets go of a disc that is not asked for

  function place(canvas, event) {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left - canvas.clientLeft, event.clientY - box.top - canvas.clientTop];
  }

  function discAt(canvas, view, frame, [px, py]) {
    let [best, nearest] = [null, NEAR];
    frame.discs.forEach(([x, y, radius], i) => {
      const [cx, cy] = Panels.toPixel(canvas, view, x, y);
      const off = Math.hypot(px - cx, py - cy) - radius * view.scale;
      if (off < nearest) [best, nearest] = [i, off];
    });
    return best === null ? null : frame.ids[best];
  }

  function zoom(canvas, view, factor, [px, py]) {
    const [x, y] = Panels.toWorld(canvas, view, px, py);
    const scale = Math.min(600, Math.max(8, view.scale * factor));
    const kept = view.scale / scale;
    return { cx: x + (view.cx - x) * kept, cy: y + (view.cy - y) * kept, scale };
  }

  function attach(canvas, look, send) {
    const held = new Map();  // pointer -> {id, x, y} of a disc, or {px, py} of the ground

    const pull = ({ id, x, y }) => send({ kind: "drag", disc: id, x_m: x, y_m: y });
    setInterval(() => held.forEach((grip) => grip.id !== undefined && pull(grip)), RENEW);

    canvas.addEventListener("pointerdown", (event) => {
      const { frame, view, choose } = look();
      if (!frame || event.button) return;
      const [px, py] = place(canvas, event);
      const id = discAt(canvas, view, frame, [px, py]);
      canvas.setPointerCapture(event.pointerId);
      if (id === null) {
        held.set(event.pointerId, { px, py });
        return;
      }
      const [x, y] = frame.discs[frame.ids.indexOf(id)];
      const [wx, wy] = Panels.toWorld(canvas, view, px, py);
      const grip = { id, x, y, dx: x - wx, dy: y - wy };
      held.set(event.pointerId, grip);
      choose(id);
      pull(grip);
    });

    canvas.addEventListener("pointermove", (event) => {
      const { frame, view, setView } = look();
      const [px, py] = place(canvas, event);
      const grip = held.get(event.pointerId);
      if (!grip) {
        const over = frame && discAt(canvas, view, frame, [px, py]) !== null;
        canvas.style.cursor = over ? "pointer" : "grab";
      } else if (grip.id === undefined) {
        setView({ ...view, cx: view.cx - (px - grip.px) / view.scale, cy: view.cy + (py - grip.py) / view.scale });
        [grip.px, grip.py] = [px, py];
      } else {
        const [wx, wy] = Panels.toWorld(canvas, view, px, py);
        [grip.x, grip.y] = [wx + grip.dx, wy + grip.dy];
        pull(grip);
      }
    });

    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => {
        const grip = held.get(event.pointerId);
        held.delete(event.pointerId);
        if (grip && grip.id !== undefined) send({ kind: "release", disc: grip.id });
      });
    }

    canvas.addEventListener("wheel", (event) => {
      const { view, setView } = look();
      event.preventDefault();
      if (view) setView(zoom(canvas, view, Math.exp(-0.002 * event.deltaY), place(canvas, event)));
    }, { passive: false });

    canvas.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      const { frame, chosen } = look();
      const disc = frame && frame.discs[frame.ids.indexOf(chosen)];
      if (!way || !disc) return;
      event.preventDefault();
      pull({ id: chosen, x: disc[0] + 0.25 * way[0], y: disc[1] + 0.25 * way[1] });
    });
  }

  return { attach, zoom };
})();
