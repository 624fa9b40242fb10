"use strict";
/* The form of settings, made of what is declared: unit, range, default, effect.
Form.make(form, entries, values, change)    change(key, value): after a valid change
Form.show(form, values)                     bring its values up to date
Form.misfit(values, ordered)                which two sides are in another order; empty: none.
    ordered: products of keys and numbers, with the sign between them */

const Form = (() => {
  const HEADINGS = {
    robot: "Robot: limits", radius: "Safety radius", filter: "QP filter", ahead: "Look-ahead",
    margins: "Margins", actuation: "Actuation", repulsion: "Repulsion (Eq. 5, 7)", guide: "Guide",
    lidar: "LiDAR", perception: "Perception",
  };
  const OPEN = ["radius"];

  const keyOf = ({ section, key }) => `${section}.${key}`;

  function caption({ key, unit, range }) {
    const bare = unit ? key.slice(0, key.lastIndexOf("_")) : key;
    const words = (unit && /_per_s$|_rad_per_m2$/.test(key) ? key.replace(/_(rad_per_m2|per_s)$/, "") : bare).replaceAll("_", " ");
    const said = [["gt", ">"], ["ge", "≥"], ["lt", "<"], ["le", "≤"]].filter(([name]) => range[name] !== undefined);
    const bounds = said.map(([name, sign]) => `${sign} ${range[name]}`).join(", ");
    return [words, [unit, bounds].filter(Boolean).join(", ")];
  }

  function field({ choices, switch: isSwitch }) {
    if (choices.length) return element("select", {}, ...choices.map((word) => element("option", {}, word)));
    return element("input", isSwitch ? { type: "checkbox" } : { type: "text", inputmode: "decimal", autocomplete: "off" });
  }

  function valueOf(input) {
    if (input.type === "checkbox") return input.checked;
    if (input.tagName === "SELECT") return input.value;
    const text = input.value.trim().replace(",", ".").replace("−", "-");
    if (/^[+-]?inf(inity)?$|^-?∞$/.test(text)) return text.startsWith("-") ? -Infinity : Infinity;
    return text === "" ? NaN : Number(text);
  }

  /** What is wrong with a value, in words; empty: nothing. */
  function wrong({ range, choices, switch: isSwitch }, value) {
    if (isSwitch || choices.length) return "";
    if (Number.isNaN(value)) return "wants a number";
    if (range.finite && !Number.isFinite(value)) return "wants a finite number";
    const holds = { gt: (x) => value > x, ge: (x) => value >= x, lt: (x) => value < x, le: (x) => value <= x };
    const signs = { gt: ">", ge: "≥", lt: "<", le: "≤" };
    const broken = Object.keys(signs).find((name) => range[name] !== undefined && !holds[name](range[name]));
    return broken ? `wants ${signs[broken]} ${range[broken]}` : "";
  }

  function misfit(values, ordered) {
    const product = (side) => side.reduce((all, x) => all * (typeof x === "number" ? x : values[x]), 1);
    const holds = (one, sign, other) => (sign === "<" ? one < other : one <= other);
    const broken = ordered.find(([one, sign, other]) => !holds(product(one), sign, product(other)));
    return broken ? `${broken[0].join(" · ")} ${broken[1]} ${broken[2].join(" · ")} is wanted` : "";
  }

  function row(entry, change) {
    const input = field(entry);
    input.name = keyOf(entry);
    const [words, rest] = caption(entry);
    const alarm = element("span", { class: "wrong", role: "alert" });
    const told = element("small", {}, entry.effect);
    const name = element("span", {}, words, element("span", { class: "muted" }, rest ? ` (${rest})` : ""), told);
    input.addEventListener("change", () => {
      const value = valueOf(input);
      const why = wrong(entry, value) || change(keyOf(entry), value) || "";
      alarm.textContent = why;
    });
    return element("label", {}, name, input, alarm);
  }

  function make(form, entries, change, first = []) {
    const parts = new Map();
    for (const entry of entries) {
      if (!parts.has(entry.section)) {
        const open = OPEN.includes(entry.section);
        const head = element("summary", {}, HEADINGS[entry.section] || entry.section, element("span", { class: "muted" }, ` [${entry.section}]`));
        parts.set(entry.section, element("details", { open }, head));
      }
      parts.get(entry.section).append(row(entry, change));
    }
    form.replaceChildren(...first, ...parts.values());
    form.addEventListener("submit", (event) => event.preventDefault());
  }

  function show(form, values, usual) {
    for (const [key, value] of Object.entries(values)) {
      const input = form.elements[key];
      if (!input) continue;
      if (input.type === "checkbox") input.checked = value;
      else input.value = typeof value === "number" ? (Number.isFinite(value) ? String(Number(value.toPrecision(6))) : value > 0 ? "inf" : "-inf") : value;
      input.closest("label").classList.toggle("changed", value !== usual[key]);
      input.closest("label").querySelector(".wrong").textContent = "";
    }
  }

  return { make, show, misfit };
})();
