"use strict";
/* How much of the plane of twists is shown.
Ranges.axes(robot)   the robot's limits
Ranges.near(frame)   those of one step, and what is chosen in it */

const Ranges = (() => {
  const widened = ([lo, hi]) => [lo - 0.1 * (hi - lo), hi + 0.1 * (hi - lo)];

  /** Axes of twists: the robot's limits, or what is driven where there is none. */
  function axes(robot) {
    const [v1, v2, w1, w2] = robot.limits;
    const cut = (value) => Math.min(5, Math.max(-5, value));
    return { v: widened([cut(v1), cut(v2)]), w: widened([cut(w1), cut(w2)]) };
  }

  /** Axes about the limits of one step and what is chosen in it. */
  function near({ box: [v1, v2, w1, w2], v, w, va, wa }) {
    const about = (...values) => {
      const [lo, hi] = [Math.min(...values), Math.max(...values)];
      return [lo - 0.3 * (hi - lo) - 0.01, hi + 0.3 * (hi - lo) + 0.01];
    };
    return { v: about(v1, v2, v, va), w: about(w1, w2, w, wa) };
  }

  return { axes, near };
})();
