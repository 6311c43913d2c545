"""A body with a key on every frame, as in imported motion capture; also runs in Blender with a window."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from rigid_motion.animation import write_channel
from rigid_motion.motion.twists import exponential
from tests.animation.bones.rigs import Rest, new_rig

FRAMES = np.arange(1.0, 91.0)
NAMES = ("Root", "Spine", "Head", "Arm.L", "Hand.L", "Arm.R", "Hand.R")
PARENTS = {"Spine": "Root", "Head": "Spine", "Arm.L": "Spine", "Hand.L": "Arm.L", "Arm.R": "Spine", "Hand.R": "Arm.R"}


def recorded_rig(rotation_mode: str = "QUATERNION", *, still: tuple[str, ...] = ()) -> bpy.types.Object:
    """Return a body of a few bones with a key on every frame, as in imported motion capture."""
    rig, random = new_rig("Body", list(rests()), rotation_mode), np.random.default_rng(0)
    for name in NAMES:
        if name not in still:
            record(rig, name, random)
    return rig


def rests() -> Iterator[Rest]:
    random, tails = np.random.default_rng(5), {"": np.array((0.0, 0.0, 0.5))}
    for name in NAMES:
        parent = PARENTS.get(name, "")
        tails[name] = tails[parent] + random.normal(size=3) * (0.1, 0.1, 0.2) + (0.0, 0.0, 0.25)
        yield Rest(name, tails[parent], tails[name], parent, roll=0.4)


def record(rig: bpy.types.Object, name: str, random: np.random.Generator) -> None:
    """Key a swinging bone on every frame; the root also wanders."""
    waves = random.uniform(0.05, 0.2, 3)[:, None] * FRAMES + random.uniform(0.0, 6.0, (3, 1))
    angles = 0.5 * np.sin(waves).T + 0.002 * random.normal(size=(len(FRAMES), 3))
    prefix = f'pose.bones["{name}"].'
    if rig.pose.bones[name].rotation_mode == "QUATERNION":
        turns = exponential(np.concatenate((angles.T, 0.0 * angles.T)))[0].T
        write_channel(rig, prefix + "rotation_quaternion", FRAMES, turns)
    else:
        write_channel(rig, prefix + "rotation_euler", FRAMES, angles)
    if name == "Root":
        write_channel(rig, prefix + "location", FRAMES, 0.3 * np.sin(waves[::-1]).T)
