"""What key reduction leaves of whole bodies, beside greedy insertion, Blender's Decimate and published figures."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from research.bodies import RADIUS, Body, Keys, Rig, UnusableRigError, import_rig
from research.publishing import say
from rigid_motion.motion import MODES, Poses, interpolate, reduce_keys, reduce_skeleton_keys, shell_error
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.scenes.decimated_bodies import FREE, STRAIGHT, Decimations, Left, left_of_fcurves

TOLERANCE, HEIGHT = 0.01, 1.7
"""Metres: of every joint's ball, and what every body's largest extent is made."""

MODE, COMPARED = "motor_spline", ("lerp_slerp", "dq_sclerp", "motor_spline")

OWN, SHARED = "each joint its own", "key poses"

TRIALS = 12
"""Of Decimate's error margins."""

LONG = "cmu_01_01"
"""The file that is timed uncut."""

SAMPLES, SINGLE = 900, {"tolerance": 0.005, "radius": 0.1}
"""Of a single recording that is timed."""

OZZ_BODY, OZZ_KEYS, OZZ_LARGEST, OZZ_RADIUS = "pab_walk", 901, 0.00225, 0.1
"""What ozz-animation's optimizer leaves of 8241 keys of this file; the largest error and its distance, in metres."""

NOISE = 0.01
"""Of the tolerance: what changes by less is kept constant first."""

FEET, STILL, LOW, SHORTEST = ("foot", "toe"), 0.05, 0.05, 0.1
"""In the names of joints; a foot stands that is slower (m/s) and lower (m) than this for so many seconds at least."""

WEIGHT = 4.0
"""What feet count for, where they have a weight."""

BATCH = 2**11
"""Pairs of keys looked at in one go."""


def figures(paths: Sequence[Path], recordings: list[tuple[str, float, Poses]]) -> dict[str, Any]:
    """All that is measured of the bodies in files; of recordings (names, frames a second, poses), the time."""
    result: dict[str, Body] = {}
    decimate: list[tuple[str, list[Left]]] = []
    for path in paths:
        say(f"{path.name}, Decimate")
        try:
            rig = import_rig(path)
        except UnusableRigError as error:
            say(str(error))
            continue
        body = rig.body()
        result[body.name] = body
        decimate.append((body.name, beside_decimate(rig, body.of_size(HEIGHT))))
    bodies = [body.of_size(HEIGHT) for body in result.values()]
    uncut = [import_rig(path, sys.maxsize).body().of_size(HEIGHT) for path in paths if path.stem == LONG]
    return {
        "bodies": [
            {"name": it.name, "joints": len(it.joints), "frames": it.frames, "rate": it.rate, "extent": it.extent}
            for it in result.values()
        ],
        "greedy": [row for body in bodies for row in beside_greedy(body)],
        "decimate": [row_of(body, left) for body, ways in decimate for left in ways],
        "decimate_means": means([ways for _, ways in decimate]),
        "ozz_keys": OZZ_KEYS,
        "ozz": beside_ozz(result[OZZ_BODY]) if OZZ_BODY in result else [],
        "feet": [row for body in bodies for row in slides(body)],
        "timing": [row for body in uncut or bodies for row in timing(body)],
        "timing_single": [timing_single(*recording) for recording in recordings],
    }


def reduced(body: Body, mode: str = MODE, tolerance: float = TOLERANCE, radius: float = RADIUS, **options: Any) -> Keys:
    """The keys of each joint; those of key poses (`shared`) are all alike."""
    return reduce_skeleton_keys(
        body.times, body.poses, body.parents, mode, tolerance=tolerance, radius=radius, **options
    )


# -- key poses ---------------------------------------------------------------------------------------------------------


def greedy(body: Body, mode: str = MODE, tolerance: float = TOLERANCE, radius: float = RADIUS) -> np.ndarray:
    """One key at a time where the error is largest, until it is small enough; then each goes, in turn, that can."""

    def errors(keys: np.ndarray) -> np.ndarray:
        return body.errors(body.shown_by_key_poses(keys, mode), radius).max(axis=0)

    keys = np.array((0, body.frames - 1))
    while (result := errors(keys)).max() > tolerance:
        keys = np.union1d(keys, [np.argmax(result)])
    for key in keys[1:-1]:
        fewer = keys[keys != key]
        if errors(fewer).max() <= tolerance:
            keys = fewer
    return keys


def optimum(body: Body, mode: str, tolerance: float = TOLERANCE) -> int:
    """The fewest key poses there can be, by an exact dynamic programme that tries every frame as the next key.

    It is for modes by which what is between two keys depends on no others.
    """
    if MODES[mode].is_smooth:
        raise ValueError(f"between two keys, {mode} depends on others as well")
    fewest = np.full(body.frames, math.inf)
    fewest[0] = 1
    for start in range(body.frames - 1):
        good = np.arange(start + 1, body.frames)
        for share in (0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875):
            good = good[
                errors_between(body, mode, start, good, start + ((good - start) * share).astype(int)) <= tolerance
            ]
        ends = np.repeat(good, good - start)
        samples = np.concatenate([np.arange(start, end) for end in good])
        wrong = ends[errors_between(body, mode, start, ends, samples) > tolerance]
        good = np.setdiff1d(good, wrong)
        fewest[good] = np.minimum(fewest[good], fewest[start] + 1)
    return int(fewest[-1])


def errors_between(body: Body, mode: str, start: int, ends: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """The largest error of any joint at a sample (m,) between two keys, of which the second is one of `ends` (m,)."""
    result = np.empty(len(samples))
    for first in range(0, len(samples), BATCH):
        some = slice(first, first + BATCH)
        keys = np.stack((np.full(len(ends[some]), start), ends[some]), axis=-1)
        shape = (len(body.joints), len(keys))
        between = interpolate(
            np.broadcast_to(body.times[keys], (*shape, 2)),
            body.poses[:, keys],
            np.broadcast_to(body.times[samples[some], None], (*shape, 1)),
            mode,
        )
        shown = body.skeleton.in_root_space(Poses(between.positions[:, :, 0], between.quaternions[:, :, 0]))
        result[some] = shell_error(shown, body.truth[:, samples[some]], RADIUS).max(axis=0)
    return result


def beside_greedy(body: Body) -> list[dict[str, Any]]:
    """Key poses beside those of greedy insertion, and beside the fewest there can be."""
    say(f"{body.name}, greedy insertion")
    return [
        {
            "body": body.name,
            "mode": mode,
            "greedy": len(greedy(body, mode)),
            "key_count": len(reduced(body, mode, shared=True)[0]),
            "optimum": None if MODES[mode].is_smooth else optimum(body, mode),
        }
        for mode in COMPARED
    ]


# -- Blender's Decimate ------------------------------------------------------------------------------------------------


def beside_decimate(rig: Rig, body: Body) -> list[Left]:
    """Keys of each joint's own, key poses, Decimate with one error margin, and what was there before."""
    channels = body.moving + body.turning
    own, shared = reduced(body), reduced(body, shared=True)[0]
    counted = [(keys, count) for keys, count in zip(own, channels.tolist(), strict=True) if count]

    def seen(how: str = "Decimate", numbers_of_key: int = FREE) -> Left:
        poses = rig.poses()
        poses.positions[...] *= body.enlarged
        largest = float(body.errors(body.skeleton.in_root_space(poses)).max())
        return left_of_fcurves(how, rig.keys(), largest, numbers_of_key)

    return [
        Left(
            OWN,
            len(set().union(*(keys.tolist() for keys, _ in counted))),
            sum(len(keys) for keys, _ in counted),
            sum(len(keys) * (1 + count) for keys, count in counted),
            float(body.errors(body.shown(own, MODE)).max()),
        ),
        Left(
            SHARED,
            len(shared),
            len(shared) * np.count_nonzero(channels),
            len(shared) * (1 + int(channels.sum())),
            float(body.errors(body.shown_by_key_poses(shared, MODE)).max()),
        ),
        Decimations(rig.obj, seen, TRIALS).within(TOLERANCE) or seen(),
        seen("as imported", STRAIGHT),
    ]


def row_of(body: str, left: Left) -> dict[str, Any]:
    """The figures of what is left."""
    figures = {"frames": left.frames, "key_count": left.keys, "numbers": left.numbers, "error_mm": 1e3 * left.largest}
    return {"body": body, "how": left.how, **figures}


def means(outcomes: list[list[Left]]) -> dict[str, dict[str, float]]:
    """What Decimate has, in multiples of the others: geometric means over the bodies."""
    return {
        how: {
            name: geometric_mean(np.array([getattr(ways[2], name) / getattr(ways[row], name) for ways in outcomes]))
            for name in ("frames", "numbers")
        }
        for row, how in enumerate((OWN, SHARED))
    }


# -- ozz-animation -----------------------------------------------------------------------------------------------------


def beside_ozz(body: Body) -> list[dict[str, Any]]:
    """Keys as ozz-animation counts them, for each mode; the body is of its own size, in metres."""
    say("ozz-animation")
    still = np.ptp(body.poses.positions, axis=1).max(axis=1) < NOISE * OZZ_LARGEST
    positions = np.where(still[:, None, None], body.poses.positions[:, :1], body.poses.positions)
    moving = np.where(still, 0, body.moving)
    cleaned = replace(body, poses=Poses(positions, body.poses.quaternions), moving=moving)
    rows = []
    for mode in COMPARED:
        keys = reduced(cleaned, mode, OZZ_LARGEST, OZZ_RADIUS)
        largest = body.errors(cleaned.shown(keys, mode), OZZ_RADIUS).max()
        varying, constant = track_keys(cleaned, keys)
        rows.append(
            {"mode": mode, "error_mm": 1e3 * largest, "key_count": int(varying + constant), "varying": int(varying)}
        )
    return rows


def track_keys(body: Body, keys: Keys) -> tuple[int, int]:
    """Keys of translations and rotations that vary, and one for each that does not, unless it is the identity."""
    counts = np.array([len(own) for own in keys])
    moved = np.abs(body.poses.positions[:, 0]).max(axis=1) >= 1e-6
    turned = np.abs(body.poses.quaternions[:, 0, 1:]).max(axis=1) >= 1e-6
    varying = counts[body.moving > 0].sum() + counts[body.turning > 0].sum()
    return varying, (moved & (body.moving == 0)).sum() + (turned & (body.turning == 0)).sum()


# -- feet --------------------------------------------------------------------------------------------------------------


def contacts(body: Body) -> list[tuple[int, int, int]]:
    """The joints of feet that stand, each from one sample to another."""
    result = []
    for joint in np.flatnonzero(is_foot(body)).tolist():
        places = body.truth.positions[joint]
        speed = np.linalg.norm(np.gradient(places, 1.0 / body.rate, axis=0), axis=1)
        stands = (speed < STILL) & (places[:, 2] < places[:, 2].min() + LOW)
        bounds = np.flatnonzero(np.diff(np.concatenate(([False], stands, [False])).astype(np.int8)))
        result += [(joint, a, b) for a, b in bounds.reshape(-1, 2).tolist() if (b - a) / body.rate >= SHORTEST]
    return result


def is_foot(body: Body) -> np.ndarray:
    """Which joints are of feet."""
    return np.array([any(word in name.lower() for word in FEET) for name in body.joints])


def slide(positions: np.ndarray, standing: list[tuple[int, int, int]]) -> dict[str, float]:
    """How far joints at positions (joints, n, 3) get across the ground from where they began to stand."""
    across = [positions[joint, start:end, :2] for joint, start, end in standing]
    ways = [1e3 * float(np.linalg.norm(places - places[0], axis=1).max()) for places in across]
    return {"largest_mm": max(ways), "total_mm": sum(ways)}


def slides(body: Body) -> list[dict[str, Any]]:
    """How far feet slide in the recording, and by each way to reduce its keys; nothing where none stands."""
    if not (standing := contacts(body)):
        return []
    say(f"{body.name}, feet")
    about = {"body": body.name, "contacts": len(standing)}
    rows = [{**about, "how": "recording", "key_count": body.frames, **slide(body.truth.positions, standing)}]
    for how, shared in ((OWN, False), (SHARED, True)):
        for more, weights in (("", None), (f", feet weigh {WEIGHT:g}", np.where(is_foot(body), WEIGHT, 1.0))):
            keys = reduced(body, shared=shared, weights=weights)
            count = len(keys[0]) if shared else sum(map(len, keys))
            slid = slide(body.shown(keys, MODE).positions, standing)
            rows.append({**about, "how": how + more, "key_count": count, **slid})
    return rows


# -- time --------------------------------------------------------------------------------------------------------------


def seconds(run: Callable[[], object]) -> float:
    """Of the faster of two runs."""
    result = []
    for _ in range(2):
        start = time.perf_counter()
        run()
        result.append(time.perf_counter() - start)
    return min(result)


def timing(body: Body) -> list[dict[str, Any]]:
    """Both ways to have keys, and greedy insertion of key poses in multiples."""
    say(f"{body.name}, time")
    theirs = seconds(lambda: greedy(body))
    rows = []
    for how, shared in ((OWN, False), (SHARED, True)):
        ours = seconds(lambda shared=shared: reduced(body, shared=shared))
        about = {"name": body.name, "joints": len(body.joints), "frames": body.frames, "how": how}
        rows.append({**about, "seconds": ours, "of_greedy": ours / theirs})
    return rows


def timing_single(name: str, rate: float, poses: Poses) -> dict[str, Any]:
    """The first samples of a recording at so many frames a second."""
    poses = poses[:SAMPLES]
    times, lifted = np.arange(len(poses)) / rate, Poses(poses.positions[None], poses.quaternions[None])
    body = Body(name, rate, (name,), np.array([-1]), lifted, np.array([3]), np.array([4]))
    ours, theirs = seconds(lambda: reduce_keys(times, poses, MODE, **SINGLE)), seconds(lambda: greedy(body, **SINGLE))
    return {
        "name": name,
        "samples": len(poses),
        "seconds": ours,
        "key_count": len(reduce_keys(times, poses, MODE, **SINGLE)),
        "greedy_seconds": theirs,
        "greedy_key_count": len(greedy(body, **SINGLE)),
        "of_greedy": ours / theirs,
    }
