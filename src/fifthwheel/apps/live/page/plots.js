// A plot of values with bands of two sigma on a canvas.
const LEFT = 52, RIGHT = 6, TOP = 6, BOTTOM = 18;

function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= rough);
  const made = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k++) made.push(k * step);
  return [made, step];
}

function label(value, step) {
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const text = value.toFixed(decimals);
  return decimals ? text : text.replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

// lines: [{colour, points: [[time, value, sigma], ...]}], null for a missing value; span: [first, last] time.
export function bandPlot(canvas, lines, [first, last]) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const g = canvas.getContext("2d");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, width, height);
  const shown = lines.flatMap((line) => line.points).filter(([t, v]) => v !== null && t >= first);
  if (!shown.length) return;
  let low = Infinity, high = -Infinity;
  for (const [, v, s] of shown) {
    low = Math.min(low, v - 2 * (s ?? 0));
    high = Math.max(high, v + 2 * (s ?? 0));
  }
  const margin = Math.max(1e-9, 0.05 * (high - low), 1e-6 * Math.abs(high));
  low -= margin;
  high += margin;
  const x = (t) => LEFT + (t - first) / (last - first) * (width - LEFT - RIGHT);
  const y = (v) => TOP + (high - v) / (high - low) * (height - TOP - BOTTOM);
  g.font = "11px system-ui, sans-serif";
  g.fillStyle = "#5a5a5a";
  g.strokeStyle = "#e8e8e8";
  g.lineWidth = 1;
  g.textAlign = "right";
  g.textBaseline = "middle";
  const [vertical, step] = ticks(low, high, 4);
  for (const value of vertical) {
    g.beginPath();
    g.moveTo(LEFT, y(value));
    g.lineTo(width - RIGHT, y(value));
    g.stroke();
    g.fillText(label(value, step), LEFT - 5, y(value));
  }
  g.textAlign = "center";
  g.textBaseline = "top";
  const [horizontal, seconds] = ticks(first, last, Math.max(2, width / 90));
  for (const t of horizontal.filter((t) => t >= 0)) g.fillText(`${label(t, seconds)} s`, x(t), height - BOTTOM + 4);
  for (const { colour, points } of lines) {
    for (const run of runs(points.filter(([t]) => t >= first))) {
      g.fillStyle = g.strokeStyle = colour;
      g.globalAlpha = 0.18;
      g.beginPath();
      run.forEach(([t, v, s]) => g.lineTo(x(t), y(v + 2 * (s ?? 0))));
      run.toReversed().forEach(([t, v, s]) => g.lineTo(x(t), y(v - 2 * (s ?? 0))));
      g.fill();
      g.globalAlpha = 1;
      g.lineWidth = 1.6;
      g.beginPath();
      run.forEach(([t, v]) => g.lineTo(x(t), y(v)));
      g.stroke();
    }
  }
}

// The points between missing values.
function runs(points) {
  const made = [[]];
  for (const point of points) {
    if (point[1] === null) made.push([]);
    else made.at(-1).push(point);
  }
  return made.filter((run) => run.length);
}
