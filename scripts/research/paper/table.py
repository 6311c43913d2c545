"""The paper's table: how many updates a second each mode needs to be as good as the state of the art is with its own.

As good means, by one of three `YARDSTICKS` set beforehand, an error no larger than that of `lerp_slerp` at 30, 20, 15
or 12 updates a second. Errors are taken over a whole range of updates a second, and where a sender happens to begin is
averaged out: `PHASES` of them, each a little later than the one before, are measured together. Then the lowest rate
that is as good is where the curve of a mode first comes down to the error wanted. Errors are in metres and m/s.

`comparison.study.needed` asks the same of one sender and one yardstick, key by key; over several senders the curves
are smooth enough for the other two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from rigid_motion.motion import MODES, Errors, decimate, interpolate, measure, reduce_keys, rms
from rigid_motion.motion.decimation import nearest
from rigid_motion_batch.analysis.metrics import NOTHING, geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.analysis.reconstructions import same_motions
from rigid_motion_batch.recordings.clips import Clip

from . import claims
from .motions import sampling_rate

RADIUS = 0.1
"""Of the shell, in metres."""

YARDSTICKS = {
    "rms_shell_m": "RMS shell error",
    "p95_shell_m": "95th percentile of the shell error",
    "rms_velocity_m_s": "RMS velocity error",
}
"""Columns of the tables, and what they are called."""

UPDATES = tuple(row.state_of_the_art for row in claims.TABLE)
"""Updates a second of the state of the art, from the most to the fewest."""

LOWEST, HIGHEST, STEP = 1.5, 60.0, 1.05
"""The rates that are tried: updates a second, and the factor from one rate to the next."""

PHASES = 6
"""Senders of the same rate that begin one after the other within an interval."""

SAMPLES_AN_UPDATE = 2.0
"""A recording tells nothing of in-betweens at a rate that leaves it fewer samples than this."""

TOLERANCES = 0.5, 2.0, 8
"""Of adaptive keys: from this multiple of the smallest error wanted to this multiple of the largest, so many."""

UNIFORM, ADAPTIVE = "uniform", "adaptive"


@dataclass(frozen=True)
class Point:
    """One point of a curve: the errors of a mode with so many keys a second. The fields are columns of `errors.csv`."""

    clip: str
    mode: str
    decimation: str

    asked: float
    """Updates a second, or for adaptive keys the tolerance in metres."""

    keys_per_s: float
    """Those that were really kept."""

    rms_shell_m: float
    p95_shell_m: float
    rms_velocity_m_s: float


@dataclass(frozen=True)
class LookAhead:
    """What a mode waits for. The fields are columns of `look_ahead.csv`."""

    clips: str
    """The set of clips whose mean rate is taken, by the first yardstick."""

    updates: int
    """Of the state of the art that it is as good as."""

    mode: str
    behind: int
    ahead: int
    """Updates that it takes beyond the two that it goes between."""

    waits_s: float
    """From an update to the moment at which its pose is shown, with a link that takes no time."""


@dataclass(frozen=True)
class Needed:
    """A cell of the table. The fields are columns of `table.csv`."""

    clips: str
    """The clip, or the set of clips that this is the geometric mean of."""

    updates: int
    """Of the state of the art."""

    mode: str
    decimation: str
    yardstick: str

    needed: float
    """Updates a second that are as good; infinite where none of those tried was."""

    saved: float
    """The bandwidth saved, as a share: below zero where more is needed."""

    reached: int
    """On how many clips it was."""

    asked: int
    """Of how many."""


Cell = TypeVar("Cell")
"""With `clips` and `needed`."""


def rates_for(clip: Clip) -> np.ndarray:
    """The rates to try on a clip, rising: those of the table among them."""
    steps = int(np.log(HIGHEST / LOWEST) / np.log(STEP))
    rates = np.union1d(LOWEST * STEP ** np.arange(steps + 1), UPDATES)
    return rates[rates <= sampling_rate(clip) / SAMPLES_AN_UPDATE * (1.0 + 1e-9)]


def senders(clip: Clip, rate: float) -> list[np.ndarray]:
    """The samples that each of `PHASES` senders sends."""
    begins = clip.times[0] + np.arange(PHASES) / (PHASES * rate)
    firsts = np.unique(nearest(clip.times, begins))
    sent = [int(first) + decimate(clip.times[first:], rate) for first in firsts]
    return [keys for keys in sent if len(keys) > 1]


def point(clip: Clip, mode: str, decimation: str, asked: float, senders_keys: Sequence[np.ndarray]) -> Point:
    """The errors of a mode over all of these keys, pooled."""
    found = [errors_of(clip, mode, keys) for keys in senders_keys]
    shell = np.concatenate([errors.shell for errors in found])
    velocity = np.concatenate([errors.velocity for errors in found])
    segments = sum(len(keys) - 1 for keys in senders_keys)
    seconds = sum(float(clip.times[keys[-1]] - clip.times[keys[0]]) for keys in senders_keys)
    return Point(
        clip=clip.name,
        mode=mode,
        decimation=decimation,
        asked=float(asked),
        keys_per_s=segments / seconds,
        rms_shell_m=rms(shell),
        p95_shell_m=float(np.percentile(shell, 95.0)),
        rms_velocity_m_s=rms(velocity),
    )


def errors_of(clip: Clip, mode: str, keys: np.ndarray) -> Errors:
    """The errors of a mode at all samples from the first of its keys to the last."""
    samples = slice(int(keys[0]), int(keys[-1]) + 1)
    times, truth = clip.times[samples], clip.in_metres(clip.poses[samples])
    filled = interpolate(clip.times[keys], clip.poses[keys], times, mode)
    return measure(times, clip.in_metres(filled), truth, RADIUS)


def measure_clip(
    clip: Clip, modes: Sequence[str], adaptive: Sequence[str], advance: Callable[[], object] = lambda: None
) -> list[Point]:
    """All points of all curves of a clip.

    Parameters
    ----------
    clip : Clip
    modes : sequence of str
        Those that get evenly spaced keys, `lerp_slerp` first.
    adaptive : sequence of str
        Those that get keys where they need them as well.
    advance : callable
        Called after every rate and every tolerance.
    """
    rates = rates_for(clip)
    points: dict[str, list[Point]] = {mode: [] for mode in modes}
    groups = same_motions(clip, tuple(modes), RADIUS)
    for rate in rates:
        keys = senders(clip, rate)
        for group in groups if keys else ():
            found = point(clip, group[0], UNIFORM, rate, keys)
            for mode in group:
                points[mode].append(replace(found, mode=mode))
        advance()
    wanted = [one.rms_shell_m for one in points[REFERENCE] if one.asked in UPDATES]
    curves = [one for mode in modes for one in points[mode]]
    if not wanted or min(wanted) <= NOTHING:
        return curves
    low, high, count = TOLERANCES
    for tolerance in np.geomspace(low * min(wanted), high * max(wanted), count):
        for mode in adaptive:
            lengths = float(tolerance / clip.metres_per_unit), RADIUS / clip.metres_per_unit
            keys = reduce_keys(clip.times, clip.poses, mode, *lengths, rms=True)
            curves.append(point(clip, mode, ADAPTIVE, float(tolerance), [keys]))
        advance()
    return curves


def needed_by(points: Iterable[Point], updates: Sequence[int] = UPDATES) -> list[Needed]:
    """The cells of the table for every clip: what each mode needs by each yardstick.

    There is none where the recording has too few samples for the state of the art's rate, or nothing moves.
    """
    curves: dict[str, dict[tuple[str, str], list[Point]]] = {}
    for one in points:
        curves.setdefault(one.clip, {}).setdefault((one.mode, one.decimation), []).append(one)
    cells = []
    for clip, of_clip in curves.items():
        reference = {one.asked: one for one in of_clip[REFERENCE, UNIFORM]}
        for rate in updates:
            for yardstick in YARDSTICKS:
                wanted = getattr(reference[rate], yardstick) if rate in reference else 0.0
                if wanted <= NOTHING:
                    continue
                for (mode, decimation), curve in of_clip.items():
                    share = lowest(curve, yardstick, wanted) / reference[rate].keys_per_s
                    there = int(np.isfinite(share))
                    cells.append(Needed(clip, rate, mode, decimation, yardstick, rate * share, 1.0 - share, there, 1))
    return cells


def lowest(curve: Iterable[Point], yardstick: str, wanted: float) -> float:
    """The fewest keys a second at which a curve is down to the error wanted; infinite where it never is.

    Between two rates that were tried, error and rate are taken to be lines on a double logarithmic scale.
    """
    ordered = sorted(curve, key=lambda one: one.keys_per_s)
    keys = np.array([one.keys_per_s for one in ordered])
    errors = np.array([getattr(one, yardstick) for one in ordered])
    good = np.flatnonzero(errors <= wanted)
    if not len(good):
        return float("inf")
    first = int(good[0])
    if first == 0 or errors[first] == wanted:
        return float(keys[first])
    before, after = np.log(np.maximum(errors[[first - 1, first]], NOTHING))
    part = (before - np.log(wanted)) / (before - after)
    return float(keys[first - 1] * (keys[first] / keys[first - 1]) ** part)


def look_ahead(cells: Iterable[Needed], clips: str) -> list[LookAhead]:
    """How long each mode waits at the rates that it needs, of evenly spaced keys."""
    first = next(iter(YARDSTICKS))
    chosen = [
        cell
        for cell in cells
        if (cell.clips, cell.decimation, cell.yardstick) == (clips, UNIFORM, first) and np.isfinite(cell.needed)
    ]
    return [
        LookAhead(clips, cell.updates, cell.mode, mode.behind, mode.ahead, (1.0 + mode.ahead) / cell.needed)
        for cell in chosen
        for mode in (MODES[cell.mode],)
    ]


def mean_over(cells: Iterable[Needed], name: str, clips: Iterable[str]) -> list[Needed]:
    """Geometric means over some clips, of those on which the error was reached."""
    return [
        Needed(name, updates, mode, decimation, yardstick, rate, 1.0 - rate / updates, there, asked)
        for (updates, mode, decimation, yardstick), rate, there, asked in mean_rates(
            cells, clips, lambda cell: (cell.updates, cell.mode, cell.decimation, cell.yardstick)
        )
    ]


def mean_rates(
    cells: Iterable[Cell], clips: Iterable[str], kind: Callable[[Cell], tuple]
) -> Iterator[tuple[tuple, float, int, int]]:
    """Of each kind of cell the geometric mean over some clips of what is needed, on how many it was found, of how many.

    Infinite where it was on none.
    """
    members = set(clips)
    of_kind: dict[tuple, list[float]] = {}
    for cell in cells:
        if cell.clips in members:
            of_kind.setdefault(kind(cell), []).append(cell.needed)
    for one, found in of_kind.items():
        rates = np.array(found)
        there = int(np.isfinite(rates).sum())
        yield one, float(geometric_mean(rates)) if there else float("inf"), there, len(found)
