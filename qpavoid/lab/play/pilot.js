"use strict";
/* A robot on its way, driven by the package's own functions as WebAssembly: what
qpavoid.lab.simulation.loop does in Python, call by call. Qpavoid.Kernel is that of
`export-c --wasm`; every pilot has a module of its own, whose memory goes with it.

setup = {module, method, robot: {outlines, edges, limits, outline, inner}, settings by
         section.key, entries, sizes, dt, plan (n · 5), law (9), lags, start, guided,
         lidar: whether obstacles are those that it perceives} */

const Pilot = (() => {
  const METHODS = {
    eq5: { law: 5 }, eq7: { law: 7 }, qp: { ahead: false }, "qp-repulsion": { ahead: false, bound: "repulsion" },
    "qp-ahead": { ahead: true }, "qp-ahead+guide": { ahead: true, guided: true },
  };
  const WIDTHS = { points: 2, capsules: 12, discs: 3, speeds: 2, walls: 4, rest: 2, corners: 2, polygons: 4 };
  const [A_V, A_OMEGA, B, OWNER, ROW] = [0, 1, 2, 3, 9];  // columns of a row of the QP, and how many there are
  const [RADIUS, V_X] = [4, 5];  // columns of a capsule

  /** The program from its base64, to be made instances of. */
  async function program(packed) {
    const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return WebAssembly.compile(await new Response(stream).arrayBuffer());
  }

  /** Settings as the compiled functions take them, by the names of their record. */
  function recorded({ settings, entries, dt, method }, sections) {
    const found = { dt };
    for (const entry of entries) {
      if (!sections(entry.section)) continue;
      const value = settings[`${entry.section}.${entry.key}`];
      found[entry.name] = entry.choices.length ? entry.choices.indexOf(value) : value;
      if (entry.name === "bound" && METHODS[method].bound) found.bound = entry.choices.indexOf(METHODS[method].bound);
    }
    return found;
  }

  /** The same of the guide, cut to what the robot can. */
  function guiding(setup) {
    const [, v_max, omega_min, omega_max] = setup.robot.limits;
    const { cell } = setup.sizes;
    const said = recorded(setup, (section) => section === "guide" || section === "radius");
    return {
      ...said, reach: cell * Math.round(said.reach / cell), speed: Math.min(said.speed, v_max),
      turn_rate: Math.min(said.turn_rate, omega_max, -omega_min), inner: setup.robot.inner,
    };
  }

  class Robot {
    constructor(setup) {
      const kernel = new Qpavoid.Kernel(new WebAssembly.Instance(setup.module, {}).exports);
      Object.assign(this, { kernel, dt: setup.dt, lags: setup.lags, sizes: setup.sizes, how: METHODS[setup.method], tables: {} });
      this.known = recorded(setup, (section) => !["guide", "lidar", "perception"].includes(section));
      this.setup = {
        edges: this.rows(setup.robot.edges, 6), robot: kernel.vector(setup.robot.limits), settings: kernel.record("filter_settings", this.known),
      };
      this.radius = setup.robot.limits[8];
      this.lidar = setup.lidar ? new Lidar(kernel, setup, this.setup.edges) : null;
      [this.law, this.plan] = [kernel.vector(setup.law), this.rows(setup.plan, 5)];
      [this.state, this.stageState] = [kernel.vector(setup.sizes.state), kernel.vector(setup.sizes.stage)];
      if (this.how.guided || setup.guided) this.guide(setup);
      Object.assign(this, { pose: [...setup.start], driven: [0, 0], place: 0, mode: 0, memory: kernel.vector(1) });
    }

    /** Numbers row by row as a matrix. */
    rows(numbers, columns) {
      const made = this.kernel.matrix(numbers.length / columns, columns);
      made.values.set(numbers);
      return made;
    }

    guide(setup) {
      const { kernel } = this;
      const settings = guiding(setup);
      if (!(Math.min(settings.speed, settings.turn_rate) > 0)) throw new Error("a guide wants a robot that drives and turns");
      this.stage = { setup: this.setup, law: this.law, settings: kernel.record("guide_settings", settings), body: this.rows(setup.robot.outline, 2) };
      this.search = kernel.vector(kernel.search_size(settings.reach));
      this.ahead = kernel.matrix(settings.horizon > 0 ? setup.sizes.ahead : 0, 5);
    }

    /** Memory of so many rows, made anew only where there is no room. */
    table(name, rows, columns = WIDTHS[name]) {
      const { kernel, tables } = this;
      if (!tables[name] || tables[name].rows < rows) {
        if (tables[name]) kernel.free(tables[name]);
        tables[name] = kernel.matrix(2 * rows + 16, columns);
      }
      return tables[name].first(rows);
    }

    given(name, rows) {
      const made = this.table(name, rows.length);
      made.values.set(rows.flat());
      return made;
    }

    /** Fill in rows of the table of capsules, from a number on; the others stay. */
    fill(first, rows, { discs = [], discVelocities = [], walls = [], corners = [], polygons = [] }) {
      const rest = walls.map(() => [0, 0]);
      const given = [["discs", discs], ["speeds", discVelocities], ["walls", walls], ["rest", rest], ["corners", corners], ["polygons", polygons]];
      const wrong = this.kernel.fill_capsules(first, ...given.map(([name, one]) => this.given(name, one)), rows);
      if (wrong >= 0) throw new Error("a cart is not convex");
    }

    /** See the world at a time: what is there, and what is known, in the robot frame. */
    look(world, time) {
      const { kernel } = this;
      const { points, discs, walls, steady, held } = world;
      const counts = [discs.length + walls.length, steady.corners.length, held.corners.length];
      const all = this.table("capsules", counts[0] + counts[1] + counts[2]);
      const known = this.given("points", points);
      const part = (name, i) => this.table(name, counts[i], WIDTHS.capsules);
      const first = points.length + discs.length + walls.length;
      const put = (made, begin) => all.values.set(made.values, WIDTHS.capsules * begin);
      const standing = part("standing", 0);
      this.fill(points.length, standing, world);
      put(standing, 0);
      const carts = part("carts", 1);
      this.fill(first, carts, steady);
      const moved = part("moved", 1);
      kernel.in_robot_frame([0, 0, 0], time, [known.first(0), carts], [this.table("none", 0, 2), moved]);
      put(moved, counts[0]);
      const dragged = part("dragged", 2);
      this.fill(first + steady.polygons.length, dragged, held);
      put(dragged, counts[0] + counts[1]);
      const from = (pose, name) => {
        const seen = [this.table(`${name}Points`, points.length, 2), this.table(name, all.rows, WIDTHS.capsules)];
        kernel.in_robot_frame(pose, 0, [known, all], seen);
        return seen;
      };
      this.seen = this.there = from(this.pose, "there");
      if (this.lidar) {
        this.lidar.scan(from(this.lidar.pose(this.pose), "scanned"), this.pose, time);
        this.seen = this.lidar.obstacles(this.pose, time);
      }
      const [most, there] = [this.seen, this.there].map((seen) => kernel.most_contacts(this.setup.edges, seen));
      this.contacts = this.table("contacts", this.sizes.contact * Math.max(most, there), 1);
      const size = kernel.memory_size(most, this.setup.settings);
      if (this.memory.rows < size) {
        kernel.free(this.memory);
        this.memory = kernel.vector(2 * size);
      }
      if (this.stage) this.bodies = this.table("bodies", most * this.sizes.body, 1);
    }

    /** The twist that tracking and guide desire, and whether there is no way. */
    desire() {
      const { kernel, pose, sizes } = this;
      const [target, rate] = kernel.waiting_reference(this.plan, this.place, pose, this.lags);
      if (this.stage) kernel.fill_ahead(this.plan, this.place, pose, sizes.tick / this.dt, this.ahead);
      this.place += rate;
      this.target = target;
      const [v, omega, mode] = kernel.track_step(this.law, this.setup.robot, pose, target, this.mode);
      this.mode = mode;
      if (!this.stage) return [[v, omega], false];
      const error = kernel.tracking_error(pose, [target.x, target.y, target.heading]);
      const tracking = { desired: [v, omega], error, v_r: target.v, driven: this.driven, dt: this.dt, ahead: this.ahead };
      const [progress, ...twist] = kernel.guide_step(this.stage, this.stageState, { bodies: this.bodies, search: this.search }, this.seen, tracking);
      return [twist, progress === sizes.blocked];
    }

    /** What the method makes of a desired twist. */
    decide(desired) {
      const { kernel, setup, state } = this;
      if (this.how.law) return kernel.repulsion_step(this.how.law, setup, this.request(desired, false), state, this.contacts);
      const told = kernel.filter_step(setup.edges, setup.robot, setup.settings, ...this.seen, 0, this.how.ahead, ...desired, state, this.memory);
      const [code, v, omega, , slack] = told;
      return { code, v, omega, slack };
    }

    request(desired, ahead) {
      return { obstacles: this.seen, age: 0, ahead, desired };
    }

    /** The QP of a step: its limits, where it aims, and all its rows; of a law that of
    the one-step filter. */
    problem(desired) {
      const { kernel, setup, sizes } = this;
      const kept = this.state.values.slice();
      const [code] = kernel.filter_step(setup.edges, setup.robot, setup.settings, ...this.seen, 0, Boolean(this.how.ahead), ...desired, this.state, this.memory);
      this.state.values.set(kept);
      const all = this.memory.values;
      const most = kernel.most_contacts(setup.edges, this.seen);
      const end = kernel.memory_size(most, setup.settings);
      const [m, , ...terms] = code < 0 ? [0, 0, 0, 0, 0, 0, 0, 0] : all.subarray(end - sizes.problem, end);
      const begin = this.sizes.contact * most;
      const planes = [];
      for (let i = 0; i < m; i++) {
        const row = all.subarray(begin + ROW * i, begin + ROW * (i + 1));
        if (row[A_V] || row[A_OMEGA]) planes.push([row[A_V], row[A_OMEGA], row[B], row[OWNER]]);
      }
      return { box: terms.slice(0, 4), va: terms[4], wa: terms[5], planes };
    }

    /** The nearest contact: P_r in the world frame, whose it is, and its r_min and r. */
    nearest(seen, pose) {
      const { kernel, known } = this;
      const [, row] = kernel.contact_table(this.setup.edges, this.radius, seen, 0, this.contacts);
      const near = row < 0 ? { distance: Infinity, v_x: 0, v_y: 0, obstacle: -1 } : kernel.contact_at(this.contacts, row);
      const [rmin] = kernel.required_distance(this.setup.settings, Math.hypot(near.v_x, near.v_y), 0);
      const [c, s] = [Math.cos(pose[2]), Math.sin(pose[2])];
      const contact = row < 0 ? null : [pose[0] + c * near.x - s * near.y, pose[1] + s * near.x + c * near.y];
      return { clearance: near.distance, rmin, r: known.zone_ratio * rmin, obstacle: near.obstacle, contact };
    }

    /** Drive for one control step; return its frame, see panels.js. */
    step(world, time) {
      this.look(world, time);
      const [x, y, heading] = this.pose;
      const [desired, blocked] = this.desire();
      const problem = this.problem(desired);
      const decision = this.decide(desired);
      const near = this.nearest(this.there, this.pose);
      const [v, w] = this.kernel.limit_twist(this.setup.robot, [decision.v, decision.omega], this.driven, this.dt);
      this.driven = [v, w];
      this.pose = this.kernel.integrate(this.pose, this.driven, 0, this.dt);
      const plan = this.how.ahead ? Object.values(this.kernel.kept_plan(this.state)) : null;
      return {
        t: time, x, y, heading, xr: this.target.x, yr: this.target.y, hr: this.target.heading, vd: desired[0], wd: desired[1],
        v, w, slack: decision.slack, code: decision.code, blocked: blocked && !v && !w,
        plan, after: this.pose, ...problem, ...near,
      };
    }

    /** What a step would be, without taking it. */
    peek(world, time) {
      const kept = [this.pose, this.driven, this.place, this.mode];
      const restore = this.lidar && this.lidar.keep();
      const states = [this.state, this.stageState].map((one) => one.values.slice());
      const frame = this.step(world, time);
      [this.pose, this.driven, this.place, this.mode] = kept;
      [this.state, this.stageState].forEach((one, i) => one.values.set(states[i]));
      if (restore) restore();
      return frame;
    }

    /** Go on where another one is: its pose, its way, and what it drives. */
    takeOver(other) {
      Object.assign(this, { pose: [...other.pose], driven: [...other.driven], place: other.place, mode: other.mode });
      this.kernel.set_driven(this.state, ...this.driven);
      if (this.lidar && other.lidar) this.lidar.takeOver(other.lidar);
    }

    /** What its LiDAR has made known at the step of a frame, world frame. */
    perceived({ x, y, heading }) {
      const [c, s] = [Math.cos(heading), Math.sin(heading)];
      const turned = (a, b) => [c * a - s * b, s * a + c * b];
      const rows = ({ rows: many, columns, values }) => Array.from({ length: many }, (_, i) => values.subarray(columns * i, columns * (i + 1)));
      const at = ([a, b]) => turned(a, b).map((value, k) => value + [x, y][k]);
      const [points, capsules] = this.seen.map(rows);
      return {
        points: points.map(at), discs: capsules.map((row) => [...at(row), row[RADIUS]]), velocities: capsules.map((row) => turned(row[V_X], row[V_X + 1])),
        walls: [], polygons: [], scan: this.lidar.echoes(), free: this.lidar.free(), ...this.nearest(this.seen, [x, y, heading]),
      };
    }
  }

  return { Robot, program };
})();
