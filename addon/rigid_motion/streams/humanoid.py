"""Humanoid bones: which joint of a skeleton is which, and poses of one skeleton as poses of another.

The names are those of Unity's `HumanBodyBones`, which VRM and VMC share. Skeletons differ in where their bones point
at rest: arms that hang down in one, and are held out in another. What is carried over is how far each bone is turned
from where it would be if both were at rest alike. Poses are in the space of the roots here, metres, Blender's axes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ..motion import Poses
from ..motion.quaternions import conjugate, multiply, normalise, rotate

_SIDED = {
    "Shoulder": "",
    "UpperArm": "Shoulder",
    "LowerArm": "UpperArm",
    "Hand": "LowerArm",
    "UpperLeg": "",
    "LowerLeg": "UpperLeg",
    "Foot": "LowerLeg",
    "Toes": "Foot",
    **{
        finger + part: finger + before if before else "Hand"
        for finger in ("Thumb", "Index", "Middle", "Ring", "Little")
        for part, before in (("Proximal", ""), ("Intermediate", "Proximal"), ("Distal", "Intermediate"))
    },
}
"""The bones of each side, and what they hang on."""

SPINE = ("Spine", "Chest", "UpperChest")

HUMANOID = {
    "Hips": "",
    "Spine": "Hips",
    "Chest": "Spine",
    "UpperChest": "Chest",
    "Neck": "UpperChest",
    "Head": "Neck",
    "Jaw": "Head",
    **{f"{side}Eye": "Head" for side in ("Left", "Right")},
    **{
        side + bone: side + above if above else ("UpperChest" if bone == "Shoulder" else "Hips")
        for side in ("Left", "Right")
        for bone, above in _SIDED.items()
    },
}
"""All bones and what they hang on where that is there, parents first."""

NEXT = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}
"""The bones that rests differ in, and where they point to."""

HELD_OUT = {"Arm": (1.0, 0.0, 0.0), "Leg": (0.0, 0.0, -1.0)}
"""Where those of the left side point in a T-pose."""

_ALIASES = {
    "Hips": ("torso", "hips", "hip", "pelvis"),
    "Neck": ("neck", "neck1", "neck01"),
    "Head": ("head",),
    "Jaw": ("jaw", "jawmaster"),
    "Eye": ("eye", "mastereye"),
    "Shoulder": ("shoulder", "collar", "clavicle", "collarbone"),
    "UpperArm": ("upperarm", "uparm", "arm"),
    "LowerArm": ("lowerarm", "forearm", "loarm"),
    "Hand": ("hand", "wrist"),
    "UpperLeg": ("upperleg", "upleg", "thigh"),
    "LowerLeg": ("lowerleg", "lowleg", "leg", "shin", "calf"),
    "Foot": ("foot", "ankle"),
    "Toes": ("toes", "toe", "toebase", "ball"),
}
"""What bones are called by many, without their side, the better first."""

_KNOWN = {alias: (bone, rank) for bone, aliases in _ALIASES.items() for rank, alias in enumerate(aliases)}
_OF_A_SIDE = frozenset(_SIDED) | {"Eye"}
_TRUNK = re.compile(r"(spine|chest|upperchest|lowerback|abdomen|torso)\d*")
_FINGER = re.compile(r"(?:hand|f)?(thumb|index|middle|ring|pinky|little)(?:0?([123])|(proximal|intermediate|distal))")
_MECHANISM = ("def", "org", "mch", "vis", "wgt")


def _plain(name: str) -> tuple[str, str]:
    """Return a name in lower case without its namespace and side; and the side, L, R or nothing."""
    name = name.rpartition(":")[2]
    for side in ("Left", "Right"):
        if side.lower() in name.lower():
            return _letters(re.sub(side, "", name, flags=re.IGNORECASE)), side[0]
    parts = re.split(r"[\W_]+", name)
    for side in "LR":
        for place in (0, -1, 1):
            if len(parts) > abs(place) and parts[place].upper() == side:
                return _letters("".join(parts[:place] + parts[place:][1:] if place >= 0 else parts[:-1])), side
        if re.match(side + "[A-Z]", name):
            return _letters(name[1:]), side
    return _letters(name), ""


def _letters(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).lower()


def humanoid_bones(joints: Sequence[str]) -> dict[str, int]:
    """Which joint each humanoid bone is, as far as names tell; joints are given parents first."""
    result: dict[str, tuple[int, int]] = {}
    trunk: list[int] = []
    is_rigify = any(name.startswith("ORG-") for name in joints)
    for number, joint in enumerate(joints):
        if is_rigify and _letters(joint).startswith(_MECHANISM):
            continue
        name, side = _plain(joint)
        has_fk = name.endswith("fk") or bool(re.search(r"fk\d*$", name))
        name = re.sub(r"fk(?=\d*$)", "", name)
        if not side and _TRUNK.fullmatch(name) and name != "torso" and (has_fk or not is_rigify):
            trunk.append(number)
        if finger := _FINGER.fullmatch(name):
            part = ("Proximal", "Intermediate", "Distal")[int(finger[2]) - 1] if finger[2] else finger[3].capitalize()
            bone, rank = finger[1].replace("pinky", "little").capitalize() + part, 0
        elif name in _KNOWN:
            bone, rank = _KNOWN[name]
        else:
            continue
        if bool(side) == (bone in _OF_A_SIDE):
            bone = {"L": "Left", "R": "Right", "": ""}[side] + bone
            if bone not in result or rank < result[bone][1]:
                result[bone] = (number, rank)
    bones = {bone: number for bone, (number, _) in result.items()}
    if is_rigify:
        # The lower half of its spine hangs upside down on the middle, and carries the legs.
        trunk = sorted(trunk, key=lambda number: joints[number])[len(trunk) // 2 :]
    named = {_plain(joints[number])[0]: number for number in trunk}
    if "chest" in named:
        bones |= {bone: named[bone.lower()] for bone in SPINE if bone.lower() in named}
    else:
        bones |= zip(SPINE, trunk[-len(SPINE) :], strict=False)
    return {bone: bones[bone] for bone in HUMANOID if bone in bones}


def matched(sources: Sequence[str], targets: Sequence[str]) -> dict[str, str]:
    """Which target each source moves: of the same skeleton that of its name. Otherwise that which is the same humanoid
    bone; or else of the same name, or the same but for case, namespace and how sides are written.
    """
    if set(sources) <= set(targets):
        return {name: name for name in sources}
    ours, theirs = humanoid_bones(sources), humanoid_bones(targets)
    # Spines of other lengths have their upper ends in common.
    spines = [[bone for bone in SPINE if bone in bones][::-1] for bones in (ours, theirs)]
    same = {bone: bone for bone in ours if bone in theirs and bone not in SPINE} | dict(zip(*spines, strict=False))
    pairs = {sources[ours[bone]]: targets[theirs[other]] for bone, other in same.items()}
    plain = {_plain(name): name for name in reversed(targets)}
    for name in sources:
        target = name if name in targets else plain.get(_plain(name))
        if target is not None and name not in pairs and target not in pairs.values():
            pairs[name] = target
    return {name: pairs[name] for name in sources if name in pairs}


def shortest_turns(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return shortest rotations (..., 4) that turn directions (..., 3) to others; none where either has no length."""
    lengths = np.linalg.norm(first, axis=-1) * np.linalg.norm(second, axis=-1)
    w = lengths + np.einsum("...i,...i->...", first, second)
    turns = np.concatenate((w[..., None], np.cross(first, second)), axis=-1)
    turns[w <= 1e-9 * np.maximum(lengths, 1e-9)] = (1.0, 0.0, 0.0, 0.0)
    return normalise(turns)


def alignments(bones: dict[str, int], first: np.ndarray, second: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """By what each bone of one skeleton is to be turned to be at rest as in another.

    `bones` are numbers of places (n, 3) at rest; without the second places the other is a T-pose.
    """
    result: dict[str, np.ndarray] = {}
    for bone in HUMANOID:
        side = bone[: 4 if bone.startswith("Left") else 5 if bone.startswith("Right") else 0]
        part = bone[len(side) :]
        end = NEXT.get(part) if side else None
        if end and bone in bones and side + end in bones:
            own, tip = bones[bone], bones[side + end]
            if second is None:
                to = np.array(HELD_OUT[part[-3:]]) * (1.0 if side == "Left" else -1.0 if part.endswith("Arm") else 1.0)
            else:
                to = second[tip] - second[own]
            result[bone] = shortest_turns(first[tip] - first[own], to)
        elif side and HUMANOID[bone] in result and part not in ("Foot", "Toes"):
            result[bone] = result[HUMANOID[bone]]
    return {bone: turn for bone, turn in result.items() if bone in bones}


class Retargeting:
    """Poses of a source's joints as poses of a target's, pair by pair.

    Parameters
    ----------
    source, target : Poses, shape (joints,)
        Both at rest, in the space of their roots.
    pairs : array of int, shape (pairs, 2)
        Numbers of joints, parents before their children.
    parents : array of int, shape (pairs,)
        The pair that each hangs on in the source, -1 for none.
    bones : dict
        The pair that each humanoid bone is.
    sliding : array of bool, shape (pairs,)
        Which pairs have places of their own.
    """

    def __init__(
        self,
        source: Poses,
        target: Poses,
        pairs: np.ndarray,
        parents: np.ndarray,
        bones: dict[str, int],
        sliding: np.ndarray,
    ) -> None:
        self.sources, self.sliding = pairs[:, 0], sliding
        source, target = source[pairs[:, 0]], target[pairs[:, 1]]
        arms = [np.where(sliding[parents] | (parents < 0), 0.0, _lengths(rest, parents)) for rest in (source, target)]
        both = (arms[0] > 1e-6) & (arms[1] > 1e-6)
        self.has_places = bool(np.any(_lengths(source, parents) > 1e-6)) or len(pairs) == 1
        legs = [row for bone, row in bones.items() if bone.endswith(("LowerLeg", "Foot")) and both[row]]
        self.scale = float(np.median(arms[1][both] / arms[0][both])) if both.any() else 1.0
        if legs:
            # Then feet are on the same ground.
            self.scale = float(np.sum(arms[1][legs]) / np.sum(arms[0][legs]))
        hips = [row for bone, row in bones.items() if bone.endswith("UpperLeg")]
        aligned = alignments(bones, target.positions, source.positions) if self.has_places else {}
        turns = target.quaternions.copy()
        for bone, turn in aligned.items():
            turns[bones[bone]] = multiply(turn, turns[bones[bone]])
        self._from_rest = multiply(conjugate(source.quaternions), turns)
        """What turns a source's pose into the target's."""
        self._beside = np.zeros((len(pairs), 3))
        """Where the target is, seen from the source's joint at rest: such that what hangs on it is in one place."""
        for pair in np.flatnonzero(sliding):
            children = np.flatnonzero(parents == pair)
            if len(children):
                of_hips = [child for child in children.tolist() if child in hips]
                children = np.array(of_hips) if of_hips else children
                theirs = (source.positions[children] - source.positions[pair]).mean(axis=0)
                ours = (target.positions[children] - target.positions[pair]).mean(axis=0)
                self._beside[pair] = rotate(conjugate(source.quaternions[pair]), self.scale * theirs - ours)

    def __call__(self, poses: Poses) -> Poses:
        """Return the poses (pairs, ...) of the target of those of the source (joints, ...)."""
        poses = poses[self.sources]
        extra = (slice(None), *(None,) * (poses.quaternions.ndim - 2))
        positions = self.scale * poses.positions + rotate(poses.quaternions, self._beside[extra])
        return Poses(positions, multiply(poses.quaternions, self._from_rest[extra]))


def _lengths(rest: Poses, parents: np.ndarray) -> np.ndarray:
    return np.linalg.norm(rest.positions - rest.positions[parents], axis=1)
