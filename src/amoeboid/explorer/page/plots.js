// Plots as SVG: lines over axes, outlines of cells. Colors are those of the style sheet.

const SVG = "http://www.w3.org/2000/svg";

export function element(name, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

export function ticks(low, high, count = 5) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push(k * step);
  return found;
}

export function shown(value, digits = 4) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(2) : String(Number(value.toPrecision(digits)));
  return text.replace("-", "\u2212");
}

// "L^2/T" as people read it
export function unitText(unit) {
  const powers = { 2: "\u00b2", 3: "\u00b3", 4: "\u2074" };
  return unit.replace(/\^(\d)/g, (_, n) => powers[n] ?? n).replace(/\bum\b/g, "\u00b5m");
}

export function titled(name, unit) {
  return unit ? `${name} [${unitText(unit)}]` : name;
}

function extent(values, include = [], part = 0.1) {
  const all = [...values, ...include].filter(Number.isFinite);
  let [low, high] = [Math.min(...all), Math.max(...all)];
  if (!(high > low)) [low, high] = [low - (Math.abs(low) || 1) * 0.5, high + (Math.abs(high) || 1) * 0.5];
  const margin = part * (high - low);
  return [low - (low === 0 ? 0 : margin), high + margin];
}

// lines {x, y, color, dash, width}; marks {x, y, color, kind, title}; rule: x of a vertical line
export function plot(box, spec) {
  const width = box.clientWidth || 400;
  const height = box.clientHeight || 200;
  const edge = { left: 54, right: 12, top: 10, bottom: 40 };
  const [x0, x1] = spec.x ?? extent(spec.lines.flatMap((l) => l.x));
  const [y0, y1] = spec.y ?? extent([...spec.lines.flatMap((l) => l.y), ...(spec.marks ?? []).map((m) => m.y)], spec.include, spec.margin);
  const X = (v) => edge.left + ((v - x0) / (x1 - x0)) * (width - edge.left - edge.right);
  const Y = (v) => height - edge.bottom - ((v - y0) / (y1 - y0)) * (height - edge.top - edge.bottom);
  const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": spec.about });
  const xs = spec.xTicks ?? ticks(x0, x1, width > 320 ? 6 : 4).map((v) => [v, shown(v)]);
  for (const [v, text] of xs) {
    svg.append(
      element("path", { class: "grid", d: `M${X(v)} ${edge.top}V${height - edge.bottom}` }),
      element("text", { class: "tick", x: X(v), y: height - edge.bottom + 15, "text-anchor": "middle" }, text),
    );
  }
  for (const v of ticks(y0, y1, height > 250 ? 6 : 4)) {
    svg.append(
      element("path", { class: "grid", d: `M${edge.left} ${Y(v)}H${width - edge.right}` }),
      element("text", { class: "tick", x: edge.left - 6, y: Y(v) + 4, "text-anchor": "end" }, shown(v)),
    );
  }
  if (y0 < 0 && y1 > 0) svg.append(element("path", { class: "axis", d: `M${edge.left} ${Y(0)}H${width - edge.right}`, "stroke-opacity": 0.6 }));
  svg.append(
    element("path", { class: "axis", d: `M${edge.left} ${edge.top}V${height - edge.bottom}H${width - edge.right}` }),
    element("text", { x: (edge.left + width - edge.right) / 2, y: height - 6, "text-anchor": "middle" }, spec.xTitle),
    element("text", { transform: `translate(13 ${(edge.top + height - edge.bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, spec.yTitle),
  );
  const clip = `clip-${box.id}`;
  svg.append(element("clipPath", { id: clip }, element("rect", { x: edge.left, y: edge.top - 8, width: Math.max(1, width - edge.left - edge.right), height: Math.max(1, height - edge.top - edge.bottom + 16) })));
  const inside = element("g", { "clip-path": `url(#${clip})` });
  if (spec.rule !== undefined && spec.rule !== null) {
    inside.append(element("path", { d: `M${X(spec.rule)} ${edge.top}V${height - edge.bottom}`, stroke: "var(--here)", "stroke-width": 1.5, "stroke-opacity": 0.75 }));
  }
  for (const line of spec.lines) {
    const d = line.x.map((v, k) => `${k ? "L" : "M"}${X(v).toFixed(1)} ${Y(line.y[k]).toFixed(1)}`).join("");
    inside.append(element("path", { d, fill: "none", stroke: line.color, "stroke-width": line.width ?? 2.4, "stroke-linejoin": "round", ...(line.dash ? { "stroke-dasharray": "6 4" } : {}) }));
  }
  for (const mark of spec.marks ?? []) {
    const [x, y] = [X(mark.x), Y(mark.y)];
    const shape =
      mark.kind === "fold" ? element("path", { d: `M${x} ${y - 6}L${x + 6} ${y}L${x} ${y + 6}L${x - 6} ${y}Z`, fill: mark.color })
      : mark.kind === "stem" ? element("path", { d: `M${x} ${Y(0)}V${y}`, stroke: mark.color, "stroke-width": 7, "stroke-opacity": 0.8 })
      : element("circle", { cx: x, cy: y, r: mark.r ?? 5.5, fill: mark.hollow ? "var(--panel)" : mark.color, stroke: mark.hollow ? mark.color : "var(--panel)", "stroke-width": mark.hollow ? 2.4 : 1.5 });
    if (mark.title) shape.append(element("title", {}, mark.title));
    inside.append(shape);
    if (mark.label) {
      const below = mark.y < 0;
      const label = element("text", { class: "tick", x, y: y + (below ? 19 : -10), "text-anchor": "middle" }, mark.label);
      (spec.labels ??= []).push(label);
    }
  }
  svg.append(inside, ...(spec.labels ?? []));
  box.replaceChildren(svg);
}

export function colorAt(colors, share) {
  return colors[Math.max(0, Math.min(colors.length - 1, Math.round(share * (colors.length - 1))))];
}

// An axisymmetric cell from the side, front up: the outline colored by c, arrows of the flow.
export function outline(state, look) {
  const size = look.size * 1.32;
  const svg = element("svg", { viewBox: `${-size} ${-size} ${2 * size} ${2 * size}`, role: "img", "aria-label": look.about });
  const { r, z, c, u } = state;
  const path = [...r.map((v, k) => [v, z[k]]), ...r.map((v, k) => [-v, z[k]]).reverse()];
  svg.append(element("path", { d: path.map(([a, b], k) => `${k ? "L" : "M"}${a} ${b}`).join("") + "Z", fill: "var(--grid)" }));
  const thick = 0.085 * look.size;
  for (const side of [1, -1]) {
    for (let k = 0; k + 1 < r.length; k += 1) {
      const share = ((c[k] + c[k + 1]) / 2 - look.low) / (look.high - look.low);
      svg.append(element("path", { d: `M${side * r[k]} ${z[k]}L${side * r[k + 1]} ${z[k + 1]}`, stroke: colorAt(look.colors, share), "stroke-width": thick, "stroke-linecap": "round" }));
    }
    if (!(look.fastest > 0)) continue;
    const arrows = 9;
    for (let n = 1; n < arrows; n += 1) {
      const k = Math.round((n * (r.length - 1)) / arrows);
      const [dr, dz] = [r[k + 1] - r[k - 1], z[k + 1] - z[k - 1]];
      const norm = Math.hypot(dr, dz);
      const length = (0.42 * look.size * u[k]) / look.fastest;
      if (Math.abs(length) < 0.03 * look.size) continue;
      const [tr, tz] = [dr / norm, dz / norm];
      const [nr, nz] = [-tz, tr];
      const out = nr * r[k] + nz * z[k] > 0 ? 1 : -1;
      const [ar, az] = [r[k] + out * nr * 0.13 * look.size, z[k] + out * nz * 0.13 * look.size];
      const [br, bz] = [ar + length * tr, az + length * tz];
      const sign = Math.sign(length);
      const head = 0.085 * look.size;
      const tip = [br, bz];
      const left = [br - sign * head * tr + 0.55 * head * nr, bz - sign * head * tz + 0.55 * head * nz];
      const right = [br - sign * head * tr - 0.55 * head * nr, bz - sign * head * tz - 0.55 * head * nz];
      svg.append(
        element("path", { d: `M${side * ar} ${az}L${side * (br - sign * 0.6 * head * tr)} ${bz - sign * 0.6 * head * tz}`, stroke: "var(--ink)", "stroke-width": 0.028 * look.size }),
        element("path", { d: `M${side * tip[0]} ${tip[1]}L${side * left[0]} ${left[1]}L${side * right[0]} ${right[1]}Z`, fill: "var(--ink)" }),
      );
    }
  }
  return svg;
}

// A path seen from one side, the latest place last, with a bar of its scale.
export function map(box, places, look) {
  if (places.length < 2) return box.replaceChildren();
  const [as, bs] = [places.map((p) => p[0]), places.map((p) => p[1])];
  const middle = [(Math.min(...as) + Math.max(...as)) / 2, (Math.min(...bs) + Math.max(...bs)) / 2];
  const half = Math.max(1, (Math.max(...as) - Math.min(...as)) / 2, (Math.max(...bs) - Math.min(...bs)) / 2) * 1.15;
  const svg = element("svg", { viewBox: "-50 -50 100 112" });
  const point = (p) => `${((50 * (p[0] - middle[0])) / half).toFixed(2)} ${((-50 * (p[1] - middle[1])) / half).toFixed(2)}`;
  const bar = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500].filter((b) => b <= 0.9 * half).pop() ?? 0.1;
  svg.append(
    element("rect", { x: -50, y: -50, width: 100, height: 112, rx: 4, fill: "var(--panel)", "fill-opacity": 0.7, stroke: "var(--line)" }),
    element("path", { d: places.map((p, k) => (k ? "L" : "M") + point(p)).join(""), fill: "none", stroke: "var(--unstable)", "stroke-width": 1.8 }),
    element("circle", { cx: point(places.at(-1)).split(" ")[0], cy: point(places.at(-1)).split(" ")[1], r: 3, fill: "var(--ink)" }),
    element("path", { d: `M-45 52h${(50 * bar) / half}`, stroke: "var(--ink)", "stroke-width": 1.6 }),
  );
  const label = element("text", { x: -45 + (50 * bar) / half + 4, y: 56 }, look(bar));
  label.style.fontSize = "10px";
  svg.append(label);
  box.replaceChildren(svg);
}
