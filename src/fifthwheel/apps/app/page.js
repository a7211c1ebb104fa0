// One time cursor in all plots of a log, and the values of their lines at this time; a report in its whole height and in the theme.
(function () {
  const form = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(4))).replace("-", "\u2212") : "");

  function valueAt(x, y, time) {  // interpolated; NaN outside the line and in its gaps
    let low = 0, high = x.length - 1;
    if (!(time >= x[low] && time <= x[high])) return NaN;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (x[middle] === null) return NaN;
      if (x[middle] <= time) low = middle; else high = middle;
    }
    if (y[low] === null || y[high] === null) return NaN;
    return y[low] + (y[high] - y[low]) * (x[high] === x[low] ? 0 : (time - x[low]) / (x[high] - x[low]));
  }

  function overlay(plot, name) {
    let found = plot.querySelector(`:scope > .${name}`);
    if (!found) {
      found = document.createElement("div");
      found.className = name;
      found.setAttribute("aria-hidden", "true");
      plot.append(found);
    }
    return found;
  }

  function show(plot, time) {
    const line = overlay(plot, "fw-cursor"), values = overlay(plot, "fw-values");
    const axis = plot._fullLayout.xaxis, at = time === null ? NaN : axis.l2p(time);
    const inside = at >= 0 && at <= axis._length;
    line.hidden = values.hidden = !inside;
    if (!inside) return;
    line.style.left = `${axis._offset + at}px`;
    const rows = {};
    for (const trace of plot._fullData) {
      if (trace.type !== "scatter" || trace.mode !== "lines" || trace.fill !== "none" || trace.visible !== true) continue;
      const value = form(valueAt(trace.x, trace.y, time));
      if (value) (rows[trace.yaxis] ||= []).push([trace, value]);
    }
    values.replaceChildren(...Object.entries(rows).map(([name, entries], k) => {
      const row = document.createElement("div"), y = plot._fullLayout[name.replace("y", "yaxis")];
      row.style.top = `${y._offset - 18}px`;
      if (k === 0) row.append(`${form(time)} s  `);
      for (const [trace, value] of entries) {
        const part = document.createElement("span");
        part.style.color = trace.line.color;
        part.textContent = `${/^trace \d+$/.test(trace.name) ? "" : trace.name} ${value}  `;
        row.append(part);
      }
      return row;
    }));
  }

  function moved(event) {
    const plot = event.target.closest && event.target.closest(".fw-time");
    const axis = plot && plot._fullLayout && plot._fullLayout.xaxis;
    const at = axis ? event.clientX - plot.getBoundingClientRect().left - axis._offset : NaN;
    const time = at >= 0 && at <= axis._length ? axis.p2l(at) : null;
    for (const other of document.querySelectorAll(".fw-time")) {
      if (other._fullLayout && other._fullLayout.xaxis)
        show(other, plot && other.dataset.log === plot.dataset.log ? time : null);
    }
  }

  let waiting = null;
  function later(event) {
    if (!waiting) requestAnimationFrame(() => { const latest = waiting; waiting = null; moved(latest); });
    waiting = event;
  }
  document.addEventListener("pointermove", later);
  document.addEventListener("pointerdown", later);

  const reports = () => [...document.querySelectorAll(".fw-report")];
  const sendTheme = (report) =>
    report.contentWindow.postMessage({ dark: document.body.classList.contains("body--dark") }, "*");
  const BAR = 60;  // pixels that the bar covers
  window.addEventListener("message", (event) => {  // the report says its height and where a link leads, no more
    const report = reports().find((frame) => frame.contentWindow === event.source);
    if (!report || !event.data) return;
    const { height, top } = event.data;
    if (top > 0) window.scrollTo({ top: window.scrollY + report.getBoundingClientRect().top + top - BAR });
    if (!(height > 0)) return;
    report.style.height = `${Math.min(Math.ceil(height) + 2, 60000)}px`;
    sendTheme(report);
  });
  document.addEventListener("DOMContentLoaded", () => {
    new MutationObserver(() => reports().forEach(sendTheme)).observe(document.body, { attributeFilter: ["class"] });
  });
})();
