"""The paper's study on whole bodies: the key poses each mode needs, and its errors.

Each joint is interpolated in its parent's space, as in a rig. Errors are in metres, measured in the space of the
roots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion_batch.analysis.choices import JOINT_RADIUS_M, Uniform
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE as BLENDERS
from rigid_motion_batch.analysis.modes import STATE_OF_THE_ART as REFERENCE
from rigid_motion_batch.analysis.needed import DECIMATIONS, RATES, Ways, keys_needed, part_of
from rigid_motion_batch.analysis.reconstructions import moving, reconstruct
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip

from .table import SCREW, has_samples_for, means, shares_of

MODES = (REFERENCE, BLENDERS, SCREW, "pga_lerp", "motor_spline")
ERROR_RATES = (5, 10)  # key poses per second at which errors are measured

SEARCHED_S = 10.0
"""Seconds of a whole body, from its first sample, used to search for key poses: every try reduces keys anew."""

EXTENSIONS = (".bvh", ".fbx", ".glb", ".gltf", ".blend")  # of files that may hold a body


# -- input -------------------------------------------------------------------------------------------------------------


def read_body(path: Path) -> Clip:
    """Read and repair the first whole body of a file.

    Raises
    ------
    TrajectoryError
        If there is none, or none of its joints moves.
    """
    whole = [clip for clip in read_clips([str(path)])[0] if clip.rest_body is not None]
    if not whole:
        raise TrajectoryError(path, "it is no whole body", "leave it out")
    if not moving(whole[0]).any():
        raise TrajectoryError(path, "at rest: none of its joints moves", "leave it out")
    return replace(whole[0], name=path.stem)


# -- results -----------------------------------------------------------------------------------------------------------


def needed_of(clip: Clip) -> dict[str, dict[str, list[float]]]:
    """Return the key poses that each mode needs, by mode and decimation: `shares_of` the reference's at `RATES`.

    Blender's curves are only tried with evenly spaced key poses.
    """
    radii = np.full(len(clip.rest_body.joints), JOINT_RADIUS_M)
    searched = part_of(clip, 0, int(np.searchsorted(clip.times, clip.times[0] + SEARCHED_S, side="right")) - 1)
    evenly = shares_of(clip, keys_needed(_Evenly(searched, radii), (BLENDERS,), REFERENCE))
    others = tuple(mode for mode in MODES if mode != BLENDERS)
    return evenly | shares_of(clip, keys_needed(Ways(searched, radii), others, REFERENCE))


class _Evenly(Ways):
    """Evenly spaced keys only: for Blender's curves, which depend on all keys, every other try takes minutes."""

    def by_motion(self, mode: str, target: float, evenly: int) -> list[tuple[np.ndarray, float]]:
        del mode, target, evenly
        return []


def errors_of(clip: Clip) -> dict[str, dict[int, tuple[float, float]]]:
    """Return the body's RMS shell error and RMS velocity error, by mode and rate of `ERROR_RATES`.

    NaN if the clip has fewer than two samples per key pose.
    """
    result = {mode: dict.fromkeys(ERROR_RATES, (np.nan, np.nan)) for mode in MODES}
    for rate in ERROR_RATES:
        made = reconstruct(clip, Uniform(str(rate)), MODES, JOINT_RADIUS_M) if has_samples_for(clip, rate) else None
        for row in measured(made).rows if made else ():
            result[row.mode][rate] = row.rms_shell_m, row.rms_velocity_m_s
    return result


def measure(clips: Sequence[Clip]) -> dict[str, Any]:
    """Return all results, with geometric means over bodies."""
    needed, rates = [needed_of(clip) for clip in clips], [int(rate) for rate in RATES]
    errors = {clip.name: errors_of(clip) for clip in clips}

    def mean(mode: str, rate: int) -> dict[str, float]:
        shell, velocity = geometric_mean(np.array([of_clip[mode][rate] for of_clip in errors.values()]))
        return {"shell": shell, "velocity": velocity}

    return {
        "bodies": {
            clip.name: {
                "joints": len(clip.rest_body.joints),
                "seconds": float(clip.times[-1] - clip.times[0]),
                "samples_per_s": clip.samples_a_second,
                "skipped": clip.calibration,
            }
            for clip in clips
        },
        "rates": rates,
        "needed": {
            mode: {way: means([shares[mode][way] for shares in needed], rates) for way in DECIMATIONS[:2]}
            for mode in MODES
        },
        "errors": {mode: {rate: mean(mode, rate) for rate in ERROR_RATES} for mode in MODES},
        "by_body": {
            name: {mode: {rate: shell for rate, (shell, _) in rates.items()} for mode, rates in of_clip.items()}
            for name, of_clip in errors.items()
        },
    }
