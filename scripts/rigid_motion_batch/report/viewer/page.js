/* The page: which clip and choice of keys is shown, the list of modes, controls and keys of the keyboard. */
import { at, readChoice, readRecording } from "./data.js";
import { addressOf, clamp, fromAddress, short } from "./mathematics.js";
import { $, changed, id, ink, PAGE, paint, play, S, shown, UNITS } from "./state.js";
import { follow, newChoice, newPaths, openView, readColours, readOutLanes } from "./view.js";
import { cursor, seek, worst, zoom, zoomBy } from "./chart.js";

const all = (selector) => [...document.querySelectorAll(selector)], arrived = {};
let remembering = 0;
window.rigidMotionClip = (place, data) => arrived[place](data);

/* The data of a clip: in the page, or in a file beside it that a script element brings. */
const dataOf = (place, src = PAGE.clips[place].data) => new Promise((resolve, reject) => {
  if (!src) return resolve(JSON.parse($(`clip-${place}`).textContent));
  arrived[place] = resolve;
  const onerror = () => reject(new Error(`${src} is not beside this page`));
  return document.head.append(Object.assign(document.createElement("script"), { src, onerror }));
});

async function show({ clip, choice, t }) {
  const place = Math.max(0, PAGE.clips.findIndex(({ name }) => name === clip));
  if (S.clip?.name !== PAGE.clips[place].name) {
    const data = await dataOf(place);
    [S.recording, S.clip] = [await readRecording(data.recording), data];
  }
  S.choice = await readChoice(S.clip.choices.find(({ name }) => name === choice) ?? S.clip.choices[0], S.recording);
  for (const one of all("[name=clip]")) if (one.type === "radio") one.checked = +one.value === place; else one.value = place;
  for (const one of all("[name=choice]")) {
    one.checked = one.value === S.choice.name;
    one.disabled = !S.clip.choices.some(({ name }) => name === one.value);
  }
  [$("about").textContent, $("end").textContent] = [S.choice.about, ` / ${S.choice.end.toFixed(2)} s`];
  for (const one of all("[data-clip]"))
    one.hidden = one.dataset.clip !== `${place}` || (one.dataset.choice ?? S.choice.name) !== S.choice.name;
  zoom(S.choice.begin, S.choice.end);
  listModes();
  newChoice();
  if (t === undefined) return toWorst(0);
  seek(t);
  return follow(true, 0);
}

function listModes() {
  const least = short(Math.min(...S.choice.motions.map(({ rms }) => rms[S.measure])));
  $("modes").tBodies[0].replaceChildren(...S.choice.motions.map((motion, k) => {
    const row = $("mode").content.firstElementChild.cloneNode(true), find = (name) => row.querySelector(`.${name}`);
    const hot = (on) => { S.hot = on && !S.hidden.has(id(motion)) ? id(motion) : ""; changed("chart", "view"); };
    Object.assign(row, { onpointerenter: () => hot(true), onpointerleave: () => hot(false) });
    Object.assign(row.dataset, { mode: id(motion), number: k + 1 });
    row.style.setProperty("--c", `var(${ink(motion)})`);
    find("chip").lastChild.textContent = motion.name;
    find("chip").ariaPressed = !S.hidden.has(id(motion));
    find("chip").onclick = () => toggle(motion);
    find("also").textContent = motion.also.map((name) => `= ${name}`).join("\n");
    find("rms").textContent = short(motion.rms[S.measure]);
    find("rms").classList.toggle("best", short(motion.rms[S.measure]) === least);
    find("worst").textContent = short(worst(motion).value);
    find("worst").onclick = () => toWorst(undefined, [motion]);
    return row;
  }));
  $("unit").textContent = UNITS[S.measure];
  changed("chart");
}
function toggle(motion) {
  if (!S.hidden.delete(id(motion))) S.hidden.add(id(motion));
  $("modes").querySelector(`[data-mode="${id(motion)}"] .chip`).ariaPressed = !S.hidden.has(id(motion));
  newPaths();
  changed("chart");
}
function toWorst(ms, motions = shown()) {
  if (!motions.length) return;
  play(false);
  seek(motions.map(worst).reduce((a, b) => (b.value > a.value ? b : a)).t);
  if (S.t < S.low || S.t > S.high) zoom(S.t - (S.high - S.low) / 2, S.t + (S.high - S.low) / 2);
  follow(true, ms);
}
function toKey(way) {
  const keys = shown().flatMap((motion) => motion.keys).filter((t) => way * (t - S.t) > 1e-4);
  if (keys.length) seek(way > 0 ? Math.min(...keys) : Math.max(...keys));
}
function toSample(way) {
  const { times } = S.choice, [i, share] = at(times, S.t + 1e-6);
  seek(times[clamp(way > 0 ? i + 1 : share > 0.01 ? i : i - 1, 0, times.length - 1)]);
}
function magnify(factor) {
  [S.factor, S.automatic] = [clamp(+factor.toPrecision(2), 1, 1000), false];
  newPaths();
}

const ACTIONS = { play: () => play(), worst: () => toWorst(), last: () => toKey(-1), next: () => toKey(1),
  before: () => toSample(-1), after: () => toSample(1), begin: () => seek(S.choice.begin), end: () => seek(S.choice.end),
  in: () => zoomBy(0.6), out: () => zoomBy(1 / 0.6), all: () => zoom(S.choice.begin, S.choice.end),
  more: () => magnify(S.factor * 1.25), less: () => magnify(S.factor / 1.25), whole: () => follow(!S.follow),
  automatic: () => { S.automatic = true; newChoice(); } };
const KEYS = { " ": "play", w: "worst", ArrowLeft: "before", ArrowRight: "after", Home: "begin", End: "end", f: "whole",
  "+": "in", "-": "out", 0: "all", "]": "more", "[": "less" };
addEventListener("keydown", (event) => {
  const name = event.shiftKey && { ArrowLeft: "last", ArrowRight: "next" }[event.key] || KEYS[event.key];
  const chip = $("modes").querySelector(`[data-number="${event.key}"] .chip`), on = event.target;
  if (event.ctrlKey || event.metaKey || event.altKey || !(name || chip) || on.matches("input, select")
    || (event.key === " " && on.matches("button, a, summary")) || (/Home|End/.test(event.key) && on.tabIndex < 0)) return;
  event.preventDefault();
  if (name) ACTIONS[name](); else chip.click();
});
document.addEventListener("click", ({ target }) => ACTIONS[target.closest("[data-do]")?.dataset.do]?.());
document.addEventListener("change", ({ target: { name, value, type, checked } }) => {
  if (name === "clip") show({ clip: PAGE.clips[value].name, choice: S.choice.name });
  else if (name === "choice") show({ clip: S.clip.name, choice: value, t: S.t });
  else if (name === "follow") follow(checked);
  else if (name === "scope" || name === "column")
    for (const one of all("[data-scope]"))
      one.hidden = one.dataset.scope !== $("scope").value || (one.dataset.column ?? $("column").value) !== $("column").value;
  else if (name in S) {
    S[name] = type === "checkbox" ? checked : name === "speed" || name === "measure" ? +value : value;
    listModes();
    newPaths();
  }
});
$("factor").addEventListener("input", ({ target }) => magnify(10 ** (target.value / 50)));

paint("cursor", () => {
  cursor();
  readOutLanes();
  clearTimeout(remembering);
  remembering = setTimeout(() => !S.playing && history.replaceState(null, "", addressOf(S.clip.name, S.choice.name, S.t)), 300);
});
const addressed = () => (PAGE.clips.some(({ name }) => name === fromAddress(location.hash).clip) ? fromAddress(location.hash) : null);
addEventListener("hashchange", () => addressed() && show(addressed()));
new ResizeObserver(() => S.choice && (newPaths(), changed("chart", "view"))).observe($("view"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
addEventListener("beforeprint", () => all("details").forEach((one) => { one.open = true; }));
await openView();
readColours();
await show(addressed() ?? PAGE.start).catch((error) => { $("about").textContent = error.message; });
