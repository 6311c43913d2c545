"""Synthetic clips of a swinging tool, for tests: small, smooth, and different for every seed."""

from collections.abc import Sequence

import numpy as np

from rigid_motion.motion import KEYFRAME_MODES, Poses, decimate
from rigid_motion_batch.analysis.choices import Choice, Radii, Uniform
from rigid_motion_batch.analysis.reconstructions import Reconstruction
from rigid_motion_batch.analysis.reconstructions import reconstruct as reconstruct_modes
from rigid_motion_batch.analysis.results import ChoiceResult, measured
from rigid_motion_batch.recordings.clips import Clip


def swinging_clip(
    name: str = "swing", *, seconds: float = 3.0, rate: float = 90.0, seed: int = 1, repairs: tuple[str, ...] = ()
) -> Clip:
    """Return a clip of a body on a winding path that turns about a changing axis."""
    random = np.random.default_rng(seed)
    times = 100.0 + np.arange(round(seconds * rate) + 1) / rate
    waves = random.uniform(2.0, 9.0, (7, 1)) * times + random.uniform(0.0, 6.0, (7, 1))
    quaternions = np.stack((3.0 + 0.0 * times, *np.sin(waves[:3])), axis=-1)
    quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
    poses = Poses(0.3 * np.sin(waves[3:6]).T, quaternions)
    return Clip(name, f"{name}.csv", "blender", times, poses, repairs)


def reconstruct(clip: Clip, rate: str = "10", modes: tuple[str, ...] = tuple(KEYFRAME_MODES)) -> Reconstruction:
    """Return a reconstruction of the clip from keys at `rate`, with the real modes."""
    return Reconstruction(
        clip, Uniform(rate), dict.fromkeys(modes, (decimate(clip.times, float(rate)),)), np.array([0.1])
    )


def compare_clip(clip: Clip, choice: Choice, modes: Sequence[str], radii: Radii) -> ChoiceResult | None:
    """Return the result of comparing a clip in one step; None if it is too short for two keys."""
    made = reconstruct_modes(clip, choice, modes, radii.of(clip))
    return None if made is None else measured(made)
