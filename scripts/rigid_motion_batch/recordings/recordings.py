"""Results of reading: trajectories of the requested bodies, names of the other bodies, or one clear error.

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
"""Name that requests every body of a file."""

MOST_POSES = 50_000_000
"""Poses of all joints together: a small file may state any number of joints and frames."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a file that hold the numbers of a body, for writing other numbers in their place."""

    rows: np.ndarray
    """The row of each sample, shape (n,)."""

    shape: tuple[int, int]
    """Number of rows and columns of the file."""

    numbers: Callable[[Poses], Mapping[int, np.ndarray]]
    """A function of poses like those of the trajectory. It returns the numbers (n,) of each column."""

    write: Callable[[Path, np.ndarray], None]
    """A function that writes the whole file to a path with numbers of that shape; NaN keeps the present number."""

    times: Callable[[np.ndarray], Mapping[int, np.ndarray]] | None = None
    """A function of times (n,), likewise; None if the time column is shared with other bodies, or has no numbers."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One body of one file, exactly as recorded: unrepaired, native axes, units and signs."""

    name: str
    """The body: CSV file stem, Motive rigid body, A-Frame device, BVH joint, Blender object, or OBJECT/BONE."""

    times: np.ndarray
    """Seconds, shape (n,). Only a sound recording has increasing and finite ones."""

    poses: Poses
    """Shape (n,). A sample that was not tracked is NaN; scales are None unless the file has a scale other than 1.

    For a whole body shape (joints, n), each joint in its parent's space, without scales."""

    metres_per_unit: float = 1.0
    """The length of one unit of the positions, if the file states it; 1 otherwise."""

    remark: str = ""
    """A remark for the user who requested this body."""

    warnings: tuple[ClipWarning, ...] = ()
    """Warnings of implausible parts of this recording."""

    dated: bool = False
    """True if its times were dates or clock times, whose unit is certain."""

    rest_body: RestBody | None = None
    """The rest body of a whole body."""

    rate: float | None = None
    """Samples a second of the recording, if `times` may have additional samples in between."""

    axes: str = ""
    """The axes of the program that wrote the file, if other than those of the format: a name in `axes.DESCRIBED`."""

    cells: Cells | None = None
    """None if the numbers in the file cannot be replaced."""


@dataclass(frozen=True, eq=False)
class Recording:
    """The trajectories read from a file, with remarks."""

    path: Path

    trajectories: tuple[Trajectory, ...]
    """The requested bodies, in the order of the file."""

    others: tuple[str, ...] = ()
    """The names of the other bodies."""

    note: str = ""
    """Remarks on the bodies read. If the file has several bodies and none was named, also a note that says which was
    read, which are left, and how to name one."""

    body: str = ""
    """The body that was requested by name; empty if the first or all were."""

    axes: str = "blender"
    """The convention of its format, or of the program that wrote it: a name in `axes.DESCRIBED`."""

    axes_known: bool = False
    """True if the axes are those of the program that wrote the file, in a format that several programs write."""

    measured: bool = True
    """True if the format holds measurements of devices, and not animation."""


class TrajectoryError(ValueError):
    """Error that says in one line why a recording cannot be read: `FILE:LINE: what is wrong; way out`."""

    def __init__(self, path: Path | str, problem: str, way_out: str, line: int | None = None) -> None:
        where = f"{path}:{line}" if line else f"{path}"
        self.problem = printable(problem)
        super().__init__(printable(f"{where}: {problem}; {way_out}"))


class NoMotion(TrajectoryError):
    """Error for a file without a recording, which need not be damaged: another kind of table, or a body at rest."""


def refuse_too_many(path: Path, joints: int, frames: float) -> None:
    """Raise TrajectoryError for more poses than memory can hold."""
    if joints * frames > MOST_POSES:
        problem = f"{joints} joints in {frames:.0f} frames are more than {MOST_POSES} poses"
        raise TrajectoryError(path, problem, "export fewer joints, or split the recording")


class Selection:
    """Selection of the bodies of a file: the first, all, or one by name."""

    def __init__(self, path: Path, requested: str | None) -> None:
        self.path = path
        self.requested = requested
        self.names: tuple[str, ...] = ()
        self._similar_name = ""
        """Hint at a similar name, for a name that is not in the file."""

    def of(self, names: Sequence[str], unlisted: Sequence[str] = (), more: int = 0) -> list[str]:
        """Return the requested bodies of the file.

        Parameters
        ----------
        names : sequence of str
            The bodies, in the order of the file.
        unlisted : sequence of str
            More bodies, selected only by name.
        more : int
            How many further bodies there are, which an error counts but does not name.

        Raises
        ------
        TrajectoryError
            If the name, ignoring case, fits no body of the file or several, or the file has no bodies.
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
            raise TrajectoryError(self.path, f"no body named {shown(self.requested)}{self._similar_name}", way_out)
        return [self.requested]

    def match(self, names: Iterable[str]) -> None:
        """Replace the requested name by the one in the file, if they differ only in case and underscores.

        Raises
        ------
        TrajectoryError
            If several names in the file fit.
        """
        requested, names = self.requested or ALL, tuple(names)
        if requested == ALL or requested in names:
            return
        alike = list(dict.fromkeys(name for name in names if _folded(name) == _folded(requested)))
        if len(alike) > 1:
            problem = f"no body named {shown(requested)}, and {len(alike)} that differ from it in their case alone"
            raise TrajectoryError(self.path, problem, f"name one of {listed(alike)}")
        self.requested = alike[0] if alike else requested
        self._similar_name = self._similar_name or ("" if alike else did_you_mean(requested, names))

    def recording(self, trajectories: Sequence[Trajectory]) -> Recording:
        """Return the recording, with remarks on the bodies that were read and those that were not."""
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
    """Return a name in lower case, with underscores for spaces, as Blender writes names to BVH files."""
    return name.casefold().replace(" ", "_")


def unique(names: Sequence[str]) -> list[str]:
    """Return the names, with repeated ones numbered like in Blender: Hand, Hand.001, Hand.002."""
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
    """Return a text from a file, in quotes, and short enough for an error message."""
    return repr(text if len(text) <= limit else f"{text[:limit]}...")
