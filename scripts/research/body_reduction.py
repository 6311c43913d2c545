"""What key reduction leaves of whole bodies, beside greedy insertion, Blender's Decimate and published figures."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from research.bodies import RADIUS, Body, Keys, Rig, UnusableRigError, import_rig
from research.studies import report, seconds_in_turns
from rigid_motion.motion import MODES, Poses, interpolate, reduce_skeleton_keys, shell_error
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.scenes.decimated_bodies import FREE, STRAIGHT, Decimations, Left, left_of_fcurves

TOLERANCE, HEIGHT = 0.01, 1.7  # metres: of every joint's ball, and what every body's largest extent is made

MODE, COMPARED = "motor_spline", ("lerp_slerp", "dq_sclerp", "motor_spline")
SINGLE, SHARED = "each joint its own", "key poses"
KEYS = ((SINGLE, False), (SHARED, True))  # the ways to have keys

TRIALS = 12  # of Decimate's error margins
LONG = "cmu_01_01"  # the file that is timed uncut

OZZ_BODY, OZZ_KEYS, OZZ_LARGEST, OZZ_RADIUS = "pab_walk", 901, 0.00225, 0.1
"""What ozz-animation's optimizer leaves of 8241 keys of this file; the largest error and its distance, in metres."""

NOISE = 0.01  # of the tolerance: what changes by less is kept constant first

FEET, STILL, LOW, SHORTEST = ("foot", "toe"), 0.05, 0.05, 0.1
"""In the names of joints; a foot stands that is slower (m/s) and lower (m) than this for so many seconds at least."""

WEIGHT = 4.0  # what feet count for, where they have a weight
BATCH = 2**11  # pairs of keys looked at in one go


def figures(paths: Sequence[Path]) -> dict[str, Any]:
    """Return all that is measured of the bodies in files."""
    imported: dict[str, Body] = {}
    decimated: dict[str, list[Left]] = {}
    for path in paths:
        report(f"{path.name}, Decimate")
        try:
            rig = import_rig(path)
        except UnusableRigError as error:
            report(str(error))
            continue
        body = imported[path.stem] = rig.body()
        decimated[body.name] = beside_decimate(rig, body.of_size(HEIGHT))
    bodies = [body.of_size(HEIGHT) for body in imported.values()]
    uncut = [import_rig(path, sys.maxsize).body().of_size(HEIGHT) for path in paths if path.stem == LONG]
    return {
        "bodies": [
            {"name": name, "joints": len(it.joints), "frames": it.frames, "rate": it.rate, "extent": it.extent}
            for name, it in imported.items()
        ],
        "greedy": [row for body in bodies for row in beside_greedy(body)],
        "decimate": [
            {"body": body, "how": left.how, **figures_of(left)} for body, ways in decimated.items() for left in ways
        ],
        "decimate_means": means(list(decimated.values())),
        "ozz_keys": OZZ_KEYS,
        "ozz": beside_ozz(imported[OZZ_BODY]) if OZZ_BODY in imported else [],
        "feet": [row for body in bodies for row in slides(body)],
        "timing": [row for body in uncut or bodies for row in timing(body)],
    }


def reduced(body: Body, mode: str = MODE, tolerance: float = TOLERANCE, radius: float = RADIUS, **options: Any) -> Keys:
    """Return the keys of each joint; those of key poses (`shared`) are one array."""
    keys = reduce_skeleton_keys(
        body.times, body.poses, body.parents, mode, tolerance=tolerance, radius=radius, **options
    )
    return keys[0] if options.get("shared") else keys


# -- key poses ---------------------------------------------------------------------------------------------------------


def greedy(body: Body, mode: str = MODE, tolerance: float = TOLERANCE, radius: float = RADIUS) -> np.ndarray:
    """Put in key poses where the error is largest, until it is small enough; then take out each, in turn, that can go.

    They have shape (k,).
    """

    def errors(keys: np.ndarray) -> np.ndarray:
        return body.errors(body.shown(keys, mode), radius).max(axis=0)

    keys = np.array((0, body.frames - 1))
    while (result := errors(keys)).max() > tolerance:
        keys = np.union1d(keys, [np.argmax(result)])
    for key in keys[1:-1]:
        fewer = keys[keys != key]
        if errors(fewer).max() <= tolerance:
            keys = fewer
    return keys


def optimum(body: Body, mode: str, tolerance: float = TOLERANCE) -> int:
    """Return the fewest key poses there can be, by an exact dynamic programme that tries every frame as the next key.

    It is for modes by which what is between two keys depends on no others.
    """
    if MODES[mode].is_smooth:
        raise ValueError(f"between two keys, {mode} depends on others as well")
    fewest = np.full(body.frames, math.inf)
    fewest[0] = 1
    for start in range(body.frames - 1):
        ends = np.arange(start + 1, body.frames)
        for share in (0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875):
            samples = start + ((ends - start) * share).astype(int)
            ends = ends[errors_between(body, mode, start, ends, samples) <= tolerance]
        tried, samples = np.repeat(ends, ends - start), np.concatenate([np.arange(start, end) for end in ends])
        ends = np.setdiff1d(ends, tried[errors_between(body, mode, start, tried, samples) > tolerance])
        fewest[ends] = np.minimum(fewest[ends], fewest[start] + 1)
    return int(fewest[-1])


def errors_between(body: Body, mode: str, start: int, ends: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return the largest error of any joint at samples (m,), each between a first key and the second in `ends` (m,)."""
    result = np.empty(len(samples))
    for first in range(0, len(samples), BATCH):
        batch = slice(first, first + BATCH)
        keys = np.stack(np.broadcast_arrays(start, ends[batch]), axis=-1)
        times = np.broadcast_to(body.times[keys], (len(body.joints), *keys.shape))
        moments = np.broadcast_to(body.times[samples[batch], None], (*times.shape[:2], 1))
        between = interpolate(times, body.poses[:, keys], moments, mode)
        shown = body.skeleton.in_root_space(between[:, :, 0])
        result[batch] = shell_error(shown, body.truth[:, samples[batch]], RADIUS).max(axis=0)
    return result


def beside_greedy(body: Body) -> list[dict[str, Any]]:
    """Return how many key poses there are beside greedy insertion, and beside the fewest there can be."""
    report(f"{body.name}, greedy insertion")
    return [
        {
            "body": body.name,
            "mode": mode,
            "greedy": len(greedy(body, mode)),
            "key_count": len(reduced(body, mode, shared=True)),
            "optimum": None if MODES[mode].is_smooth else optimum(body, mode),
        }
        for mode in COMPARED
    ]


# -- Blender's Decimate ------------------------------------------------------------------------------------------------


def beside_decimate(rig: Rig, body: Body) -> list[Left]:
    """Return what is left by keys of each joint, by key poses, by Decimate with one error margin, and by none of it."""
    channels = body.moving + body.turning

    def by_keys(how: str, keys: Keys) -> Left:
        of_joints = [keys] * len(channels) if how == SHARED else keys
        counted = [
            (samples.tolist(), count) for samples, count in zip(of_joints, channels.tolist(), strict=True) if count
        ]
        frames, count = len(set().union(*(samples for samples, _ in counted))), sum(len(it) for it, _ in counted)
        numbers = sum(len(samples) * count for samples, count in counted) + (frames if how == SHARED else count)
        return Left(how, frames, count, numbers, float(body.errors(body.shown(keys, MODE)).max()))

    def by_fcurves(how: str = "Decimate", numbers_of_key: int = FREE) -> Left:
        poses = rig.poses()
        poses.positions[...] *= body.enlarged
        largest = float(body.errors(body.skeleton.in_root_space(poses)).max())
        return left_of_fcurves(how, rig.keys(), largest, numbers_of_key)

    return [
        *(by_keys(how, reduced(body, shared=shared)) for how, shared in KEYS),
        Decimations(rig.obj, by_fcurves, TRIALS).within(TOLERANCE) or by_fcurves(),
        by_fcurves("as imported", STRAIGHT),
    ]


def figures_of(left: Left) -> dict[str, float]:
    """Return the figures of what is left."""
    return {"frames": left.frames, "key_count": left.keys, "numbers": left.numbers, "error_mm": 1e3 * left.largest}


def means(outcomes: list[list[Left]]) -> dict[str, dict[str, float]]:
    """Return what Decimate has, in multiples of the others: geometric means over the bodies."""
    return {
        how: {
            name: geometric_mean(np.array([getattr(ways[2], name) / getattr(ways[row], name) for ways in outcomes]))
            for name in ("frames", "numbers")
        }
        for row, (how, _) in enumerate(KEYS)
    }


# -- ozz-animation -----------------------------------------------------------------------------------------------------


def beside_ozz(body: Body) -> list[dict[str, Any]]:
    """Return keys as ozz-animation counts them, for each mode; the body is of its own size, in metres."""
    report("ozz-animation")
    still = np.ptp(body.poses.positions, axis=1).max(axis=1) < NOISE * OZZ_LARGEST
    positions = np.where(still[:, None, None], body.poses.positions[:, :1], body.poses.positions)
    moving = np.where(still, 0, body.moving)
    cleaned = replace(body, poses=Poses(positions, body.poses.quaternions), moving=moving)
    rows = []
    for mode in COMPARED:
        keys = reduced(cleaned, mode, OZZ_LARGEST, OZZ_RADIUS)
        largest = body.errors(cleaned.shown(keys, mode), OZZ_RADIUS).max()
        varying, constant = track_keys(cleaned, keys)
        rows.append({"mode": mode, "error_mm": 1e3 * largest, "key_count": varying + constant, "varying": varying})
    return rows


def track_keys(body: Body, keys: Keys) -> tuple[int, int]:
    """Return how many keys of translations and rotations vary, and one for each that does not but for the identity."""
    counts = np.array([len(samples) for samples in keys])
    moved = np.abs(body.poses.positions[:, 0]).max(axis=1) >= 1e-6
    turned = np.abs(body.poses.quaternions[:, 0, 1:]).max(axis=1) >= 1e-6
    varying = counts[body.moving > 0].sum() + counts[body.turning > 0].sum()
    return int(varying), int((moved & (body.moving == 0)).sum() + (turned & (body.turning == 0)).sum())


# -- feet --------------------------------------------------------------------------------------------------------------


def contacts(body: Body) -> list[tuple[int, int, int]]:
    """Return the joints of feet that stand, each from one sample to another."""
    result = []
    for joint in np.flatnonzero(is_foot(body)).tolist():
        places = body.truth.positions[joint]
        speed = np.linalg.norm(np.gradient(places, 1.0 / body.rate, axis=0), axis=1)
        stands = (speed < STILL) & (places[:, 2] < places[:, 2].min() + LOW)
        bounds = np.flatnonzero(np.diff(np.pad(stands, 1).astype(np.int8)))
        result += [(joint, a, b) for a, b in bounds.reshape(-1, 2).tolist() if (b - a) / body.rate >= SHORTEST]
    return result


def is_foot(body: Body) -> np.ndarray:
    """Return which joints are of feet."""
    return np.array([any(word in name.lower() for word in FEET) for name in body.joints])


def slide(positions: np.ndarray, standing: list[tuple[int, int, int]]) -> dict[str, float]:
    """Return how far joints at positions (joints, n, 3) get across the ground from where they began to stand."""
    across = [positions[joint, start:end, :2] for joint, start, end in standing]
    ways = [1e3 * float(np.linalg.norm(places - places[0], axis=1).max()) for places in across]
    return {"largest_mm": max(ways), "total_mm": sum(ways)}


def slides(body: Body) -> list[dict[str, Any]]:
    """Return how far feet slide in the recording, and by each way to reduce its keys; nothing where none stands."""
    if not (standing := contacts(body)):
        return []
    report(f"{body.name}, feet")
    about = {"body": body.name, "contacts": len(standing)}
    rows = [{**about, "how": "recording", "key_count": body.frames, **slide(body.truth.positions, standing)}]
    for how, shared in KEYS:
        for weighed, weights in (("", None), (f", feet weigh {WEIGHT:g}", np.where(is_foot(body), WEIGHT, 1.0))):
            keys = reduced(body, shared=shared, weights=weights)
            slid = slide(body.shown(keys, MODE).positions, standing)
            count = len(keys) if shared else sum(map(len, keys))
            rows.append({**about, "how": how + weighed, "key_count": count, **slid})
    return rows


# -- time --------------------------------------------------------------------------------------------------------------


def timing(body: Body) -> list[dict[str, Any]]:
    """Return the seconds of both ways to have keys, and as multiples of greedy insertion's."""
    report(f"{body.name}, time")
    runs = {how: lambda shared=shared: reduced(body, shared=shared) for how, shared in KEYS}
    seconds = {how: min(spent) for how, spent in seconds_in_turns(runs | {"": lambda: greedy(body)}, 2).items()}
    about = {"name": body.name, "joints": len(body.joints), "frames": body.frames}
    return [{**about, "how": how, "seconds": seconds[how], "of_greedy": seconds[how] / seconds[""]} for how in runs]
