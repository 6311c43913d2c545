"""Measure the public recordings that these pages cite, and write docs/figures/recordings.json.

    python docs/measure_recordings.py --recordings FOLDER
    python scripts/research pages

This takes five minutes; the second command puts the figures into the pages. Only recordings that belong to every row
of the table on the paper's page count: single bodies that move, with two samples per update at 30 updates a second.
Errors are RMS shell errors at a radius of 0.1 m, means are geometric.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from unittest import mock

import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("addon", "scripts")]

from research.pages import ROOT, write_figures
from research.paper.motions import read_all, read_motion
from research.paper.table import SHELL_RADIUS_M, has_samples_for
from research.studies import files_in
from rigid_motion.motion import curves, decimate, key_splines
from rigid_motion.motion.segments import Curves, Segments
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE as BLENDERS
from rigid_motion_batch.analysis.modes import STATE_OF_THE_ART as REFERENCE
from rigid_motion_batch.analysis.needed import TABLE_RATES, KeysNeeded, Ways, keys_needed, overall
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip

RATES = ("5", "10", "15", "20", "30")
"""Evenly spaced keys per second."""

STREAMED = (REFERENCE, BLENDERS, "dq_sclerp", "motor_spline_causal", "motor_spline")
"""Modes in the table of errors."""

COUNTED = (REFERENCE, "dq_sclerp", "pga_lerp", "motor_spline")
"""Modes for which the keys needed are counted."""


def parabola(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the weight of the twist before a key, without a bound, from the durations of the segments around it."""
    return after / (before + after)


def bounded(
    factor: float, power: float = 1.0, least_part: float = 0.0
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return the parabola's rule with the shorter segment's weight limited to factor * (short / long) ** power.

    A segment of at most `least_part` times the longer segment's duration has no weight.
    """

    def shares(before: np.ndarray, after: np.ndarray) -> np.ndarray:
        least, most = 1.0 - factor * (after / before) ** power, factor * (before / after) ** power
        bound = np.clip(parabola(before, after), least, most)
        return np.where(after <= least_part * before, 1.0, np.where(before <= least_part * after, 0.0, bound))

    return shares


RULES = {
    "parabola": parabola,
    "2": bounded(2.0),
    "1.5": bounded(1.5),
    "1": bounded(1.0),
    "1, none up to 1/16": bounded(1.0, least_part=1.0 / 16.0),
    "0.75": bounded(0.75),
    "squared": bounded(1.0, 2.0),
    "between_neighbours": lambda before, after: before / (before + after),
}
"""Rules for the weight of the twist before a key. The program uses "1, none up to 1/16"."""

PARTS = {"whole": 1.0, "none": 0.0}
"""Fractions of the parabola's addition that a key of `motor_spline_causal` could use. The program uses half."""


def main(arguments: list[str] | None = None) -> int:
    """Measure the recordings, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=Path, metavar="FOLDER", required=True)
    parser.add_argument("--root", type=Path, default=ROOT, help="write ROOT/docs/figures (this checkout)")
    options = parser.parse_args(arguments)
    chosen = dict(_counting(files_in([options.recordings])))
    clips, paths = list(chosen.values()), list(chosen)
    figures = {
        "recordings": {clip.name: len(clip.times) for clip in clips},
        "errors": _errors(paths),
        "causal_errors": {name: _errors_of_clips(clips, part) for name, part in PARTS.items()},
        "keys_needed": _needed(clips, COUNTED, fit=True),
        "rules": {name: _by_rule(clips, name) for name in RULES},
        "assets": {"smooth_mm": _smooth_errors()},
    }
    write_figures("recordings", figures, "python docs/measure_recordings.py --recordings FOLDER", options.root)
    return 0


def _counting(paths: Sequence[Path]) -> Iterator[tuple[Path, Clip]]:
    for path, clip in read_all(paths, lambda path: (path, read_motion(path)))[0]:
        if has_samples_for(clip, float(TABLE_RATES[0])):
            yield path, clip


def _smooth_errors() -> list[float]:
    """Return the RMS shell errors in smooth.png, in mm, mode by mode."""
    (clip,), _ = read_clips([str(ASSETS / "reach.csv")], "blender")
    made = reconstruct(clip, Uniform("8"), ("lerp_slerp", "dq_sclerp", "motor_spline"), SHELL_RADIUS_M)
    return [1e3 * row.rms_shell_m for row in measured(made).rows]


# -- errors of evenly spaced keys --------------------------------------------------------------------------------------


def _errors(paths: Sequence[Path]) -> dict[str, dict[str, float]]:
    """Return the error by mode and rate, as a multiple of the error of `REFERENCE`."""
    with _compared(paths, "--rates", ",".join(RATES), "--modes", ",".join(STREAMED)) as folder:
        table = _Metrics(folder)
        return {mode: {rate: table.mean(partial(table.ratio, rate, mode)) for rate in RATES} for mode in STREAMED[1:]}


def _errors_of_clips(clips: Sequence[Clip], part: float) -> dict[str, float]:
    """Return the error of `motor_spline_causal` by rate, if keys use this fraction of the parabola's addition."""
    bent = curves._bent

    def with_part(segments: Segments, at_keys: Callable[..., np.ndarray]) -> Curves:
        def changed(leaving: np.ndarray, arriving: np.ndarray, *others: np.ndarray) -> np.ndarray:
            result, rests = at_keys(leaving, arriving, *others), others[-1]
            added = np.where(rests[:, 1:], 0.0, result[..., 2:] - leaving[..., 1:])
            return np.concatenate((result[..., :2], result[..., 2:] + (2.0 * part - 1.0) * added), axis=-1)

        return bent(segments, changed)

    means = {}
    for rate in RATES:
        ratios = []
        for clip in clips:
            ways, keys = Ways(clip, SHELL_RADIUS_M), decimate(clip.times, float(rate))
            stretch = ways.between(int(keys[0]), int(keys[-1]))
            with mock.patch.object(curves, "_bent", with_part):
                error = stretch.error(keys, "motor_spline_causal")
            ratios.append(error / stretch.error(keys, REFERENCE))
        means[rate] = float(geometric_mean(np.array(ratios)))
    return means


# -- keys needed -------------------------------------------------------------------------------------------------------


def _needed(clips: Sequence[Clip], modes: Sequence[str], *, fit: bool) -> dict[str, dict[str, dict[str, float]]]:
    """Return the keys needed by mode, decimation and rate, as a fraction of those of `REFERENCE`."""
    result = []
    for clip in clips:
        _say(f"keys needed, {clip.name} ...")
        result.append(_apart(keys_needed(Ways(clip, SHELL_RADIUS_M, fit), modes, REFERENCE)))
    means = overall(result)
    decimations = Ways(clips[0], SHELL_RADIUS_M, fit).decimations
    shares = {group[0]: means.shares[row] for row, group in enumerate(means.groups)}
    return {
        mode: {
            decimation: {rate: float(shares[mode][column, means.rates.index(rate)]) for rate in TABLE_RATES}
            for column, decimation in enumerate(decimations)
        }
        for mode in modes
    }


def _apart(result: KeysNeeded) -> KeysNeeded:
    """Return the result with one row per mode, even if several modes are the same motion."""
    rows = [row for row, group in enumerate(result.groups) for _ in group]
    groups = tuple((mode,) for group in result.groups for mode in group)
    return KeysNeeded(
        result.clip,
        groups,
        result.rates,
        result.durations,
        result.reference_keys,
        result.targets,
        result.keys[rows],
        result.reached[rows],
        result.uniform_errors[rows],
    )


def _by_rule(clips: Sequence[Clip], name: str) -> dict[str, dict[str, float]]:
    """Return the keys that `motor_spline` needs under a rule, by decimation and rate."""
    _say(f"rule {name} ...")
    rule = RULES[name]
    with mock.patch.object(curves, "twist_shares", rule), mock.patch.object(key_splines, "twist_shares", rule):
        return _needed(clips, ("motor_spline",), fit=name in ("parabola", "1, none up to 1/16"))["motor_spline"]


# -- runs of compare.py ------------------------------------------------------------------------------------------------


class _Metrics:
    """The table of a `compare.py` run: `metrics.csv`."""

    def __init__(self, folder: Path) -> None:
        self._at = {(row["clip"], row["rate_hz"], row["mode"]): row for row in _rows(folder / "metrics.csv")}
        self.clips = list(dict.fromkeys(clip for clip, _, _ in self._at))

    def value(self, clip: str, rate: str, mode: str) -> float:
        return float(self._at[clip, rate, mode]["rms_shell_m"])

    def ratio(self, rate: str, mode: str, clip: str) -> float:
        return self.value(clip, rate, mode) / self.value(clip, rate, REFERENCE)

    def mean(self, of_clip: Callable[[str], float]) -> float:
        return float(geometric_mean(np.array([of_clip(clip) for clip in self.clips])))


@contextmanager
def _compared(paths: Sequence[Path], *options: str) -> Iterator[Path]:
    """Run `compare.py`, and yield its output folder."""
    _say(f"compare.py {' '.join(options)} ...")
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, DOCS.parent / "scripts" / "compare.py", *paths, "--no-video", "--jobs", "1"]
        subprocess.run([*command, *options, "--output", folder], check=True, capture_output=True)
        yield Path(folder)


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _say(what: str) -> None:
    print(what, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
