"""Synthetic clips of whole bodies, for tests: small, in centimetres with y up, and different for every seed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.rest_bodies import RestBody

BONES = {
    "Hips": (None, (0, 90, 0)),
    "Spine": ("Hips", (0, 20, 0)),
    "Head": ("Spine", (0, 40, 0)),
    "Arm": ("Spine", (20, 25, 0)),
    "Hand": ("Arm", (50, 0, 0)),
    "Glove": ("Hand", (10, 0, 0)),
    "Leg": ("Hips", (10, -5, 0)),
    "Foot": ("Leg", (0, -80, 0)),
}
"""Parents, and joint positions in the parents' spaces. The glove moves with its hand."""

JOINTS = tuple(BONES)

PARENTS = np.array([-1 if parent is None else JOINTS.index(parent) for parent, _ in BONES.values()])


def turns(angles: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return quaternions (..., 4) of turns by angles (...) about axes (..., 3)."""
    axes = axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    return np.concatenate((np.cos(angles / 2.0)[..., None], np.sin(angles / 2.0)[..., None] * axes), axis=-1)


def swinging_body(
    name: str = "walk", *, seconds: float = 2.0, rate: float = 30.0, seed: int = 1, joints: Sequence[str] = JOINTS
) -> Clip:
    """Return a clip of a body that walks forward and swings all joints except the glove; the foot stands for 0.5 s."""
    random = np.random.default_rng(seed)
    times = 7.0 + np.arange(round(seconds * rate) + 1) / rate
    since = np.maximum(times - times[0] - 0.5, 0.0)
    phases = random.uniform(2.0, 6.0, (len(BONES), 1)) * since
    poses = Poses(
        np.tile(np.array([offset for _, offset in BONES.values()], dtype=float)[:, None], (1, len(times), 1)),
        turns(0.8 * np.sin(phases), random.normal(size=(len(BONES), 1, 3))),
    )
    poses.positions[0] += 60.0 * np.stack((0.0 * since, 0.2 * np.sin(5.0 * since), since), axis=-1)
    glove = list(BONES).index("Glove")
    poses.quaternions[glove] = poses.quaternions[glove, :1]
    # The arm swings from the first moment on.
    arm = list(BONES).index("Arm")
    poses.quaternions[arm] = turns(np.sin(4.0 * times), np.array((0.0, 0.3, 1.0)))
    rest_body = rest_body_of(joints, PARENTS, poses[:, 0], np.tile((0.0, 10.0, 0.0), (len(joints), 1)))
    return Clip(name, f"{name}.bvh", "opengl", times, poses, (), 0.01, rest_body=rest_body)


def rest_body_of(joints: Sequence[str], parents: np.ndarray, local: Poses, tails: np.ndarray) -> RestBody:
    """Return the rest body of joints with these rest poses in their parents' spaces."""
    unplaced = RestBody(tuple(joints), parents, local, tails)
    return replace(unplaced, rest=unplaced.skeleton.in_root_space(local))


def still_body(name: str = "statue") -> Clip:
    """Return a clip of the same body standing still."""
    clip = swinging_body(name)
    return replace(clip, poses=clip.poses[:, np.zeros(len(clip.times), dtype=int)])
