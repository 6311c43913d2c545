"""Contents of a recording: its bodies, units, axes, times and motion, and what looks wrong with it.

Nothing is printed here, and only the recording is read. Lengths are in metres, times in seconds, angles in degrees; x,
y and z are the recording's own axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion.jitter import jitter
from rigid_motion.motion.outliers import outliers
from rigid_motion.motion.quaternions import angle_between
from rigid_motion.motion.repair import MIN_GAP_INTERVALS
from rigid_motion_batch.axes import AXES, DESCRIBED, NERF

from .clip_reading import make_clip
from .clips import Clip, ClipWarning
from .column_names import METRES
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .reading import Format, format_of, read_all_singles
from .recordings import Recording, Trajectory, TrajectoryError
from .rest_bodies import carrying
from .sizing import axis_up, leading

UNIT_NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches", "ft": "feet"}

MAX_EVEN_INTERVAL_RATIO = 0.1
"""Samples are even if the middle 90 % of the intervals differ from the median by at most this fraction of it."""

ABOVE_THE_FLOOR = 0.3, 2.5
"""Lowest and highest metres above the floor for hands, heads and cameras of people."""

LEAST_JITTER = 1e-6, 1e-4
"""Metres and degrees: less jitter is rounding."""


@dataclass(frozen=True)
class Unit:
    """The unit of a body's lengths."""

    metres: float
    name: str
    known_from: str
    """Where the unit is known from, and so how certain it is."""


@dataclass(frozen=True)
class Timing:
    """Timing of the usable samples."""

    samples: int
    recorded: int
    """Samples in the file, including those that are damaged or left out."""

    first: float
    """The time of the first sample, in seconds of the file's times."""

    seconds: float
    rate: float
    """Samples a second: as the file states, or from the median interval."""

    shortest: float
    longest: float
    """The shortest and the longest interval, in seconds."""

    even: bool
    gaps: int
    """Number of intervals in which samples are missing."""


@dataclass(frozen=True)
class Size:
    """Extent and speed of a motion.

    For a whole body, the extent is that of all joints; path, speeds and turns are those of the joint that leads it.
    """

    lowest: tuple[float, float, float]
    highest: tuple[float, float, float]
    path: float
    """Length of the path of the body, in metres."""

    speed: float
    """The 95th percentile of the speed, in metres a second."""

    turning: float
    """The 95th percentile of the turning speed, in degrees a second."""

    turned: float
    """The largest rotation away from the first sample, in degrees."""

    @property
    def extent(self) -> tuple[float, float, float]:
        low, high = self.lowest, self.highest
        return high[0] - low[0], high[1] - low[1], high[2] - low[2]


@dataclass(frozen=True)
class MeasuredJitter:
    """Jitter and spikes of a measured body, which no motion explains: see `rigid_motion.motion.clean`."""

    position: float
    """Standard deviation along an axis, in metres; 0 if no jitter is found."""

    rotation: float
    """Standard deviation about an axis, in degrees; 0 if no jitter is found."""

    spikes: tuple[float, ...]
    """The times of samples that are spikes or repeats of the sample before, in seconds of the file's times."""


@dataclass(frozen=True)
class Contents:
    """Contents of one body."""

    name: str
    joints: tuple[str, ...]
    """The joints of a whole body; empty for a single rigid body."""

    unit: Unit
    timing: Timing
    size: Size
    scaled: bool
    """True if the body grows or shrinks."""

    up: str
    """The axis that seems to point up; empty if unclear."""

    repairs: tuple[str, ...]
    """Sentences on the repairs."""

    warnings: tuple[ClipWarning, ...]

    jitter: MeasuredJitter | None
    """None for whole bodies and animations."""


@dataclass(frozen=True)
class Axes:
    """The convention of a recording's axes."""

    name: str
    """The convention used for reading: a name in `axes.DESCRIBED`."""

    known_from: str
    others: tuple[str, ...] = ()
    """Other conventions that fit the motion."""

    @property
    def described(self) -> str:
        return DESCRIBED[self.name]


@dataclass(frozen=True)
class Inspection:
    """Contents of a recording."""

    source: str
    format: str
    bytes: int
    bodies: tuple[str, ...]
    """The names of all bodies, to be used after FILE: in a source. For a whole body, see its joints."""

    axes: Axes
    contents: tuple[Contents, ...]
    unreadable: tuple[tuple[str, str], ...] = ()
    """Bodies with fewer than two poses, and the reason."""

    note: str = ""
    """A note on what was read and what was not: takes, armatures, guessed units."""


def inspect(source: str, axes: str | None = None, options: ReadingOptions = AS_THE_FILE_SAYS) -> Inspection:
    """Return the contents of a recording.

    Parameters
    ----------
    source : str
        As in `read_trajectories`. All bodies of a file without a whole body are read.
    axes : str, optional
        The axes of the recording, a name in `rigid_motion_batch.axes.AXES`, if the user knows them.
    options : ReadingOptions, optional

    Raises
    ------
    TrajectoryError
        If the recording cannot be read, or none of its bodies has two poses.
    """
    recording = read_all_singles(source, options)
    path, result = recording.path, format_of(recording.path)
    contents, unreadable = [], []
    for trajectory in recording.trajectories:
        try:
            clip = make_clip(
                trajectory, source, trajectory.name, axes or recording.axes, options, measured=result.measured
            )
            jitter = _jitter(clip) if result.measured and clip.rest_body is None else None
            contents.append(_contents(clip, trajectory, _unit(clip, trajectory, result, options), jitter))
        except TrajectoryError as error:
            unreadable.append((trajectory.name, error.problem))
    if not contents:
        raise TrajectoryError(source, "; ".join(problem for _, problem in unreadable), "record at least 2 poses")
    bodies = (*(item.name for item in recording.trajectories), *recording.others)
    ups = {content.up for content in contents if content.up}
    taken = _axes(recording, axes, next(iter(ups)) if len(ups) == 1 else "")
    size = path.stat().st_size
    # The remarks of the bodies that were read; the other bodies are listed anyway.
    note = "; ".join(dict.fromkeys(item.remark for item in recording.trajectories if item.remark))
    return Inspection(source, result.label, size, bodies, taken, tuple(contents), tuple(unreadable), note)


def _contents(clip: Clip, trajectory: Trajectory, unit: Unit, jitter: MeasuredJitter | None) -> Contents:
    said = {str(warning) for warning in clip.warnings}
    return Contents(
        trajectory.name,
        clip.rest_body.joints if clip.rest_body else (),
        unit,
        _timing(clip, len(trajectory.times)),
        _size(clip),
        clip.poses.scales is not None,
        _up_axis(clip),
        tuple(repair for repair in clip.repairs if repair not in said),
        clip.warnings,
        jitter,
    )


def _jitter(clip: Clip) -> MeasuredJitter:
    noise = jitter(clip.times, clip.poses)
    found = np.logical_or(*outliers(clip.times, clip.poses, noise))
    sizes = np.array([noise.position * clip.metres_per_unit, np.degrees(noise.rotation)])
    position, rotation = np.where(sizes > LEAST_JITTER, sizes, 0.0).tolist()
    return MeasuredJitter(position, rotation, tuple(clip.times[found].tolist()))


def _unit(clip: Clip, trajectory: Trajectory, result: Format, options: ReadingOptions) -> Unit:
    metres = clip.metres_per_unit
    short = next((unit for unit, length in METRES.items() if length == metres), "")
    name = UNIT_NAMES.get(short, f"units of {metres:.4g} m")
    if options.scale is not None:
        return Unit(metres, name, "as --scale says")
    if not result.in_metres:
        guessed = "taken for" in trajectory.remark
        return Unit(metres, name, "guessed from the size of the body" if guessed else "they make a body of usual size")
    if metres != 1.0:
        return Unit(metres, name, "as the file says")
    return Unit(
        metres, name, "as the format has it" if result.says_unit else "assumed, where the file says nothing else"
    )


def _timing(clip: Clip, recorded: int) -> Timing:
    steps = np.diff(clip.times)
    median = 1.0 / clip.samples_a_second
    low, high = np.percentile(steps, (5.0, 95.0)) / median
    return Timing(
        samples=len(clip.times),
        recorded=recorded,
        first=float(clip.times[0]),
        seconds=float(clip.times[-1] - clip.times[0]),
        rate=clip.samples_a_second,
        shortest=float(steps.min()),
        longest=float(steps.max()),
        even=bool(low >= 1.0 - MAX_EVEN_INTERVAL_RATIO and high <= 1.0 + MAX_EVEN_INTERVAL_RATIO),
        gaps=int(np.count_nonzero(steps > MIN_GAP_INTERVALS * median)),
    )


def _size(clip: Clip) -> Size:
    root = clip.poses if clip.rest_body is None else leading(clip.rest_body, clip.poses)
    places, steps = root.positions * clip.metres_per_unit, np.diff(clip.times)
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=-1)
    turns = np.degrees(angle_between(root.quaternions[1:], root.quaternions[:-1]))
    if clip.rest_body is not None:
        joints = clip.rest_body.skeleton.in_root_space(clip.poses).positions
        joints = joints[~carrying(clip.rest_body.parents, joints)]
        places = joints.reshape(-1, 3) * clip.metres_per_unit
    return Size(
        tuple(places.min(axis=0).tolist()),
        tuple(places.max(axis=0).tolist()),
        float(lengths.sum()),
        float(np.percentile(lengths / steps, 95.0)),
        float(np.percentile(turns / steps, 95.0)),
        float(np.degrees(angle_between(root.quaternions, root.quaternions[0]).max())),
    )


def _up_axis(clip: Clip) -> str:
    """Return the axis that points up, judged by heights above the floor or by how a body stands; empty if unclear."""
    if clip.rest_body is not None:
        return axis_up(clip.rest_body, clip.poses)
    low, high = np.percentile(clip.poses.positions * clip.metres_per_unit, (1.0, 99.0), axis=0)
    above = (low > ABOVE_THE_FLOOR[0]) & (high < ABOVE_THE_FLOOR[1])
    around = (low < 0.0) & (high > 0.0)
    return "xyz"[int(above.argmax())] if above.sum() == 1 and around.sum() == 2 else ""


def _axes(recording: Recording, given: str | None, up: str) -> Axes:
    name = given or recording.axes
    if given:
        known_from = "as --axes says"
    elif not recording.measured:
        known_from = "as Blender reads it"
    else:
        known = recording.axes_known or name != "blender"
        known_from = "as its format has it" if known else "assumed"
    matching = tuple(axes for axes, change in AXES.items() if up and change[2]["xyz".index(up)] == 1.0)
    fits = name in matching or name == NERF or not recording.measured
    return Axes(name, known_from, () if fits else matching)
