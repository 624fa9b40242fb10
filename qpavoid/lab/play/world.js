"use strict";
/* What stands and moves about the robots, in the world frame: metres, seconds, radians.

thing = {id, kind: "point" | "disc" | "wall" | "cart", ...}
    point, disc: x, y, radius; track: {times, positions, endless, fleeting} or null
    wall:        x1, y1, x2, y2
    cart:        corners [[x, y]...] counter-clockwise, velocity [v_x, v_y], turn (rad/s):
                 where it was at time 0, moving steadily; touched: shift [x, y] from there
All that is movable has a target [x, y] while a hand pulls it. A hand is no faster than a
hand is: discs and carts that are dragged are obstacles with a velocity. */

const World = (() => {
  const HAND_SPEED = 1.5;  // m/s; a thing follows the pointer at this speed at most
  const EASE = 0.1;  // s; it follows with this lag: pointers move in jerks, hands do not
  const AWAY = 1e4;  // m; x and y of a disc that is not there

  /** Place and velocity of a track at a time: straight between its way-points. */
  function along({ times, positions, endless, fleeting }, time) {
    const last = times.length - 1;
    if (fleeting && !(times[0] <= time && time <= times[last])) return [[AWAY, AWAY], [0, 0]];
    let i = times.findIndex((one) => one > time);
    i = (i < 0 ? times.length : i) - 1;  // the piece that begins at or before the time
    const beyond = i < 0 || i >= last;
    if (last === 0 || (beyond && !endless)) return [positions[Math.min(Math.max(i, 0), last)], [0, 0]];
    i = Math.min(Math.max(i, 0), last - 1);
    const pace = (k) => (positions[i + 1][k] - positions[i][k]) / (times[i + 1] - times[i]);
    const velocity = [pace(0), pace(1)];
    const on = time - times[i];
    return [[positions[i][0] + velocity[0] * on, positions[i][1] + velocity[1] * on], velocity];
  }

  /** Where a hand has brought a place by the end of a step. */
  function pulled([x, y], target, dt) {
    const way = [target[0] - x, target[1] - y];
    const far = Math.hypot(...way);
    const share = far > 0 ? Math.min(dt / Math.max(EASE, dt), (HAND_SPEED * dt) / far) : 0;
    return [x + share * way[0], y + share * way[1]];
  }

  class Scene {
    /** What a scenario says of its obstacles. */
    constructor({ points, discs, tracks, walls, carts }) {
      this.things = [];
      this.next = 0;
      points.forEach(([x, y]) => this.add({ kind: "point", x, y, radius: 0 }));
      discs.forEach(([x, y, radius]) => this.add({ kind: "disc", x, y, radius }));
      tracks.forEach(({ radius, ...track }) => this.add({ kind: "disc", x: 0, y: 0, radius, track }));
      walls.forEach(([x1, y1, x2, y2]) => this.add({ kind: "wall", x1, y1, x2, y2 }));
      carts.forEach((one) => this.add({ kind: "cart", ...one }));
      this.restart();
    }

    /** Put a thing into the world; return it. */
    add(thing) {
      const made = { id: this.next++, track: null, target: null, velocity: [0, 0], turn: 0, shift: null, ...thing };
      made.begun = { x: made.x, y: made.y, track: made.track };
      this.things.push(made);
      return made;
    }

    remove(id) { this.things = this.things.filter((one) => one.id !== id); }
    find(id) { return this.things.find((one) => one.id === id) || null; }
    of(kind) { return this.things.filter((one) => one.kind === kind); }

    /** Put everything back to where it starts. */
    restart() {
      for (const one of this.things) {
        Object.assign(one, one.begun, { target: null, shift: null, speed: [0, 0] });
        if (one.track) [one.x, one.y] = along(one.track, 0)[0];
      }
    }

    /** Take hold of a disc or cart, or go on holding it, and pull it to a place. */
    pull(one, target, time) {
      if (one.kind === "cart" && !one.shift) this.halt(one, time);
      one.track = null;
      one.target = target;
    }

    /** End a cart's own motion: from now on it is where hands bring it. */
    halt(one, time) {
      one.held = cornersOf(one, time);
      one.shift = [0, 0];
    }

    /** Put a thing somewhere at once, as an edit of the scene: nothing moves. */
    place(one, [x, y], time) {
      const [was_x, was_y] = anchor(one, time);
      const [d_x, d_y] = [x - was_x, y - was_y];
      const moved = ([a, b]) => [a + d_x, b + d_y];
      if (one.kind === "wall") {
        [one.x1, one.y1] = moved([one.x1, one.y1]);
        [one.x2, one.y2] = moved([one.x2, one.y2]);
      } else if (one.kind === "cart") {
        if (one.shift) one.shift = moved(one.shift);
        else one.corners = one.corners.map(moved);
      } else {
        Object.assign(one, { x, y, track: null });
        if (time === 0) Object.assign(one.begun, { x, y, track: null });
      }
    }

    /** Say how fast everything will move in the coming step. */
    plan(time, after) {
      const dt = after - time;
      for (const one of this.things) {
        const here = one.kind === "cart" ? one.shift : [one.x, one.y];
        if (one.track) {
          const [there, speed] = along(one.track, time);
          Object.assign(one, { x: there[0], y: there[1], speed, there: along(one.track, after)[0] });
        } else if (one.target && here) {
          const from = one.kind === "cart" ? centre(one.held) : [0, 0];
          one.there = pulled(here, [one.target[0] - from[0], one.target[1] - from[1]], dt);
          one.speed = [(one.there[0] - here[0]) / dt, (one.there[1] - here[1]) / dt];
        } else Object.assign(one, { there: here, speed: [0, 0] });
      }
    }

    /** Let everything be where the coming step brings it. */
    move() {
      for (const one of this.things) {
        if (!one.there) continue;
        if (one.kind === "cart") one.shift = one.there;
        else [one.x, one.y] = one.there;
      }
    }

    /** Return what the robots see at a time, as the numbers of its arrays. */
    arrays(time) {
      const discs = this.of("disc");
      const steady = this.of("cart").filter((one) => !one.shift);
      const held = this.of("cart").filter((one) => one.shift);
      const table = (carts, speeds) => ({
        corners: carts.flatMap((one) => (one.shift ? cornersOf(one, time) : one.corners)),
        polygons: carts.map((one) => [one.corners.length, ...speeds(one)]),
      });
      return {
        points: this.of("point").map(({ x, y }) => [x, y]),
        discs: discs.map(({ x, y, radius }) => [x, y, radius]),
        discVelocities: discs.map(({ speed }) => speed),
        walls: this.of("wall").map(({ x1, y1, x2, y2 }) => [x1, y1, x2, y2]),
        steady: table(steady, ({ velocity, turn }) => [...velocity, turn]),
        held: table(held, ({ speed }) => [...speed, 0]),
      };
    }

    /** Things in the order in which their numbers count. */
    numbered() {
      const carts = this.of("cart");
      const [steady, held] = [carts.filter((one) => !one.shift), carts.filter((one) => one.shift)];
      return [...this.of("point"), ...this.of("disc"), ...this.of("wall"), ...steady, ...held];
    }

    /** What panels draw: see panels.js. */
    shown(time) {
      const carts = this.numbered().filter((one) => one.kind === "cart");
      return {
        points: this.of("point").map(({ x, y }) => [x, y]),
        walls: this.of("wall").map(({ x1, y1, x2, y2 }) => [x1, y1, x2, y2]),
        discs: this.of("disc").map(({ x, y, radius }) => [x, y, radius]),
        polygons: carts.map((one) => cornersOf(one, time)),
      };
    }
  }

  function centre(corners) {
    const sum = (k) => corners.reduce((total, place) => total + place[k], 0) / corners.length;
    return [sum(0), sum(1)];
  }

  /** Corners of a cart at a time, world frame. */
  function cornersOf(one, time) {
    if (one.shift) return one.held.map(([x, y]) => [x + one.shift[0], y + one.shift[1]]);
    const [c, s] = [Math.cos(one.turn * time), Math.sin(one.turn * time)];
    const [x, y] = centroid(one.corners);
    const on = [x + time * one.velocity[0], y + time * one.velocity[1]];
    return one.corners.map(([a, b]) => [on[0] + c * (a - x) - s * (b - y), on[1] + s * (a - x) + c * (b - y)]);
  }

  function centroid(corners) {
    let [x, y, area] = [0, 0, 0];
    const [x0, y0] = corners[0];
    for (let i = 1; i + 1 < corners.length; i++) {
      const [a, b] = [corners[i][0] - x0, corners[i][1] - y0];
      const [c, d] = [corners[i + 1][0] - x0, corners[i + 1][1] - y0];
      const twice = a * d - b * c;
      area += twice;
      x += twice * (a + c);
      y += twice * (b + d);
    }
    return [x0 + x / (3 * area), y0 + y / (3 * area)];
  }

  /** Where a thing is taken hold of by keys: its middle. */
  function anchor(one, time) {
    if (one.kind === "wall") return [(one.x1 + one.x2) / 2, (one.y1 + one.y2) / 2];
    return one.kind === "cart" ? centre(cornersOf(one, time)) : [one.x, one.y];
  }

  /** Distance of a place from a thing, m; 0 or less inside. */
  function distance(one, [x, y], time) {
    const off = (from, to) => {
      const [a, b] = Panels.foot([...from, ...to], [x, y]);
      return Math.hypot(a - x, b - y);
    };
    if (one.kind === "wall") return off([one.x1, one.y1], [one.x2, one.y2]);
    if (one.kind !== "cart") return Math.hypot(x - one.x, y - one.y) - one.radius;
    const corners = cornersOf(one, time);
    const sides = corners.map((end, i) => [corners.at(i - 1), end]);
    const inside = sides.every(([[a, b], [c, d]]) => (c - a) * (y - b) - (d - b) * (x - a) > 0);
    return inside ? 0 : Math.min(...sides.map(([from, to]) => off(from, to)));
  }

  return { Scene, anchor, cornersOf, distance };
})();
