"use strict";
/* Figures of the ranking, drawn by plotly; their numbers stand in the tables too. */

const Figures = (() => {
  const OUTCOMES = {
    arrived: ["--qp-ahead", ""], touched: ["--eq7", "x"], stalled: ["--qp", "/"],
    "off goal": ["--other2", "."], failed: ["--other1", "\\"], died: ["--muted", "-"],
  };
  const LEGEND = { showlegend: true, margin: { l: 10, r: 16, t: 40, b: 78 } };
  const percent = (value) => 100 * value;

  function layout(title, x, height, extra = {}) {
    const [fg, grid] = [Pen.color("--fg"), Pen.color("--grid")];
    return {
      title: { text: title, font: { size: 15 }, x: 0, xref: "container", xanchor: "left", pad: { l: 8 } },
      font: { color: fg, family: "system-ui, sans-serif" }, height,
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      margin: { l: 10, r: 16, t: 40, b: 44 }, barmode: "stack", showlegend: false,
      xaxis: { title: { text: x }, gridcolor: grid, zerolinecolor: grid, ...extra.xaxis },
      yaxis: { automargin: true, gridcolor: grid, zeroline: false, autorange: "reversed", fixedrange: true, ...extra.yaxis },
      hoverlabel: { font: { family: "system-ui, sans-serif" } },
      legend: { orientation: "h", yref: "container", y: 0, yanchor: "bottom", x: 0, traceorder: "normal" }, ...extra.layout,
    };
  }

  const short = (name) => (name.length > 44 ? `${name.slice(0, 43)}…` : name);
  const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const rowHeight = (count) => 100 + 26 * count;

  function axis(methods) {
    return { tickvals: methods.map((_, i) => i), ticktext: methods.map((one) => plain(short(one.method))) };
  }

  function outcomes(methods) {
    const names = [...new Set([...Object.keys(OUTCOMES), ...methods.flatMap((one) => Object.keys(one.outcomes))])];
    const bars = names.map((name) => {
      const [hue, shape] = OUTCOMES[name] || ["--other3", "+"];
      return {
        type: "bar", orientation: "h", name: plain(name), y: methods.map((_, i) => i),
        x: methods.map((one) => percent((one.outcomes[name] || 0) / one.runs)),
        customdata: methods.map((one) => [one.outcomes[name] || 0, plain(one.method)]),
        hovertemplate: `%{customdata[1]}<br>${plain(name)}: %{customdata[0]} runs, %{x:.1f} %<extra></extra>`,
        marker: { color: Pen.color(hue), pattern: { shape, fgcolor: Pen.color("--bg"), size: 7, solidity: 0.25, fillmode: "overlay" } },
      };
    }).filter((bar) => bar.x.some((value) => value > 0));
    return [bars, layout("Outcomes", "% of runs", 30 + rowHeight(methods.length), { yaxis: axis(methods), xaxis: { range: [0, 100] }, layout: LEGEND })];
  }

  function successes(methods, hues) {
    const rates = methods.map((one) => one.success.map(percent));
    const trace = {
      type: "scatter", mode: "markers", y: methods.map((_, i) => i), x: rates.map(([rate]) => rate),
      error_x: { type: "data", symmetric: false, array: rates.map(([rate, , high]) => high - rate), arrayminus: rates.map(([rate, low]) => rate - low), color: Pen.color("--fg"), thickness: 1.2 },
      marker: { size: 10, color: hues.map(Pen.color) },
      customdata: methods.map((one, i) => [plain(one.method), rates[i][1], rates[i][2], one.runs]),
      hovertemplate: "%{customdata[0]}<br>%{x:.1f} % (%{customdata[1]:.1f} to %{customdata[2]:.1f}) of %{customdata[3]} runs<extra></extra>",
    };
    return [[trace], layout("Success, with 95 % intervals", "% of runs", rowHeight(methods.length), { yaxis: axis(methods), xaxis: { range: [-2, 102] } })];
  }

  function boxes(methods, hues, key, title, unit) {
    const traces = methods.map((one, i) => [one[key], i]).filter(([box]) => box).map(([box, i]) => ({
      type: "box", orientation: "h", y: [i], name: plain(methods[i].method),
      lowerfence: [box[0]], q1: [box[1]], median: [box[2]], q3: [box[3]], upperfence: [box[4]],
      line: { color: Pen.color(hues[i]) }, hoverinfo: "x+name", width: 0.6,
    }));
    return [traces, layout(title, unit, rowHeight(methods.length), { yaxis: axis(methods) })];
  }

  function effect({ setting, points }) {
    const who = [...new Set(points.map((one) => one.who))];
    const hues = Pen.hues(who.map((name) => name.split(" ")[0]));
    const numeric = points.every((one) => typeof one.value === "number");
    const traces = who.map((name, i) => {
      const mine = points.filter((one) => one.who === name).sort((a, b) => a.value - b.value);
      const rates = mine.map((one) => one.success.map(percent));
      return {
        type: "scatter", mode: "lines+markers", name: plain(name), x: mine.map((one) => (numeric ? one.value : String(one.value))), y: rates.map(([rate]) => rate),
        error_y: { type: "data", symmetric: false, array: rates.map(([rate, , high]) => high - rate), arrayminus: rates.map(([rate, low]) => rate - low), thickness: 1 },
        line: { color: Pen.color(hues[i]), dash: ["solid", "dash", "dot", "dashdot"][i % 4] }, marker: { symbol: i, size: 9 },
        hovertemplate: `${plain(name)}<br>${plain(setting)} = %{x}: %{y:.1f} %<extra></extra>`,
      };
    });
    const values = [...new Set(points.map((one) => one.value))];
    const xaxis = numeric && values.length <= 8 ? { tickvals: values } : { type: numeric ? "linear" : "category" };
    const y = { autorange: false, range: [-3, 103], title: { text: "success, % of runs" } };
    return [traces, layout(`Success over ${plain(setting)}`, plain(setting), 340, { xaxis, yaxis: y, layout: LEGEND })];
  }

  /** Places first, so that each figure finds its width. */
  function draw(place, figures) {
    const label = (title) => `Figure: ${title}. Its numbers stand in the tables.`;
    const holders = figures.map(([, look]) => element("div", { class: "figure", role: "img", "aria-label": label(look.title.text) }));
    place.replaceChildren(...holders);
    figures.forEach(([traces, look], i) => Plotly.newPlot(holders[i], traces, look, { displaylogo: false, responsive: true }));
  }

  /** Draw all figures of one ranking, and those of the settings that were varied. */
  function show(place, methods, effects) {
    const best = methods.slice(0, 30);
    const hues = Pen.hues(best.map((one) => one.controller));
    const figures = [outcomes(best), successes(best, hues), boxes(best, hues, "clearance_box", "Least clearance: least, quartiles, greatest", "m")];
    if (best.some((one) => one.time_box)) figures.push(boxes(best, hues, "time_box", "Time of the runs that arrived", "s"));
    draw(place, [...figures, ...effects.map(effect)]);
    if (methods.length > best.length) place.append(element("p", { class: "muted" }, `The figures show the first ${best.length} methods.`));
  }

  return { show };
})();
