/* The view: the recording as a ghost, what each mode makes of it, paths and keys, in one picture or side by side. */
import { at, highest, inflate, unpack, valueAt } from "./data.js";
import { axesOf, between, cameraOf, clamp, lengthOf, magnification, matrixOf, mix, moved, NARROW, nice, poseAt,
  short } from "./mathematics.js";
import { $, changed, id, ink, PAGE, paint, S, shown, UNITS } from "./state.js";
import { drawingOn } from "./drawing.js";
import { pointers, wheel } from "./pointers.js";

const canvas = $("view"), camera = { turn: 1.05, tilt: 0.22, far: 1, to: [0, 0, 0] }, colours = {}, mesh = {};
const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
let pen = null, paths = [], flight = 0, flying = false;

const isBody = () => S.clip.joints.length > 0;
const sizeOf = () => (isBody() ? S.clip.extent : PAGE.mesh.size) || 1;
const sideBySide = () => (S.layout ? S.layout === "side" : canvas.clientWidth >= 190 * S.choice.motions.length);
const lanes = () => (sideBySide() ? shown().map((motion) => [motion]) : [shown()]);

export async function openView() {
  const bytes = await inflate(PAGE.mesh.block), rows = (name) => unpack(bytes, PAGE.mesh[name])[0];
  const begin = () => {
    pen = drawingOn(canvas, PAGE.shaders, PAGE.ramp.flatMap(rgb));
    $("nogl").hidden = Boolean(pen);
    if (pen) Object.assign(mesh, { corners: pen.triangles(rows("corners")), edges: pen.segments(rows("edges")) });
    paths = [];
  };
  begin();
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => { begin(); newPaths(); });
}

export function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ink", "bg", "lines", "recorded", ...PAGE.modes.map((_, i) => `m${i}`)])
    colours[`--${name}`] = rgb(style.getPropertyValue(`--${name}`).trim());
  changed("view");
}

/* A choice of keys is shown: which joint has a path, which error is red, and how much is magnified. */
export function newChoice() {
  const { motions } = S.choice, largest = (rows) => rows.map((row) => row[highest(row)]);
  const worst = Math.max(...motions.map(({ errors }) => errors[0][highest(errors[0])])) / 1000;
  const joints = motions.map(({ byJoint }) => largest(byJoint ?? [[worst]]));
  S.choice.worst = worst;
  S.choice.top = Math.max(...joints.flat()) || 1;
  S.choice.joint = highest(joints.find((all) => Math.max(...all) === Math.max(...joints.flat())));
  if (S.automatic) S.factor = magnification(worst, sizeOf() * (isBody() ? 0.15 : 0.34));
  newPaths();
}

export function newPaths() {
  const { factor } = S, said = `×${+factor.toPrecision(2)}`, heat = isBody() && lanes()[0]?.length === 1;
  $("badge").innerHTML = `${factor === 1 ? "Deviation as it is" : `<b>Deviation ${said}</b>`} · grid `
    + lengthOf(nice(sizeOf() * 0.35)) + (heat ? ` · error 0 <i class="ramp"></i> ${short(1000 * S.choice.top)} mm` : "");
  [$("factor").value, $("times").value, $("automatic").ariaPressed] = [50 * Math.log10(factor), said, S.automatic];
  $("lanes").innerHTML = sideBySide() ? shown().map((motion) => `<div style="color:var(${ink(motion)})">`
    + `<span></span><small></small></div>`).join("") : "";
  shown().forEach(({ name }, k) => { if ($("lanes").children[k]) $("lanes").children[k].firstChild.textContent = name; });
  changed("view", "cursor");
  if (!pen) return;
  const { seen, moments, joint, motions } = S.choice, rows = (all) => all.slice(3 * joint, 3 * joint + 3);
  const places = rows(S.recording.places);
  const path = (away) => {
    const points = Array.from(moments, (t, i) =>
      [...places.map((row, k) => row[seen + i] + (away ? factor * away[k][i] : 0)), t]);
    return pen.segments(points.slice(1).flatMap((point, i) => [...points[i], ...point]));
  };
  const dots = (t, [i, share] = at(moments, t)) => [...between(places, seen + i, share), t];
  paths.forEach(pen.drop);
  paths = [path(), ...motions.flatMap(({ away, keys }) =>
    [path(rows(away)), pen.points(keys.flatMap((t) => dots(t)))])];
}

/* The middle of the object, and a camera close to it, or so far that all of the recording is seen. */
function middle() {
  const pose = poseAt(S.recording, S.choice, S.t), along = (k) => pose.places.filter((_, row) => row % 3 === k);
  if (!isBody()) return moved(matrixOf(pose), PAGE.mesh.middle);
  return [0, 1, 2].map((k) => (Math.min(...along(k)) + Math.max(...along(k))) / 2);
}
const wide = () => clamp(canvas.clientWidth / Math.max(lanes().length, 1) / Math.max(canvas.clientHeight, 1), 0.1, 1);
const close = () => ({ ...camera, to: middle(), far: (sizeOf() + 0.5 * S.factor * S.choice.worst) * (isBody() ? 2.4 : 2.8) * wide() ** -0.4 });
function whole() {
  const [low, high] = S.clip.box, across = Math.hypot(...low.map((value, i) => high[i] - value)) + sizeOf();
  return { ...camera, to: mix(low, high, 0.5), far: (0.4 * across) / NARROW / wide() };
}

function fly(goal, ms = matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : 420) {
  const from = { ...camera }, begin = performance.now(), own = ++flight;
  flying = true;
  (function step(now) {
    if (own !== flight) return;
    const share = ms ? clamp((now - begin) / ms, 0, 1) : 1, eased = share * share * (3 - 2 * share);
    for (const key of ["turn", "tilt", "far"]) camera[key] = from[key] + (goal[key] - from[key]) * eased;
    camera.to = mix(from.to, goal.to, eased);
    changed("view");
    flying = share < 1;
    if (flying) requestAnimationFrame(step);
  })(begin);
}
export function follow(on, ms) {
  S.follow = $("follow").checked = on;
  fly(on ? close() : whole(), ms);
}

/* Lines from joint to joint, with the errors at their ends. */
const sticks = ({ places, errors }) => S.clip.parents.flatMap((parent, joint) => (parent < 0 ? []
  : [parent, joint].flatMap((end) => [...places.slice(3 * end, 3 * end + 3), errors ? errors[end] : 0])));

function drawBody(motions, poses, truth, faded, ratio) {
  const alone = motions.length === 1;
  if (S.ghost !== "none")
    pen.linesOnce(sticks(truth), colours["--recorded"], (S.ghost === "wire" ? 1 : 2.6) * ratio, 0.6);
  motions.forEach((motion, k) => pen.linesOnce(sticks(poses[k]), colours[ink(motion)], (alone ? 2.2 : 1.7) * ratio,
    faded(motion), { top: alone && poses[k].errors ? S.choice.top : 0, lift: -0.0005 * k, solid: true }));
}

function drawTool(motions, poses, truth, faded, ratio) {
  const body = matrixOf(truth);
  motions.forEach((motion, k) =>
    faded(motion) === 1 && pen.solid(mesh.corners, matrixOf(poses[k]), colours[ink(motion)], 1, 2 * k));
  if (S.ghost === "ghost") pen.solid(mesh.corners, body, colours["--recorded"], 0.26);
  if (S.ghost === "none" || (S.slow && S.playing)) return;
  pen.lines(mesh.edges, colours["--recorded"], 0.55 * ratio, S.ghost === "wire" ? 0.95 : 0.4, { body, lift: -0.0004 });
}

paint("view", () => {
  const ratio = S.slow && S.playing ? 1 : Math.min(devicePixelRatio || 1, 2), { joint, begin, end } = S.choice;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.round(side * ratio));
  if (!pen || !width || !height) return;
  if (S.follow && !flying) camera.to = mix(camera.to, middle(), S.playing ? 0.3 : 1);
  const truth = poseAt(S.recording, S.choice, S.t), size = sizeOf(), all = lanes();
  const trail = { now: S.t, faint: end - begin > 15 ? 0.06 : 0.34 };
  pen.begin(width, height);
  all.forEach((motions, place) => {
    const x = Math.round((width * place) / all.length), across = Math.round((width * (place + 1)) / all.length) - x;
    const poses = motions.map((motion) => poseAt(S.recording, S.choice, S.t, motion, S.factor));
    const path = (motion) => 1 + 2 * S.choice.motions.indexOf(motion);
    const faded = (motion) => (all.length > 1 || !S.hot || S.hot === id(motion) ? 1 : 0.2);
    pen.lane(x, across, cameraOf(camera, across / height, camera.far + 40 * size));
    pen.ground(colours["--lines"], [...camera.to.slice(0, 2), S.clip.box[0][2] - (isBody() ? 0 : 0.75 * size)],
      Math.max(camera.far, 4 * size), nice(size * 0.35));
    if (S.paths) pen.lines(paths[0], colours["--recorded"], 1.1 * ratio, 0.9, { ...trail, trail: 0.6 });
    for (const motion of S.paths ? motions : [])
      pen.lines(paths[path(motion)], colours[ink(motion)], 1.25 * ratio, faded(motion), { ...trail, trail: 0.45 });
    (isBody() ? drawBody : drawTool)(motions, poses, truth, faded, ratio);
    if (!S.paths || !motions.length) return;
    const stalks = poses.flatMap((pose) => [truth, pose].flatMap(({ places }) => [...rowsOf(places, joint), 0]));
    pen.linesOnce(stalks, colours["--ink"], 0.7 * ratio, 0.55, { hidden: false });
    for (const motion of S.choice.keyed ? motions : motions.slice(0, 1))
      pen.dots(paths[path(motion) + 1], colours["--bg"], colours[S.choice.keyed ? ink(motion) : "--ink"], 6.5 * ratio, trail);
  });
});
const rowsOf = (places, joint) => places.slice(3 * joint, 3 * joint + 3);

export function readOutLanes() {
  if (sideBySide()) shown().forEach(({ errors }, k) => { $("lanes").children[k].lastChild.textContent =
    `${short(valueAt(S.choice.times, errors[S.measure], S.t))} ${UNITS[S.measure]}`; });
}

function move(change) {
  flight++;
  flying = false;
  Object.assign(camera, change);
  changed("view");
}
function pan(dx, dy) {
  const [right, up] = axesOf(camera), scale = (2 * NARROW * camera.far) / canvas.clientHeight;
  S.follow = $("follow").checked = false;
  move({ to: camera.to.map((value, i) => value + (up[i] * dy - right[i] * dx) * scale) });
}
const approach = (factor) => move({ far: clamp(camera.far * factor, 0.4 * sizeOf(), 400 * sizeOf()) });
pointers(canvas, {
  move: (to, from, event) => (event.shiftKey || event.buttons & 6 ? pan(to.x - from.x, to.y - from.y) : move({
    turn: camera.turn - (to.x - from.x) * 0.008, tilt: clamp(camera.tilt + (to.y - from.y) * 0.008, -1.5, 1.5) })),
  pinch: (a, b) => [approach(a.apart / b.apart), pan(b.x - a.x, b.y - a.y)],
});
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("dblclick", () => follow(false));
wheel(canvas, (event) => approach(Math.exp(event.deltaY * (event.ctrlKey ? 0.006 : 0.0012))));
