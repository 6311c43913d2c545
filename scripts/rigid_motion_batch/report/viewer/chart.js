/* The chart: the error over time under each mode, their keys, and the moment that the view shows. */
import { at, highest, polyline, valueAt } from "./data.js";
import { clamp, short, ticks } from "./mathematics.js";
import { $, changed, id, ink, paint, play, S, shown } from "./state.js";
import { pointers, wheel } from "./pointers.js";

const plot = $("plot"), LEFT = 44, RIGHT = 10, TOP = 10, ROW = 8;
let base = 0, tallest = 1, dragged = false;
const inside = () => plot.clientWidth - LEFT - RIGHT;
const xAt = (t) => LEFT + ((t - S.low) / (S.high - S.low)) * inside();
const timeAt = (x) => clamp(S.low + ((x - LEFT) / inside()) * (S.high - S.low), S.low, S.high);
const element = (name, attributes, text = "") =>
  `<${name}${Object.entries(attributes).map(([key, value]) => ` ${key}="${value}"`).join("")}>${text}</${name}>`;
const label = (x, y, anchor, text) => element("text", { x, y, "text-anchor": anchor }, text);

/* The largest error of a motion: when, and how much. */
export function worst({ errors }) {
  const i = highest(errors[S.measure]);
  return { t: S.choice.times[i], value: errors[S.measure][i] };
}

paint("chart", () => {
  const { times, keyed, motions } = S.choice, all = shown();
  const rows = keyed ? all.filter(({ keys }) => keys.length) : motions.slice(0, 1);
  const [width, height] = [plot.clientWidth, plot.clientHeight], first = at(times, S.low)[0];
  const last = Math.min(at(times, S.high)[0] + 1, times.length - 1);
  const lines = all.map(({ errors }) => polyline(errors[S.measure], first, last, inside()));
  const top = 1.06 * Math.max(1e-6, ...lines.map((points) => points.reduce((most, [, v]) => Math.max(most, v), 0)));
  const y = (value) => base - (value / top) * (base - TOP), along = ticks(S.low, S.high, width / 90);
  base = height - 27 - ROW * rows.length;
  tallest = Math.max(1e-9, ...all.map((motion) => worst(motion).value));
  let drawn = `<clipPath id="inside"><rect x="${LEFT}" width="${inside()}" height="${height}"/></clipPath>`
    + label(LEFT - 7, base + ROW + 5, "end", "keys");
  for (const [v, text] of ticks(0, top, 6))
    drawn += element("line", { class: v ? "grid" : "axis", x1: LEFT, x2: width - RIGHT, y1: y(v), y2: y(v) })
      + label(LEFT - 7, y(v) + (v ? 4 : 1), "end", text);
  for (const [t, text] of along)
    drawn += label(Math.min(xAt(t), width - 20), height - 3, "middle", t === along.at(-1)[0] ? `${text} s` : text);
  drawn += `<g clip-path="url(#inside)">`;
  for (const { from, to } of S.clip.warnings.filter((one) => one.from !== null))
    drawn += element("rect", { class: "doubt", x: xAt(from), y: TOP, width: Math.max(2, xAt(to ?? from) - xAt(from)),
      height: base - TOP });
  rows.forEach((motion, row) => {
    const places = new Set(motion.keys.filter((t) => t >= S.low && t <= S.high).map((t) => Math.round(xAt(t))));
    const d = [...places].map((x) => `M${x} ${base + 4 + ROW * row}v${ROW - 2}`).join("");
    drawn += element("path", { class: "key", d, stroke: keyed ? `var(${ink(motion)})` : "var(--soft)" });
  });
  all.forEach((motion, k) => {
    const { t, value } = worst(motion), stroke = `var(${ink(motion)})`;
    const d = `M${lines[k].map(([i, v]) => `${xAt(times[i]).toFixed(1)} ${y(v).toFixed(1)}`).join("L")}`;
    drawn += element("path", { class: `line${S.hot ? (S.hot === id(motion) ? " hot" : " dim") : ""}`, d, stroke,
      ...(k === 2 && { "stroke-dasharray": "5 3" }) });
    drawn += element("circle", { cx: xAt(t), cy: y(value), r: 3.5, stroke });
  });
  plot.innerHTML = `${drawn}</g><g id="cursor"></g>`;
  changed("cursor");
});

export function cursor() {
  const x = xAt(S.t), said = shown().map((motion) => [motion, valueAt(S.choice.times, motion.errors[S.measure], S.t)]);
  if (S.playing && (S.t < S.low || S.t > S.high)) zoom(S.t, S.t + S.high - S.low);
  $("cursor").innerHTML = S.t < S.low || S.t > S.high ? "" : `<path d="M${x - 5} 0h10v5l-5 5-5-5z"/>`
    + element("line", { class: "now", x1: x, x2: x, y1: TOP - 4, y2: base + 5 });
  [plot.ariaValueMin, plot.ariaValueNow, plot.ariaValueMax] = [S.choice.begin, S.t, S.choice.end];
  $("now").textContent = S.t.toFixed(2);
  plot.ariaValueText = `${S.t.toFixed(2)} s; ${said.map(([{ name }, value]) => `${name} ${short(value)}`).join(", ")}`;
  for (const [motion, value] of said) {
    const row = $("modes").tBodies[0].rows[S.choice.motions.indexOf(motion)];
    row.querySelector(".live").textContent = short(value);
    row.style.setProperty("--share", value / tallest);
  }
}

export function seek(t) {
  S.t = clamp(t, S.choice.begin, S.choice.end);
  changed("view", "cursor");
}
export function zoom(from, to) {
  const { begin, end } = S.choice, span = clamp(to - from, Math.min(0.1, end - begin), end - begin);
  S.low = clamp(from, begin, end - span);
  S.high = S.low + span;
  changed("chart");
}
export const zoomBy = (share, t = clamp(S.t, S.low, S.high)) => zoom(t + (S.low - t) * share, t + (S.high - t) * share);

/* The highest point near a place, or the moment there. */
function peakAt(x) {
  const { times } = S.choice, [first, last] = [timeAt(x - 7), timeAt(x + 7)].map((t) => at(times, t)[0]);
  const most = (i) => Math.max(...shown().map(({ errors }) => errors[S.measure][i]));
  const peak = first + highest(Array.from({ length: last - first + 1 }, (_, i) => most(first + i)));
  return peak > first && peak < last ? times[peak] : timeAt(x);
}
pointers(plot, {
  start: () => { dragged = false; play(false); },
  move: (to) => { dragged = true; seek(timeAt(to.x)); },
  pinch: (a, b) => zoomBy(a.apart / b.apart, timeAt(a.x)),
  finish: (place, { type }) => !dragged && type === "pointerup" && seek(peakAt(place.x)),
});
wheel(plot, (event) => zoomBy(Math.exp(event.deltaY * 0.0015), timeAt(event.offsetX)));
