"use strict";
(function () {
  const plots = JSON.parse(document.getElementById("figures").textContent);
  const coarse = window.matchMedia && window.matchMedia("(pointer: coarse)").matches;
  const config = {
    displaylogo: false,
    responsive: true,
    displayModeBar: coarse ? true : "hover",
    modeBarButtons: [coarse ? ["zoom2d", "pan2d", "resetScale2d"]
      : ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
  };
  const groups = {};  // name -> {range, members}
  let busy = false;

  function follow(group, source, event) {
    if (busy) return;
    let range = null;
    if (event["xaxis.range"]) range = event["xaxis.range"];
    else if ("xaxis.range[0]" in event) range = [event["xaxis.range[0]"], event["xaxis.range[1]"]];
    else if (!event["xaxis.autorange"]) return;
    group.range = range;
    busy = true;
    const change = range ? { "xaxis.range": range, "xaxis.autorange": false } : { "xaxis.autorange": true };
    const moved = group.members.filter((m) => m !== source).map((m) => Plotly.relayout(m, Object.assign({}, change)));
    Promise.all(moved).finally(() => { busy = false; });
  }

  function keys(place, traces) {  // a legend that wraps; a click hides or shows its trace
    const row = document.createElement("div");
    row.className = "keys";
    traces.forEach((trace, index) => {
      if (trace.showlegend === false) return;
      const dash = { dash: "7 4", dot: "2 3" }[trace.line && trace.line.dash] || "none";
      const svg = trace.fill ? `<rect y="1" width="24" height="8" fill="${trace.fillcolor}"/>`
        : trace.mode === "markers" ? `<path d="M8 1l8 8m0-8l-8 8" stroke="${(trace.marker || trace.line).color}" stroke-width="2"/>`
        : `<path d="M0 5h24" stroke="${trace.line.color}" stroke-width="2" stroke-dasharray="${dash}"/>`;
      const key = document.createElement("button");
      key.innerHTML = `<svg width="24" height="10" aria-hidden="true">${svg}</svg>`;
      key.append(" " + trace.name);
      key.setAttribute("aria-pressed", "true");
      key.addEventListener("click", () => {
        const visible = key.getAttribute("aria-pressed") !== "true";
        key.setAttribute("aria-pressed", String(visible));
        Plotly.restyle(place, { visible }, [index]);
      });
      row.append(key);
    });
    place.before(row);
  }

  function draw(index) {
    const plot = plots[index], place = document.getElementById("plot" + index);
    if (!place || place.dataset.drawn) return;
    place.dataset.drawn = "yes";
    const group = groups[plot.group] = groups[plot.group] || { range: null, members: [] };
    const layout = plot.layout;
    layout.dragmode = coarse ? false : "zoom";  // a finger scrolls the page
    if (group.range) layout.xaxis.range = group.range.slice();
    Plotly.newPlot(place, plot.data, layout, config);
    keys(place, plot.data);
    group.members.push(place);
    place.on("plotly_relayout", (event) => follow(group, place, event));
  }

  let next = 0;
  function some() {
    const until = performance.now() + 60;
    while (next < plots.length && performance.now() < until) draw(next++);
    if (next < plots.length) setTimeout(some, 0);
    else document.body.dataset.drawn = "yes";
  }
  some();

  const closed = [];
  const drawn = () => document.querySelectorAll(".plot[data-drawn]");
  window.addEventListener("beforeprint", () => {  // two columns of a page of paper
    while (next < plots.length) draw(next++);
    document.querySelectorAll("details:not([open])").forEach((d) => { d.open = true; closed.push(d); });
    drawn().forEach((p) => {
      const height = p.classList.contains("tall") ? 270 : 200;
      Plotly.relayout(p, { autosize: false, width: 330, height });
    });
  });
  window.addEventListener("afterprint", () => {
    closed.splice(0).forEach((d) => { d.open = false; });
    drawn().forEach((p) => Plotly.relayout(p, { autosize: true, width: null, height: null }));
  });
})();
