"""Comparison of modes with Blender's own curves: accuracy on recordings, and the benefits of rigid motion.

    python scripts/research rivals --recordings FOLDER

Errors are shell errors at a radius of 0.1 m with evenly spaced keys, as ratios to those of Blender's curves; means are
geometric, over the recordings of the folder that have two samples per key.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from research.paper.motions import read_all, read_motion
from research.studies import files_in, publish, report, study_parser
from rigid_motion.motion import Poses, decimate, interpolate, rms, shell_error
from rigid_motion.motion.quaternions import align_signs, conjugate, multiply, rotate
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE, STATE_OF_THE_ART
from rigid_motion_batch.places import ASSETS, from_here
from rigid_motion_batch.recordings.clips import Clip

MODES = (REFERENCE, STATE_OF_THE_ART, "dq_sclerp", "pga_lerp", "motor_spline")
KEYS_PER_S = (2, 3, 5, 10, 20, 30)
"""Keys per second."""

SHELL_RADIUS_M = 0.1
MAX_RECORDING_S = 20.0
"""Maximum seconds used of a recording."""

LEVERS_M = (0.1, 0.3, 1.0)
"""Metres from the hand to the origin of the tool it holds."""

MAX_ROUNDING_M = 1e-6
"""Metres that count as zero."""

HELD_AT = (5, 10)
REACHED_AT = 8
DOOR_TURNS_DEG = (60, 120, 170)
"""Degrees that a door turns between two keys."""

HINGE_DISTANCE_M = 0.8
"""Metres from the door's origin to its hinge."""


def main(arguments: Sequence[str]) -> int:
    """Measure, and write the figures."""
    parser = study_parser("rivals", __doc__ or "")
    parser.add_argument("--recordings", type=Path, required=True, metavar="FOLDER", help="recordings of single bodies")
    options = parser.parse_args(arguments)
    clips, left_out = read_all(files_in([options.recordings]), read_motion)
    found = {
        "recordings": {clip.name: len(clip.times) for clip in clips},
        "left_out": sorted(left_out),
        "errors": errors(clips),
        "slips": slips(clips),
        "doors": {str(degrees): door(degrees) for degrees in DOOR_TURNS_DEG},
        "other_sign_deg": other_sign(clips),
        "reach_mm": reach(),
    }
    return publish("rivals", found, options, "--recordings", options.recordings)


def sampled(clip: Clip, rate: float) -> tuple[np.ndarray, Poses, np.ndarray] | None:
    """Return times in seconds, poses in metres, and the indices of keys, for the first seconds of a clip.

    None if the clip has fewer than two samples per key.
    """
    count = int(np.searchsorted(clip.times, clip.times[0] + MAX_RECORDING_S))
    times, poses = clip.times[:count], clip.in_metres(clip.poses[:count])
    if (len(times) - 1) / (times[-1] - times[0]) < 2.0 * rate:
        return None
    keys = decimate(times, rate)
    part = slice(keys[0], keys[-1] + 1)
    return times[part], poses[part], keys - keys[0]


def errors(clips: Iterable[Clip]) -> dict[str, Any]:
    """Return RMS errors of all modes at all rates, as ratios to the reference's, and the number of clips."""
    result: dict[str, Any] = {}
    for rate in KEYS_PER_S:
        report(f"{rate} keys a second")
        rows = []
        for clip in clips:
            if (taken := sampled(clip, rate)) and len(taken[2]) > 3:
                times, poses, keys = taken
                shown = [interpolate(times[keys], poses[keys], times, mode) for mode in MODES]
                rows.append([rms(shell_error(one, poses, SHELL_RADIUS_M)) for one in shown])
        means = geometric_mean(np.array(rows))
        result[str(rate)] = {"clips": len(rows), **dict(zip(MODES, means / means[0], strict=True))}
    return result


def slips(clips: Iterable[Clip]) -> dict[str, Any]:
    """Return the maximum distance of a tool from its place in the hand that holds it, in mm.

    Hand and tool are keyed at the same times, independently; the lever is the distance between their origins.
    """
    result: dict[str, Any] = {}
    for rate in HELD_AT:
        for lever in LEVERS_M:
            grip = np.array((lever, 0.0, 0.0))
            rows = []
            for clip in clips:
                if (taken := sampled(clip, rate)) is None:
                    continue
                times, hand, keys = taken
                tool = Poses(hand.positions + rotate(hand.quaternions, grip), hand.quaternions)
                row = []
                for mode in MODES:
                    holding, held = (interpolate(times[keys], one[keys], times, mode) for one in (hand, tool))
                    place = rotate(conjugate(holding.quaternions), held.positions - holding.positions)
                    row.append(np.linalg.norm(place - grip, axis=1).max())
                rows.append(row)
            means = 1e3 * geometric_mean(np.maximum(np.array(rows), MAX_ROUNDING_M))
            means = np.where(means > 1.001e3 * MAX_ROUNDING_M, means, 0.0)
            result.setdefault(str(rate), {})[str(lever)] = dict(zip(MODES, means, strict=True))
    return result


def reach() -> dict[str, float]:
    """Return the RMS errors in mm of the generated hand at `REACHED_AT` keys per second, as shown in pictures."""
    taken = sampled(read_motion(from_here(ASSETS) / "reach.csv"), REACHED_AT)
    assert taken is not None
    times, poses, keys = taken
    return {
        mode: 1e3 * rms(shell_error(interpolate(times[keys], poses[keys], times, mode), poses, SHELL_RADIUS_M))
        for mode in MODES
    }


def door(degrees: float) -> dict[str, float]:
    """Return how far a door's hinge leaves its place between two keys, in mm."""
    half = np.radians(degrees) / 2.0
    quaternions = np.array(((1.0, 0.0, 0.0, 0.0), (np.cos(half), 0.0, 0.0, np.sin(half))))
    hinge = np.array((HINGE_DISTANCE_M, 0.0, 0.0))
    keys, result = Poses(rotate(quaternions, hinge), quaternions), {}
    for mode in MODES:
        shown = interpolate([0.0, 1.0], keys, np.linspace(0.0, 1.0, 401), mode)
        off = np.linalg.norm(shown.positions - rotate(shown.quaternions, hinge), axis=1).max()
        result[mode] = 0.0 if off < 1e-9 else 1e3 * float(off)
    return result


def other_sign(clips: Iterable[Clip]) -> dict[str, float]:
    """Return the largest rotation error in degrees at 10 keys per second if every other key's quaternion is negated,
    which is the same pose; the median over the clips.

    Blender interpolates the four numbers as they are; `blenders_quaternions` does the same.
    """
    rows = []
    for clip in clips:
        if taken := sampled(clip, 10):
            times, poses, keys = taken
            kept = poses[keys]
            signed = np.where(np.arange(len(keys)) % 2, -1.0, 1.0)[:, None] * align_signs(kept.quaternions)
            row = []
            for mode in MODES:
                if mode == REFERENCE:
                    turned = blenders_quaternions(times[keys], signed, times)
                else:
                    turned = interpolate(times[keys], Poses(kept.positions, signed), times, mode).quaternions
                off = multiply(conjugate(poses.quaternions), turned)
                half = np.arctan2(np.linalg.norm(off[:, 1:], axis=1), np.abs(off[:, 0]))
                row.append(np.degrees(2.0 * half.max()))
            rows.append(row)
    return dict(zip(MODES, np.median(np.array(rows), axis=0), strict=True))


def blenders_quaternions(key_times: np.ndarray, quaternions: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return Blender's interpolation of quaternions (k, 4) of any sign at times (m,): four independent curves."""
    still = np.tile((1.0, 0.0, 0.0, 0.0), (len(quaternions), 1))
    rows = [
        interpolate(key_times, Poses(quaternions[:, some], still), times, REFERENCE).positions
        for some in ([0, 1, 2], [3, 3, 3])
    ]
    turned = np.column_stack((rows[0], rows[1][:, 0]))
    return turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12)
