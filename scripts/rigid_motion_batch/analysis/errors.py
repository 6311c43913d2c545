"""Errors: how far off what a mode makes of its keys is, joint by joint; a rigid body has one joint.

What is as long as the recording is worked on a block of samples at a time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses, measure
from rigid_motion.motion.contacts import slide, standing
from rigid_motion_batch.axes import to_blender

from .reconstructions import Reconstruction


@dataclass(frozen=True, eq=False)
class MotionErrors:
    """How far off a mode is, in metres and radians."""

    shell: np.ndarray
    """Shape (joints, n), at each sample from the first key to the last."""

    position: np.ndarray
    """RMS over the samples, shape (joints,); and so the following."""

    rotation: np.ndarray
    velocity: np.ndarray

    slide: float
    """The farthest that a joint which stands on the ground in the recording gets from where it began to stand."""

    largest: np.ndarray
    """The largest error of any joint in position, in metres, and in rotation, in degrees, shape (2, n)."""

    places: np.ndarray
    """Where the mode puts the joints, in metres with z up, single precision, shape (joints, n, 3)."""

    @property
    def worst(self) -> tuple[int, int]:
        """The joint and the sample of the largest error."""
        joint, sample = np.unravel_index(np.argmax(self.shell), self.shell.shape)
        return int(joint), int(sample)


@dataclass(frozen=True, eq=False)
class Ground:
    """What stands on the ground in a recording, from the first key to the last."""

    joints: np.ndarray
    """Those that stand at any time; of a rigid body none."""

    stands: np.ndarray
    """When, shape (those joints, n)."""

    slide: float
    """The farthest that one of them slides in the recording itself, in metres."""

    @classmethod
    def of(cls, made: Reconstruction) -> Ground:
        if made.clip.rest_body is None:
            return cls(np.empty(0, dtype=int), np.empty((0, len(made.times)), dtype=bool), 0.0)
        places = np.concatenate([_upright(made, made.truth(block)) for block in made.blocks()], axis=1)
        stands = standing(made.times, places)
        joints = np.flatnonzero(stands.any(axis=1))
        return cls(joints, stands[joints], slide(places[joints], stands[joints]))


def errors_of(made: Reconstruction, mode: str, ground: Ground) -> MotionErrors:
    """Return how far off a mode is, joint by joint."""
    joints, start, count = len(made.skeleton), made.samples.start, len(made.times)
    shell, places = np.empty((joints, count)), np.empty((joints, count, 3), dtype=np.float32)
    feet, largest = np.empty((len(ground.joints), count, 3)), np.empty((2, count))
    squares = np.zeros((3, joints))
    for block in made.blocks(overlap=1):
        times = made.clip.times[block]
        shown = made.shown(mode, times)
        errors = measure(times, shown, made.truth(block), made.radii[:, None])
        own = slice(block.start - start, block.stop - start)
        places[:, own] = upright = _upright(made, shown)
        shell[:, own], feet[:, own] = errors.shell, upright[ground.joints]
        largest[:, own] = errors.position.max(axis=0), np.degrees(errors.rotation).max(axis=0)
        # The first sample of a block is the last of the one before, where velocities begin.
        new = slice(int(block.start > start), None)
        squares += [
            np.square(some).sum(axis=-1) for some in (errors.position[:, new], errors.rotation[:, new], errors.velocity)
        ]
    position, rotation, velocity = np.sqrt(squares / np.array([count, count, count - 1.0])[:, None])
    return MotionErrors(shell, position, rotation, velocity, slide(feet, ground.stands), largest, places)


def _upright(made: Reconstruction, poses: Poses) -> np.ndarray:
    """Return positions with the third axis upwards."""
    return to_blender(poses, made.clip.axes).positions
