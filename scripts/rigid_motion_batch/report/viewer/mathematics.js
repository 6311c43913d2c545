/* Vectors, quaternions (w, x, y, z), matrices in columns as WebGL takes them, and numbers as people read them. */
import { at } from "./data.js";

export const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const mix = (a, b, share) => a.map((value, i) => value + (b[i] - value) * share);

export const times = (a, b) => [a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
  a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2], a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
  a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]];

/* The quaternion of a rotation vector. */
export function turning(vector) {
  const angle = Math.hypot(...vector), share = angle > 1e-9 ? Math.sin(angle / 2) / angle : 0.5;
  return [Math.cos(angle / 2), ...vector.map((value) => value * share)];
}

/* Numbers of some rows at a sample, or on the way to the next. */
export const between = (rows, i, share) => rows.map((row) => (share ? row[i] + (row[i + 1] - row[i]) * share : row[i]));

export function quaternionAt(rows, i, share) {
  const a = between(rows, i, 0), b = share ? between(rows, i + 1, 0) : a;
  const sign = a.reduce((sum, value, k) => sum + value * b[k], 0) < 0 ? -1 : 1;
  const q = a.map((value, k) => value + (sign * b[k] - value) * share), length = Math.hypot(...q) || 1;
  return q.map((value) => value / length);
}

/* Where a body is at a time: in the recording, or in a motion that is so many times as far from it. */
export function poseAt(recording, choice, t, motion, factor) {
  const [i, share] = at(choice.moments, t), k = i + choice.seen;
  const pose = { places: between(recording.places, k, share), scale: 1 };
  if (recording.turns) pose.turn = quaternionAt(recording.turns, k, share);
  if (recording.scales) [pose.scale] = between(recording.scales, k, share);
  if (!motion) return pose;
  if (motion.byJoint) pose.errors = between(motion.byJoint, i, share);
  between(motion.away, i, share).forEach((value, row) => { pose.places[row] += factor * value; });
  if (motion.turn) {
    const vector = between(motion.turn, i, share), most = Math.min(factor, 3 / Math.max(Math.hypot(...vector), 1e-9));
    pose.turn = times(turning(vector.map((value) => value * most)), pose.turn);
  }
  if (motion.grown) pose.scale *= Math.exp(factor * between(motion.grown, i, share)[0]);
  return pose;
}

export function matrixOf({ places: [x, y, z], turn: [w, a, b, c], scale: s }) {
  return [s * (1 - 2 * (b * b + c * c)), s * 2 * (a * b + c * w), s * 2 * (a * c - b * w), 0,
    s * 2 * (a * b - c * w), s * (1 - 2 * (a * a + c * c)), s * 2 * (b * c + a * w), 0,
    s * 2 * (a * c + b * w), s * 2 * (b * c - a * w), s * (1 - 2 * (a * a + b * b)), 0, x, y, z, 1];
}
export const moved = (m, p) => [0, 1, 2].map((i) => m[12 + i] + m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2]);
export const product = (a, b) => Float32Array.from({ length: 16 }, (_, k) => [0, 1, 2, 3].reduce((sum, i) =>
  sum + a[4 * i + (k % 4)] * b[4 * (k >> 2) + i], 0));

/* Right, up and back of a camera that is turned and tilted. */
export function axesOf({ turn, tilt }) {
  const [s, c, u, v] = [Math.sin(turn), Math.cos(turn), Math.sin(tilt), Math.cos(tilt)];
  return [[c, s, 0], [-s * u, c * u, v], [s * v, -c * v, u]];
}

export const NARROW = Math.tan(0.26); // of half the angle that the view has from top to bottom
export function cameraOf(camera, aspect, deep) {
  const axes = axesOf(camera), eye = camera.to.map((value, i) => value + axes[2][i] * camera.far), f = 1 / NARROW;
  const near = camera.far * 0.02, far = camera.far + deep;
  const look = [...[0, 1, 2].flatMap((i) => [...axes.map((axis) => axis[i]), 0]), ...axes.map((a) => -dot(a, eye)), 1];
  const depth = [-(far + near) / (far - near), (-2 * far * near) / (far - near)];
  return { view: product([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, depth[0], -1, 0, 0, depth[1], 0], look), eye };
}

/* Round numbers from one to another, about so many, as [number, text]. */
export function ticks(low, high, wanted) {
  const raw = (high - low) / wanted, power = 10 ** Math.floor(Math.log10(raw)), found = [];
  const step = power * [1, 2, 5, 10].find((one) => one * power >= raw * 0.999);
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++)
    found.push([k * step, (k * step).toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)))]);
  return found;
}

export const short = (value) => value.toFixed(value >= 99.95 ? 0 : value >= 9.995 ? 1 : 2);
/* The address of a moment: clip, choice of keys, seconds. */
export const addressOf = (clip, choice, t) => `#${[clip, choice].map(encodeURIComponent).join()},${t.toFixed(3)}`;
export function fromAddress(hash) {
  try {
    const [clip, choice, t] = hash.slice(1).split(",").map(decodeURIComponent);
    return { clip, choice, t: t && Number.isFinite(+t) ? +t : undefined };
  } catch { return {}; }
}
