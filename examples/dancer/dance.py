"""A dancer with a key on every bone and frame, like motion capture; this module generates the dance from a plan.

Ten seconds, sixteen beats: steps to the side, a kick, a full turn, a lunge. The plan gives the positions of feet, hips,
chest and hands on some beats; the in-betweens are smooth. Legs and arms follow by two-bone IK, so planted feet stay
in place. The result is written as rotations in the parents' spaces, with the noise of a recording.

X is the dancer's left, Z is up, and the audience is at -Y. Lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import bpy
import numpy as np

from examples.dancer.plan import (
    BEND,
    BONES,
    DIP,
    ELBOWS,
    GAZE,
    HANDS,
    HEADING,
    HIPS,
    KICK,
    LEAN,
    NOD,
    START,
    STEPS,
    SWAY,
    TWIST,
    Plan,
)
from rigid_motion.animation import write_channel

FPS, BEAT = 30, 18.75
"""Frames per second, and frames per beat."""

FRAMES = np.arange(1.0, 301.0)

NOISE, JITTER = np.radians(0.05), 0.00025
"""Standard deviations of the noise: radians for trunk, shoulders and hands, metres for hips, wrists and (0.3x) ankles.

The noise is white and adds up along bone chains. Within 10 mm, this dance needs 65 key poses; with twice the noise it
needs 78, and with four times (0.2 degrees) 187.
"""

KNEES = 0.965
"""The longest reach of a leg, as a fraction of its length: nearly straight knees would snap."""

WIDTH = 0.72
"""Factor on the plans' sideways positions of steps and hips."""

Vectors = np.ndarray
"""Shape (n, 3)."""
Turns = np.ndarray
"""Rotation matrices, shape (n, 3, 3)."""


def dancer(seed: int = 0, last: float = FRAMES[-1]) -> bpy.types.Object:
    """Add a dancer 1.7 m tall with 22 bones to the open scene, with its dance up to the frame `last`."""
    rig = _skeleton()
    frames = FRAMES[last >= FRAMES]
    turns, hips = _dance(frames, np.random.default_rng(seed))
    for name, (parent, *_) in BONES.items():
        bone = rig.pose.bones[_named(name)]
        rest = np.array(bone.bone.matrix_local.to_3x3())
        within = turns[name] if parent is None else np.swapaxes(turns[parent], 1, 2) @ turns[name]
        path = f'pose.bones["{bone.name}"].'
        write_channel(rig, path + "rotation_quaternion", frames, _quaternions(rest.T @ within @ rest), group=bone.name)
        if parent is None:
            write_channel(rig, path + "location", frames, (hips - BONES[name][1]) @ rest, group=bone.name)
    return rig


def _named(name: str) -> str:
    return f"DEF-{name}"


def _skeleton() -> bpy.types.Object:
    rig = bpy.data.objects.new("Dancer", bpy.data.armatures.new("Dancer"))
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (parent, head, tail) in BONES.items():
        bone = rig.data.edit_bones.new(_named(name))
        bone.head, bone.tail = head, tail
        if parent:
            bone.parent = rig.data.edit_bones[_named(parent)]
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig


def _dance(frames: np.ndarray, random: np.random.Generator) -> tuple[dict[str, Turns], Vectors]:
    """Return the rotation of every bone from its rest pose, in the rig's space, and the position of the hips."""
    count = len(frames)
    beats = (frames - FRAMES[0]) / BEAT

    def at(plan: Plan, late: float = 0.0) -> np.ndarray:
        return _smooth(plan, beats - late)

    def noise() -> Turns:
        return _turn(NOISE * random.normal(size=(count, 3)))

    def jitter() -> Vectors:
        return JITTER * random.normal(size=(count, 3))

    def turned(up: np.ndarray, side: np.ndarray, forward: np.ndarray) -> Turns:
        """Return rotations by angles in degrees around Z, then the turned Y, then the turned X."""
        return _about(2, up) @ _about(1, side) @ _about(0, forward)

    none = np.zeros(count)
    turns = {"spine": turned(at(HEADING), at(SWAY), 0.4 * at(LEAN)) @ noise()}
    for number, name in enumerate(("spine.001", "spine.002", "spine.003")):
        late = 0.06 * number
        share = (0.3, 0.35, 0.35)[number]
        step = turned(share * at(TWIST, late), share * (at(BEND, late) - 0.6 * at(SWAY, late)), share * at(LEAN, late))
        turns[name] = turns[("spine", "spine.001", "spine.002")[number]] @ step @ noise()
    chest = turns["spine.003"]
    face = turned(at(GAZE), 0.3 * at(BEND, 0.15), at(NOD, 0.1))
    turns["spine.004"] = _between(chest, face, 0.45) @ noise()
    turns["spine.006"] = face @ noise()

    aim = at(HIPS) * (WIDTH, 1.0)
    high = BONES["spine"][1][2] - 0.01 * at(DIP)
    hips = np.concatenate((aim, high[:, None]), axis=1)
    hips[:, 2] -= _too_far(turns, hips, beats)
    hips += jitter()
    for side, out in (("L", 1.0), ("R", -1.0)):
        flip = np.array((out, 1.0, 1.0))
        hand = at(HANDS[side])
        raised = np.clip(hand[:, 2], 0.0, 1.0)
        turns[f"shoulder.{side}"] = chest @ turned(none, -out * (4.0 + 16.0 * raised), none) @ noise()
        root = _carried(turns, hips, f"upper_arm.{side}")
        reach = 1.1 * hand * (out, -1.0, 1.0)
        length = _length("upper_arm.L") + _length("forearm.L")
        target = root + _apply(chest, length * reach) + jitter()
        pole = _apply(chest, np.tile(np.array(ELBOWS) * flip, (count, 1)))
        _bend(turns, ("upper_arm", "forearm"), side, root, target, pole, np.array(ELBOWS) * flip)
        drag = 22.0 * np.gradient(at(HANDS[side], 0.12), beats, axis=0)
        drag = np.clip(drag, -35.0, 35.0)
        turns[f"hand.{side}"] = (
            turns[f"forearm.{side}"] @ turned(none, out * 0.8 * drag[:, 2], 0.5 * drag[:, 1]) @ noise()
        )

        ankle, heading, heel = _foot(side, beats)
        turns[f"foot.{side}"] = _about(2, heading) @ _about(0, heel)
        knees = _about(2, 0.6 * heading + 0.4 * at(HEADING))
        root = _carried(turns, hips, f"thigh.{side}")
        pole = _apply(knees, np.tile((0.12 * out, -1.0, 0.0), (count, 1)))
        _bend(turns, ("thigh", "shin"), side, root, ankle + 0.3 * jitter(), pole, np.array((0.0, -1.0, 0.0)))
        turns[f"toe.{side}"] = _about(2, heading) @ _about(0, np.minimum(heel, 0.0) + 0.25 * np.maximum(heel, 0.0))
    return turns, hips


def _too_far(turns: dict[str, Turns], hips: Vectors, beats: np.ndarray) -> np.ndarray:
    """Return how far the hips must go down to keep the knees bent, smoothed over time."""
    reach = KNEES * (_length("thigh.L") + _length("shin.L"))
    lower = np.zeros(len(beats))
    for side in "LR":
        way = _foot(side, beats)[0] - _carried(turns, hips, f"thigh.{side}")
        beside = np.minimum(np.hypot(way[:, 0], way[:, 1]), 0.9 * reach)
        lower = np.maximum(lower, -way[:, 2] - np.sqrt(reach**2 - beside**2))
    offsets = np.arange(-15, 16)
    weights = np.exp(-0.5 * (offsets / 5.0) ** 2)
    return np.convolve(np.pad(lower, 15, mode="edge"), weights / weights.sum(), mode="valid")


def _foot(side: str, beats: np.ndarray) -> tuple[Vectors, np.ndarray, np.ndarray]:
    """Return the position of the ankle, and the heading of the foot and the lift of its heel, both in degrees."""
    (x, y), heading = START[side]
    place, raised = np.array((x, y, 0.0)), 0.0
    ways = np.tile(place, (len(beats), 1))
    headings, heels = np.full(len(beats), float(heading)), np.zeros(len(beats))
    for number, (first, last, (x, y), new, height, heel) in enumerate(STEPS[side]):
        share = np.clip((beats - first) / (last - first), 0.0, 1.0)
        share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        kicks = (side, number) == KICK[:2]
        goal = np.array((WIDTH * x, y, KICK[2] if kicks else 0.0))
        ways += share[:, None] * (goal - place)
        bump = np.sin(np.pi * share) ** 2
        ways[:, 2] += bump * (0.0 if kicks else height)
        headings += share * (new - heading)
        heels += share * (heel - raised) + (18.0 if number and not kicks else 8.0) * bump
        place, heading, raised = goal, new, heel
    # The plan places the ball of the foot; the ankle rises around it.
    _, ankle, ball = BONES["foot.L"]
    ankle = np.tile(ankle - ball, (len(beats), 1))
    ankle = _apply(_about(2, headings) @ _about(0, heels), ankle)
    ways[:, 2] += ball[2]
    ways[:, 1] += ball[1]
    return ways + ankle, headings, heels


def _bend(
    turns: dict[str, Turns],
    names: tuple[str, str],
    side: str,
    root: Vectors,
    target: Vectors,
    pole: Vectors,
    rest_pole: np.ndarray,
) -> None:
    """Set the rotations of two bones by IK: the second bone ends on a target, the joint points towards a pole."""
    upper, lower = (f"{name}.{side}" for name in names)
    a, b = _length(upper), _length(lower)
    way = target - root
    far = np.linalg.norm(way, axis=1, keepdims=True)
    along = way / far
    # Limbs straighten more slowly when nearly straight, so joints do not snap.
    far = _softly(far, 0.995 * (a + b), 0.02)
    normal = np.cross(along, pole)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    cosine = np.clip((a**2 + far**2 - b**2) / (2.0 * a * far), -1.0, 1.0)
    joint = a * (cosine * along + np.sqrt(1.0 - cosine**2) * np.cross(normal, along))
    first, second = joint / a, (far * along - joint) / b
    for name, now in ((upper, first), (lower, second)):
        _, head, tail = BONES[name]
        rest = (tail - head) / np.linalg.norm(tail - head)
        rest_normal = np.cross(rest, rest_pole)
        rest_normal /= np.linalg.norm(rest_normal)
        turns[name] = _frame(now, normal) @ _frame(rest[None], rest_normal[None]).swapaxes(1, 2)


def _softly(values: np.ndarray, limit: float, width: float) -> np.ndarray:
    """Return values that approach a limit smoothly and never reach it."""
    return limit - width * np.logaddexp(0.0, (limit - values) / width)


def _carried(turns: Mapping[str, Turns], hips: Vectors, name: str) -> Vectors:
    """Return the head position of a bone, from the rotations of its ancestors."""
    chain = [name]
    while (parent := BONES[chain[-1]][0]) is not None:
        chain.append(parent)
    place = hips
    for child, parent in reversed(list(pairwise(chain))):
        place = place + turns[parent] @ (BONES[child][1] - BONES[parent][1])
    return place


def _length(name: str) -> float:
    _, head, tail = BONES[name]
    return float(np.linalg.norm(tail - head))


def _smooth(plan: Plan, beats: np.ndarray, width: float = 0.3) -> np.ndarray:
    """Return the values of a plan at these beats, smoothed by a Gaussian with a standard deviation of `width` beats."""
    offsets = np.linspace(-3.0, 3.0, 61)
    weights = np.exp(-0.5 * offsets**2)
    when = np.array([beat for beat, _ in plan], dtype=float)
    values = np.array([value for _, value in plan], dtype=float)
    moments = beats[:, None] + width * offsets
    if values.ndim == 1:
        return np.interp(moments, when, values) @ weights / weights.sum()
    return np.stack([np.interp(moments, when, column) @ weights for column in values.T], axis=1) / weights.sum()


def _frame(along: Vectors, normal: Vectors) -> Turns:
    return np.stack((along, np.cross(normal, along), normal), axis=2)


def _apply(turns: Turns, vectors: Vectors) -> Vectors:
    return np.einsum("nij,nj->ni", turns, vectors)


def _about(axis: int, degrees: np.ndarray) -> Turns:
    return _turn(np.radians(degrees)[:, None] * np.eye(3)[axis])


def _turn(vectors: Vectors) -> Turns:
    """Return the rotation matrices of rotation vectors."""
    angles = np.linalg.norm(vectors, axis=1)
    x, y, z = (vectors / np.maximum(angles, 1e-12)[:, None]).T
    o = np.zeros_like(x)
    cross = np.moveaxis(np.array(((o, -z, y), (z, o, -x), (-y, x, o))), 2, 0)
    return np.eye(3) + np.sin(angles)[:, None, None] * cross + (1.0 - np.cos(angles))[:, None, None] * cross @ cross


def _between(start: Turns, end: Turns, share: float) -> Turns:
    q, r = _quaternions(start), _quaternions(end)
    r *= np.sign(np.sum(q * r, axis=1, keepdims=True))
    mixed = (1.0 - share) * q + share * r
    return _matrices(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def _matrices(q: np.ndarray) -> Turns:
    w, v = q[:, :1], q[:, 1:]
    x, y, z = v.T
    o = np.zeros_like(x)
    cross = np.moveaxis(np.array(((o, -z, y), (z, o, -x), (-y, x, o))), 2, 0)
    return np.eye(3) + 2.0 * w[:, :, None] * cross + 2.0 * cross @ cross


def _quaternions(turns: Turns) -> np.ndarray:
    """Return the quaternions of matrices, with continuous signs from frame to frame, shape (n, 4)."""
    m, trace = turns, np.trace(turns, axis1=1, axis2=2)
    # Use the row with the largest component: it is never near zero.
    four = np.empty((len(m), 4, 4))
    four[:, 0] = np.stack(
        (1.0 + trace, m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]), axis=1
    )
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        four[:, 1 + i, 0] = m[:, k, j] - m[:, j, k]
        four[:, 1 + i, 1 + i] = 1.0 + m[:, i, i] - m[:, j, j] - m[:, k, k]
        four[:, 1 + i, 1 + j] = m[:, j, i] + m[:, i, j]
        four[:, 1 + i, 1 + k] = m[:, k, i] + m[:, i, k]
    largest = np.argmax(np.abs(np.diagonal(four, axis1=1, axis2=2)), axis=1)
    q = four[np.arange(len(m)), largest]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    q[1:] *= np.cumprod(flips)[:, None]
    return q
