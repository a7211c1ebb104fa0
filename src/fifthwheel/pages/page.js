"use strict";
(async function () {
  async function decompressed(id) {  // base64 of deflated data
    const text = atob(document.getElementById(id).textContent);
    const bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).text();
  }

  if (typeof DecompressionStream === "undefined") {
    const note = document.getElementById("unsupported");
    note.hidden = false;
    document.getElementById("verdict")?.after(note);
    return;
  }
  const library = document.createElement("script");
  library.textContent = await decompressed("library");
  document.head.append(library);
  const plots = JSON.parse(await decompressed("figures"));

  const coarse = window.matchMedia && window.matchMedia("(pointer: coarse)").matches;
  const config = {
    displaylogo: false,
    responsive: true,
    doubleClick: false,  // resetGroup() below handles it
    displayModeBar: coarse ? true : "hover",
    modeBarButtons: [coarse ? ["zoom2d", "pan2d", "resetScale2d"]
      : ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
  };
  const printHeights = { tall: 290, small: 165 }, printWidths = { small: 215 };
  const groups = {};  // name -> {range, members}
  let updating = false;

  function relayoutGroup(group, source, change) {
    updating = true;
    const updates = group.members.filter((m) => m !== source).map((m) => Plotly.relayout(m, change(m)));
    Promise.all(updates).finally(() => { updating = false; });
  }

  function onRelayout(group, source, event) {
    if (updating) return;
    let range = null;
    if (event["xaxis.range"]) range = event["xaxis.range"];
    else if ("xaxis.range[0]" in event) range = [event["xaxis.range[0]"], event["xaxis.range[1]"]];
    else if (!event["xaxis.autorange"]) return;
    group.range = range;
    relayoutGroup(group, source, () => (range ? { "xaxis.range": range.slice(), "xaxis.autorange": false } : autorange()));
  }

  const autorange = () => ({ "xaxis.autorange": true });

  function resetGroup(group) {  // all axes of all plots to their first range
    group.range = null;
    relayoutGroup(group, null, (member) => {
      const change = autorange();
      for (const axis of ["yaxis", "yaxis2"]) {
        if (!member.layout[axis]) continue;
        const range = member.firstRanges[axis];
        if (range) change[axis + ".range"] = range.slice();
        else change[axis + ".autorange"] = true;
      }
      return change;
    });
  }

  function moveCursor(group, time) {  // the same time in all plots of the group
    for (const member of group.members) {
      const axis = member._fullLayout && member._fullLayout.xaxis;
      const at = time === null || !axis ? NaN : axis.l2p(time);
      member.cursor.hidden = !(at >= 0 && at <= axis._length);
      if (!member.cursor.hidden) member.cursor.style.left = `${axis._offset + at}px`;
    }
  }

  function addLegend(place, traces) {  // a legend that wraps; a click hides or shows its trace
    const row = document.createElement("div");
    row.className = "trace-legend";
    traces.forEach((trace, index) => {
      if (trace.showlegend === false) return;
      const dash = { dash: "7 4", dot: "2 3" }[trace.line && trace.line.dash] || "none";
      const svg = trace.fill ? `<rect y="1" width="24" height="8" fill="${trace.fillcolor}"/>`
        : trace.type === "bar" ? `<rect y="1" width="24" height="8" fill="${trace.marker.color}"/>`
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
    layout.dragmode = coarse ? false : "zoom";  // so that a touch scrolls the page
    place.firstRanges = Object.fromEntries(["yaxis", "yaxis2"].map((axis) => [axis, layout[axis]?.range?.slice()]));
    if (group.range) layout.xaxis.range = group.range.slice();
    const plotConfig = { ...config, toImageButtonOptions: { format: "svg", filename: plot.name.join(" ") } };
    Plotly.newPlot(place, plot.data, layout, plotConfig);
    addLegend(place, plot.data);
    place.cursor = document.createElement("div");
    place.cursor.className = "cursor";
    place.cursor.hidden = true;
    place.append(place.cursor);
    group.members.push(place);
    place.on("plotly_relayout", (event) => onRelayout(group, place, event));
    place.on("plotly_doubleclick", () => resetGroup(group));
    place.on("plotly_hover", (event) => moveCursor(group, event.xvals ? event.xvals[0] : event.points[0].x));
    place.on("plotly_unhover", () => moveCursor(group, null));
  }

  const isFolded = (index) => document.getElementById("plot" + index)?.closest("details:not([open])");
  document.querySelectorAll("details").forEach((details) => details.addEventListener("toggle", () => {
    if (!details.open) return;
    plots.forEach((_, index) => { if (details.contains(document.getElementById("plot" + index))) draw(index); });
  }));

  let next = 0;
  function drawSome() {  // for 60 ms, so that the page stays responsive
    const until = performance.now() + 60;
    for (; next < plots.length && performance.now() < until; next++) if (!isFolded(next)) draw(next);
    if (next < plots.length) setTimeout(drawSome, 0);
    else document.body.dataset.drawn = "yes";
  }
  drawSome();

  const opened = [];
  const drawn = () => document.querySelectorAll(".plot[data-drawn]");
  window.addEventListener("beforeprint", () => {  // in two columns
    document.querySelectorAll("details:not([open])").forEach((d) => { d.open = true; opened.push(d); });
    plots.forEach((_, index) => draw(index));
    drawn().forEach((p) => {
      const size = ["tall", "small"].find((word) => p.classList.contains(word));
      Plotly.relayout(p, { autosize: false, width: printWidths[size] || 330, height: printHeights[size] || 215 });
    });
  });
  window.addEventListener("afterprint", () => {
    opened.splice(0).forEach((d) => { d.open = false; });
    drawn().forEach((p) => Plotly.relayout(p, { autosize: true, width: null, height: null }));
  });
})();
