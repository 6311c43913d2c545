"""The numbers of a run as one array, gathered clip by clip; thousands of clips take a few megabytes.

Values are in the units that the report shows: millimetres, degrees, keys per second and bytes per second.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import floor, isfinite, log10

import numpy as np

from rigid_motion_batch.analysis.choices import Budget, Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import MAX_ROUNDING_M, Metrics, geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE, STATE_OF_THE_ART, label_of
from rigid_motion_batch.analysis.reconstructions import Groups, joint_groups
from rigid_motion_batch.analysis.results import ChoiceNumbers


@dataclass(frozen=True)
class Measure:
    """A number of each clip, for one choice of keys and one mode."""

    metric: str
    """The field of `Metrics`."""

    title: str
    unit: str
    factor: float = 1.0
    """Converts the metric's unit to this one."""

    def of(self, row: Metrics) -> float:
        value = getattr(row, self.metric)
        return float("nan") if value is None else value * self.factor


MEASURES = (
    Measure("rms_shell_m", "Shell error, RMS", "mm", 1e3),
    Measure("p95_shell_m", "Shell error, 95th percentile", "mm", 1e3),
    Measure("max_shell_m", "Shell error, largest", "mm", 1e3),
    Measure("rms_position_m", "Position, RMS", "mm", 1e3),
    Measure("rms_rotation_deg", "Rotation, RMS", "°"),
    Measure("rms_velocity_m_s", "Velocity, RMS", "mm/s", 1e3),
    Measure("keys_per_s", "Keys", "/s"),
    Measure("bytes_per_s", "Size", "bytes/s"),
    Measure("foot_slide_m", "Feet slide", "mm", 1e3),
    Measure("still_point_m", "Point that stays, largest", "mm", 1e3),
)
NONE, MINUS = "\u2013", "\u2212"

ERROR_AT, LARGEST_AT, KEYS_AT, STILL_AT = 0, 2, 6, 9
"""Indices of measures. The RMS shell error decides, or the keys per second if a tolerance limits the error."""

KINDS: tuple[type[Choice], ...] = (Uniform, Budget, Tolerance)


@dataclass(frozen=True, eq=False)
class Numbers:
    """All numbers of a run."""

    clips: tuple[str, ...]
    choices: tuple[Choice, ...]
    """Sorted by kind, then by amount."""

    modes: tuple[str, ...]
    values: np.ndarray
    """Shape (measures, clips, choices, modes); NaN if a clip is too short for a choice."""

    groupings: tuple[frozenset[Groups], ...]
    """For each clip, the modes that give identical motion, under each choice."""

    asked: str = REFERENCE
    """The mode to compare others with, if the run includes it."""

    @property
    def reference(self) -> str | None:
        """The mode that others are compared with; None if the run lacks it."""
        return self.asked if self.asked in self.modes else None

    def label(self, mode: str) -> str:
        """Return the name of a mode, without its algebra in brackets."""
        return label_of(mode).partition(" (")[0]

    def joined(self, modes: Iterable[str]) -> str:
        """Return the names of modes that give identical motion, joined by "="."""
        return " = ".join(map(self.label, modes))

    def groups(self, clip: int | None = None) -> Groups:
        """Return the modes grouped by identical motion, under every choice, on one clip or on all."""
        groupings = self.groupings if clip is None else self.groupings[clip : clip + 1]
        return joint_groups(sorted({groups for some in groupings for groups in some}))

    def mean(self, clip: int | None = None) -> np.ndarray:
        """Return a clip's numbers, or geometric means over clips with values, shape (measures, choices, modes)."""
        if clip is not None or len(self.clips) == 1:
            return self.values[:, clip or 0]
        return np.stack([geometric_mean(of_clips) for of_clips in self.values])

    def deciding(self, choice: int) -> int:
        """Return the index of the measure that decides under a choice."""
        return KEYS_AT if isinstance(self.choices[choice], Tolerance) else ERROR_AT


RMS_IS = "RMS is a mean over time in which large errors count more."


def error_is(rigid: float | None, joint: float | None, clips: int) -> str:
    """Return a sentence that explains the errors to a reader who has never seen them.

    `rigid` and `joint` are the radii in metres for rigid bodies and joints, if there are any; `clips` is a count.
    """
    around = [] if rigid is None else [f"{100.0 * rigid:g} cm of the body's origin"]
    around += [] if joint is None else [f"{100.0 * joint:g} cm of a joint"]
    over = f"; over {clips} clips the geometric mean, and the largest of all" if clips > 1 else ""
    return f"Shell error: how far any point within {' or '.join(around)} is out of place{over}"


def who_else(numbers: Numbers) -> str:
    """Return a sentence on what most game engines do; empty if that mode is not in the run."""
    known = STATE_OF_THE_ART in numbers.modes
    return f"{numbers.label(STATE_OF_THE_ART)} is what most game engines do." if known else ""


class Gathering:
    """Collects the numbers of clips, one clip at a time."""

    def __init__(self, reference: str = REFERENCE) -> None:
        self.reference = reference
        self._clips: list[str] = []
        self._rows: list[tuple[tuple[Choice, ...], tuple[str, ...], np.ndarray]] = []
        """For each clip its choices, its modes, and its numbers, shape (measures, choices, modes)."""
        self._groupings: list[frozenset[Groups]] = []

    def add(self, clip: str, results: Sequence[ChoiceNumbers]) -> None:
        """Add the numbers of a clip."""
        choices = tuple(result.choice for result in results)
        modes = tuple(dict.fromkeys(row.mode for result in results for row in result.rows))
        values = np.full((len(MEASURES), len(choices), len(modes)), np.nan)
        for place, result in enumerate(results):
            for row in result.rows:
                values[:, place, modes.index(row.mode)] = [measure.of(row) for measure in MEASURES]
        self._clips.append(clip)
        self._rows.append((choices, modes, values))
        self._groupings.append(frozenset(result.groups for result in results))

    def numbers(self) -> Numbers:
        """Return the numbers of all clips. Raises ValueError if no clip had a result."""
        result = dict.fromkeys(choice for choices, _, _ in self._rows for choice in choices)
        choices = tuple(sorted(result, key=lambda choice: (KINDS.index(type(choice)), choice.size)))
        modes = tuple(dict.fromkeys(mode for _, own, _ in self._rows for mode in own))
        if not choices:
            raise ValueError("no reconstruction to report: every clip is too short for two keys")
        values = np.full((len(MEASURES), len(self._rows), len(choices), len(modes)), np.nan)
        for clip, (own_choices, own_modes, own) in enumerate(self._rows):
            rows, columns = [choices.index(item) for item in own_choices], [modes.index(item) for item in own_modes]
            values[:, clip, np.array(rows)[:, None], columns] = own
        return Numbers(tuple(self._clips), choices, modes, values, tuple(self._groupings), self.reference)


def digits(value: float | None, places: int = 3) -> str:
    """Return a number with `places` significant digits, as tables show it."""
    if value is None or not isfinite(value):
        return NONE
    if abs(value) < MAX_ROUNDING_M * 1e3:
        return "0"
    return f"{value:.{max(0, places - 1 - floor(log10(abs(value))))}f}"


def listed(words: Iterable[str]) -> str:
    """Return words as prose lists them: "5, 10 and 15"."""
    words = list(words)
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def percent(share: float) -> str:
    """Return a fraction as prose has it: "64 %"."""
    return f"{100 * share:.0f}\u00a0%"
