"""Comparison of cleaning with filters that are tuned to the true motion, on recordings with added noise.

    python scripts/research cleaning FOLDER

The tracks are recordings, or parts and joints of them. No threshold was chosen with them, except those of long spikes,
held samples, hits and clocks, with other seeds. Noise is seeded: white (1 mm and 0.3 degrees along each axis),
correlated (the same, each sample 0.7 of the one before), white with spikes in a hundredth of the samples, white with
held samples in a fiftieth, and white with jittering timestamps. Errors are RMS shell errors at 10 cm. Tuned rivals know
the true motion: each gets the best of all settings for the clip. Blender's filters are its formulas in NumPy, applied
to locations and to quaternion components.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from research.studies import publish, report, study_parser
from rigid_motion.motion import Poses, clean, shell_error
from rigid_motion.motion.differences import turned_in_world
from rigid_motion.motion.quaternions import align_signs, normalise
from rigid_motion_batch.recordings.clip_reading import read_clips

PLACE_NOISE_M, TURN_NOISE_RAD = 1e-3, np.radians(0.3)
TOLERANCE_M = 3e-3
NOISE_SEEDS = (21, 22, 31, 32)
HIT_SEEDS = range(41, 61)
KINDS = ("white", "correlated", "spikes", "holds", "clock")
HIT_COUNT = 12
CUTOFFS_HZ = np.geomspace(0.5, 60.0, 30)

HAND, OPTICAL, MADE = "hand", "optical", "made"
MIN_NOISE_SAMPLES = 200  # samples: noise is hard to measure in shorter tracks
TRACKS = (
    ("aframe_head.csv", "", 0, HAND),
    ("aframe_right.csv", "", 600, HAND),
    ("broad_fast_rotation.csv", "", 5200, OPTICAL),
    ("freiburg1_xyz.tum", "", 1800, OPTICAL),
    ("cmu_01_01.bvh", "RightForeArm", 1500, OPTICAL),
    ("cmu_01_01.bvh", "LeftToeBase", 1500, OPTICAL),
    ("cmu_01_01.bvh", "Hips", 1500, OPTICAL),
    ("freebvh.bvh", "mixamorig:RightForeArm", 0, OPTICAL),
    ("pab_run.fbx", "Lefthand", 0, OPTICAL),
    ("pab_run.fbx", "LeftFootThumb1", 0, OPTICAL),
)
"""The file, the joint, the first of the 1200 rows to use, and the kind."""

Filter = Callable[[np.ndarray], np.ndarray]


def tracks(folder: Path) -> Iterator[tuple[str, str, np.ndarray, Poses]]:
    """Yield the name, the kind, the times and the poses in metres of each track; generated tracks come last."""
    for file, joint, first, kind in TRACKS:
        (clip, *_), _ = read_clips([str(next(folder.rglob(file)))])
        poses = clip.in_blender(clip.poses)
        if clip.rest_body:
            poses = clip.rest_body.skeleton.in_root_space(poses)[clip.rest_body.joints.index(joint)]
        part = slice(first, first + 1200)
        times, poses = clip.times[part] - clip.times[part][0], poses[part]
        yield f"{Path(file).stem} {joint}".strip(), kind, times, Poses(poses.positions, align_signs(poses.quaternions))
    times = np.arange(900) / 90.0
    phase = np.mod(times, 1.0) - 0.5
    drum, throw = 0.8 * np.abs(phase), 2.45 * (0.25 - phase**2)
    step = 0.3 * np.floor(times) + 0.3 * np.clip(5.0 * np.mod(times, 1.0), 0.0, 1.0)
    for name, height in (("drum", drum), ("throw", throw), ("step", step)):
        places = np.stack([0.2 * np.sin(times), 0.1 * times, height], axis=1)
        tilt = np.stack([np.zeros_like(times), height, 0.0 * times], axis=1)
        still = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
        yield f"made {name}", MADE, times, Poses(places, turned_in_world(still, tilt))


def shaken(kind: str, seed: int, times: np.ndarray, truth: Poses) -> tuple[np.ndarray, Poses, np.ndarray]:
    """Return times and poses with noise, and a mask of samples that are spikes or held."""
    random, count = np.random.default_rng(seed), len(times)
    noise = random.normal(size=(2, count, 3))
    if kind == "correlated":
        for row in range(1, count):
            noise[:, row] = 0.7 * noise[:, row - 1] + np.sqrt(1.0 - 0.7**2) * noise[:, row]
    positions = truth.positions + PLACE_NOISE_M * noise[0]
    quaternions = turned_in_world(truth.quaternions, TURN_NOISE_RAD * noise[1])
    out = np.zeros(count, dtype=bool)
    share = {"spikes": 0.01, "holds": 0.02}.get(kind, 0.0)
    while np.count_nonzero(out) < share * count:
        length, first = int(random.integers(1, 4)), int(random.integers(6, count - 9))
        rows, what = slice(first, first + length), int(random.integers(3))
        if out[first - 6 : first + length + 6].any():
            continue
        out[rows] = True
        if kind == "holds":
            positions[rows], quaternions[rows] = positions[first - 1], quaternions[first - 1]
            continue
        off, turn = (each / np.linalg.norm(each) for each in random.normal(size=(2, 3)))
        if what != 1:
            positions[rows] += random.uniform(0.03, 0.3) * off
        if what != 0:
            quaternions[rows] = turned_in_world(quaternions[rows], np.radians(random.uniform(10, 60)) * turn[None])
    if kind == "clock":
        times = np.sort(times + random.normal(size=count) * 0.1 * np.median(np.diff(times)))
    return times, Poses(positions, align_signs(quaternions)), out


def butterworth(order: int, cutoff: float, rate: float) -> Filter:
    """Return a Butterworth filter run forwards and backwards, by its frequency response, reflecting both ends."""

    def smooth(values: np.ndarray) -> np.ndarray:
        before, behind = 2.0 * values[0] - values[:0:-1], 2.0 * values[-1] - values[-2::-1]
        long = np.concatenate((before, values, behind))
        angles = np.pi * np.fft.rfftfreq(len(long))
        edge = np.tan(np.pi * min(cutoff / rate, 0.499))
        gain = 1.0 / (1.0 + (np.tan(np.minimum(angles, 1.57)) / edge) ** (2 * order))
        return np.fft.irfft(gain[:, None] * np.fft.rfft(long, axis=0), len(long), axis=0)[len(before) :][: len(values)]

    return smooth


def gaussian(width: int, sigma: float) -> Filter:
    """Return Blender's Gaussian smooth: `width` keys on either side, sigma as a fraction of the width."""
    weights = np.exp(-0.5 * (np.abs(np.arange(-width, width + 1)) / width / sigma) ** 2)

    def smooth(values: np.ndarray) -> np.ndarray:
        long = np.pad(values, ((width, width), (0, 0)), mode="edge")
        return sliding_window_view(long, 2 * width + 1, axis=0) @ (weights / weights.sum())

    return smooth


def one_euro(values: np.ndarray, times: np.ndarray, lowest: np.ndarray, betas: np.ndarray) -> np.ndarray:
    """Return values (n, k) filtered by the One Euro filter with settings (m,), shape (m, n, k)."""
    made = np.repeat(values[None], len(lowest), axis=0)
    speed = np.zeros_like(made[:, 0])
    for row, step in enumerate(np.diff(times), 1):
        share = 1.0 / (1.0 + 1.0 / (2.0 * np.pi * step))
        speed += share * ((values[row] - made[:, row - 1]) / step - speed)
        cutoffs = lowest + betas * np.linalg.norm(speed, axis=1)
        shares = 1.0 / (1.0 + 1.0 / (2.0 * np.pi * step * cutoffs))
        made[:, row] = made[:, row - 1] + shares[:, None] * (values[row] - made[:, row - 1])
    return made


def rivals(times: np.ndarray, poses: Poses, truth: Poses) -> dict[str, Poses]:
    """Return a recording filtered by each rival."""
    rate = 1.0 / float(np.median(np.diff(times)))
    channels = poses.positions, poses.quaternions
    widths = np.unique(np.geomspace(1, 60, 25).astype(int))

    def by(smooth: Filter) -> Poses:
        return Poses(smooth(channels[0]), normalise(smooth(channels[1])))

    def best(made: Iterator[Poses]) -> Poses:
        return min(made, key=lambda each: rms(each, truth))

    lowest, betas = (each.ravel() for each in np.meshgrid(np.geomspace(0.3, 30.0, 8), [0, 0.1, 1, 3, 10, 30, 100]))
    places, turns = (one_euro(each, times, lowest, betas) for each in channels)
    place = min(places, key=lambda each: float(np.square(each - truth.positions).sum()))
    turn = min(turns, key=lambda each: float(np.square(normalise(each) - truth.quaternions).sum()))
    return {
        "Butterworth, tuned": best(by(butterworth(2, cutoff, rate)) for cutoff in CUTOFFS_HZ),
        "One Euro, tuned": Poses(place, normalise(turn)),
        "Blender's Butterworth Smooth": by(butterworth(4, 3.0, rate)),
        "Blender's Butterworth Smooth, tuned": best(by(butterworth(4, cutoff, rate)) for cutoff in CUTOFFS_HZ),
        "Blender's Gaussian Smooth": by(gaussian(6, 0.33)),
        "Blender's Gaussian Smooth, tuned": best(by(gaussian(int(width), 0.33)) for width in widths),
    }


def rms(poses: Poses, truth: Poses, rows: np.ndarray | slice = slice(None)) -> float:
    """Return the RMS shell error in metres over some rows."""
    return float(np.sqrt(np.mean(shell_error(poses, truth)[rows] ** 2)))


def hardest(truth: Poses) -> np.ndarray:
    """Return the rows with the largest accelerations."""
    return np.argsort(-np.linalg.norm(np.diff(truth.positions, 2, axis=0), axis=1))[:HIT_COUNT] + 1


def measure(kind: str, seed: int, name: str, track: str, times: np.ndarray, truth: Poses) -> dict[str, Any]:
    """Return the results for a track with this kind of noise. Lengths are in millimetres."""
    stamped, shaky, out = shaken(kind, seed, times, truth)
    free, capped = clean(stamped, shaky), clean(stamped, shaky, TOLERANCE_M)
    left_out = capped.spikes | capped.repeats
    again = clean(capped.times, capped.poses, TOLERANCE_M)
    hits = hardest(truth)
    errors = {"recorded": shaky, "cleaned": free.poses, **rivals(stamped, shaky, truth)}
    found = free.spikes | free.repeats
    return {
        "noise": kind,
        "seed": seed,
        "track": name,
        "kind": track,
        "rms": {key: 1e3 * rms(each, truth) for key, each in errors.items()},
        "hits": {key: 1e3 * rms(each, truth, hits) for key, each in errors.items()},
        "floor": (free.noise / (PLACE_NOISE_M, TURN_NOISE_RAD)).tolist(),
        "out": [int(out.sum()), int((found & out).sum()), int((found & ~out).sum()), len(times)],
        "over": float(capped.moved[~left_out].max() / TOLERANCE_M),
        "again": float(again.moved.max() / TOLERANCE_M),
        "alone": float(free.alone.mean()),
        "steadied": bool((free.times != stamped).any()),
    }


def hit_ratio(seed: int, times: np.ndarray, truth: Poses) -> float:
    """Return the remaining fraction of the error at the hits of a track with white noise."""
    _, shaky, _ = shaken("white", seed, times, truth)
    hits = hardest(truth)
    return rms(clean(times, shaky).poses, truth, hits) / rms(shaky, truth, hits)


def spread(values: list[Any]) -> list[float]:
    """Return minimum, median and maximum."""
    return [float(part) for part in np.percentile(values, (0, 50, 100))]


def summaries(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return by kind of noise the error ratios to each rival: the geometric mean and the worst clip's."""
    result = {}
    for kind in KINDS:
        own = [row for row in rows if row["noise"] == kind]
        table = {}
        for rival in own[0]["rms"]:
            if rival != "cleaned":
                ratios = np.array(
                    [[row[what]["cleaned"] / row[what][rival] for what in ("rms", "hits")] for row in own]
                )
                table[rival] = [*np.exp(np.log(ratios).mean(axis=0)).tolist(), *ratios.max(axis=0).tolist()]
        result[kind] = {
            "ratios": table,
            "means": {key: float(np.mean([row["rms"][key] for row in own])) for key in own[0]["rms"]},
            "out": np.sum([row["out"] for row in own], axis=0).tolist(),
            "floor": [
                spread([row["floor"] for row in own if (row["out"][3] < MIN_NOISE_SAMPLES) == short])
                for short in (False, True)
            ],
            "over": max(row["over"] for row in own),
            "again": [sum(row["again"] > 1e-6 for row in own), len(own), max(row["again"] for row in own)],
            "steadied": sum(row["steadied"] for row in own),
        }
    return result


def main(arguments: list[str] | None = None) -> int:
    """Measure all tracks, and write the figures."""
    parser = study_parser("cleaning", __doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="with the recordings and rigs")
    options = parser.parse_args(arguments)
    rows, untouched, made = [], [], {}
    for name, track, times, truth in tracks(options.folder):
        report(name)
        found = clean(times, truth)
        untouched.append(
            {
                "track": name,
                "kind": track,
                "noise": [1e3 * float(found.noise[0]), float(np.degrees(found.noise[1]))],
                "spikes": int((found.spikes | found.repeats).sum()),
                "rows": len(times),
            }
        )
        if track == MADE:
            made[name] = spread([hit_ratio(seed, times, truth) for seed in HIT_SEEDS])
        rows += [measure(kind, seed, name, track, times, truth) for kind in KINDS for seed in NOISE_SEEDS]
    figures = {
        "tolerance_mm": 1e3 * TOLERANCE_M,
        "table": summaries(rows),
        "made": made,
        "as_recorded": untouched,
        "runs": len(rows),
    }
    return publish("cleaning", figures, options, "FOLDER")
