"""The numbers of a run as one array, gathered clip by clip: thousands of clips are a few megabytes.

Values are in the units that the report shows: millimetres, degrees, keys and bytes a second.
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
    """A number that a clip has under one choice of keys and one mode."""

    metric: str
    """The field of `Metrics`."""

    title: str
    unit: str
    factor: float = 1.0
    """From the metric's unit to this one."""

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
"""Places of measures. The RMS shell error decides, or the keys a second where a tolerance limits the error."""

KINDS: tuple[type[Choice], ...] = (Uniform, Budget, Tolerance)


@dataclass(frozen=True, eq=False)
class Numbers:
    """All numbers of a run."""

    clips: tuple[str, ...]
    choices: tuple[Choice, ...]
    """By kind, and from the smallest amount to the largest."""

    modes: tuple[str, ...]
    values: np.ndarray
    """Shape (measures, clips, choices, modes); NaN where a clip is too short for a choice."""

    groupings: tuple[frozenset[Groups], ...]
    """Of each clip, the modes that are one motion under each choice."""

    asked: str = REFERENCE
    """The mode that others are to be held against, if it is among them."""

    @property
    def reference(self) -> str | None:
        """The mode that others are held against."""
        return self.asked if self.asked in self.modes else None

    def label(self, mode: str) -> str:
        """Return the name of a mode, without its algebra."""
        return label_of(mode).partition(" (")[0]

    def joined(self, modes: Iterable[str]) -> str:
        """Return the names of modes that are one motion."""
        return " = ".join(map(self.label, modes))

    def groups(self, clip: int | None = None) -> Groups:
        """Return the modes, those together that are one motion on a clip, or on all of them, under every choice."""
        groupings = self.groupings if clip is None else self.groupings[clip : clip + 1]
        return joint_groups(sorted({groups for some in groupings for groups in some}))

    def mean(self, clip: int | None = None) -> np.ndarray:
        """Return the numbers of a clip, or geometric means over those with any, shape (measures, choices, modes)."""
        if clip is not None or len(self.clips) == 1:
            return self.values[:, clip or 0]
        return np.stack([geometric_mean(of_clips) for of_clips in self.values])

    def deciding(self, choice: int) -> int:
        """Return the measure that decides under a choice."""
        return KEYS_AT if isinstance(self.choices[choice], Tolerance) else ERROR_AT


RMS_IS = "RMS is a mean over time in which large errors count more."


def error_is(rigid: float | None, joint: float | None, clips: int) -> str:
    """Return what the errors are, for somebody who has never seen them.

    The radii in metres of rigid bodies and of joints, where there are any, and how many clips there are.
    """
    around = [] if rigid is None else [f"{100.0 * rigid:g} cm of the body's origin"]
    around += [] if joint is None else [f"{100.0 * joint:g} cm of a joint"]
    over = f"; over {clips} clips the geometric mean, and the largest of all" if clips > 1 else ""
    return f"Shell error: how far any point within {' or '.join(around)} is out of place{over}"


def who_else(numbers: Numbers) -> str:
    """Return who does without this program what one of the modes does; nothing where none is among them."""
    known = STATE_OF_THE_ART in numbers.modes
    return f"{numbers.label(STATE_OF_THE_ART)} is what most game engines do." if known else ""


class Gathering:
    """Numbers while clips come in, one at a time."""

    def __init__(self, reference: str = REFERENCE) -> None:
        self.reference = reference
        self._clips: list[str] = []
        self._rows: list[tuple[tuple[Choice, ...], tuple[str, ...], np.ndarray]] = []
        """Of each clip its choices, its modes, and its numbers, shape (measures, choices, modes)."""
        self._groupings: list[frozenset[Groups]] = []

    def add(self, clip: str, results: Sequence[ChoiceNumbers]) -> None:
        """Take the numbers of a clip of this name."""
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
        """All of them. Raises ValueError where no clip had a result."""
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
    """Return a number with so many significant digits, as tables show it."""
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
    """Return a share as prose has it: "64 %"."""
    return f"{100 * share:.0f}\u00a0%"
