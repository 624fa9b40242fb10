"use strict";
/* Puts the report together from the data in the page. */

(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const at = (id) => document.getElementById(id);

  const { facts, provenance } = data;
  const counted = (name) => `${facts[name].toLocaleString("en")} ${name}${facts[name] === 1 ? "" : "s"}`;
  at("facts").textContent = `${Object.keys(facts).filter((name) => facts[name]).map(counted).join(", ")}.`;

  function listed(content) {
    if (content === null || typeof content !== "object") return String(content);
    const items = Object.entries(content).flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, listed(value))]);
    return element("dl", {}, ...items);
  }
  at("provenance").append(listed(provenance));

  at("figures").append(...data.figures.map(({ title, image }, i) => element("figure", { id: `figure-${i}` }, element("figcaption", {}, title), element("img", { src: image, alt: `Ways of the runs: ${title}` }))));
  if (!data.figures.length) at("figures").append('No log of any run was kept: put trajectories = "failures" or "all" into the study and sweep it again.');

  const { tables } = data;
  function choose(i) {
    at("ranking").replaceChildren(Tables.ranking(tables[Number(i)]));
  }
  if (tables.length > 1) {
    const names = tables.map(({ scenario }, i) => [i, scenario === null ? "all" : scenario]);
    at("choice").append(choice("Scenario", names, choose)[0]);
  }
  choose(0);

  if (data.failures.count) {
    at("failures").append(Tables.failures(data.failures));
  } else {
    at("failures").append("Every run succeeded.");
  }
})();
