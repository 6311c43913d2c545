"""What key reduction leaves of whole bodies, beside greedy insertion, Blender's own curves and its Decimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from research.decimating import MIN_VARIATION, DecimatedBody, between
from research.studies import interleaved_seconds, report
from rigid_motion.motion import Poses, shell_error
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.analysis.metrics import geometric_mean, key_samples
from rigid_motion_batch.analysis.modes import REFERENCE, STATE_OF_THE_ART
from rigid_motion_batch.analysis.needed import part_of
from rigid_motion_batch.analysis.reconstructions import Reconstruction, moving, reconstruct
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip

TOLERANCE, RADIUS_M, HEIGHT_M = Tolerance("10mm"), 0.03, 1.7
"""The errors that are allowed, of the ball at every joint, and what every body's largest extent is made; metres."""

MODE, COMPARED = "motor_spline", (STATE_OF_THE_ART, REFERENCE, "dq_sclerp", "motor_spline")
WAYS = {"keys of each joint": False, "key poses": True}
RIVALS = "Blender's curves", "Decimate"

MOST_FRAMES = 1200  # longer recordings are cut off
TIMED_FILE = "cmu_01_01"  # the file that is timed uncut


def figures(paths: Sequence[Path]) -> dict[str, Any]:
    """Return all that is measured of the bodies in files."""
    clips = {path.stem: replace(read_clips([str(path)])[0][0], name=path.stem) for path in paths}
    bodies = [of_height(part_of(clip, 0, min(len(clip.times), MOST_FRAMES) - 1)) for clip in clips.values()]
    pairs = {way: [beside(body, way) for body in bodies] for way in WAYS}
    return {
        "bodies": [about(body) | {"extent": HEIGHT_M / body.metres_per_unit} for body in bodies],
        "greedy": [row for body in bodies for row in beside_greedy(body)],
        "beside": [row for of_way in pairs.values() for rows in of_way for row in rows],
        "beside_means": {
            way: {
                rival: {
                    name: geometric_mean(np.array([rows[place][name] / rows[0][name] for rows in of_way]))
                    for name in ("frames", "key_count", "numbers")
                }
                for place, rival in enumerate(RIVALS, 1)
            }
            for way, of_way in pairs.items()
            if of_way
        },
        "timing": [row for name in clips.keys() & {TIMED_FILE} or clips for row in timing(of_height(clips[name]))],
    }


def about(body: Clip) -> dict[str, Any]:
    """Return what a body is."""
    joints, frames = body.poses.shape
    return {"name": body.name, "joints": joints, "frames": frames, "rate": body.samples_a_second}


def of_height(clip: Clip) -> Clip:
    """Return the same body, larger or smaller: in the first frame its joints span `HEIGHT_M` along one of the axes."""
    places = clip.rest_body.skeleton.in_root_space(clip.poses[:, :1]).positions
    return replace(clip, metres_per_unit=HEIGHT_M / float(np.ptp(places, axis=(0, 1)).max()))


def reduced(body: Clip, mode: str = MODE, *, shared: bool = True) -> Reconstruction:
    """Return the fewest keys within the tolerance."""
    return reconstruct(body, TOLERANCE, [mode], RADIUS_M, shared=shared)


# -- key poses ---------------------------------------------------------------------------------------------------------


@cache
def truth_of(body: Clip) -> Poses:
    """Return where the joints are in the recording, in metres, shape (joints, n)."""
    return body.in_metres(body.rest_body.skeleton.in_root_space(body.poses))


def errors_of(body: Clip, keys: np.ndarray, mode: str) -> np.ndarray:
    """Return the largest error of any joint on every frame, by key poses (k,), in metres, shape (n,)."""
    radii = np.full(len(body.poses), RADIUS_M)
    made = Reconstruction(body, TOLERANCE, {mode: (keys,) * len(body.poses)}, radii, shared=True)
    return shell_error(made.shown(mode, body.times), truth_of(body), RADIUS_M).max(axis=0)


def greedy(body: Clip, mode: str = MODE, tolerance: float = TOLERANCE.metres(1.0)) -> np.ndarray:
    """Put in key poses where the error is largest, until it is small enough; then take out each, in turn, that can go.

    They have shape (k,).
    """
    keys = np.array((0, len(body.times) - 1))
    while (errors := errors_of(body, keys, mode)).max() > tolerance:
        keys = np.union1d(keys, [np.argmax(errors)])
    for key in keys[1:-1]:
        fewer = keys[keys != key]
        if errors_of(body, fewer, mode).max() <= tolerance:
            keys = fewer
    return keys


def beside_greedy(body: Clip) -> list[dict[str, Any]]:
    """Return how many key poses there are beside greedy insertion."""
    report(f"{body.name}, greedy insertion")
    return [
        {
            "body": body.name,
            "mode": mode,
            "greedy": len(greedy(body, mode)),
            "key_count": max(map(len, reduced(body, mode).keys[mode])),
        }
        for mode in COMPARED
    ]


# -- Blender's own, and time -----------------------------------------------------------------------------------------


def beside(body: Clip, way: str) -> list[dict[str, Any]]:
    """Return what is left by keys of each joint or by key poses, by the same with Blender's curves between them, and by
    Decimate within the error that the first have.
    """
    report(f"{body.name}, {way}")
    made = {mode: reduced(body, mode, shared=WAYS[way]) for mode in (MODE, REFERENCE)}
    own, curves = (left_by(one) for one in made.values())
    left = DecimatedBody(made[MODE]).within(1e-3 * own["error_mm"])
    rows = own, curves, left.figures()
    return [{"body": body.name, "how": how, **row} for how, row in zip((way, *RIVALS), rows, strict=True)]


def left_by(made: Reconstruction) -> dict[str, Any]:
    """Return what the keys of its one mode are, their largest error between frames as well, and how far feet slide."""
    (row,) = measured(made).rows
    slides = {"slide_mm": row.foot_slide_m, "recorded_slide_mm": row.recorded_slide_m}
    return {
        "frames": row.key_frames,
        "key_count": row.keys,
        "numbers": numbers_of(made),
        "on_frames_mm": 1e3 * row.max_shell_m,
        "error_mm": 1e3 * largest_error(made),
        **{name: None if metres is None else 1e3 * metres for name, metres in slides.items()},
    }


def largest_error(made: Reconstruction) -> float:
    """Return the largest error of any joint at any part of a frame, in metres: the recording is straight between its
    samples.
    """
    (mode,) = made.keys
    every = np.arange(made.samples.start, made.samples.stop)
    times, straight = between(made.times), replace(made, keys={STATE_OF_THE_ART: (every,) * len(made.radii)})
    truth = straight.shown(STATE_OF_THE_ART, times)
    return float(shell_error(made.shown(mode, times), truth, made.radii[:, None]).max())


def numbers_of(made: Reconstruction) -> int:
    """Return how many numbers the keys take: for each its time, and the place and the turn where these vary."""
    (keys,), clip = made.keys.values(), made.clip
    places = np.ptp(clip.poses.positions, axis=1).max(axis=1) * clip.metres_per_unit > MIN_VARIATION
    counts, channels, moves = np.array([*map(len, keys)]), 4 + 3 * places, moving(clip)
    times = len(key_samples(keys)) if made.shared else counts[moves].sum()
    return int(times + (counts * channels)[moves].sum())


def timing(body: Clip) -> list[dict[str, Any]]:
    """Return the seconds of both ways to have keys, and as multiples of greedy insertion's."""
    report(f"{body.name}, time")
    runs = {how: lambda shared=shared: reduced(body, shared=shared) for how, shared in WAYS.items()}
    seconds = {how: min(spent) for how, spent in interleaved_seconds(runs | {"": lambda: greedy(body)}, 2).items()}
    return [
        about(body) | {"how": how, "seconds": seconds[how], "of_greedy": seconds[how] / seconds[""]} for how in runs
    ]
