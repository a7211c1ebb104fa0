(function () {
  function decompressed(id) {  // base64 of deflated data
    const text = atob(document.getElementById(id).textContent), bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    return new TextDecoder().decode(inflate(bytes));
  }

  const library = document.createElement("script");
  library.textContent = decompressed("library");
  document.head.append(library);
  const plots = JSON.parse(decompressed("figures"));

  const coarse = window.matchMedia && window.matchMedia("(pointer: coarse)").matches;
  const config = {
    displaylogo: false,
    responsive: true,
    doubleClick: false,  // resetGroup() below handles it
    displayModeBar: "hover",
    modeBarButtons: [coarse ? ["zoom2d", "pan2d", "resetScale2d"]
      : ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
  };
  const groups = {};  // name -> {range, members}
  const legends = new Map();  // part of the page -> {row, keys: {name: button}, members}
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
      for (const [axis, range] of Object.entries(member.firstRanges)) {
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

  function swatch(trace) {
    const dash = { dash: "7 4", dot: "2 3" }[trace.line && trace.line.dash] || "none";
    const svg = trace.fill ? `<rect y="1" width="24" height="8" fill="${trace.fillcolor}"/>`
      : trace.type === "bar" ? `<rect y="1" width="24" height="8" fill="${trace.marker.color}"/>`
      : trace.mode === "markers" ? `<path d="M8 1l8 8m0-8l-8 8" stroke="${(trace.marker || trace.line).color}" stroke-width="2"/>`
      : `<path d="M0 5h24" stroke="${trace.line.color}" stroke-width="2" stroke-dasharray="${dash}"/>`;
    return `<svg width="24" height="10" aria-hidden="true">${svg}</svg>`;
  }

  function addLegend(place, traces) {  // one for the page and one for each fold; a click hides or shows lines everywhere
    const part = place.closest("details") || document.querySelector("main");
    const legend = legends.get(part) || { row: document.createElement("div"), keys: {}, members: [] };
    legends.set(part, legend);
    legend.members.push(place);
    for (const trace of traces) {
      if (trace.showlegend === false) continue;
      const look = trace.name + swatch(trace);  // a line of another colour has a key of its own
      if (look in legend.keys) {
        if (legend.keys[look].getAttribute("aria-pressed") === "false") show(place, trace.name, false);
        continue;
      }
      if (!legend.row.isConnected) {
        legend.row.className = "trace-legend";
        (part.localName === "main" ? place.closest("main > *") : place.closest(".plots")).before(legend.row);
      }
      const key = legend.keys[look] = document.createElement("button");
      key.type = "button";
      key.innerHTML = swatch(trace);
      key.append(" " + trace.name);
      key.setAttribute("aria-pressed", "true");
      key.addEventListener("click", () => {
        const visible = key.getAttribute("aria-pressed") !== "true";
        key.setAttribute("aria-pressed", String(visible));
        legend.members.forEach((member) => show(member, trace.name, visible));
      });
      legend.row.append(key);
    }
  }

  function show(place, name, visible) {
    const indices = place.data.flatMap((trace, k) => (trace.name === name ? [k] : []));
    if (indices.length) Plotly.restyle(place, { visible }, indices);
  }

  function draw(index) {
    const plot = plots[index], place = document.getElementById("plot" + index);
    if (!place || place.dataset.drawn) return;
    place.dataset.drawn = "yes";
    const group = groups[plot.group] = groups[plot.group] || { range: null, members: [] };
    const layout = plot.layout;
    layout.dragmode = coarse ? false : "zoom";  // so that a touch scrolls the page
    const axes = Object.keys(layout).filter((key) => key.startsWith("yaxis"));
    place.firstRanges = Object.fromEntries(axes.map((axis) => [axis, layout[axis].range?.slice()]));
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

  function drawVisible() {  // what no fold hides, at once, so that a page that is printed when it opens has its plots
    plots.forEach((_, index) => { if (!document.getElementById("plot" + index)?.closest("details:not([open])")) draw(index); });
  }
  document.querySelectorAll("details").forEach((details) => details.addEventListener("toggle", () => { if (details.open) drawVisible(); }));
  drawVisible();
  document.body.dataset.drawn = "yes";
  if (window.parent !== window) {  // the workbench gives the page its whole height, scrolls it, and says whether it is dark
    const themes = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules])
      .filter((rule) => rule.media && rule.media.mediaText.includes("prefers-color-scheme"));
    window.addEventListener("message", (event) => {
      if (event.source !== window.parent || typeof event.data.dark !== "boolean") return;
      themes.forEach((rule) => { rule.media.mediaText = event.data.dark ? "screen" : "not all"; });
      document.documentElement.style.colorScheme = event.data.dark ? "dark" : "light";
    });
    document.querySelectorAll('nav a[href^="#"]').forEach((link) => link.addEventListener("click", (event) => {
      event.preventDefault();  // the frame does not scroll, the page around it does
      const target = document.querySelector(link.getAttribute("href"));
      window.parent.postMessage({ top: target.getBoundingClientRect().top }, "*");
    }));
    new ResizeObserver(() => window.parent.postMessage({ height: document.documentElement.offsetHeight }, "*")).observe(document.documentElement);
  }

  const drawn = () => [...document.querySelectorAll("div.plot[data-drawn]")].filter((p) => !p.closest("details:not([open])"));
  const printed = { wide: (p) => [680, Math.min(40 + 85 * p.style.getPropertyValue("--panels"), 900)], tall: () => [330, 290], small: () => [215, 165] };
  let folds = [];
  window.addEventListener("beforeprint", () => {
    folds = [...document.querySelectorAll("#appendix details:not([open])")];
    folds.forEach((details) => { details.open = true; });
    drawVisible();
    drawn().forEach((p) => {
      const size = Object.keys(printed).find((word) => p.classList.contains(word));
      const [width, height] = size ? printed[size](p) : [330, 215];
      const ticks = p.layout.xaxis.type === "date" ? { "xaxis.nticks": 3 } : {};
      Plotly.relayout(p, { autosize: false, width, height, ...ticks });
    });
  });
  window.addEventListener("afterprint", () => {
    drawn().forEach((p) => Plotly.relayout(p, { autosize: true, width: null, height: null }));
    folds.forEach((details) => { details.open = false; });
  });
})();
