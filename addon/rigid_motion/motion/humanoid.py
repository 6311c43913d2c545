"""Humanoid bones: finds which joint of a skeleton is which bone, and how rest poses of skeletons differ.

The names are those of Unity's `HumanBodyBones`, which VRM and VMC share. At rest, arms hang down in some skeletons and
are held out in others. Metres, Blender's axes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from .poses import Poses, inverse, placed
from .quaternions import normalise

SIDES = {"": "", "L": "Left", "R": "Right"}
FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
FINGER_PARENTS = {"Proximal": "*Hand", "Intermediate": "Proximal", "Distal": "Intermediate"}

BONES = (
    ("Hips", "", "torso hips hip pelvis"),
    ("Spine", "Hips", ""),
    ("Chest", "Spine", ""),
    ("UpperChest", "Chest", ""),
    ("Neck", "UpperChest", "neck neck1 neck01"),
    ("Head", "Neck", "head"),
    ("Jaw", "Head", "jaw jawmaster"),
    ("*Eye", "Head", "eye mastereye"),
    ("*Shoulder", "UpperChest", "shoulder collar clavicle collarbone"),
    ("*UpperArm", "*Shoulder", "upperarm uparm arm"),
    ("*LowerArm", "*UpperArm", "lowerarm forearm loarm"),
    ("*Hand", "*LowerArm", "hand wrist"),
    ("*UpperLeg", "Hips", "upperleg upleg thigh"),
    ("*LowerLeg", "*UpperLeg", "lowerleg lowleg leg shin calf"),
    ("*Foot", "*LowerLeg", "foot ankle"),
    ("*Toes", "*Foot", "toes toe toebase ball"),
    *(
        (f"*{finger}{part}", above if above == "*Hand" else f"*{finger}{above}", "")
        for finger in FINGERS
        for part, above in FINGER_PARENTS.items()
    ),
)
"""Each bone with its parent and its other names. Parents come first; * stands for a side, Left or Right. The other
names are in lower case, without side, sign or namespace, the better ones first."""

HUMANOID = {
    bone.replace("*", side): above.replace("*", side)
    for side in SIDES.values()
    for bone, above, _ in BONES
    if bone.startswith("*") == bool(side)
}
"""All bones and their parents in a skeleton that has these, parents first."""

SPINE = ("Spine", "Chest", "UpperChest")

NEXT_BONES = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}
"""The bones whose rest direction differs between skeletons, and the bones they point to."""

HELD_OUT = {"LeftArm": (1.0, 0.0, 0.0), "RightArm": (-1.0, 0.0, 0.0)}
"""Directions of the arms in a T-pose; legs point down."""

_KNOWN_ALIASES = {
    alias: (bone.strip("*"), rank) for bone, _, names in BONES for rank, alias in enumerate(names.split())
}
_TRUNK = re.compile(r"(spine|chest|upperchest|lowerback|abdomen|torso)\d*")
_FINGER = re.compile(r"(?:hand|f)?(thumb|index|middle|ring|pinky|little)(?:0?([123])|(proximal|intermediate|distal))")
_MECHANISM = ("def", "org", "mch", "vis", "wgt")


def plain_name(name: str) -> tuple[str, str]:
    """Return a name in lower case without namespace and side, and the side: L, R or an empty string."""
    name = name.rpartition(":")[2]
    for side in ("Left", "Right"):
        if side.lower() in name.lower():
            return _letters(re.sub(side, "", name, flags=re.IGNORECASE)), side[0]
    parts = re.split(r"[\W_]+", name)
    for place in (0, -1, 1):
        if len(parts) > abs(place) and (side := parts[place].upper()) in ("L", "R"):
            del parts[place]
            return "".join(parts).lower(), side
    side = name[0] if re.match("[LR][A-Z]", name) else ""
    return _letters(name[len(side) :]), side


def _letters(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).lower()


def humanoid_bones(joints: Sequence[str]) -> dict[str, int]:
    """Return the joint number of each humanoid bone that can be told by names; joints are given parents first."""
    result: dict[str, tuple[int, int]] = {}
    trunk: list[int] = []
    is_rigify = any(name.startswith("ORG-") for name in joints)
    for number, joint in enumerate(joints):
        if is_rigify and _letters(joint).startswith(_MECHANISM):
            continue
        name, side = plain_name(joint)
        has_fk = name.endswith("fk") or bool(re.search(r"fk\d*$", name))
        name = re.sub(r"fk(?=\d*$)", "", name)
        if not side and _TRUNK.fullmatch(name) and name != "torso" and (has_fk or not is_rigify):
            trunk.append(number)
        if finger := _FINGER.fullmatch(name):
            part = list(FINGER_PARENTS)[int(finger[2]) - 1] if finger[2] else finger[3].capitalize()
            bone, rank = finger[1].replace("pinky", "little").capitalize() + part, 0
        elif name in _KNOWN_ALIASES:
            bone, rank = _KNOWN_ALIASES[name]
        else:
            continue
        bone = SIDES[side] + bone
        if bone in HUMANOID and (bone not in result or rank < result[bone][1]):
            result[bone] = (number, rank)
    bones = {bone: number for bone, (number, _) in result.items()}
    if is_rigify:
        # The lower half of Rigify's spine hangs upside down from the middle, and carries the legs.
        trunk = sorted(trunk, key=lambda number: joints[number])[len(trunk) // 2 :]
    named = {plain_name(joints[number])[0]: number for number in trunk}
    if "chest" in named:
        bones |= {bone: named[bone.lower()] for bone in SPINE if bone.lower() in named}
    else:
        bones |= zip(SPINE, trunk[-len(SPINE) :], strict=False)
    return {bone: bones[bone] for bone in HUMANOID if bone in bones}


def shortest_turns(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the shortest rotations (..., 4) from directions (..., 3) to others; none where either has no length."""
    lengths = np.linalg.norm(first, axis=-1) * np.linalg.norm(second, axis=-1)
    w = lengths + np.einsum("...i,...i->...", first, second)
    turns = np.concatenate((w[..., None], np.cross(first, second)), axis=-1)
    turns[w <= 1e-9 * np.maximum(lengths, 1e-9)] = (1.0, 0.0, 0.0, 0.0)
    return normalise(turns)


def alignments(bones: dict[str, int], first: np.ndarray, second: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Return the rotation that brings each bone of one skeleton to the rest direction of another.

    `bones` are the numbers of places (n, 3) at rest. Without the second places, the other skeleton is in a T-pose.
    """
    result: dict[str, np.ndarray] = {}
    for bone in HUMANOID:
        side = bone[: 4 if bone.startswith("Left") else 5 if bone.startswith("Right") else 0]
        part = bone[len(side) :]
        end = NEXT_BONES.get(part) if side else None
        if end and bone in bones and side + end in bones:
            own, tip = bones[bone], bones[side + end]
            held_out = np.array(HELD_OUT.get(side + part[-3:], (0.0, 0.0, -1.0)))
            to = held_out if second is None else second[tip] - second[own]
            result[bone] = shortest_turns(first[tip] - first[own], to)
        elif side and HUMANOID[bone] in result and part not in ("Foot", "Toes"):
            result[bone] = result[HUMANOID[bone]]
    return {bone: turn for bone, turn in result.items() if bone in bones}


def relative_to_followed(poses: Poses, follows: np.ndarray) -> Poses:
    """Return poses (bones,) relative to the poses they follow, by number; those that follow none (-1) are unchanged."""
    result, hanging = poses.copy(), follows >= 0
    result[hanging] = placed(inverse(poses[follows[hanging]]), poses[hanging])
    return result
