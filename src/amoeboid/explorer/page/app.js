// The page: parameters on one side, what follows from them on the other.

import { colorAt, map, outline, plot, shown, titled, unitText } from "amoeboid/plots";
import { Server, Stored } from "amoeboid/sources";

const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const isLive = data.mode === "live";

const NAMES = {
  v_p0: "v_p0", D: "D", delta_P: "\u0394P", c0: "c\u2080", beta: "\u03b2", eta_b: "\u03b7_b", alpha: "\u03b1",
  gamma_t: "\u03b3_t", gamma_n: "\u03b3_n", gamma_c: "\u03b3_c", gamma_share: "share of \u03b3 \u221d c", kappa: "\u03ba", chi: "\u03c7",
  max_retrograde_speed: "retrograde speed", cortex_drag_speed: "migration speed",
  polarity: "polarity", c_front: "c at the front", c_rear: "c at the rear", zeta0: "membrane tension \u03b6\u2080",
  deformation: "deformation",
};
const STARTS = {
  noise: "from noise", polarization: "from a polarized sphere", turned: "from one that is poked from the side", elongated: "from an elongated cell",
  surface: "from a surface in a file\u2026",
};
const named = (name) => NAMES[name] ?? name;

const state = { units: "simulation", values: {}, vary: "v_p0", observable: "max_retrograde_speed", preset: null, number: 0 };
const known = { theory: null, branch: null, states: null };
let view = null; // of the living cell

const make = (name, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
};

// ---- parameters

const sliders = () => (isLive ? data.sliders[state.units] : data.sliders[state.units].filter((s) => data.values[s.name])
  .map((s) => ({ ...s, steps: data.values[s.name] })));
const STEPS = 1000;
const FIRST_SEED = 4;

function positionOf(slider, value) {
  if (slider.steps) return slider.steps.reduce((best, v, k) => (Math.abs(v - value) < Math.abs(slider.steps[best] - value) ? k : best), 0);
  const { low, high, logarithmic } = slider;
  const share = logarithmic ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.round(STEPS * Math.max(0, Math.min(1, share)));
}

function valueAt(slider, position) {
  if (slider.steps) return slider.steps[position];
  const { low, high, logarithmic } = slider;
  const share = position / STEPS;
  return Number((logarithmic ? low * (high / low) ** share : low + share * (high - low)).toPrecision(3));
}

function buildSliders() {
  const rows = sliders().map((slider) => {
    const id = `p-${slider.name}`;
    const range = make("input", { type: "range", id, min: 0, max: slider.steps ? slider.steps.length - 1 : STEPS, step: 1 });
    const text = make("input", { type: "text", id: `${id}-text`, inputMode: "decimal", spellcheck: false, readOnly: !isLive });
    text.setAttribute("aria-label", `${slider.name}, ${slider.meaning}, in ${slider.unit || "numbers"}`);
    const wrong = make("p", { className: "wrong", id: `${id}-wrong`, hidden: true });
    wrong.setAttribute("role", "alert");
    for (const input of [range, text]) input.setAttribute("aria-describedby", `${wrong.id} ${id}-meaning`);
    const show = () => {
      const value = state.values[slider.name];
      range.value = positionOf(slider, Number(value));
      text.value = typeof value === "number" ? shown(value, 5).replace("\u2212", "-") : value;
      range.setAttribute("aria-valuetext", `${text.value} ${slider.unit}`);
    };
    range.addEventListener("input", () => { state.values[slider.name] = valueAt(slider, Number(range.value)); show(); changed(); });
    text.addEventListener("change", () => {
      const typed = text.value.trim().replace("\u2212", "-");
      state.values[slider.name] = typed !== "" && Number.isFinite(Number(typed)) ? Number(typed) : typed;
      if (typeof state.values[slider.name] === "number") show();
      changed();
    });
    show();
    const name = make("div", { className: "name" }, make("label", { htmlFor: id, textContent: named(slider.name) }), text,
      make("span", { className: "unit", textContent: unitText(slider.unit) }));
    const meaning = make("small", { id: `${id}-meaning`, textContent: slider.meaning });
    return make("div", { className: "field" }, name, meaning, range, wrong);
  });
  const rare = sliders().map((slider) => Boolean(slider.rare));
  const often = rows.filter((_, k) => !rare[k]);
  const further = rows.filter((_, k) => rare[k]);
  if (isLive) {
    often.push(relationField("law", "Law v_p(c)", "exponential, inverse, or an expression in c", ["exponential", "inverse", "v_p0/(1 + (c/c_r)**2)"]));
    further.push(relationField("stress", "Active stress \u03c4(c)", "none, or an expression in c", ["none", "0.2*c/(1 + c/c_r)"]));
  }
  const inUse = sliders().some((slider) => slider.rare && Number(state.values[slider.name]) !== 0);
  const more = make("details", { id: "rare", open: inUse || Boolean($("rare")?.open) }, make("summary", { textContent: "Further parameters" }), ...further);
  $("sliders").replaceChildren(...often, ...(further.length ? [more] : []));
}

function relationField(name, title, meaning, examples) {
  const text = make("input", { type: "text", id: `p-${name}-text`, value: state.values[name] ?? examples[0], spellcheck: false });
  text.setAttribute("list", `${name}-examples`);
  text.setAttribute("aria-describedby", `p-${name}-wrong p-${name}-meaning`);
  text.addEventListener("change", () => { state.values[name] = text.value.trim(); begin(); changed(); });
  const list = make("datalist", { id: `${name}-examples` }, ...examples.map((value) => make("option", { value })));
  const wrong = make("p", { className: "wrong", id: `p-${name}-wrong`, hidden: true });
  wrong.setAttribute("role", "alert");
  return make("div", { className: "field law" }, make("label", { htmlFor: text.id, textContent: title }),
    make("small", { id: `p-${name}-meaning`, textContent: meaning }), text, list, wrong);
}

function point() {
  const names = isLive ? [...sliders().map((s) => s.name), "law", "stress"] : Object.keys(state.values);
  const values = Object.fromEntries(names.filter((n) => state.values[n] !== undefined).map((n) => [n, state.values[n]]));
  return { units: state.units, values };
}

let waiting = null;
function changed() {
  drawBranch();
  clearTimeout(waiting);
  waiting = setTimeout(() => {
    clearRefusals();
    ask();
    if (isLive) source.live({ do: "change", ...point() });
  }, 40);
}

function ask() {
  $("busy").textContent = "computing\u2026";
  state.number = source.ask({ ...point(), vary: state.vary });
}

// the first cell is the same each time, those after it are not
function begin(seed = Math.floor(Math.random() * 2 ** 31)) {
  if (!isLive) return;
  view?.restart();
  source.live({ do: "begin", ...point(), start: $("start").value, seed });
  if (!live.moves) source.live({ do: "pause", value: true });
}

// what the user starts may move, also where the system asks for less motion
function beginByHand() {
  live.moves = true;
  begin();
}

function choosePreset(preset, start = true) {
  Object.assign(state, { preset, units: preset.units, values: { ...preset.values } });
  $("preset").value = preset.name;
  $("note").textContent = isLive ? preset.note : `${preset.title}. ${preset.note}`;
  for (const radio of document.getElementsByName("units")) radio.checked = radio.value === state.units;
  if (isLive) {
    $("start").value = preset.start;
    $("pace").value = preset.pace;
  }
  $("surface").hidden = true;
  clearRefusals();
  buildSliders();
  if (start) { ask(); begin(); if (isLive) setPace(); }
}

function buildHeader() {
  $("preset").replaceChildren(...data.presets.map((p) => make("option", { value: p.name, textContent: p.title })));
  $("preset").closest("label").hidden = data.presets.length < 2;
  $("preset").addEventListener("change", () => choosePreset(data.presets.find((p) => p.name === $("preset").value)));
  const fields = ["simulation", "physical"].map((value) => {
    const radio = make("input", { type: "radio", name: "units", value });
    radio.addEventListener("change", () => choosePreset(data.presets.find((p) => p.units === value)));
    return make("label", {}, radio, ` ${value} units`);
  });
  $("units").append(...fields);
  $("units").hidden = !isLive;
  const dark = (on) => {
    document.documentElement.classList.toggle("dark", on);
    $("theme").setAttribute("aria-pressed", String(on));
    view?.dark(on);
  };
  const wanted = matchMedia("(prefers-color-scheme: dark)");
  wanted.addEventListener("change", () => dark(wanted.matches));
  $("theme").addEventListener("click", () => dark(!document.documentElement.classList.contains("dark")));
  dark(wanted.matches);
}

// ---- refusals, shown beside the field

function clearRefusals() {
  for (const wrong of document.querySelectorAll(".wrong")) wrong.hidden = true;
  for (const input of document.querySelectorAll("[aria-invalid]")) input.removeAttribute("aria-invalid");
}

function refuse({ field, message }) {
  const wrong = $(`p-${field}-wrong`);
  $("busy").textContent = "";
  if (!wrong) {
    $("saved").textContent = message;
    if (!isLive || field !== "save") $("sentences").replaceChildren(make("p", { textContent: message }));
    return;
  }
  wrong.textContent = message;
  wrong.hidden = false;
  const folded = wrong.closest("details");
  if (folded) folded.open = true;
  $(`p-${field}-text`).setAttribute("aria-invalid", "true");
}

// ---- answers

function showTheory(theory) {
  known.theory = theory;
  sentences(theory.verdict);
  const numbers = theory.numbers.map(({ title, text }) => make("div", {}, make("dt", { textContent: title }), make("dd", { textContent: text })));
  const notes = theory.notes.map((textContent) => make("p", { className: "caption", textContent }));
  $("numbers").replaceChildren(make("dl", {}, ...numbers), ...notes, make("p", { className: "caption", textContent: theory.description }));
  const ls = theory.rates.map((r) => r.l);
  const marks = theory.rates.flatMap(({ l, rate, slow }) => {
    const color = slow > 0 ? "var(--unstable)" : "var(--stable)";
    const title = `l = ${l}: ${shown(slow)} at this pressure, ${shown(rate)} at infinite pressure`;
    return [{ x: l, y: slow, color, kind: "stem", title }, { x: l, y: slow, color, kind: "dot", title, label: shown(slow, 2) }];
  });
  plot($("rates"), {
    about: `Growth rates of the modes l = 1 to ${ls.length}: ${theory.rates.map((r) => shown(r.slow)).join(", ")}`,
    lines: [], marks, include: [0], margin: 0.3, x: [0.4, ls.length + 0.6], xTicks: ls.map((l) => [l, String(l)]),
    xTitle: "mode l", yTitle: titled("growth rate \u03bb", theory.rate_unit),
  });
}

function sentences(lines) {
  const texts = lines.map((line) => line.replace(/(?<=^|[\s(])-(?=\d)/g, "\u2212"));
  const same = $("sentences").textContent === texts.join("");
  if (!same) $("sentences").replaceChildren(...texts.map((textContent) => make("p", { textContent })));
}

function drawBranch() {
  const branch = known.branch;
  if (!branch) return;
  if (!branch.curves.length) {
    $("branch").replaceChildren();
    $("branch-text").textContent = branch.problems.join(" ");
    return;
  }
  const o = state.observable;
  const line = (x, y, stable, width) => ({ x, y, color: stable ? "var(--stable)" : "var(--unstable)", dash: !stable, width });
  const lines = [];
  const { sphere } = branch;
  for (let k = 0; k + 1 < sphere.x.length; ) {
    let end = k + 1;
    while (end + 1 < sphere.x.length && sphere.stable[end] === sphere.stable[k]) end += 1;
    lines.push(line(sphere.x.slice(k, end + 1), sphere.y[o].slice(k, end + 1), sphere.stable[k]));
    k = end;
  }
  lines.push(...branch.curves.map((c) => line(c.x, c.y[o], c.stable)));
  const here = Number(state.values[branch.name]);
  const marks = branch.folds.map((f) => ({ x: f.x, y: f.y[o], color: "var(--ink)", kind: "fold", title: `fold at ${shown(f.x, 6)}` }));
  marks.push(...branch.bifurcations.map((b) => ({ x: b.x, y: b.y[o], color: "var(--ink)", hollow: true, r: 4, title: `${b.kind}, m = ${b.m}, at ${shown(b.x, 6)}` })));
  const at = known.states?.value === here ? known.states.states : [];
  marks.push(...at.map((s) => ({ x: here, y: s.numbers[o], color: "var(--here)", hollow: !s.stable, title: `${s.rest ? "at rest" : "polarized"}, ${s.stable ? "stable" : "unstable"}` })));
  plot($("branch"), {
    about: `${branch.text}. ${at.length} steady states at ${named(branch.name)} = ${shown(here)}.`,
    lines, marks, rule: Number.isFinite(here) ? here : null, x: branch.window, include: o === "zeta0" ? [] : [0],
    xTitle: titled(named(branch.name), branch.unit), yTitle: titled(named(o), branch.observables.find((b) => b.name === o).unit),
  });
  $("branch-text").textContent = [branch.text.replace(/^Branch in [^:]*: /, ""), ...branch.problems].join(". ");
}

const ENVIRONMENTS = {
  fluid: "in a fluid", matrix: "in a matrix", "patch:30": "on a substrate", "channel:30": "in a channel", cortex: "all drag on the cortex",
};

function showMigration(all, units) {
  const moving = all.filter((s) => !s.rest);
  const head = make("tr", {}, make("th", { scope: "col", textContent: `migration speed [${unitText(units.u)}]` }),
    ...moving.map((s) => make("th", { scope: "col", className: s.stable ? "stable" : "unstable", textContent: s.stable ? "stable" : "unstable" })));
  const rows = Object.entries(ENVIRONMENTS).map(([name, words]) => make("tr", {}, make("th", { scope: "row", textContent: words }),
    ...moving.map((s) => make("td", { textContent: s.migration[name] === null ? "\u2013" : shown(s.migration[name], 3) }))));
  $("migration").hidden = moving.length === 0;
  $("migration").replaceChildren(make("thead", {}, head), make("tbody", {}, ...rows));
}

function fastestOf(rates) {
  const m = rates.reduce((best, [re], k) => (re > rates[best][0] ? k : best), 0);
  const [re, im] = rates[m];
  return `${shown(re, 3)}${Math.abs(im) > 1e-9 ? ` \u00b1 ${shown(Math.abs(im), 3)}i` : ""}, m = ${m}`;
}

function showStates(answer) {
  known.states = answer;
  if (answer.verdict) sentences(answer.verdict);
  drawBranch();
  const all = answer.states;
  const every = (name) => all.flatMap((s) => s[name]);
  let [low, high] = [Math.min(...every("c")), Math.max(...every("c"))];
  if (high - low < 0.05 * high) [low, high] = [low - 0.025 * high, high + 0.025 * high];
  const fastest = Math.max(...every("u").map(Math.abs));
  const size = Math.max(...every("z").map(Math.abs), ...every("r"));
  const kind = (s) => (s.rest ? "at rest" : "polarized");
  $("outlines").replaceChildren(...all.map((s) => {
    const about = `${kind(s)}, ${s.stable ? "stable" : "unstable"}; flow ${s.texts.max_retrograde_speed}, c from ${s.texts.c_front} to ${s.texts.c_rear}`;
    const svg = outline(s, { size, low, high, fastest: s.rest ? 0 : fastest, colors: data.colors, about });
    const word = make("b", { textContent: s.stable ? "stable" : "unstable", className: s.stable ? "stable" : "unstable" });
    return make("figure", {}, svg, make("figcaption", {}, `${kind(s)}, `, word));
  }));
  const columns = ["max_retrograde_speed", "c_front", "c_rear", "deformation"];
  const short = { max_retrograde_speed: "flow", c_front: "c front", c_rear: "c rear", deformation: "deform." };
  const head = make("tr", {}, make("th", { textContent: "state", scope: "col" }),
    ...columns.map((c) => make("th", { scope: "col", title: named(c), textContent: short[c] })),
    make("th", { textContent: "rate", scope: "col", title: "growth rate of the fastest growing or slowest decaying perturbation exp(i m phi), and its m" }));
  const number = (v) => shown(v, 3);
  const rows = all.map((s) => make("tr", {}, make("th", { scope: "row", className: s.stable ? "stable" : "unstable", textContent: kind(s), title: s.stable ? "stable" : "unstable" }),
    ...columns.map((c) => make("td", { textContent: number(s.numbers[c]) })),
    make("td", { textContent: fastestOf(s.rates) })));
  showMigration(all, answer.units);
  const units = answer.units.max_retrograde_speed ? make("caption", { className: "caption", textContent: `Flow [${unitText(answer.units.max_retrograde_speed)}], c [${unitText(answer.units.c)}]; rate of growth [${unitText(answer.units.rate)}] of the fastest growing or slowest decaying perturbation, and its m` }) : "";
  $("state-table").replaceChildren(units, make("thead", {}, head), make("tbody", {}, ...rows));
  $("state-table").caption?.style.setProperty("caption-side", "bottom");
  const lines = (name) => all.map((s) => ({ x: s.r.map((r, k) => Math.atan2(r, s.z[k])), y: s[name], color: s.stable ? "var(--stable)" : "var(--unstable)", dash: !s.stable }));
  const axis = { x: [0, Math.PI], xTicks: [[0, "rear"], [Math.PI / 4, "\u03c0/4"], [Math.PI / 2, "\u03b8 = \u03c0/2"], [(3 * Math.PI) / 4, "3\u03c0/4"], [Math.PI, "front"]], xTitle: "" };
  plot($("profile-u"), { ...axis, lines: lines("u"), include: [0], yTitle: titled("u(\u03b8)", answer.units.u), about: "Flow u over the angle theta from the rear; negative is towards the rear" });
  plot($("profile-c"), { ...axis, lines: lines("c"), include: [0], yTitle: titled("c(\u03b8)", answer.units.c), about: "Filament concentration c over the angle theta from the rear" });
}

// ---- the living cell

let limits = null;
let mapped = 0;
function showFrame(frame) {
  const { c } = frame.fields;
  let [low, high] = [Infinity, -Infinity];
  for (const v of c) { low = Math.min(low, v); high = Math.max(high, v); }
  const middle = (low + high) / 2;
  const least = 0.1 * Math.max(middle, 1e-12);
  if (high - low < least) [low, high] = [middle - least / 2, middle + least / 2];
  limits = limits ? [limits[0] + 0.2 * (low - limits[0]), limits[1] + 0.2 * (high - limits[1])] : [low, high];
  if (view) {
    view.still = frame.polarity < 0.02;
    view.show(frame, limits);
  }
  const now = performance.now();
  live.frames += 1;
  if (now - mapped < 200 && frame.paused === live.latest?.paused && !frame.problem) return;
  mapped = now;
  if (view) map($("map"), view.seen(), (bar) => `${shown(bar)} R0`);
  $("clock").textContent = [`t = ${unitText(frame.time)}`, frame.steady, frame.paused ? "paused" : ""].filter(Boolean).join(", ");
  $("low").textContent = shown(limits[0], 3);
  $("high").textContent = `${shown(limits[1], 3)} ${unitText(frame.unit)}`;
  if (frame.observables) live.observables = frame.observables;
  const entries = Object.entries(live.observables).map(([name, text]) => make("div", {}, make("dt", { textContent: named(name) }), make("dd", { textContent: unitText(text) })));
  $("observables").replaceChildren(...entries);
  $("cell").setAttribute("aria-label", `The cell at t = ${frame.time}: polarity ${shown(frame.polarity, 2)}, retrograde speed ${live.observables.max_retrograde_speed}`);
  $("pause").textContent = frame.paused ? "Go on" : "Pause";
  $("lost").hidden = !frame.problem;
  if (frame.problem) $("lost").textContent = `${frame.problem} Restart the cell.`;
  live.latest = frame;
}

const live = { moves: !matchMedia("(prefers-reduced-motion: reduce)").matches, frames: 0, begun: 0, failed: false, latest: null, observables: {} };

async function buildLive() {
  $("live").hidden = false;
  $("ramp").style.background = `linear-gradient(to right, ${data.colors.join(", ")})`;
  $("start").append(...data.starts.map((value) => make("option", { value, textContent: STARTS[value] })));
  $("start").addEventListener("change", () => {
    $("surface").hidden = $("start").value !== "surface";
    if ($("start").value === "surface") $("surface").click();
    else beginByHand();
  });
  $("surface").addEventListener("change", () => { if ($("surface").files[0]) source.surface($("surface").files[0]); });
  $("restart").addEventListener("click", beginByHand);
  $("pause").addEventListener("click", () => {
    live.moves ||= Boolean(live.latest?.paused);
    source.live({ do: "pause", value: !live.latest?.paused });
  });
  $("pace").addEventListener("input", setPace);
  $("strength").addEventListener("input", () => {
    const value = Number($("strength").value);
    $("strength-value").textContent = (value < 0 ? "\u2212" : "+") + Math.abs(value).toFixed(1);
  });
  for (const button of document.querySelectorAll("[data-poke]")) {
    button.addEventListener("click", () => view?.pokeAt(view.inside(...button.dataset.poke.split(",").map(Number))));
  }
  $("save").addEventListener("click", () => { $("saved").textContent = "saving\u2026"; source.live({ do: "save" }); });
  $("movie").addEventListener("click", () => { $("saved").textContent = "saving\u2026"; source.live({ do: "save", movie: true }); });
  $("lines").addEventListener("click", () => source.live({ do: "lines" }));
  $("copy").addEventListener("click", () => navigator.clipboard.writeText($("dialog-text").textContent));
  $("close").addEventListener("click", () => $("dialog").close());
  try {
    const { CellView } = await import("amoeboid/cell");
    view = new CellView($("cell"), { colors: data.colors, poke: (direction) => source.live({ do: "poke", direction, strength: Number($("strength").value) }) });
    view.dark(document.documentElement.classList.contains("dark"));
    source.live({ do: "all" });
  } catch (error) {
    $("lost").hidden = false;
    $("lost").textContent = `This browser cannot draw the cell (${error.message}): its numbers are below.`;
  }
}

function setPace() {
  const value = 2 ** (Number($("pace").value) / 2);
  source.live({ do: "pace", value });
  $("pace-value").textContent = `\u00d7${shown(value, 2)}`;
  $("pace").setAttribute("aria-valuetext", `${shown(value, 2)} times`);
}

// ---- messages

const receivers = {
  opened() {
    live.failed = false;
    ask();
    begin(FIRST_SEED);
    if (isLive) setPace();
  },
  closed() {
    if (live.failed) return; // why is said already
    $("connection").hidden = false;
    $("connection").textContent = "The server does not answer. If it has ended, start `amoeboid explore` again and open its new address.";
  },
  theory(theory) { $("connection").hidden = true; showTheory(theory); },
  branch(branch) { known.branch = branch; drawBranch(); },
  states(states) { showStates(states); $("busy").textContent = ""; },
  refused: refuse,
  frame: showFrame,
  begun() { $("connection").hidden = true; limits = null; view?.restart(); live.latest = null; live.begun += 1; },
  surface() { begin(); },
  saving({ share }) { $("saved").textContent = `saving, ${Math.round(100 * share)} %`; },
  saved({ folder }) { $("saved").textContent = `saved in ${folder}`; },
  lines({ text }) { $("dialog-text").textContent = text; $("dialog").showModal(); },
  failed({ message }) { live.failed = true; $("busy").textContent = ""; $("connection").hidden = false; $("connection").textContent = message; },
};

function receive(message) {
  if (message.number && message.number < state.number && message.kind !== "refused") return; // of an older point
  receivers[message.kind]?.(message);
}

document.documentElement.classList.add(data.mode === "live" ? "live" : "file");
buildHeader();
$("observable").append(...["max_retrograde_speed", "cortex_drag_speed", "polarity", "c_front", "c_rear", "zeta0", "deformation"].map((value) => make("option", { value, textContent: named(value) })));
$("observable").addEventListener("change", () => { state.observable = $("observable").value; drawBranch(); });
$("vary").append(...data.sliders.simulation.map((s) => make("option", { value: s.name, textContent: named(s.name) })));
$("vary").addEventListener("change", () => { state.vary = $("vary").value; known.branch = null; $("branch").replaceChildren(); ask(); });
$("vary-label").hidden = !isLive;
choosePreset(isLive ? data.presets[0] : data.preset, false);
const source = isLive ? new Server(receive) : new Stored(receive, data);
if (isLive) buildLive();

let resizing = null;
new ResizeObserver(() => {
  clearTimeout(resizing);
  resizing = setTimeout(() => { if (known.theory) showTheory(known.theory); if (known.states) showStates(known.states); else drawBranch(); }, 120);
}).observe(document.querySelector("main"));

globalThis.explorer = { state, known, live, colorAt }; // for tests, and for those who look behind the page
