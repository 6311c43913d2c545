/* What is shown, and when it is drawn again: once in the next frame, whatever has changed until then. */

export const $ = (id) => document.getElementById(id);
export const PAGE = JSON.parse($("page").textContent);
export const UNITS = ["mm", "mm", "°"];
export const S = { t: 0, low: 0, high: 1, playing: false, speed: 0.5, measure: 0, hidden: new Set(), hot: "", factor: 1,
  automatic: true, layout: "", ghost: true, paths: true, follow: true, ...PAGE.begins };
export const id = (motion) => motion.modes[0];
export const shown = () => S.choice.motions.filter((motion) => !S.hidden.has(id(motion)));
export const ink = (motion) => `--m${PAGE.modes.indexOf(id(motion))}`;

const painters = {}, due = new Set();
let asked = 0, before = 0, late = 0;
export const paint = (name, painter) => { painters[name] = painter; };

/* Have parts painted again: "view", "chart", "cursor". */
export function changed(...parts) {
  parts.forEach((part) => due.add(part));
  asked ||= requestAnimationFrame(frame);
}

function frame(now) {
  const parts = new Set(due), span = now - before;
  [asked, before] = [0, now];
  due.clear();
  if (!S.choice) return;
  if (S.playing) {
    const { begin, end } = S.choice;
    S.t = begin + ((S.t - begin + (Math.min(span, 100) / 1000) * S.speed) % Math.max(end - begin, 1e-3));
    late = span > 90 ? late + 1 : 0;
    S.slow ||= late > 10; // a machine without a graphics card draws less
    parts.add("view").add("cursor");
    changed("view", "cursor");
  }
  parts.forEach((part) => painters[part]());
}

export function play(on = !S.playing) {
  [S.playing, $("play").ariaPressed, before] = [on, on, performance.now()];
  changed("view", "cursor");
}
