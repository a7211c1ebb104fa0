// The truck from above, forward to the right, and each unit from behind. ISO 8855: angles are positive to the left.
const SVG = "http://www.w3.org/2000/svg";
const EXAGGERATED = 5, ARROW = 5;
const DEGREES = 180 / Math.PI;

function add(parent, tag, attributes, content = "") {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.textContent = content;
  parent.append(made);
  return made;
}

function box(parent, x, y, width, height, colour, opacity) {
  return add(parent, "rect", { x, y, width, height, fill: colour, "fill-opacity": opacity, rx: 0.1 });
}

export function drawings(truck, above, behind) {
  const drawAbove = fromAbove(truck, above);
  const drawBehind = truck.units.map((unit) => fromBehind(truck, unit, behind));
  return (states) => {
    drawAbove(states);
    drawBehind.forEach((draw) => draw(states));
  };
}

function fromAbove(truck, svg) {
  const { radius, width: wheelWidth } = truck.wheel;
  const length = truck.units.reduce((sum, unit) => sum + unit.front - unit.rear, 0);
  const front = truck.units[0].cog + ARROW + 0.5, rear = truck.units[0].front - length - 1;
  svg.setAttribute("viewBox", `${rear} -4.5 ${front - rear} 9`);
  const units = truck.units.map((unit) => {
    const group = add(svg, "g", {});
    box(group, unit.rear, -unit.width / 2, unit.front - unit.rear, unit.width, unit.colour, 0.25);
    const wheels = unit.axles.flatMap((axle) => [-1, 1].map((side) => {
      const wheel = add(group, "g", {});
      box(wheel, -radius, -wheelWidth / 2, 2 * radius, wheelWidth, "#333333", 0.8);
      return { wheel, x: axle.x, y: side * (truck.track - wheelWidth) / 2, steer: axle.steer };
    }));
    add(group, "circle", { cx: unit.cog, cy: 0, r: 0.18, fill: "#333333" });
    const arrow = add(group, "path", {
      d: `M0 0H${ARROW}m-0.8 -0.4l0.8 0.4l-0.8 0.4`, fill: "none", stroke: "#D55E00", "stroke-width": 0.16,
    });
    return { unit, group, wheels, arrow };
  });
  return (states) => {
    let x = 0, y = 0, heading = 0;  // of the unit's origin
    units.forEach(({ unit, group, wheels, arrow }, k) => {
      if (k) {
        const ahead = truck.units[k - 1];
        x += ahead.behind * Math.cos(heading);
        y += ahead.behind * Math.sin(heading);
        heading += states[`articulation.${unit.name}`] ?? 0;
        x -= unit.ahead * Math.cos(heading);
        y -= unit.ahead * Math.sin(heading);
      }
      group.setAttribute("transform", `translate(${x} ${-y}) rotate(${-heading * DEGREES})`);
      for (const { wheel, x: at, y: side, steer } of wheels) {
        wheel.setAttribute("transform", `translate(${at} ${side}) rotate(${-(states[steer] ?? 0) * DEGREES})`);
      }
      const sideslip = states[`sideslip.${unit.name}`];
      arrow.setAttribute("visibility", typeof sideslip === "number" ? "visible" : "hidden");
      arrow.setAttribute("transform", `translate(${unit.cog} 0) rotate(${-(sideslip ?? 0) * DEGREES * EXAGGERATED})`);
    });
  };
}

function fromBehind(truck, unit, parent) {
  const { radius, width: wheelWidth } = truck.wheel;
  const top = Math.max(3, unit.floor + unit.load + 0.6);
  const svg = add(parent, "svg", { viewBox: `-2.2 ${-top} 4.4 ${top + 0.9}`, role: "img", "aria-label": `${unit.title} from behind` });
  add(svg, "line", { x1: -2.2, x2: 2.2, y1: 0, y2: 0, stroke: "#8c8c8c", "stroke-width": 0.04 });
  for (const side of [-1, 1]) {
    const x = side * (truck.track - wheelWidth) / 2 - wheelWidth / 2;
    box(svg, x, -2 * radius, wheelWidth, 2 * radius, "#333333", 0.8);
  }
  const body = add(svg, "g", {});
  box(body, -unit.width / 2, -unit.floor, unit.width, unit.floor - unit.frame + 0.15, unit.colour, 0.5);
  const height = unit.load || 1.6;
  box(body, -unit.width / 2, -unit.floor - height, unit.width, height, unit.load ? "#E69F00" : unit.colour, 0.3);
  const label = add(svg, "text", { x: 0, y: 0.65, "font-size": 0.34, "text-anchor": "middle", fill: "#1c1c1c" });
  return (states) => {
    const roll = states[`roll.${unit.name}`];
    body.setAttribute("transform", `rotate(${(roll ?? 0) * DEGREES * EXAGGERATED} 0 ${-unit.roll_axis})`);
    const angle = typeof roll === "number" ? ` ${(roll * DEGREES).toFixed(2)} deg` : "";
    label.textContent = `${unit.title}${angle}`;
  };
}
