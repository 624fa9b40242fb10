"use strict";
/* Tables that sort by their headings and filter by what is typed. */

const Tables = (() => {
  const MOST = 50; // rows shown before all are asked for

  const number = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits).replace("-", "−"));
  const interval = (found, digits, unit = "") => (found ? `${number(found[0], digits)}${unit} (${number(found[1], digits)} to ${number(found[2], digits)})` : "–");
  const percent = (rate) => interval(rate && rate.map((value) => 100 * value), 1, " %");
  const first = (found) => (found ? found[0] : null);

  const RANKING = [
    { name: "place", says: "By success, then contacts, then median time", text: (row) => String(row.place), value: (row) => row.place },
    { name: "method", says: "Controller, with its solver and settings where they differ", text: (row) => row.method, value: (row) => row.method, head: true },
    { name: "runs", says: "How many", text: (row) => String(row.runs), value: (row) => row.runs },
    { name: "success", says: "Share of runs that arrived without contact (95 %, Wilson)", text: (row) => percent(row.success), value: (row) => row.success[0] },
    { name: "contact", says: "Share of runs in which the footprint met an obstacle (95 %, Wilson)", text: (row) => percent(row.contact), value: (row) => row.contact[0] },
    { name: "below r_min", says: "Share of runs in which clearance fell below r_min by more than 1 mm (95 %, Wilson)", text: (row) => percent(row.below), value: (row) => first(row.below) },
    { name: "median time, s", says: "Until it had arrived for good, of the successes", text: (row) => number(row.time, 2), value: (row) => row.time },
    { name: "median least clearance, m", says: "Least distance of footprint and obstacles in a run; negative: overlap", text: (row) => number(row.clearance, 3), value: (row) => row.clearance },
    { name: "median greatest error, m", says: "Greatest distance from the reference in a run", text: (row) => number(row.error, 3), value: (row) => row.error },
    { name: "median time changed, s", says: "How long another twist than the desired one was driven in a run", text: (row) => number(row.changed, 2), value: (row) => row.changed },
  ];

  const FAILED = [
    { name: "scenario", says: "Its name", text: (row) => row.scenario, head: true },
    { name: "seed", says: "What its random parts were drawn from", text: (row) => String(row.seed ?? "–"), value: (row) => row.seed },
    { name: "method", says: "Controller, with its solver and settings where they differ", text: (row) => row.method },
    { name: "outcome", says: "touched; else arrived; else stalled: not 0.1 m far in its last 5 s; else off goal; failed or died: no run", text: (row) => row.outcome },
    { name: "least clearance, m", says: "Least distance of footprint and obstacles; negative: overlap", text: (row) => number(row.min_clearance_m, 3), value: (row) => row.min_clearance_m },
    { name: "time, s", says: "When the run ended", text: (row) => number(row.time_s, 1), value: (row) => row.time_s },
    { name: "error", says: "Why there is no run", text: (row) => row.error || "" },
  ];

  function compare(a, b) {
    const [noA, noB] = [a === null || a === undefined, b === null || b === undefined];
    if (noA || noB) return noA - noB;
    return typeof a === "number" ? a - b : String(a).localeCompare(String(b));
  }

  /** An interval in brackets goes below its value. */
  function split(text) {
    const [, value, bracket] = text.match(/^(.+?) (\([^()]* to [^()]*\))$/) || [null, text, null];
    return bracket ? [`${value} `, element("span", { class: "interval" }, bracket)] : [value];
  }

  /** A table of rows; columns have a name, a text and perhaps a value to sort by. */
  function table(caption, columns, rows) {
    const shown = columns.filter((column) => rows.some((row) => !["–", ""].includes(column.text(row))));
    const body = element("tbody", {});
    const heads = shown.map((column) => element("th", { scope: "col", title: column.says }, element("button", { type: "button", onclick: () => sort(column) }, column.name)));
    const filter = element("input", { type: "search", placeholder: "Filter", "aria-label": `Filter: ${caption}`, oninput: () => fill() });
    const count = element("span", { class: "muted", role: "status" });
    const more = element("button", { type: "button", onclick: () => { most = rows.length; fill(); } });
    let [order, by, down, most] = [rows, null, false, MOST];

    function sort(column) {
      down = by === column && !down;
      by = column;
      const value = column.value || column.text;
      order = [...rows].sort((a, b) => compare(value(a), value(b)) * (down ? -1 : 1));
      heads.forEach((head, i) => (shown[i] === column ? head.setAttribute("aria-sort", down ? "descending" : "ascending") : head.removeAttribute("aria-sort")));
      fill();
    }

    function fill() {
      const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
      const fits = (row) => { const text = shown.map((column) => column.text(row)).join(" ").toLowerCase(); return words.every((word) => text.includes(word)); };
      const kept = order.filter(fits);
      count.textContent = kept.length < rows.length ? `${kept.length} of ${rows.length}` : "";
      more.hidden = kept.length <= most;
      more.textContent = `Show all ${kept.length} rows`;
      body.replaceChildren(...kept.slice(0, most).map((row) => {
        const cells = shown.map((column) => element(column.head ? "th" : "td", { scope: column.head ? "row" : null, "data-head": column.name, class: column.value && !column.head ? "number" : null }, ...(column.cell ? [column.cell(row)] : split(column.text(row)))));
        return element("tr", {}, ...cells);
      }));
    }

    fill();
    return element("div", {}, rows.length > 3 ? element("div", { class: "bar" }, filter, count) : null,
      element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption },
        element("table", {}, element("caption", {}, caption), element("thead", {}, element("tr", {}, ...heads)), body)),
      more);
  }

  function ranking({ scenario, methods, count }) {
    const few = count > methods.length ? `, the first ${methods.length} of ${count} methods` : "";
    const rows = methods.map((row, i) => ({ ...row, place: i + 1 }));
    return table(`${scenario === null ? "All scenarios" : scenario}${few}`, RANKING, rows);
  }

  /** The runs that did not succeed, with links to their figures. */
  function failures({ count, rows }) {
    const shown = (row) => (row.figure === null ? "" : "figure");
    const watch = { name: "figure", says: "The way of the run, above", text: shown, cell: (row) => (shown(row) ? element("a", { href: `#figure-${row.figure}` }, "figure") : "") };
    const caption = count > rows.length ? `${rows.length} of ${count} runs that did not succeed` : `${count} runs that did not succeed`;
    return table(caption, [...FAILED, watch], rows);
  }

  return { ranking, failures, table, number };
})();
