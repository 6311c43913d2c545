"""Synthetic clips of dancing bodies, for tests."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.rest_bodies import Skin
from tests.scripts.clips.bodies import rest_body_of

JOINTS = ("Hips", "Spine", "Head", "Left leg", "Right leg", "Left foot")
PARENTS = (-1, 0, 1, 0, 0, 3)
OFFSETS = ((0, 0, 1.0), (0, 0.05, 0.3), (0, 0, 0.35), (0.12, 0, -0.1), (-0.12, 0, -0.1), (0, 0, -0.75))
TAILS = ((0, 0.05, 0.3), (0, 0, 0.35), (0, 0, 0.2), (0, 0, -0.75), (0, 0, -0.8), (0, 0.15, -0.05))


def dancing_clip(
    *,
    rate: float = 60.0,
    axes: str = "blender",
    metres_per_unit: float = 1.0,
    walked: float = 0.0,
    still: Sequence[int] = (),
    skin: bool = False,
) -> Clip:
    """Return a clip of six joints that turn in all directions and walk `walked` metres, but for joints in `still`."""
    times = np.arange(0.0, 1.2 + 1e-9, 1.0 / rate)
    random = np.random.default_rng(7)
    count = len(JOINTS)
    at_rest = normalise(random.normal(size=(count, 4)) * 0.2 + (1.0, 0.0, 0.0, 0.0))
    speeds, phases = random.uniform(2.0, 9.0, (count, 3, 1)), random.uniform(0.0, 6.0, (count, 3, 1))
    waves = 0.5 * np.sin(speeds * times + phases)
    waves[list(still)] = 0.3
    turns = normalise(np.concatenate((np.ones((count, 1, len(times))), waves), axis=1).transpose(0, 2, 1))
    places = np.repeat(np.array(OFFSETS, dtype=float)[:, None], len(times), axis=1)
    places[0] += np.stack((walked * times / 1.2, 0.1 * np.sin(3.0 * times), 0.05 * np.sin(7.0 * times)), axis=-1)
    scale = 1.0 / metres_per_unit
    local = Poses(np.array(OFFSETS, dtype=float) * scale, at_rest)
    rest_body = rest_body_of(JOINTS, np.array(PARENTS), local, np.array(TAILS, dtype=float) * scale)
    if skin:
        rest_body = replace(rest_body, skin=_skin(rest_body.rest, scale))
    poses = Poses(places * scale, turns)
    return Clip("dance", "dance.bvh", axes, times, poses, (), metres_per_unit, rest_body=rest_body)


def _skin(rest: Poses, scale: float) -> Skin:
    """Return a skin: a tetrahedron around each joint, weighted two thirds to it and a third to its parent."""
    around = 0.1 * np.array(((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)), dtype=float)
    faces = np.array(((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)))
    count = len(JOINTS)
    carriers = np.zeros((4 * count, 4), dtype=np.int64)
    carriers[:, 0] = np.repeat(np.arange(count), 4)
    carriers[:, 1] = np.repeat(np.maximum(PARENTS, 0), 4)
    weights = np.tile((2.0 / 3.0, 1.0 / 3.0, 0.0, 0.0), (4 * count, 1))
    weights[:4] = (1.0, 0.0, 0.0, 0.0)
    vertices = (rest.positions[:, None] + around * scale).reshape(-1, 3)
    return Skin(vertices, np.concatenate([faces + 4 * joint for joint in range(count)]), carriers, weights)
