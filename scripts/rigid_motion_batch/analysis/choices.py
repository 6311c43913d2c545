"""Choices of keys: which samples of a clip a mode may keep, evenly spaced in time or where the motion needs them.

A clip under any choice is a `Reconstruction`. The choice names the folder of its results, and describes itself in
captions, in the report and in `metrics.csv`. Amounts stay as the user wrote them. A tolerance is a length with a unit,
or in the unit of the recording. A radius is that of the ball in which no point is off by more than the shell error.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Any, ClassVar, cast

import numpy as np

from rigid_motion.motion import decimate, reduce_keys, reduce_skeleton_keys, shell_error
from rigid_motion_batch.recordings.cleaning import JOINT_RADIUS_M as JOINT_RADIUS_M
from rigid_motion_batch.recordings.cleaning import RIGID_RADIUS_M as RIGID_RADIUS_M
from rigid_motion_batch.recordings.clips import Clip

MILLIMETRES = {"mm": 1, "cm": 10, "m": 1000}
"""Units of tolerances and radii, with their lengths in millimetres."""

Radius = float | np.ndarray
"""The radius of the ball at every joint, in metres: one for all joints, or shape (joints,)."""

Keys = tuple[np.ndarray, ...]
"""For each joint the samples that are keys, in rising order; a joint that never changes has a single key."""

METRES = {unit: length * 1e-3 for unit, length in MILLIMETRES.items()}
"""Units of tolerances and radii, with their lengths in metres."""

NUMBER = r"\d{1,6}(?:\.\d{1,6})?"
"""The pattern of rates. Folders are named by rates too."""

LENGTH = re.compile(
    rf"\s*((?=\.?\d)\d{{0,6}}\.?\d{{0,6}}(?:e[+-]?\d)?)\s*({'|'.join(METRES)})?\s*", re.ASCII | re.IGNORECASE
)
"""The pattern of lengths: 5mm, 5 MM, .5cm, 5e-3."""


def read_length(text: str, problem: str) -> tuple[str, str]:
    """Return the number and the unit of a length above 0: "0.5" and "cm" for ".5 CM". The unit may be empty.

    Raises ValueError with the text `problem` if it is no such length.
    """
    parts = LENGTH.fullmatch(text)
    if not parts or not Decimal(parts[1]):
        raise ValueError(f"{text!r} {problem}")
    return f"{Decimal(parts[1]):f}", (parts[2] or "").lower()


@dataclass(frozen=True)
class Choice(ABC):
    """A way to choose keys, with its amount."""

    written: str
    """The amount as the user wrote it: "7.5", "5mm"."""

    decimation: ClassVar[str]
    """Its name in metrics.csv: "uniform" or "adaptive"."""

    unit: ClassVar[str] = "keys/s"
    """The text after the amount, if any."""

    def __post_init__(self) -> None:
        if not re.fullmatch(NUMBER, self.written, re.ASCII) or float(self.written) <= 0.0:
            raise ValueError(f"{self.written!r} is not a rate; give numbers such as 5,7.5,10")

    @abstractmethod
    def keys(self, clip: Clip, mode: str, radius: Radius, *, shared: bool = False) -> Keys:
        """Return the samples that each joint keeps under a mode; with `shared`, all joints keep the same samples.

        The radius of the shell, or of the balls at the joints, is in metres. The clip must have two `ends`.
        """

    @property
    def name(self) -> str:
        """A name that is unique among the choices of a run, and safe as the name of a folder."""
        return self.written

    @property
    def amount(self) -> str:
        """The amount as written, for use in prose."""
        return self.written

    @property
    def title(self) -> str:
        """The amount with its unit, as a heading."""
        return f"{self.amount} {self.unit}"

    @property
    def phrase(self) -> str:
        """The same for the middle of a sentence: "at 10 keys/s"."""
        return f"at {self.title}"

    @property
    def rate(self) -> str:
        """The requested keys per second, as written; empty if no rate was requested."""
        return self.written

    @abstractmethod
    def ends(self, times: np.ndarray) -> tuple[int, int] | None:
        """Return the samples of the first and the last key, which all modes keep, given the clip's times, shape (n,).

        None if the clip is too short for two keys.
        """

    def tolerance(self, clip: Clip) -> float | None:
        """Return the largest allowed shell error in metres; None if the choice sets no limit."""
        return None

    @property
    def size(self) -> float:
        """The value by which choices of one kind are sorted."""
        return float(self.written)

    @property
    def requested(self) -> tuple[Fraction, str]:
        """The exact amount and its unit: the same for "5" and "5.0", and for "5mm" and "0.5cm"."""
        return Fraction(self.written), self.unit


class Uniform(Choice):
    """A fixed number of keys per second, evenly spaced in time: the same keys for all modes."""

    decimation = "uniform"

    def keys(self, clip: Clip, mode: str, radius: Radius, *, shared: bool = False) -> Keys:
        return (decimate(clip.times, float(self.written)),) * clip.joints

    def ends(self, times: np.ndarray) -> tuple[int, int] | None:
        keys = decimate(times, float(self.written))
        return (int(keys[0]), int(keys[-1])) if len(keys) > 1 else None


class Budget(Choice):
    """An average number of keys per second, placed where the RMS shell error of the mode is smallest."""

    decimation = "adaptive"
    unit = "keys/s on average"

    def keys(self, clip: Clip, mode: str, radius: Radius, *, shared: bool = False) -> Keys:
        poses = min(self._key_count(clip.times), len(clip.times))
        return _reduced(clip, mode, radius, shared, budget=poses * (1 if shared else clip.joints))

    def ends(self, times: np.ndarray) -> tuple[int, int] | None:
        return (0, len(times) - 1) if self._key_count(times) > 1 else None

    def _key_count(self, times: np.ndarray) -> int:
        """Return as many keys as a sender at this rate has ticks. The 1e-9 absorbs rounding, as in 2.0 * 0.5."""
        return int(float(times[-1] - times[0]) * float(self.written) + 1e-9) + 1

    @property
    def name(self) -> str:
        return f"budget-{self.written}"


class Tolerance(Choice):
    """The fewest keys with which a mode's shell error stays within a length at every sample."""

    decimation = "adaptive"
    unit = ""

    def __post_init__(self) -> None:
        self._parts()

    def keys(self, clip: Clip, mode: str, radius: Radius, *, shared: bool = False) -> Keys:
        return _reduced(clip, mode, radius, shared, tolerance=self.tolerance(clip) / clip.metres_per_unit)

    def ends(self, times: np.ndarray) -> tuple[int, int]:
        return 0, len(times) - 1

    @property
    def name(self) -> str:
        return f"tolerance-{''.join(self._parts())}"

    @property
    def amount(self) -> str:
        number, unit = self._parts()
        return f"{number} {unit or ('unit' if number == '1' else 'units') + ' of the recording'}"

    @property
    def title(self) -> str:
        return f"within {self.amount}"

    @property
    def phrase(self) -> str:
        return self.title

    @property
    def rate(self) -> str:
        return ""

    def tolerance(self, clip: Clip) -> float:
        return self.metres(clip.metres_per_unit)

    def metres(self, per_unit: float) -> float:
        """Return the length in metres, given the metres per unit of the recording."""
        number, unit = self._parts()
        return float(number) * (METRES[unit] if unit else per_unit)

    def problem_with(self, clip: Clip, radius: float) -> str:
        """Return a message if the tolerance exceeds the whole motion of a clip, such as "5" meant as "5mm"; else "".

        The radius of the shell is in metres. For a whole body, the motion is measured by the positions of its joints.
        """
        if clip.rest_body is None:
            poses = clip.in_metres(clip.poses)
            size = float(shell_error(poses, poses[:1], radius).max())
        else:
            places = clip.in_metres(clip.rest_body.skeleton.in_root_space(clip.poses)).positions
            size = float(np.linalg.norm(places - places[:, :1], axis=-1).max())
        allowed = self.tolerance(clip)
        if not 0.0 < size < allowed:
            return ""
        written, unit = self._parts()
        way_out = "give a smaller one" if unit else f"give it with its unit, as in {written}mm"
        here = "" if unit == "m" else f", {allowed:.3g} m"
        more = f"is more than the whole motion, which is {size:.3g} m large: {way_out}"
        return f"a tolerance of {self.amount}{here}, {more}"

    @property
    def is_length(self) -> bool:
        """Whether the tolerance has a unit of its own, instead of the unit of the recording."""
        return bool(self._parts()[1])

    def alike(self, metres: float, per_unit: float) -> str:
        """Return another length, given in metres, as text in the unit of this tolerance."""
        _, unit = self._parts()
        length = round(metres / (METRES[unit] if unit else per_unit), 4)
        return f"{length:.3g} {unit or 'units'}"

    @property
    def size(self) -> float:
        number, unit = self._parts()
        return float(number) * METRES.get(unit, 1.0)

    @property
    def requested(self) -> tuple[Fraction, str]:
        number, unit = self._parts()
        return Fraction(number) * MILLIMETRES.get(unit, 1), "mm" if unit else ""

    def _parts(self) -> tuple[str, str]:
        """Return the number and the unit; the unit may be empty."""
        return read_length(
            self.written,
            "is not a tolerance; give a length such as 5mm, 0.5cm or 0.005m, or a plain number in the unit of the "
            "recording",
        )


def _reduced(clip: Clip, mode: str, radius: Radius, shared: bool, **requested: Any) -> Keys:
    """Return the fewest keys within a tolerance, or the best of a budget: for a rigid body, by the RMS error."""
    times, poses, radius = clip.times, clip.poses, radius / clip.metres_per_unit
    if clip.rest_body is None:
        rms = "budget" in requested
        return (reduce_keys(times, poses, mode, radius=float(np.max(radius)), rms=rms, **requested),)
    parents = clip.rest_body.parents
    return cast(Keys, reduce_skeleton_keys(times, poses, parents, mode, radius=radius, shared=shared, **requested))


def fewest_keys(choices: Iterable[Choice]) -> list[Choice]:
    """Return, for each kind of choice, the one that keeps the fewest keys: modes differ most there."""
    kinds: dict[type[Choice], list[Choice]] = {}
    for choice in choices:
        kinds.setdefault(type(choice), []).append(choice)
    return [(max if kind is Tolerance else min)(some, key=lambda choice: choice.size) for kind, some in kinds.items()]


def distinct(choices: Iterable[Choice]) -> list[Choice]:
    """Return the choices without repeats of the same amount, however it is written."""
    first: dict[tuple[Fraction, str], Choice] = {}
    for choice in choices:
        first.setdefault(choice.requested, choice)
    return list(first.values())


@dataclass(frozen=True)
class Radii:
    """The radii of shells, as plain data that tasks can take as a parameter."""

    rigid: float = RIGID_RADIUS_M
    """For a single rigid body, in metres."""

    joint: float = JOINT_RADIUS_M
    """For every joint of a whole body, in metres."""

    def of(self, clip: Clip) -> np.ndarray:
        """Return the radius of each joint of a clip, shape (joints,); a rigid body has one."""
        return np.full(clip.joints, self.joint if clip.rest_body else self.rigid)


EVERYWHERE = Radii()


def read_radii(text: str) -> Radii:
    """Return radii with one value for everything. Raises ValueError if the text is no length above 0."""
    radius = radius_in_metres(text)
    return Radii(radius, radius)


def radius_in_metres(text: str) -> float:
    """Return a radius such as 3cm, or 0.03 (metres), in metres. Raises ValueError if it is no length above 0."""
    number, unit = read_length(text, "is not a length above 0, such as 3cm or 0.03")
    return float(number) * METRES[unit or "m"]
