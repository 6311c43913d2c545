"""Trajectories of bodies from the columns of a table, the common last step for tables of all formats.

Units in names are honoured: times become seconds, and the unit of the positions is `Trajectory.metres_per_unit`. The
user has to give the order of Euler angles. A matrix may be transposed. A position and its rotation may be in different
rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile

import numpy as np

from rigid_motion.motion import Poses, interpolate, repair
from rigid_motion.motion.poses import inverse
from rigid_motion.motion.quaternions import from_matrices, matrices

from .clips import ClipWarning
from .clocks import Clock, clock_of
from .columns import BOTTOM, EULER, MATRIX, POSITION, QUATERNION, RowLayout, layout_of, metres_of
from .euler import quaternions_from_intrinsic_eulers
from .options import ReadingOptions
from .plausibility import require_one_body
from .recordings import Cells, Selection, Trajectory, unique
from .rewriting import eulers_near, write_text
from .tables import HeaderLine

WXYZ = ("qw", *QUATERNION[:3])

MOST_LABELS = 0.5
"""Share of the rows up to which different texts in a column can be names of devices. Row numbers exceed it."""

MOST_DEVICES = 1000
"""Largest number of different texts that can be names of devices."""

LARGEST_RADIANS = 4.0 * np.pi
"""Two turns. Larger angles are degrees, unless they are stated to be radians."""

SMALLEST_DEGREES = np.pi
"""Angles that are all below this, and stated to be degrees, may be radians."""

MAX_SKEW_SINE = 0.02
"""Sine of the deviation from right angles allowed for the axes of a rotation, in files of few digits."""

MAX_RIGID_SCALE_RATIO = 1e-3
"""Ratio by which a matrix may scale and still count as unscaled."""


@dataclass(frozen=True, eq=False)
class _TrackedBody:
    """One body of a file: its columns and rows."""

    header: HeaderLine
    layout: RowLayout
    options: ReadingOptions
    name: str
    prefix: str
    """The prefix of its columns."""

    columns: Mapping[str, int]
    rows: np.ndarray | slice

    def label(self, meaning: str) -> str:
        """Return the name of a column for errors."""
        return f"{self.prefix} {meaning}".strip()

    @property
    def metres(self) -> list[float]:
        """Metres per unit along x, y and z."""
        return metres_of(self.header, self.layout, self.columns, self.options)

    def trajectory(self, times: np.ndarray, held: Mapping[str, np.ndarray]) -> Trajectory:
        """Return the trajectory from `held`, which has the values of its columns by meaning."""
        header, options, metres = self.header, self.options, self.metres
        positions = np.column_stack([held[axis] for axis in POSITION])
        warnings: tuple[ClipWarning, ...] = header.warnings
        scales = held["scale"] if np.any(held.get("scale", 1.0) != 1.0) else None
        if "qw" in held:
            quaternions = np.column_stack([held[item] for item in WXYZ])
        elif "m00" in held:
            positions, quaternions, scales = _matrix_poses(header, positions, held)
        else:
            angles, more = self._radians(np.column_stack([held[item] for item in self._angles]))
            quaternions, warnings = quaternions_from_intrinsic_eulers(angles, options.intrinsic_order), warnings + more
        if len(set(metres)) > 1:
            positions, metres = positions * metres, [1.0]
        times, poses, remark = _paired(times, Poses(positions, quaternions, scales))
        if header.inverted:
            with np.errstate(invalid="ignore", over="ignore"):
                poses = inverse(poses)
        return Trajectory(self.name, times, poses, metres[0], remark, warnings, axes=header.axes)

    def numbers(self, held: Mapping[str, np.ndarray], poses: Poses) -> dict[int, np.ndarray]:
        """Return the values of each column for other poses, the inverse of `trajectory`; `held` are the old values."""
        poses = inverse(poses) if self.header.inverted else poses
        places = poses.positions / (self.metres if len(set(self.metres)) > 1 else 1.0)
        made = dict(zip(POSITION, places.T, strict=True))
        if "qw" in held:
            before = np.column_stack([held[item] for item in WXYZ])
            signs = np.where(np.einsum("nk,nk->n", before, poses.quaternions) < 0.0, -1.0, 1.0)
            made |= zip(WXYZ, (signs[:, None] * poses.quaternions).T, strict=True)
        elif "m00" in held:
            axes = matrices(poses.quaternions).transpose(2, 0, 1)
            axes = axes if poses.scales is None else axes * poses.scales[:, None, None]
            if _is_transposed(held):
                axes, made = axes.transpose(0, 2, 1), dict(zip(BOTTOM, places.T, strict=True))
            made |= zip(MATRIX, axes.reshape(-1, 9).T, strict=True)
        else:
            unit = np.pi / 180.0 if self._in_degrees else 1.0
            before = np.column_stack([held[item] for item in self._angles]) * unit
            angles = eulers_near(poses.quaternions, self.options.intrinsic_order, before) / unit
            made |= zip(self._angles, angles.T, strict=True)
        return {self.columns[item]: column for item, column in made.items()}

    @property
    def _angles(self) -> list[str]:
        """Meanings of the angles, in the order of the turns."""
        return [f"r{axis.lower()}" for axis in self.options.intrinsic_order]

    @property
    def _units(self) -> list[str]:
        return [self.layout.units.get(self.columns[item], "") for item in EULER]

    @property
    def _in_degrees(self) -> bool:
        return self.options.degrees or "deg" in self._units

    def _radians(self, angles: np.ndarray) -> tuple[np.ndarray, tuple[ClipWarning, ...]]:
        """Return angles of shape (n, 3) in radians, and warnings of implausible ones."""
        largest = float(np.nanmax(np.abs(angles), initial=0.0, where=np.isfinite(angles)))
        warnings: tuple[ClipWarning, ...] = ()
        if self.options.degrees and len(angles) and 0.0 < largest <= SMALLEST_DEGREES:
            text = f"its angles are all within {largest:.3g} degrees"
            warnings = (ClipWarning(text, "radians need no --degrees"),)
        if self._in_degrees:
            return np.radians(angles), warnings
        if "rad" not in self._units and largest > LARGEST_RADIANS:
            way_out = "say so: --degrees; or name the columns of radians rx_rad, ry_rad, rz_rad"
            raise self.header.error(f"angles go up to {largest:.4g}, which are not radians", way_out)
        return angles, ()


def read_below(selection: Selection, options: ReadingOptions, header: HeaderLine, way_out: str) -> list[Trajectory]:
    """Read the requested bodies of the rows below a header; `way_out` is the advice for rows of mixed devices."""
    layout = layout_of(header, options)
    write = header.write or (lambda target, numbers: write_text(header, target, numbers))
    bodies = _bodies(header, layout, options)
    taken = set(selection.of([body.name for body in bodies]))
    requested = [body for body in bodies if body.name in taken]
    columns = {body.label(one): index for body in requested for one, index in body.columns.items() if one != "t"}
    numbers = dict(zip(columns, header.numbers_below(columns).T, strict=True))
    count = len(next(iter(numbers.values())))
    clocks, trajectories = {}, []
    for body in requested:
        times = (body.columns["t"],) if "t" in body.columns else layout.times
        if times not in clocks:
            clocks[times] = clock_of(header, times, layout, options, count, body.rows)
        clock = clocks[times]
        held = {one: numbers[body.label(one)][body.rows] for one in body.columns if one != "t"}
        seconds, rows = clock.seconds[body.rows], np.arange(count)[body.rows]
        if header.names is None and len(layout.bodies) > 1:
            # Topics of a log share its rows, and may be missing in some.
            there = ~np.isnan([*held.values()]).all(axis=0)
            seconds, held = seconds[there], {one: column[there] for one, column in held.items()}
            rows = rows[there]
        trajectory = body.trajectory(seconds, held)
        if len(trajectory.times) == len(rows):
            own_clock = len(times) == 1 and (len(layout.bodies) == 1 or "t" in body.columns)
            written = _times_written(clock, times[0], rows) if own_clock else None
            cells = Cells(rows, (count, len(header.cells)), partial(body.numbers, held), write, written)
            trajectory = replace(trajectory, cells=cells)
        remarks = (trajectory.remark, header.remark, layout.remark, clock.remark)
        trajectory = replace(trajectory, remark="; ".join(filter(None, remarks)), dated=clock.dated)
        require_one_body(trajectory, header.path, way_out, header.number)
        trajectories.append(trajectory)
    return trajectories


def _bodies(header: HeaderLine, layout: RowLayout, options: ReadingOptions) -> list[_TrackedBody]:
    """Return all bodies, in the order of columns and rows."""
    groups = _devices(header, layout.devices, "device" in dict(options.columns))
    bodies = [
        (f"{device} {prefix}".strip() or header.path.stem, prefix, columns, rows)
        for device, rows in groups.items()
        for prefix, columns in layout.bodies.items()
    ]
    names = unique([name for name, *_ in bodies])
    return [
        _TrackedBody(header, layout, options, name, prefix, columns, rows)
        for name, (_, prefix, columns, rows) in zip(names, bodies, strict=True)
    ]


def _devices(header: HeaderLine, columns: Sequence[int], named: bool) -> dict[str, np.ndarray | slice]:
    """Return the rows of each device, by the first column that distinguishes several, or else has one name."""
    only = ""
    for column in columns:
        codes, of_rows = _codes(header.cells_below(column))
        if len(codes) > MOST_DEVICES and named:
            problem = f"more than {MOST_DEVICES} different values in the column of devices"
            raise header.error(problem, "name another with --columns device=NAME")
        if len(codes) > min(max(MOST_LABELS * len(of_rows), 1), MOST_DEVICES) and not named:
            continue
        if len(codes) > 1:
            order = np.argsort(of_rows, kind="stable")
            rows = np.split(order, np.flatnonzero(np.diff(of_rows[order])) + 1)
            return dict(zip(codes, rows, strict=True))
        only = only or next(iter(codes), "")
    return {only: slice(None)}


def _codes(cells: Iterator[tuple[int, str]]) -> tuple[dict[str, int], np.ndarray]:
    """Return a number for each text, up to one more than the limit of devices, and the numbers of the rows."""
    codes: dict[str, int] = {}
    rows = takewhile(lambda _: len(codes) <= MOST_DEVICES, cells)
    return codes, np.fromiter((codes.setdefault(text, len(codes)) for _, text in rows), np.int64)


def _times_written(clock: Clock, column: int, rows: np.ndarray) -> Callable[[np.ndarray], dict[int, np.ndarray]] | None:
    """Return a function that converts times (n,) to numbers of their column; None if the column has no numbers."""
    if not clock.per_second:
        return None
    ticks, seconds = clock.ticks[rows], clock.seconds[rows]

    def written(times: np.ndarray) -> dict[int, np.ndarray]:
        later = (times - seconds) * clock.per_second
        return {column: ticks + (np.rint(later) if ticks.dtype != float else later)}

    return written


def _is_transposed(held: Mapping[str, np.ndarray]) -> bool:
    """Return whether the translation of matrices is in the last row."""
    below, beside = ([held[item] for item in where if item in held] for where in (BOTTOM, POSITION))
    return bool(np.any(np.nan_to_num(below)) and not np.any(np.nan_to_num(beside)))


def _matrix_poses(
    header: HeaderLine, positions: np.ndarray, held: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return positions (n, 3), quaternions and scales of matrices, transposed or not; NaN where one is not a pose."""
    rotations = np.stack([held[item] for item in MATRIX], axis=-1).reshape(-1, 3, 3)
    if _is_transposed(held):
        rotations = rotations.transpose(0, 2, 1)
        positions = np.column_stack([held.get(item, np.zeros(len(positions))) for item in BOTTOM])
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        scales = np.cbrt(np.linalg.det(rotations))
        rotations = rotations / scales[:, None, None]
        squares = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        good = (scales > 0.0) & (squares < 2.0 * MAX_SKEW_SINE)
        if len(good) and not good.any():
            raise header.error(
                "the nine numbers of each row are not a rotation", "its columns must be three axes, right-handed"
            )
        quaternions = np.full((len(rotations), 4), np.nan)
        quaternions[good] = from_matrices(rotations[good])
    scaled = bool(np.any(np.abs(scales[good] - 1.0) > MAX_RIGID_SCALE_RATIO))
    return positions, quaternions, np.where(good, scales, np.nan) if scaled else None


def _paired(times: np.ndarray, poses: Poses) -> tuple[np.ndarray, Poses, str]:
    """Return times (n,) and poses with a rotation for each position, even if they are in different rows.

    The rows of the more frequent one are kept, and the other is interpolated at them. The text is a remark on that.
    """
    there = np.isfinite(times)
    placed, turned = (np.isfinite(part).all(axis=-1) & there for part in (poses.positions, poses.quaternions))
    fewest, most = sorted((placed, turned), key=np.count_nonzero)
    if 2 * np.count_nonzero(placed & turned) >= np.count_nonzero(fewest):
        return times, poses, ""
    filled = Poses(
        np.where(placed[:, None], poses.positions, 0.0),
        np.where(turned[:, None], poses.quaternions, (1.0, 0.0, 0.0, 0.0)),
    )
    parts = [repair(times[rows], filled[rows])[:2] for rows in (placed, turned)]
    within = [(times >= own.min(initial=np.inf)) & (times <= own.max(initial=-np.inf)) for own, _ in parts]
    at = times[most & within[0] & within[1]]
    if len(at) < 2:
        return times, poses, ""
    places, turns = (interpolate(own, known, at, "lerp_slerp") for own, known in parts)
    remark = "positions and rotations stand in different rows: each is filled in between its own"
    return at, Poses(places.positions, turns.quaternions), remark
