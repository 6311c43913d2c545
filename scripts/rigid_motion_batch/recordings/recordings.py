"""Results of reading: the trajectories of the bodies that were asked for, the names of the others, or one clear error.

Times are seconds; positions are in the unit of the file; quaternions are w, x, y, z with the signs of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.command_line import did_you_mean, listed, printable

from .clips import ClipWarning
from .rest_bodies import RestBody

ALL = "*"
"""Name that asks for every body of a file."""

MOST_POSES = 50_000_000
"""Poses of all joints together: a file may hold any number of joints and frames in little space."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Where a file has the numbers of a body, for others in their place."""

    rows: np.ndarray
    """The row of each sample, shape (n,)."""

    shape: tuple[int, int]
    """Rows and columns of the file."""

    numbers: Callable[[Poses], Mapping[int, np.ndarray]]
    """A function of poses like those of the trajectory, which returns numbers (n,) by their columns."""

    write: Callable[[Path, np.ndarray], None]
    """Writes the whole file to a path with numbers of that shape, where NaN stands for what is there."""

    times: Callable[[np.ndarray], Mapping[int, np.ndarray]] | None = None
    """A function of times (n,), likewise; None where the column is that of others too, or has no numbers."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One body of one file, exactly as recorded: unrepaired, native axes, units and signs."""

    name: str
    """The body: CSV file stem, Motive rigid body, A-Frame device, BVH joint, Blender object, or OBJECT/BONE."""

    times: np.ndarray
    """Seconds, shape (n,). Neither rising nor finite unless the recording is sound."""

    poses: Poses
    """Shape (n,). A sample that was not tracked is NaN; scales are None unless the file has one that is not 1.

    Of a whole body shape (joints, n), each joint's in its parent's space, without scales."""

    metres_per_unit: float = 1.0
    """The length of one unit of the positions, where the file tells it; 1 otherwise."""

    remark: str = ""
    """A remark for whoever asked for this body."""

    warnings: tuple[ClipWarning, ...] = ()
    """Warnings on what is hard to believe of this recording."""

    dated: bool = False
    """True if its times were dates or clock times, whose unit no one can mistake."""

    rest_body: RestBody | None = None
    """The rest body of a whole body."""

    rate: float | None = None
    """Samples a second, where there may be more between these."""

    axes: str = ""
    """Those that its program has, where they are not those of the format: a name in `axes.DESCRIBED`."""

    cells: Cells | None = None
    """None where nothing can be written in the place of what was read."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Trajectories that were read of a file, and what there is to say of them."""

    path: Path

    trajectories: tuple[Trajectory, ...]
    """The bodies that were asked for, in the order of the file."""

    others: tuple[str, ...] = ()
    """The names of the bodies that were left."""

    note: str = ""
    """A note for a file of several bodies of which none was named: what was taken, what is left, how to name it. And
    what there is to say of those that were taken.
    """

    body: str = ""
    """The body that was asked for by name; empty where the first was, or all."""

    axes: str = "blender"
    """The convention of its format, or of the program that wrote it: a name in `axes.DESCRIBED`."""

    axes_known: bool = False
    """True if these are those of the program that wrote it, of several that write such a format."""

    measured: bool = True
    """True if its format holds what devices measured, and not what was animated."""


class TrajectoryError(ValueError):
    """Error that says why a recording cannot be read, in one line: `FILE:LINE: what is wrong; way out`."""

    def __init__(self, path: Path | str, problem: str, way_out: str, line: int | None = None) -> None:
        where = f"{path}:{line}" if line else f"{path}"
        self.problem = printable(problem)
        super().__init__(printable(f"{where}: {problem}; {way_out}"))


class NoMotion(TrajectoryError):
    """Error of a file without a recording, which need not be wrong: a table of other things, or a body at rest."""


def refuse_too_many(path: Path, joints: int, frames: float) -> None:
    """Raise TrajectoryError for more poses than can be kept."""
    if joints * frames > MOST_POSES:
        problem = f"{joints} joints in {frames:.0f} frames are more than {MOST_POSES} poses"
        raise TrajectoryError(path, problem, "export fewer joints, or split the recording")


class Selection:
    """Selection of the bodies of a file: the first, all, or one by name."""

    def __init__(self, path: Path, requested: str | None) -> None:
        self.path = path
        self.requested = requested
        self.names: tuple[str, ...] = ()
        self._near = ""
        """What may have been meant by a name that the file has not."""

    def of(self, names: Sequence[str], unlisted: Sequence[str] = (), more: int = 0) -> list[str]:
        """Return the requested ones among the bodies of the file.

        Parameters
        ----------
        names : sequence of str
            The bodies, in the order of the file.
        unlisted : sequence of str
            More bodies, to be had by name only.
        more : int
            How many of those there are besides, which an error counts and does not name.

        Raises
        ------
        TrajectoryError
            Where the file has no body of that name, whatever its case, or several, or none at all.
        """
        self.names = tuple(names)
        if self.requested in (None, ALL):
            if not names:
                way_out = (
                    f"name one with {self.path}:NAME: {listed(unlisted, more=more)}"
                    if unlisted
                    else "record at least one"
                )
                raise TrajectoryError(self.path, "no moving body in this file", way_out)
            return list(names) if self.requested == ALL else [names[0]]
        self.match([*names, *unlisted])
        if self.requested not in names and self.requested not in unlisted:
            way_out = f"it holds {listed([*names, *unlisted], more=more)}"
            raise TrajectoryError(self.path, f"no body named {shown(self.requested)}{self._near}", way_out)
        return [self.requested]

    def match(self, names: Iterable[str]) -> None:
        """Take the name in the file for the one that is requested, where they differ in case and underscores alone.

        Raises
        ------
        TrajectoryError
            Where several names in the file do.
        """
        requested, names = self.requested or ALL, tuple(names)
        if requested == ALL or requested in names:
            return
        alike = list(dict.fromkeys(name for name in names if _folded(name) == _folded(requested)))
        if len(alike) > 1:
            problem = f"no body named {shown(requested)}, and {len(alike)} that differ from it in their case alone"
            raise TrajectoryError(self.path, problem, f"name one of {listed(alike)}")
        self.requested = alike[0] if alike else requested
        self._near = self._near or ("" if alike else did_you_mean(requested, names))

    def recording(self, trajectories: Sequence[Trajectory]) -> Recording:
        """Return the result, with what there is to say about the bodies that were taken, and those that were not."""
        taken = {trajectory.name for trajectory in trajectories}
        others = tuple(name for name in self.names if name not in taken)
        notes = list(dict.fromkeys(trajectory.remark for trajectory in trajectories if trajectory.remark))
        if others and self.requested is None:
            notes.append(
                f"{self.path} holds {len(self.names)} bodies; took {self.names[0]}; others: {listed(others)}; "
                f"name one with {self.path}:NAME, all with {self.path}:{ALL}"
            )
        named = "" if self.requested in (None, ALL) else self.requested
        return Recording(self.path, tuple(trajectories), others, printable("; ".join(notes)), named)


def _folded(name: str) -> str:
    """Return a name in small letters, with the underscores that Blender has for spaces in BVH files."""
    return name.casefold().replace(" ", "_")


def unique(names: Sequence[str]) -> list[str]:
    """Return the names, a repeated one numbered as Blender does: Hand, Hand.001, Hand.002."""
    result: list[str] = []
    unavailable = set(names)
    numbers: dict[str, int] = {}
    for name in names:
        candidate = name
        if name in numbers:
            while candidate in unavailable:
                numbers[name] += 1
                candidate = f"{name}.{numbers[name]:03d}"
            unavailable.add(candidate)
        numbers.setdefault(name, 0)
        result.append(candidate)
    return result


def shown(text: str, limit: int = 24) -> str:
    """Return a piece of a file, in quotes and short enough for a line of error."""
    return repr(text if len(text) <= limit else f"{text[:limit]}...")
