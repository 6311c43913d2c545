"""Measures: how far a motion is from the recording it stands for.

Lengths are in the unit of the positions, rotations in radians, velocities in units per second. The shell error is the
measure of the Animation Compression Library (`docs/error_metrics.md` there): the largest displacement of the three
points at `radius` from the body's origin along its axes. It counts position and rotation together, as the surface
of a body of that size shows them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .poses import Poses
from .quaternions import angle_between, rotate


@dataclass(frozen=True)
class Errors:
    """The errors of n poses: `shell`, `position` and `rotation` of shape (..., n), `velocity` of (..., n - 1)."""

    shell: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray


def measure(times: np.ndarray, poses: Poses, truth: Poses, radius: float = 0.1) -> Errors:
    """All errors of `poses` against `truth`, sample by sample.

    Parameters
    ----------
    times : array, shape (..., n)
        Seconds, rising.
    poses, truth : Poses, shape (..., n)
    radius : float
        Of the shell, in the unit of the positions.

    Notes
    -----
    The velocity error is that of the origin, by differences between successive samples: an in-between that runs
    unevenly, or turns a corner at a key, shows there first. A motion that is merely displaced has none.
    """
    # Poses that are not finite have errors that are not finite, without a warning.
    with np.errstate(over="ignore", invalid="ignore"):
        offset = poses.positions - truth.positions
        return Errors(
            shell=shell_error(poses, truth, radius),
            position=np.linalg.norm(offset, axis=-1),
            rotation=angle_between(truth.quaternions, poses.quaternions),
            velocity=np.linalg.norm(np.diff(offset, axis=-2), axis=-1) / np.diff(times, axis=-1),
        )


def shell_error(poses: Poses, truth: Poses, radius: float = 0.1) -> np.ndarray:
    """The largest displacement, shape (..., n), of the points at `radius` along the body's axes."""
    displacement = np.stack([shell_point(poses, axis, radius) - shell_point(truth, axis, radius) for axis in range(3)])
    return np.sqrt(np.einsum("a...i,a...i->a...", displacement, displacement).max(axis=0))


def shell_point(poses: Poses, axis: int, radius: float) -> np.ndarray:
    """Where the point at `radius` along one of the body's axes is, shape (..., 3)."""
    arm = radius * np.eye(3)[axis] * (1.0 if poses.scales is None else poses.scales[..., None])
    return poses.positions + rotate(poses.quaternions, np.broadcast_to(arm, poses.positions.shape))


def rms(errors: np.ndarray) -> float:
    """The root of the mean square over all samples; 0 where there are none."""
    return float(np.sqrt(np.mean(np.square(errors)))) if np.size(errors) else 0.0
