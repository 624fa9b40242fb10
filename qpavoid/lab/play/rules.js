"use strict";
/* Which settings fit together.
Rules.misfit(settings, dt, entries, ordered)   what is wrong with them; empty: nothing. ordered:
    pairs of names of the radius, of which the first must not exceed the second; entries: their keys */

const Rules = (() => {
  /** What is wrong with settings that do not fit together; empty: nothing. */
  function misfit(one, dt, entries, ordered) {
    const radius = (name) => one[`radius.${entries.find((entry) => entry.section === "radius" && entry.name === name).key}`];
    const wants = [
      ...ordered.map(([low, high]) => [radius(low) <= radius(high), `${low} ≤ ${high} is wanted`]),
      [one["ahead.tick_s"] <= one["ahead.horizon_s"], "tick ≤ horizon is wanted"],
      [one["ahead.horizon_s"] / one["ahead.tick_s"] <= 1000, "at most 1000 ticks in the horizon"],
      [one["ahead.horizon_still_s"] <= one["ahead.horizon_s"], "horizon_still ≤ horizon is wanted"],
      [one["filter.gamma_per_s"] * dt <= 1, "γ · dt > 1: one step could pass r_min"],
      [one["actuation.delay_s"] <= 8 * dt * (1 + 1e-9), "delay ≤ 8 dt is wanted"],
      [one["filter.braking_room"] || !one["filter.passive"], "passive wants braking_room"],
      [one["guide.stall_time_s"] < one["guide.blocked_time_s"], "stall_time < blocked_time is wanted"],
    ];
    const broken = wants.find(([holds]) => !holds);
    return broken ? broken[1] : "";
  }

  return { misfit };
})();
