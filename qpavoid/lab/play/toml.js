"use strict";
/* A recording as a scenario file that `qpavoid run` takes, to the last bit of a number.
Toml.places(scene) -> where everything is, by id: kept at every control step
Toml.obstacles(scene, history, dt) -> what a file lists    history: those of all steps
Toml.write(document, comment) -> text */

const Toml = (() => {
  function number(value) {
    if (value === Infinity) return "inf";
    if (value === -Infinity) return "-inf";
    const text = String(value);
    return /[.e]/.test(text) ? text : `${text}.0`;
  }

  const WHOLE = new Set(["seed", "count", "world", "beams"]);

  function inline(value, key) {
    if (Array.isArray(value)) return `[${value.map((one) => inline(one, key)).join(", ")}]`;
    if (typeof value === "number") return WHOLE.has(key) ? String(value) : number(value);
    if (value === null) return "inf";
    if (typeof value !== "object") return JSON.stringify(value);
    const pairs = Object.entries(value).map(([name, one]) => `${name} = ${inline(one, name)}`);
    return `{ ${pairs.join(", ")} }`;
  }

  const isTable = (value) => value !== null && typeof value === "object" && !Array.isArray(value);
  const isTables = (value) => Array.isArray(value) && value.length > 0 && value.every(isTable);

  function table(values, path) {
    const plain = Object.entries(values).filter(([, value]) => !isTable(value) && !isTables(value));
    const lines = plain.map(([key, value]) => `${key} = ${inline(value, key)}`);
    for (const [key, value] of Object.entries(values)) {
      const name = path ? `${path}.${key}` : key;
      if (isTable(value)) lines.push("", `[${name}]`, table(value, name));
      if (isTables(value)) value.forEach((one) => lines.push("", `[[${name}]]`, table(one, name)));
    }
    return lines.join("\n");
  }

  function write(document, comment) {
    const head = comment.map((line) => `# ${line}\n`).join("");
    return `${head}${table(document, "").replace(/\n{3,}/g, "\n\n")}\n`;
  }

  /** The rows to keep: all but those amid others of the same place. */
  function thinned(places) {
    const same = (a, b) => a && b && a[0] === b[0] && a[1] === b[1];
    return places.map((_, k) => k).filter((k) => !(same(places[k - 1], places[k]) && same(places[k], places[k + 1])));
  }

  function waypoints(places, times) {
    const rows = thinned(places);
    return [rows.map((k) => times[k]), rows.map((k) => places[k])];
  }

  const stands = (places) => places.every(([x, y]) => x === places[0][0] && y === places[0][1]);

  /** Behind one that moves it stands as way-points do, for so discs are numbered. */
  function disc(one, places, times, behind) {
    const track = one.begun.track;
    if (one.track && track) {  // no hand has touched it
      const [from, to] = track.positions;
      if (track.endless) return { kind: "disc", position_m: from, radius_m: one.radius, velocity_mps: [to[0] - from[0], to[1] - from[1]] };
      return { kind: "waypoints", times_s: track.times, positions_m: track.positions, radius_m: one.radius, fleeting: track.fleeting };
    }
    if (stands(places) && !behind) return { kind: "disc", position_m: places[0], radius_m: one.radius };
    const [times_s, positions_m] = stands(places) ? [[0], [places[0]]] : waypoints(places, times);
    return { kind: "waypoints", times_s, positions_m, radius_m: one.radius };
  }

  function cart(one, places, times) {
    if (!one.shift) return { kind: "polygon", vertices_m: one.corners, velocity_mps: one.velocity, turn_rate_radps: one.turn };
    const [times_s, shifts_m] = waypoints(places, times);
    return { kind: "polygon", vertices_m: one.held, times_s, shifts_m };
  }

  function obstacles(scene, history, dt) {
    const times = history.map((_, k) => k * dt);
    const placesOf = (one) => history.map((places) => places.get(one.id));
    const moves = (one) => one.kind === "disc" && (one.track || !stands(placesOf(one)));
    let behind = false;
    const made = {
      point: ({ x, y }) => ({ kind: "disc", position_m: [x, y] }),
      wall: ({ x1, y1, x2, y2 }) => ({ kind: "wall", start_m: [x1, y1], end_m: [x2, y2] }),
      disc: (one) => disc(one, placesOf(one), times, behind),
      cart: (one) => cart(one, placesOf(one), times),
    };
    return scene.numbered().map((one) => {
      const said = made[one.kind](one);
      behind = behind || moves(one);
      return said;
    });
  }

  /** Where everything that hands can move is now, by id. */
  function places(scene) {
    return new Map(scene.things.map((one) => [one.id, one.kind === "cart" ? one.shift || [0, 0] : [one.x, one.y]]));
  }

  return { write, obstacles, places };
})();
