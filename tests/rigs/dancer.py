"""A dancer with a key on every frame on every bone, as motion capture leaves them. The dance is designed here.

Ten seconds of sixteen beats: steps to the side, a kick, a full turn, a lunge. A plan says where feet, hips, chest
and hands are on some beats; in between they go smoothly. Legs and arms follow by two-bone IK, so feet stay where they
stand, and everything is then written as plain rotations in parents' spaces, with the noise of a recording.

X is to the dancer's left, Z up, and the audience at -Y. Metres.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import bpy
import numpy as np

from rigid_motion.animation import write_channel

FPS, BEAT = 30, 18.75
"""Frames a second, and a beat."""

FRAMES = np.arange(1.0, 301.0)

NOISE, JITTER = np.radians(0.05), 0.00025
"""Standard deviations of the noise: of each rotation of trunk, shoulders and hands, and of where hips and wrists are.

It is white, and adds up from bone to bone. Within 10 mm, 65 key poses tell this dance; with twice this noise it takes
78, and with four times, 0.2 degrees, 187.
"""

KNEES = 0.965
"""Legs are not straighter than this share of their length: nearly straight knees would snap."""

WIDTH = 0.72
"""What steps and hips go sideways of what the plans say."""

Vectors = np.ndarray
"""Shape (n, 3)."""
Turns = np.ndarray
"""Rotation matrices, shape (n, 3, 3)."""

Plan = Sequence[tuple[float, object]]
"""Beats, and what is so on them."""

TRUNK = {
    "spine": (None, (0.0, 0.03, 0.875), (0.0, 0.01, 1.0)),
    "spine.001": ("spine", (0.0, 0.01, 1.0), (0.0, 0.0, 1.12)),
    "spine.002": ("spine.001", (0.0, 0.0, 1.12), (0.0, 0.005, 1.265)),
    "spine.003": ("spine.002", (0.0, 0.005, 1.265), (0.0, 0.01, 1.42)),
    "spine.004": ("spine.003", (0.0, 0.01, 1.42), (0.0, -0.01, 1.52)),
    "spine.006": ("spine.004", (0.0, -0.01, 1.52), (0.0, -0.02, 1.70)),
}
LIMBS = {
    "shoulder": ("spine.003", (0.02, -0.02, 1.375), (0.13, 0.015, 1.375)),
    "upper_arm": ("shoulder", (0.165, 0.02, 1.36), (0.355, 0.025, 1.17)),
    "forearm": ("upper_arm", (0.355, 0.025, 1.17), (0.53, 0.015, 0.995)),
    "hand": ("forearm", (0.53, 0.015, 0.995), (0.61, 0.01, 0.915)),
    "thigh": ("spine", (0.085, 0.02, 0.91), (0.09, 0.01, 0.49)),
    "shin": ("thigh", (0.09, 0.01, 0.49), (0.09, 0.025, 0.085)),
    "foot": ("shin", (0.09, 0.025, 0.085), (0.09, -0.10, 0.036)),
    "toe": ("foot", (0.09, -0.10, 0.036), (0.09, -0.155, 0.03)),
}
"""Parent, head and tail of the bones in rest pose, those of the left side."""


def _bones() -> dict[str, tuple[str | None, np.ndarray, np.ndarray]]:
    result = {name: (parent, np.array(head), np.array(tail)) for name, (parent, head, tail) in TRUNK.items()}
    for side, out in (("L", 1.0), ("R", -1.0)):
        for name, (parent, head, tail) in LIMBS.items():
            of = parent if parent in TRUNK else f"{parent}.{side}"
            result[f"{name}.{side}"] = of, np.array(head) * (out, 1.0, 1.0), np.array(tail) * (out, 1.0, 1.0)
    return result


BONES = _bones()

HEADING: Plan = (
    (0, 0),
    (1, 14),
    (2, 0),
    (3, -14),
    (4, 0),
    (5, -18),
    (7, 0),
    (7.75, -28),
    (10.9, 360),
    (12, 345),
    (13, 332),
    (14, 350),
    (15, 360),
)
"""Of the hips, in degrees to the left, seen from above counterclockwise."""

STEPS = {
    "L": (
        (0.1, 1.2, (0.42, 0.00), 16, 0.10, 0),
        (3.7, 4.9, (0.22, -0.10), 8, 0.09, 0),
        (7.7, 8.8, (0.24, -0.02), 75, 0.07, 0),
        (9.3, 10.4, (0.14, -0.10), 300, 0.07, 0),
        (11.6, 12.9, (0.56, 0.02), 392, 0.12, 0),
        (13.9, 15.1, (0.16, 0.00), 372, 0.09, 0),
    ),
    "R": (
        (4.7, 5.7, (-0.06, -0.62), -5, 0.62, -25),
        (5.7, 7.0, (-0.26, 0.08), -18, 0.05, 0),
        (8.4, 9.6, (0.10, -0.16), 190, 0.07, 0),
        (10.0, 11.2, (-0.12, 0.00), 346, 0.07, 0),
    ),
}
"""First and last beat, where to, heading there, height in between, and how far the heel is up then, in degrees."""

KICK = "R", 0, 0.62
"""The step that ends in the air, and how high."""

START = {"L": ((0.11, 0.0), 8), "R": ((-0.11, 0.0), -8)}

HIPS: Plan = (
    (0, (0.0, 0.02)),
    (1.0, (0.27, 0.02)),
    (1.7, (0.32, 0.02)),
    (2.8, (-0.04, 0.02)),
    (3.5, (-0.08, 0.02)),
    (4.0, (-0.06, 0.0)),
    (4.9, (0.17, -0.06)),
    (5.7, (0.19, -0.04)),
    (6.7, (-0.20, 0.08)),
    (7.5, (-0.18, 0.08)),
    (8.6, (0.16, 0.0)),
    (9.5, (0.14, -0.10)),
    (10.3, (0.10, -0.08)),
    (11.5, (-0.04, 0.0)),
    (12.6, (0.27, 0.03)),
    (13.8, (0.36, 0.03)),
    (14.8, (0.13, 0.0)),
    (16, (0.10, 0.0)),
)
"""Where they are, seen from above."""

DIP: Plan = (
    (0, 5),
    (0.6, 8),
    (1.4, 5),
    (2.5, 8),
    (3.5, 5),
    (4.6, 8),
    (5.3, 4),
    (6.2, 9),
    (7, 6),
    (7.7, 11),
    (8.6, 5),
    (11, 5),
    (11.7, 7),
    (12.7, 25),
    (13.2, 23),
    (13.7, 25),
    (14.8, 5),
    (16, 5),
)
"""How far they are lower than with straight legs, in centimetres."""

SWAY: Plan = (
    (0, 0),
    (0.7, -9),
    (1.5, -12),
    (2.1, 0),
    (2.8, 9),
    (3.5, 12),
    (4.2, 0),
    (4.9, -8),
    (6, 4),
    (7, 10),
    (8, -4),
    (9, 3),
    (11, 0),
    (12.7, -8),
    (13.2, 4),
    (13.7, -10),
    (14.8, -7),
    (16, -9),
)
"""Hips raised on the right, in degrees."""

LEAN: Plan = (
    (0, 2),
    (4.4, 4),
    (5.2, -8),
    (6.3, 12),
    (7.5, 6),
    (8.5, -3),
    (11, -2),
    (12.7, 14),
    (13.7, 10),
    (15, -6),
    (16, -7),
)
"""Of the trunk, forward, in degrees."""

BEND: Plan = (
    (0, 0),
    (0.7, 10),
    (1.5, 16),
    (2.2, 0),
    (2.9, -12),
    (3.5, -17),
    (4.4, 0),
    (5, 12),
    (6.2, -8),
    (7.5, -12),
    (8.5, 5),
    (11, 0),
    (12.7, -16),
    (13.2, -8),
    (13.7, -18),
    (14.8, 10),
    (16, 13),
)
"""Of the trunk to its right, in degrees: against the hips."""

TWIST: Plan = (
    (0, 0),
    (1.2, -26),
    (2.1, 4),
    (3.2, 26),
    (4.2, 6),
    (5.2, 30),
    (6.3, -20),
    (7.7, -40),
    (8.8, 22),
    (10.5, 12),
    (11.5, -10),
    (12.8, 24),
    (13.3, 8),
    (13.8, 28),
    (15, -16),
    (16, -18),
)
"""Of the trunk against the hips, to the left, in degrees."""

GAZE: Plan = (
    (0, 0),
    (1.2, 26),
    (2.1, 0),
    (3.2, -26),
    (4.2, 0),
    (5.3, 0),
    (6.4, -8),
    (7.5, 0),
    (8.5, 0),
    (9.6, 340),
    (12, 360),
    (12.8, 396),
    (13.7, 392),
    (14.8, 356),
    (16, 352),
)
"""Where the face points, in degrees to the left. In the turn it stays with the audience and then is there first."""

NOD: Plan = (
    (0, 0),
    (0.5, 6),
    (1, -3),
    (1.5, 6),
    (2, -3),
    (2.5, 6),
    (3, -3),
    (3.5, 6),
    (4.2, 0),
    (5.2, -12),
    (6.3, 12),
    (7.6, 8),
    (8.4, -4),
    (11, 0),
    (12.7, -14),
    (14, -8),
    (15, -16),
    (16, -18),
)
"""Of the face, down, in degrees."""

HANDS = {
    "L": (
        (0, (0.45, 0.20, -0.75)),
        (0.6, (0.80, 0.10, -0.35)),
        (1.4, (0.85, 0.15, 0.42)),
        (2.1, (0.55, 0.55, -0.15)),
        (2.8, (-0.15, 0.75, -0.25)),
        (3.5, (-0.30, 0.70, 0.05)),
        (4.2, (0.50, 0.60, -0.30)),
        (5.2, (0.95, -0.05, 0.15)),
        (6.2, (0.35, 0.25, -0.80)),
        (7.0, (0.70, 0.40, -0.30)),
        (7.8, (-0.10, 0.72, -0.10)),
        (8.6, (0.80, 0.40, 0.0)),
        (9.4, (0.30, 0.50, 0.35)),
        (10.3, (0.25, 0.35, 0.80)),
        (11.2, (0.60, 0.10, 0.70)),
        (12.0, (0.40, 0.50, -0.20)),
        (12.8, (0.72, 0.15, 0.64)),
        (13.3, (0.66, 0.30, 0.44)),
        (13.8, (0.70, 0.10, 0.68)),
        (14.4, (0.60, 0.40, -0.15)),
        (15.2, (0.40, 0.10, 0.88)),
        (16, (0.45, 0.08, 0.87)),
    ),
    "R": (
        (0, (0.45, 0.20, -0.75)),
        (0.7, (0.10, 0.65, -0.35)),
        (1.5, (-0.30, 0.70, 0.05)),
        (2.2, (0.55, 0.50, -0.35)),
        (2.8, (0.80, 0.10, -0.20)),
        (3.4, (0.85, 0.15, 0.42)),
        (4.2, (0.60, 0.40, -0.20)),
        (5.2, (0.55, 0.15, 0.78)),
        (6.2, (0.60, -0.25, -0.62)),
        (7.0, (0.75, -0.20, -0.35)),
        (7.8, (0.92, -0.20, 0.05)),
        (8.7, (0.20, 0.70, -0.05)),
        (9.5, (0.25, 0.45, 0.40)),
        (10.3, (0.25, 0.35, 0.80)),
        (11.2, (0.60, 0.10, 0.70)),
        (12.0, (0.55, 0.30, -0.40)),
        (12.8, (0.80, -0.30, -0.42)),
        (13.3, (0.72, 0.00, -0.52)),
        (13.8, (0.82, -0.34, -0.38)),
        (14.5, (0.45, 0.55, -0.35)),
        (15.2, (0.92, 0.05, 0.18)),
        (16, (0.94, 0.0, 0.22)),
    ),
}
"""From the shoulder, in the chest's space: outwards, forwards, up, in lengths of the arm."""

ELBOWS = (0.6, 0.5, -0.55)
"""Which way they point, likewise, but backwards."""


def dancer(seed: int = 0, last: float = FRAMES[-1]) -> bpy.types.Object:
    """A figure of 1.7 m and 22 bones with its dance in the open scene, up to a frame."""
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
    """How every bone is turned away from its rest pose, in the rig's space, and where the hips begin."""
    count = len(frames)
    beats = (frames - FRAMES[0]) / BEAT

    def at(plan: Plan, late: float = 0.0) -> np.ndarray:
        return _smooth(plan, beats - late)

    def noise() -> Turns:
        return _turn(NOISE * random.normal(size=(count, 3)))

    def jitter() -> Vectors:
        return JITTER * random.normal(size=(count, 3))

    def turned(up: np.ndarray, side: np.ndarray, forward: np.ndarray) -> Turns:
        """By angles in degrees around Z, then Y, then X, in the turned space."""
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
    """How far hips have to go down for knees to stay bent."""
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
    """Where the ankle is, the heading of the foot and how far its heel is up, in degrees."""
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
    # The ball of the foot is where it stands; the ankle goes up around it.
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
    """Turn two bones so that the second ends on a target, the joint in between towards a pole."""
    upper, lower = (f"{name}.{side}" for name in names)
    a, b = _length(upper), _length(lower)
    way = target - root
    far = np.linalg.norm(way, axis=1, keepdims=True)
    along = way / far
    # Nearly straight limbs straighten ever slower, so that joints do not snap.
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
    """The values, bent off below a limit which they do not reach."""
    return limit - width * np.logaddexp(0.0, (limit - values) / width)


def _carried(turns: Mapping[str, Turns], hips: Vectors, name: str) -> Vectors:
    """Where a bone begins, from those that it hangs on."""
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
    """What a plan says, eased by a Gaussian of so many beats."""
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
    """Rotations by rotation vectors."""
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
    """Of matrices, of like signs from frame to frame, shape (n, 4)."""
    m, trace = turns, np.trace(turns, axis1=1, axis2=2)
    # The column of the largest component of each: no other is near zero.
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
