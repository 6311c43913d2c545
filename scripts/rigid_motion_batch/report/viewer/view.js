/* The view: the recording as a ghost, what each mode makes of it, paths and keys, in one picture or side by side. */
import { at, inflate, unpack, valueAt } from "./data.js";
import { axesOf, between, cameraOf, clamp, matrixOf, mix, moved, NARROW, poseAt, short } from "./mathematics.js";
import { $, changed, id, ink, PAGE, paint, S, shown, UNITS } from "./state.js";
import { drawingOn } from "./drawing.js";
import { pointers, wheel } from "./pointers.js";

const canvas = $("view"), colours = {}, mesh = {}, calm = matchMedia("(prefers-reduced-motion: reduce)");
const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
let camera = { turn: 1.05, tilt: 0.22, far: 1, to: [0, 0, 0] }, goal = null, pen = null, paths = [];

const isBody = () => S.clip.joints.length > 0;
const sideBySide = () => (S.layout ? S.layout === "side" : canvas.clientWidth >= 190 * S.choice.motions.length);
const lanes = () => (sideBySide() ? shown().map((motion) => [motion]) : [shown()]);
const ofJoint = (rows, joint) => rows.slice(3 * joint, 3 * joint + 3);

export async function openView() {
  const bytes = await inflate(PAGE.mesh.block), numbers = (name) => unpack(bytes, PAGE.mesh[name])[0];
  pen = drawingOn(canvas, PAGE.shaders, PAGE.ramp.flatMap(rgb));
  $("nogl").hidden = Boolean(pen);
  if (pen) Object.assign(mesh, { corners: pen.triangles(numbers("corners")), edges: pen.segments(numbers("edges")) });
}

export function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["--ink", "--bg", "--lines", "--recorded", ...PAGE.modes.map((_, i) => `--m${i}`)])
    colours[name] = rgb(style.getPropertyValue(name).trim());
  changed("view");
}

/* Paths and keys are magnified as the body is, and are made anew where that changes. */
export function magnify(factor, automatic = false) {
  [S.factor, S.automatic] = [factor, automatic];
  const said = `×${+factor.toPrecision(2)}`, heat = isBody() && lanes()[0]?.length === 1;
  const { seen, moments, joint, motions, top } = S.choice, places = ofJoint(S.recording.places, joint);
  $("badge").innerHTML = `${factor === 1 ? "Deviation as it is" : `<b>Deviation ${said}</b>`} · grid ${S.clip.grid}`
    + (heat ? ` · error 0 <i class="ramp"></i> ${short(1000 * top)} mm and more` : "");
  [$("factor").value, $("times").value, $("automatic").ariaPressed] = [50 * Math.log10(factor), said, automatic];
  changed("view", "cursor");
  if (!pen) return;
  const path = (away) => {
    const points = Array.from(moments, (t, i) =>
      [...places.map((row, k) => row[seen + i] + (away ? factor * away[k][i] : 0)), t]);
    return pen.segments(points.slice(1).flatMap((point, i) => [...points[i], ...point]));
  };
  const dot = (t, [i, share] = at(moments, t)) => [...between(places, seen + i, share), t];
  paths.forEach(pen.drop);
  paths = [path(), ...motions.flatMap(({ away, keys }) =>
    [path(ofJoint(away, joint)), pen.points(keys.flatMap((t) => dot(t)))])];
}

/* The middle of the object, and a camera close to it, or so far that all of the recording is seen. */
function middle() {
  const pose = poseAt(S.recording, S.choice, S.t), along = (k) => S.clip.drawn.map((joint) => pose.places[3 * joint + k]);
  return isBody() ? [0, 1, 2].map((k) => (Math.min(...along(k)) + Math.max(...along(k))) / 2)
    : moved(matrixOf(pose), PAGE.mesh.middle);
}
export function follow(on, at_once = calm.matches) {
  const { size, box: [low, high] } = S.clip, close = size + Math.min(S.choice.worst * S.factor, size) / 2;
  const wide = clamp(canvas.clientWidth / Math.max(lanes().length, 1) / Math.max(canvas.clientHeight, 1), 0.1, 1);
  const across = Math.hypot(...low.map((value, i) => high[i] - value)) + size;
  S.follow = $("follow").checked = on;
  goal = on ? { to: middle(), far: close * (isBody() ? 2 : 2.8) * wide ** -0.4 }
    : { to: mix(low, high, 0.5), far: (0.4 * across) / NARROW / wide };
  if (at_once) camera = { ...camera, ...goal };
  changed("view");
}
function steer() {
  const share = S.playing || goal ? 0.3 : 1, to = S.follow ? middle() : goal?.to ?? camera.to;
  camera.to = mix(camera.to, to, share);
  if (!goal) return;
  camera.far += (goal.far - camera.far) * share;
  if (Math.hypot(camera.far - goal.far, ...to.map((value, i) => value - camera.to[i])) < 1e-3 * goal.far) goal = null;
  changed("view");
}

/* Lines from joint to joint, with the errors at their ends. */
const sticks = ({ places, errors }) => S.clip.parents.flatMap((parent, joint) => (parent < 0 ? []
  : [parent, joint].flatMap((end) => [...ofJoint(places, end), errors ? errors[end] : 0])));

function drawBody(motions, poses, truth, faded, ratio) {
  const alone = motions.length === 1, wide = (alone ? 2.2 : 1.7) * ratio;
  if (S.ghost) pen.lines(sticks(truth), { colour: colours["--recorded"], wide: 2.6 * ratio, alpha: 0.6 });
  motions.forEach((motion, k) => pen.lines(sticks(poses[k]), { colour: colours[ink(motion)], alpha: faded(motion), wide,
    lift: -0.0005 * k, top: alone && poses[k].errors ? S.choice.top : 0 }, { hides: true }));
}

function drawTool(motions, poses, truth, faded, ratio) {
  const ghost = { body: matrixOf(truth), colour: colours["--recorded"], alpha: 0.26 };
  motions.forEach((motion, k) => faded(motion) === 1 && pen.draw("solid", mesh.corners,
    { body: matrixOf(poses[k]), colour: colours[ink(motion)], nearer: 2 * k }, { hides: true }));
  if (!S.ghost) return; // its depth first, or its far side would show through
  for (const seen of [false, true]) pen.draw("solid", mesh.corners, ghost, { seen, hides: !seen });
  if (!S.slow || !S.playing) pen.draw("line", mesh.edges, { ...ghost, wide: 0.55 * ratio, alpha: 0.4, lift: -0.0004 });
}

paint("view", () => {
  const ratio = S.slow && S.playing ? 1 : Math.min(devicePixelRatio || 1, 2), { joint, begin, end } = S.choice;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.round(side * ratio));
  if (!pen || !width || !height) return;
  steer();
  const truth = poseAt(S.recording, S.choice, S.t), all = lanes(), { size, cell, box } = S.clip;
  const faint = 0.34 * (S.follow ? Math.min(1, 10 / (end - begin)) ** 2 : 0.7);
  const line = { now: S.t, faint, wide: 1.2 * ratio, trail: 0.5 };
  const ground = { centre: [...camera.to.slice(0, 2), box[0][2] - (isBody() ? 0 : 0.75 * size)], cell,
    colour: colours["--lines"], reach: Math.max(camera.far, 4 * size) };
  pen.begin(width, height);
  all.forEach((motions, place) => {
    const x = Math.round((width * place) / all.length), across = Math.round((width * (place + 1)) / all.length) - x;
    const poses = motions.map((motion) => poseAt(S.recording, S.choice, S.t, motion, S.factor));
    const path = (motion) => 1 + 2 * S.choice.motions.indexOf(motion);
    const faded = (motion) => (all.length > 1 || !S.hot || S.hot === id(motion) ? 1 : 0.2);
    pen.lane(x, across, cameraOf(camera, across / height, camera.far + 40 * size));
    pen.draw("ground", pen.plane, ground);
    if (S.paths) pen.draw("line", paths[0], { ...line, colour: colours["--recorded"] });
    for (const motion of S.paths ? motions : [])
      pen.draw("line", paths[path(motion)], { ...line, colour: colours[ink(motion)], alpha: faded(motion) });
    (isBody() ? drawBody : drawTool)(motions, poses, truth, faded, ratio);
    if (!S.paths) return;
    pen.lines(poses.flatMap((pose) => [truth, pose].flatMap(({ places }) => [...ofJoint(places, joint), 0])),
      { colour: colours["--ink"], wide: 0.7 * ratio, alpha: 0.55 }, { hidden: false });
    for (const motion of S.choice.keyed ? motions : motions.slice(0, 1))
      pen.draw("dot", paths[path(motion) + 1], { ...line, wide: 6.5 * ratio, lift: -0.0006, colour: colours["--bg"],
        rim: colours[S.choice.keyed ? ink(motion) : "--ink"] });
  });
});

/* The names over the pictures side by side, with the errors now. */
export function nameLanes() {
  $("lanes").replaceChildren(...(sideBySide() ? shown() : []).map((motion) => {
    const lane = document.createElement("div"), error = valueAt(S.choice.times, motion.errors[S.measure], S.t);
    lane.style.color = `var(${ink(motion)})`;
    lane.append(motion.name, document.createElement("small"));
    lane.lastChild.textContent = `${short(error)} ${UNITS[S.measure]}`;
    return lane;
  }));
}

const move = (change) => [goal = null, camera = { ...camera, ...change }, changed("view")];
function pan(dx, dy) {
  const [right, up] = axesOf(camera), each = (2 * NARROW * camera.far) / canvas.clientHeight;
  S.follow = $("follow").checked = false;
  move({ to: camera.to.map((value, i) => value + (up[i] * dy - right[i] * dx) * each) });
}
const approach = (factor) => move({ far: clamp(camera.far * factor, 0.4 * S.clip.size, 400 * S.clip.size) });
pointers(canvas, {
  move: (to, from, event) => (event.shiftKey || event.buttons & 6 ? pan(to.x - from.x, to.y - from.y) : move({
    turn: camera.turn - (to.x - from.x) * 0.008, tilt: clamp(camera.tilt + (to.y - from.y) * 0.008, -1.5, 1.5) })),
  pinch: (a, b) => [approach(a.apart / b.apart), pan(b.x - a.x, b.y - a.y)],
});
Object.assign(canvas, { oncontextmenu: () => false, ondblclick: () => follow(false) });
wheel(canvas, (event) => approach(Math.exp(event.deltaY * (event.ctrlKey ? 0.006 : 0.0012))));
