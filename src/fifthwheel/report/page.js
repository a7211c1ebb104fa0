"use strict";
(function () {
  const plots = JSON.parse(document.getElementById("figures").textContent);
  const coarse = window.matchMedia && window.matchMedia("(pointer: coarse)").matches;
  const config = {
    displaylogo: false,
    responsive: true,
    displayModeBar: coarse ? true : "hover",
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
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

  function draw(index) {
    const plot = plots[index], place = document.getElementById("plot" + index);
    if (!place || place.dataset.drawn) return;
    place.dataset.drawn = "yes";
    const group = groups[plot.group] = groups[plot.group] || { range: null, members: [] };
    const layout = plot.layout;
    layout.dragmode = coarse ? false : "zoom";  // a finger scrolls the page
    if (group.range) layout.xaxis.range = group.range.slice();
    Plotly.newPlot(place, plot.data, layout, config);
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
  window.addEventListener("beforeprint", () => {
    while (next < plots.length) draw(next++);
    document.querySelectorAll("details:not([open])").forEach((d) => { d.open = true; closed.push(d); });
    document.querySelectorAll(".plot[data-drawn]").forEach((p) => Plotly.Plots.resize(p));
  });
  window.addEventListener("afterprint", () => {
    closed.splice(0).forEach((d) => { d.open = false; });
    document.querySelectorAll(".plot[data-drawn]").forEach((p) => Plotly.Plots.resize(p));
  });
})();
