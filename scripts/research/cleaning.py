"""Cleaning recordings, beside filters that are tuned to the truth: what is left of noise that was put in.

    python scripts/research cleaning FOLDER

The tracks are recordings, or stretches and joints of them, by which no threshold was chosen but those of long spikes,
held samples, hits and clocks, with other seeds. Noise is made with seeds: white (1 mm and 0.3 degrees along each axis),
correlated (the same, each sample 0.7 of the one before), white with spikes in a hundredth of the samples, white with
held samples in a fiftieth, and white with times that tremble. Errors are RMS shell errors at 10 cm. Rivals that are
tuned know the truth: of all settings each gets the one that is best for the clip. Those of Blender are its formulas in
NumPy, on locations and on the components of quaternions.
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
MIN_NOISE_SAMPLES = 200  # samples: noise is hard to measure
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
"""The file, the joint, and the row that 1200 rows are taken from."""

Filter = Callable[[np.ndarray], np.ndarray]


def tracks(folder: Path) -> Iterator[tuple[str, str, np.ndarray, Poses]]:
    """Yield the name, the kind, the times and the poses in metres of each track, the made ones last."""
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
    """Return times and poses with noise, and which samples are spikes or held."""
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
    """Return the filter run forwards and backwards, by its response, the ends mirrored at their samples."""

    def smooth(values: np.ndarray) -> np.ndarray:
        before, behind = 2.0 * values[0] - values[:0:-1], 2.0 * values[-1] - values[-2::-1]
        long = np.concatenate((before, values, behind))
        angles = np.pi * np.fft.rfftfreq(len(long))
        edge = np.tan(np.pi * min(cutoff / rate, 0.499))
        gain = 1.0 / (1.0 + (np.tan(np.minimum(angles, 1.57)) / edge) ** (2 * order))
        return np.fft.irfft(gain[:, None] * np.fft.rfft(long, axis=0), len(long), axis=0)[len(before) :][: len(values)]

    return smooth


def gaussian(width: int, sigma: float) -> Filter:
    """Return Blender's Gaussian smooth: so many keys on either side, sigma as part of these."""
    weights = np.exp(-0.5 * (np.abs(np.arange(-width, width + 1)) / width / sigma) ** 2)

    def smooth(values: np.ndarray) -> np.ndarray:
        long = np.pad(values, ((width, width), (0, 0)), mode="edge")
        return sliding_window_view(long, 2 * width + 1, axis=0) @ (weights / weights.sum())

    return smooth


def one_euro(values: np.ndarray, times: np.ndarray, lowest: np.ndarray, betas: np.ndarray) -> np.ndarray:
    """Return what the One Euro filter makes of values (n, k) with settings (m,), shape (m, n, k)."""
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
    """Return what each rival makes of a recording."""
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
    """Return the RMS shell error in metres, of some rows."""
    return float(np.sqrt(np.mean(shell_error(poses, truth)[rows] ** 2)))


def hardest(truth: Poses) -> np.ndarray:
    """Return the rows with the largest accelerations."""
    return np.argsort(-np.linalg.norm(np.diff(truth.positions, 2, axis=0), axis=1))[:HIT_COUNT] + 1


def measure(kind: str, seed: int, name: str, track: str, times: np.ndarray, truth: Poses) -> dict[str, Any]:
    """Return what becomes of a track with such noise. Lengths are in millimetres."""
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
    """Return the error that is left at the hits of a track with white noise, by that which was there."""
    _, shaky, _ = shaken("white", seed, times, truth)
    hits = hardest(truth)
    return rms(clean(times, shaky).poses, truth, hits) / rms(shaky, truth, hits)


def spread(values: list[Any]) -> list[float]:
    """Return the least, the middle and the largest."""
    return [float(part) for part in np.percentile(values, (0, 50, 100))]


def summed_up(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the geometric means of what is left beside each rival, and the worst clip's, by kind of noise."""
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
    """Measure, and write the figures."""
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
        "table": summed_up(rows),
        "made": made,
        "as_recorded": untouched,
        "runs": len(rows),
    }
    return publish("cleaning", figures, options, "FOLDER")
