"use strict";
/* The form of settings, made of what the server says that there is.
Form.show(form, settings, send)     make it, or bring its values up to date
Form.complain(form, about, text)    show an error beside a field; false: no such field */

const Form = (() => {
  const UNITS = {
    per_s: "1/s", mps2: "m/s²", mps: "m/s", m2: "m²", m: "m", s: "s",
  };
  const HEADINGS = {
    radius: "Safety radius", filter: "QP filter", ahead: "Look-ahead",
    margins: "Margins", repulsion: "Repulsion (Eq. 5, 7)",
  };

  function caption(key) {
    const unit = Object.keys(UNITS).find((end) => key.endsWith(`_${end}`));
    const name = unit ? key.slice(0, -unit.length - 1) : key;
    return name.replaceAll("_", " ") + (unit ? ` (${UNITS[unit]})` : "");
  }

  function field({ value, choices }) {
    if (choices.length) {
      const select = document.createElement("select");
      select.append(...choices.map((word) => new Option(word)));
      return select;
    }
    const input = document.createElement("input");
    input.type = typeof value === "boolean" ? "checkbox" : "text";
    input.inputMode = "decimal";
    return input;
  }

  function valueOf(input) {
    if (input.type === "checkbox") return input.checked;
    const number = Number(input.value.replace(",", ".").replace("−", "-"));
    const isNumber = input.tagName === "INPUT" && input.value.trim() && Number.isFinite(number);
    return isNumber ? number : input.value;
  }

  function make(form, settings, send) {
    const parts = {};
    for (const setting of settings) {
      const { section, key } = setting;
      if (!parts[section]) {
        parts[section] = document.createElement("fieldset");
        const legend = document.createElement("legend");
        legend.textContent = HEADINGS[section] || section;
        parts[section].append(legend);
      }
      const input = field(setting);
      input.name = `${section}.${key}`;
      const [label, wrong] = ["label", "span"].map((tag) => document.createElement(tag));
      wrong.className = "wrong";
      wrong.setAttribute("role", "alert");
      label.append(caption(key), input, wrong);
      parts[section].append(label);
      input.addEventListener("change", () => {
        wrong.textContent = "";
        send({ kind: "set", section, key, value: valueOf(input) });
      });
    }
    form.replaceChildren(...Object.values(parts));
    form.addEventListener("submit", (event) => event.preventDefault());
  }

  function show(form, settings, send) {
    if (!form.elements.length) make(form, settings, send);
    for (const { section, key, value } of settings) {
      const input = form.elements[`${section}.${key}`];
      if (input === document.activeElement && input.type === "text") continue;
      if (input.type === "checkbox") input.checked = value;
      else input.value = typeof value === "number" ? Number(value.toPrecision(6)) : value ?? "inf";
    }
  }

  function complain(form, about, text) {
    const input = form.elements[about];
    if (!input) return false;
    input.parentElement.querySelector(".wrong").textContent = text;
    return true;
  }

  return { complain, show };
})();
