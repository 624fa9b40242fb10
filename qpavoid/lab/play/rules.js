"use strict";
/* Which settings fit together.
Rules.misfit(settings, dt, ordered, sizes)   what is wrong with them; empty: nothing.
    ordered: key, sign and key of two settings; sizes: greatest numbers of ticks and pending twists */

const Rules = (() => {
  /** What is wrong with settings that do not fit together; empty: nothing. */
  function misfit(one, dt, ordered, sizes) {
    const holds = (first, sign, second) => (sign === "<" ? first < second : first <= second);
    const wants = [
      ...ordered.map(([a, sign, b]) => [holds(one[a], sign, one[b]), `${a} ${sign} ${b} is wanted`]),
      [one["ahead.horizon_s"] / one["ahead.tick_s"] <= sizes.ticks, `at most ${sizes.ticks} ticks in the horizon`],
      [one["filter.gamma_per_s"] * dt <= 1, "γ · dt > 1: one step could pass r_min"],
      [one["actuation.delay_s"] <= sizes.pending * dt * (1 + 1e-9), `delay ≤ ${sizes.pending} dt is wanted`],
      [one["filter.braking_room"] || !one["filter.passive"], "passive wants braking_room"],
    ];
    const broken = wants.find(([holds]) => !holds);
    return broken ? broken[1] : "";
  }

  return { misfit };
})();
