"use strict";
/* Puts the page of a recorded drive together: its numbers, its changed stretches, its replay. */

(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const at = (id) => document.getElementById(id);
  at("facts").textContent = data.facts;
  const replay = Replay.start(at("replay"), data.replay);

  function show(begin) {
    replay.ready.then(() => {
      replay.seek(replay.clockRun.at(begin));
      at("replay").scrollIntoView();
    });
  }

  const column = (name, key, digits, says) => ({ name, says, text: (row) => Tables.number(row[key], digits), value: (row) => row[key] });
  const columns = [
    column("begins, s", "begins_s", 2, "Since the first command"),
    column("lasts, s", "lasts_s", 2, "From its first changed command to its last"),
    column("commands", "commands", 0, "How many were changed"),
    column("most Δv, m/s", "most_dv_mps", 2, "Greatest difference of the speeds"),
    column("most Δω, rad/s", "most_domega_radps", 2, "Greatest difference of the yaw rates"),
    column("least clearance, m", "least_clearance_m", 2, "Least distance of footprint and obstacles"),
    { name: "why", says: "Status of the filter, or what was wrong with an input", text: (row) => row.why },
    { name: "replay", says: "Shows it step by step below", text: () => "replay",
      cell: (row) => element("button", { type: "button", onclick: () => show(row.begins_s) }, "Replay") },
  ];
  if (data.episodes.length) at("changed").append(Tables.table(`${data.episodes.length} stretches`, columns, data.episodes));
  else at("changed").append("No command was changed.");
})();
