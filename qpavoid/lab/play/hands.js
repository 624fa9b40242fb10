"use strict";
/* Mouse, fingers and keys on the view from above.
Hands.attach(canvas, app)    app: what play.js hands over, with
    view, setView(view)      what is shown
    tool                     "move", "disc", "wall", "cart" or "erase"
    at(place, reach)         the thing at a place of the world, or null
    grab(thing, place), drag(thing, place), drop(thing)
    draw(from, to, done)     a wall between two places, in the making or done
    put(place)               a new thing of the tool; erase(thing); choose(thing)
Hands.zoom(canvas, view, factor, [px, py]) -> view */

const Hands = (() => {
  const NEAR = 20;  // CSS pixels from a thing at which it can be taken
  const SHORT = 6;  // CSS pixels; a wall that is shorter was a click
  const STEP = 0.1;  // m that an arrow key moves

  function place(canvas, event) {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left - canvas.clientLeft, event.clientY - box.top - canvas.clientTop];
  }

  function zoom(canvas, view, factor, [px, py]) {
    const [x, y] = Panels.toWorld(canvas, view, px, py);
    const scale = Math.min(600, Math.max(8, view.scale * factor));
    const kept = view.scale / scale;
    return { cx: x + (view.cx - x) * kept, cy: y + (view.cy - y) * kept, scale };
  }

  function pinch(canvas, app, held) {
    const [a, b] = [...held.values()];
    const [was, now] = [Math.hypot(a.was[0] - b.was[0], a.was[1] - b.was[1]), Math.hypot(a.px - b.px, a.py - b.py)];
    const middle = [(a.px + b.px) / 2, (a.py + b.py) / 2];
    const before = [(a.was[0] + b.was[0]) / 2, (a.was[1] + b.was[1]) / 2];
    const view = { ...app.view, cx: app.view.cx - (middle[0] - before[0]) / app.view.scale, cy: app.view.cy + (middle[1] - before[1]) / app.view.scale };
    app.setView(zoom(canvas, view, now / Math.max(was, 1), middle));
    for (const one of [a, b]) one.was = [one.px, one.py];
  }

  function pointers(canvas, app) {
    const held = new Map();  // pointer -> {px, py, was, thing, off} or {…, from} of a wall
    const world = ([px, py]) => Panels.toWorld(canvas, app.view, px, py);
    const under = (spot) => app.at(world(spot), NEAR / app.view.scale);

    canvas.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      const spot = place(canvas, event);
      const grip = { px: spot[0], py: spot[1], was: spot };
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, grip);
      if (held.size > 1) {
        held.forEach((one) => { if (one.thing) app.drop(one.thing); delete one.thing; delete one.from; });
        return;
      }
      const thing = under(spot);
      if (app.tool === "wall") grip.from = world(spot);
      else if (app.tool === "erase") { if (thing) app.erase(thing); }
      else if (app.tool !== "move") app.put(world(spot));
      else if (thing) {
        grip.thing = thing;
        grip.off = app.grab(thing, world(spot));
      } else app.choose(null);
    });

    canvas.addEventListener("pointermove", (event) => {
      const spot = place(canvas, event);
      const grip = held.get(event.pointerId);
      if (!grip) {
        const over = app.view && app.tool === "move" && under(spot) !== null;
        canvas.style.cursor = app.tool === "move" ? (over ? "pointer" : "grab") : "crosshair";
        return;
      }
      [grip.px, grip.py] = spot;
      if (held.size > 1) pinch(canvas, app, held);
      else if (grip.from) app.draw(grip.from, world(spot), false);
      else if (grip.thing) {
        const [x, y] = world(spot);
        app.drag(grip.thing, [x + grip.off[0], y + grip.off[1]]);
      } else if (app.tool === "move") {
        app.setView({ ...app.view, cx: app.view.cx - (spot[0] - grip.was[0]) / app.view.scale, cy: app.view.cy + (spot[1] - grip.was[1]) / app.view.scale });
        grip.was = spot;
      }
    });

    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => {
        const grip = held.get(event.pointerId);
        held.delete(event.pointerId);
        if (!grip) return;
        if (grip.thing) app.drop(grip.thing);
        if (grip.from) {
          const long = Math.hypot(grip.px - grip.was[0], grip.py - grip.was[1]) > SHORT;
          app.draw(grip.from, world([grip.px, grip.py]), long && end === "pointerup");
        }
      });
    }

    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      app.setView(zoom(canvas, app.view, Math.exp(-0.002 * event.deltaY), place(canvas, event)));
    }, { passive: false });
  }

  /** Arrow keys move what is chosen, or else a cross; Enter does there what a click does. */
  function keys(canvas, app) {
    let begun = null;
    canvas.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (way) {
        const far = event.shiftKey ? 5 * STEP : STEP;
        app.nudge([far * way[0], far * way[1]]);
      } else if (event.key === "Enter") {
        const spot = app.cross || [app.view.cx, app.view.cy];
        app.cross = spot;
        const thing = app.at(spot, NEAR / app.view.scale);
        if (app.tool === "wall") {
          if (begun) app.draw(begun, spot, true);
          begun = begun ? null : spot;
        } else if (app.tool === "erase") { if (thing) app.erase(thing); }
        else if (app.tool === "move") app.choose(thing);
        else app.put(spot);
      } else if (event.key === "Escape") {
        begun = null;
        app.cross = null;
        app.choose(null);
      } else return;
      event.preventDefault();
      event.stopPropagation();
      if (begun && app.cross) app.draw(begun, app.cross, false);
    });
    canvas.addEventListener("blur", () => { app.cross = null; app.setView(app.view); });
  }

  function attach(canvas, app) {
    pointers(canvas, app);
    keys(canvas, app);
  }

  return { attach, zoom };
})();
