"use strict";
/* A LiDAR on a robot, and perception of its scans: what qpavoid.lab.sensing.lidar and
qpavoid.perception.perception do in Python, call by call. Places are in metres.
new Lidar(kernel, setup, edges)    setup: that of a pilot; edges: of the footprint
pose(robot)                        of the sensor, world frame
scan(seen, robot, time)            take a scan where one is due; seen: in the sensor's frame
obstacles(robot, time)             [points, capsules], robot frame
echoes()                           [x, y] of every beam's end, world frame
free()                             ever-free cells: [x, y, length, width] of stripes, map frame
keep() -> restore()                for steps that are not taken */

const Lidar = (() => {
  const SOON = 1e-9;  // s; tolerance of a tick for rounding
  const DISC = 12;  // columns of a capsule

  const placed = ([x, y, heading], [ahead, left, turned]) => {
    const [c, s] = [Math.cos(heading), Math.sin(heading)];
    return [x + c * ahead - s * left, y + s * ahead + c * left, heading + turned];
  };

  /** A standard normal number, by Box and Muller. */
  const normal = () => Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random());

  return class {
    constructor(kernel, { settings, sizes, robot }, edges) {
      const of = (key) => settings[`lidar.${key}`];
      const [n, view] = [Math.round(of("beams")), of("field_of_view_rad")];
      Object.assign(this, {
        kernel, edges, map: sizes.map, width: sizes.scan, rate: of("rate_hz"), latency: of("latency_s"), noise: of("noise_m"), dropout: of("dropout"),
        range: of("range_m"), post: of("point_radius_m"), perceives: of("perception"), due: -Infinity, taken: NaN, scans: [],
        mount: ["x_m", "y_m", "heading_rad"].map((key) => of(`mount_${key}`)), ranges: kernel.vector(n), ends: kernel.matrix(n, 2),
      });
      const round = view > sizes.all_round;
      const middles = Array.from({ length: n }, (_, k) => view * ((k + 0.5) / n - 0.5));
      this.rays = kernel.matrix(middles.map((angle) => [Math.cos(angle), Math.sin(angle)]), 2);
      const width = round ? view : view - view / n;  // between the first and the last beam
      const step = width / Math.max(round ? n : n - 1, 1);
      const [x, y, heading] = this.mount;
      const sensor = {
        mount: [x, y, round ? heading + (0.5 * view) / n : heading], step, range_max: this.range,
        round: Number(round && n > 1), angle_error: sizes.angle_error, no_echo: sizes.no_echo_free,
      };
      const angles = middles.map((_, k) => step * k - 0.5 * width);
      const beams = kernel.matrix(angles.map((angle) => [Math.cos(angle), Math.sin(angle), 0, 0]), 4);
      this.given = { rows: kernel.vector(n * sizes.scan), beams, sensor, counts: kernel.vector(2), motion: [0, 0, 0] };
      this.memory = Object.fromEntries(Object.entries(sizes.memory).map(([name, size]) => [name, kernel.vector(size)]));
      this.found = { points: kernel.matrix(n + (2 * sizes.map.half) ** 2, 2), capsules: kernel.matrix(sizes.tracks, DISC) };
      const said = (key) => settings[`perception.${key}`];
      this.model = {
        inner: Math.max(robot.inner, 0), radius: said("radius_m"), acceleration: said("acceleration_mps2"),
        memory: said("memory_s"), memory_way: said("memory_way_m"),
      };
    }

    pose(robot) { return placed(robot, this.mount); }

    scan(seen, robot, time) {
      if (time >= this.due - SOON) {
        this.due = (Math.floor((time + SOON) * this.rate) + 1) / this.rate;
        this.scans.push({ time, robot, ranges: this.measured(seen) });
      }
      while (this.scans.length > 1 && this.scans[1].time <= time - this.latency + SOON) this.scans.shift();
      const [last] = this.scans;
      this.last = last;
      if (last.time === this.taken) return;
      this.taken = last.time;
      const { values } = this.given.rows;
      last.ranges.forEach((range, k) => { values[this.width * k] = range > 0 && (range < this.range || range === Infinity) ? range : NaN; });
      this.given = { ...this.given, time: last.time, pose: last.robot };
      if (this.perceives) this.kernel.perceive(this.memory, this.given, this.model);
    }

    /** Ranges with noise; infinite without an echo or after a dropout. */
    measured(seen) {
      const exact = this.ranges.values.fill(this.range);
      this.kernel.cast_rays(this.rays, seen, this.post, this.ranges);
      return Array.from(this.ranges.values, (range) => {
        if (range >= this.range || Math.random() < this.dropout) return Infinity;
        return this.noise ? Math.max(range + this.noise * normal(), 0) : range;
      });
    }

    obstacles(robot, time) {
      const { points, capsules } = this.found;
      let [many, discs] = [0, 0];
      if (this.perceives) [many, discs] = this.kernel.obstacles_at(this.memory, this.given, this.edges, robot, time, this.found);
      else {
        const [echoes, none] = [this.echoes().filter((_, k) => this.last.ranges[k] < Infinity), capsules.first(0)];
        many = echoes.length;
        this.ends.values.set(echoes.flat());
        this.kernel.in_robot_frame(robot, 0, [this.ends.first(many), none], [points.first(many), none]);
      }
      return [points.first(many), capsules.first(discs)];
    }

    echoes() {
      const { robot, ranges } = this.last;
      const [sensor, rays] = [this.pose(robot), this.rays.values];
      return ranges.map((length, k) => {
        const range = Math.min(length, this.range);
        return placed(sensor, [range * rays[2 * k], range * rays[2 * k + 1], 0]).slice(0, 2);
      });
    }

    free() {
      const { cell, half, width, middle, free } = this.map;
      const [cells, state] = [this.memory.cells, this.memory.state].map(({ values }) => new Int32Array(values.buffer, values.byteOffset, 2 * values.length));
      const [side, stripes] = [2 * half, []];
      const low = [0, 1].map((k) => state[middle + k] - half);
      const [rows, columns] = low.map((first) => Array.from({ length: side }, (_, k) => (((first + k) % side) + side) % side));
      rows.forEach((row, i) => {
        let length = 0;
        for (let j = 0; j <= side; j++) {
          if (j < side && cells[width * (row * side + columns[j]) + free] > 0) length += 1;
          else if (length) {
            stripes.push([low[0] + i, low[1] + j - length, 1, length].map((count) => cell * count));
            length = 0;
          }
        }
      });
      return stripes;
    }

    blocks() { return [...Object.values(this.memory), this.given.rows, this.given.counts]; }

    keep() {
      const { due, taken, given } = this;
      const scans = [...this.scans];
      const values = this.blocks().map((one) => one.values.slice());
      return () => {
        Object.assign(this, { due, taken, given, scans });
        this.blocks().forEach((one, i) => one.values.set(values[i]));
      };
    }

    /** Remember what another one has seen; a scan is due. */
    takeOver(other) {
      for (const [name, block] of Object.entries(this.memory)) block.values.set(other.memory[name].values);
    }
  };
})();
