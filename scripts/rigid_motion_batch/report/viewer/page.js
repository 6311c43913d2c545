/* The page: which clip and choice of keys is shown, the list of modes, controls and keys of the keyboard. */
import { at, readChoice, readRecording } from "./data.js";
import { addressOf, clamp, fromAddress, short } from "./mathematics.js";
import { $, changed, id, ink, PAGE, paint, play, S, shown, UNITS } from "./state.js";
import { follow, magnify, nameLanes, openView, readColours } from "./view.js";
import { cursor, seek, worst, zoom, zoomBy } from "./chart.js";

const all = (selector) => [...document.querySelectorAll(selector)], arrived = window.rigidMotionClips = {};
let remembering = 0, last = 0;

/* The data of a clip: in the page, or in a file beside it that a script element brings. */
const dataOf = (place, src = PAGE.clips[place].data) => new Promise((resolve, reject) => {
  if (!src) return resolve(JSON.parse($(`clip-${place}`).textContent));
  arrived[place] = resolve;
  const onerror = () => reject(new Error(`${src} is not beside this page`));
  return document.head.append(Object.assign(document.createElement("script"), { src, onerror }));
});

async function show({ clip, choice, t }) {
  const place = Math.max(0, PAGE.clips.findIndex(({ name }) => name === clip)), own = ++last, playing = S.playing;
  const data = S.clip?.name === PAGE.clips[place].name ? S.clip : await dataOf(place);
  const recording = data === S.clip ? S.recording : await readRecording(data.recording);
  const found = await readChoice(data.choices.find(({ name }) => name === choice) ?? data.choices[0], recording);
  if (own !== last) return; // something else has been asked for since
  Object.assign(S, { clip: data, recording, choice: found });
  for (const one of all("[name=clip]"))
    if (one.type === "radio") one.checked = +one.value === place; else one.value = place;
  for (const one of all("[name=choice]")) {
    one.checked = one.value === found.name;
    one.disabled = !data.choices.some(({ name }) => name === one.value);
  }
  [$("about").textContent, $("end").textContent] = [found.about, ` / ${found.end.toFixed(2)} s`];
  for (const one of all("[data-clip]"))
    one.hidden = +one.dataset.clip !== place || (one.dataset.choice ?? found.name) !== found.name;
  zoom(found.begin, found.end);
  listModes();
  magnify(S.automatic ? found.factor : S.factor, S.automatic);
  if (t === undefined) toWorst(true); else [seek(t), follow(true, true)];
  if (PAGE.plays) play(playing);
}

function listModes() {
  const least = short(Math.min(...S.choice.motions.map(({ rms }) => rms[S.measure])));
  $("modes").tBodies[0].replaceChildren(...S.choice.motions.map((motion) => {
    const row = $("mode").content.firstElementChild.cloneNode(true), find = (name) => row.querySelector(`.${name}`);
    const hot = (mode) => { S.hot = S.hidden.has(mode) ? "" : mode; changed("chart", "view"); };
    Object.assign(row, { onpointerenter: () => hot(id(motion)), onpointerleave: () => hot("") });
    row.style.setProperty("--c", `var(${ink(motion)})`);
    find("chip").lastChild.textContent = motion.name;
    find("chip").ariaPressed = !S.hidden.has(id(motion));
    find("chip").onclick = () => {
      if (!S.hidden.delete(id(motion))) S.hidden.add(id(motion));
      find("chip").ariaPressed = !S.hidden.has(id(motion));
      magnify(S.factor, S.automatic);
      changed("chart");
    };
    find("also").textContent = motion.also.map((name) => `= ${name}`).join("\n");
    [find("rms").textContent, find("worst").textContent] = [motion.rms[S.measure], worst(motion).value].map(short);
    find("rms").classList.toggle("best", find("rms").textContent === least);
    find("worst").onclick = () => toWorst(undefined, [motion]);
    return row;
  }));
  [$("unit").textContent, S.hot] = [UNITS[S.measure], ""];
  changed("chart");
}
function toWorst(at_once, motions = shown()) {
  if (!motions.length) return;
  play(false);
  seek(motions.map(worst).reduce((a, b) => (b.value > a.value ? b : a)).t);
  if (S.t < S.low || S.t > S.high) zoom(S.t - (S.high - S.low) / 2, S.t + (S.high - S.low) / 2);
  follow(true, at_once);
}
function toKey(way) {
  const keys = shown().flatMap((motion) => motion.keys).filter((t) => way * (t - S.t) > 1e-4);
  if (keys.length) seek(way > 0 ? Math.min(...keys) : Math.max(...keys));
}
const toSample = (way, { times } = S.choice) => seek(times[clamp(at(times, S.t + 1e-6)[0] + way, 0, times.length - 1)]);

const ACTIONS = { play: () => play(), worst: () => toWorst(), last: () => toKey(-1), next: () => toKey(1),
  before: () => toSample(-1), after: () => toSample(1), begin: () => seek(-Infinity), end: () => seek(Infinity),
  in: () => zoomBy(0.6), out: () => zoomBy(1 / 0.6), all: () => zoom(S.choice.begin, S.choice.end),
  whole: () => follow(!S.follow), automatic: () => magnify(S.choice.factor, true) };
const KEYS = { " ": "play", w: "worst", ArrowLeft: "before", ArrowRight: "after", Home: "begin", End: "end", f: "whole",
  "+": "in", "-": "out", 0: "all" };
addEventListener("keydown", (event) => {
  const { key, target, shiftKey } = event, chip = $("modes").tBodies[0].rows[key - 1]?.querySelector(".chip");
  const name = (shiftKey && { ArrowLeft: "last", ArrowRight: "next" }[key]) || KEYS[key];
  if (event.ctrlKey || event.metaKey || event.altKey || !(name || chip) || target.matches("input, select")
    || (key === " " && target.matches("button, a, summary")) || (/Home|End/.test(key) && target.tabIndex < 0)) return;
  event.preventDefault();
  if (name) ACTIONS[name](); else chip.click();
});
document.addEventListener("click", ({ target }) => ACTIONS[target.closest("[data-do]")?.dataset.do]?.());
document.addEventListener("change", ({ target: { name, value, type, checked } }) => {
  if (name === "clip") show({ clip: PAGE.clips[value].name, choice: S.choice.name });
  else if (name === "choice") show({ clip: S.clip.name, choice: value, t: S.t });
  else if (name === "follow") follow(checked);
  else if (name === "scope" || name === "column") {
    const [scope, column] = [$("scope").value, $("column").value];
    for (const one of all("[data-scope]"))
      one.hidden = one.dataset.scope !== scope || (one.dataset.column ?? column) !== column;
  } else if (name in S) {
    S[name] = type === "checkbox" ? checked : name === "speed" || name === "measure" ? +value : value;
    listModes();
    magnify(S.factor, S.automatic);
  }
});
$("factor").addEventListener("input", ({ target }) => magnify(+(10 ** (target.value / 50)).toPrecision(2)));

paint("cursor", () => {
  cursor();
  nameLanes();
  clearTimeout(remembering);
  const address = addressOf(S.clip.name, S.choice.name, S.t);
  remembering = setTimeout(() => S.playing || history.replaceState(null, "", address), 300);
});
const fromHere = (asked = fromAddress(location.hash)) => PAGE.clips.some(({ name }) => name === asked.clip) && asked;
addEventListener("hashchange", () => fromHere() && show(fromHere()));
new ResizeObserver(() => S.choice && (magnify(S.factor, S.automatic), changed("chart"))).observe($("view"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
addEventListener("beforeprint", () => all("details").forEach((one) => { one.open = true; }));
await openView();
readColours();
await show(fromHere() || PAGE.start).catch((error) => { $("about").textContent = error.message; });
if (PAGE.plays && !matchMedia("(prefers-reduced-motion: reduce)").matches) play(true);
