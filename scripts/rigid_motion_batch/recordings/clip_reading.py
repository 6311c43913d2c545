"""Clips read from recordings: repaired, cut to the requested part, and named.

Another motion for a clip is read in the same way, and matched to the clip in time and joint by joint.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from rigid_motion.motion import Poses, repair
from rigid_motion_batch.axes import DESCRIBED, from_blender
from rigid_motion_batch.command_line import listed, printable

from .cleaning import cleaned_first
from .clips import Clip, ClipWarning, OtherMotion
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .plausibility import breaks, calibration_pose, losses
from .reading import format_of, read_trajectories, split_source
from .recordings import Trajectory, TrajectoryError, shown
from .rest_bodies import in_parents, repaired

LONGEST_NAME = 80
"""Characters of a clip's name: nested folders have to fit the limits of file systems."""

MOST_BYTES = 240
"""Bytes of a clip's name in UTF-8, where a character may take four: file systems allow 255."""

NOT_FOLDERS = {"metrics.csv", "metrics_joints.csv", "keys_needed.csv", "slip.csv", "report.html", "manifest.json"}
"""Names that the output itself uses."""

DEVICES = {"con", "prn", "aux", "nul"} | {
    f"{device}{digit}" for device in ("com", "lpt") for digit in "0123456789\u00b9\u00b2\u00b3"
}
"""Names that Windows reserves for devices, with or without a dot and more characters after them."""


def read_clips(
    sources: Iterable[str], axes: str | None = None, options: ReadingOptions = AS_THE_FILE_SAYS
) -> tuple[list[Clip], list[str]]:
    """Read, repair and name the clips of all sources.

    Parameters
    ----------
    sources : iterable of str
        As in `rigid_motion_batch.recordings.read_trajectories`.
    axes : str, optional
        A name in `rigid_motion_batch.axes.AXES`; None for the axes of each format.
    options : ReadingOptions, optional
        Facts that the files do not state, and the part of the recordings to read.

    Returns
    -------
    clips : list of Clip
    notes : list of str
        Notes for the user on the files read, one line each.

    Raises
    ------
    TrajectoryError
        For the first source that cannot be read, or has fewer than two usable poses.
    """
    read = [read_source(source, axes, options) for source in sources]
    clips = [clip for some, _ in read for clip in some]
    names = clip_names([(clip.name, clip.body) for clip in clips])
    return [replace(clip, name=name) for clip, name in zip(clips, names, strict=True)], [
        note for _, note in read if note
    ]


def read_source(source: str, axes: str | None, options: ReadingOptions = AS_THE_FILE_SAYS) -> tuple[list[Clip], str]:
    """Read the repaired clips of one source, with names that need not be unique, and a note on it, which may be empty.

    If there are several bodies, bodies with fewer than two poses are left out, and the note says so. Raises
    TrajectoryError if the source cannot be read, or no body is left.
    """
    recording = read_trajectories(source, options)
    stem, several = recording.path.stem, len(recording.trajectories) > 1
    clips, notes = [], [recording.note] if recording.note else []
    if recording.axes_known and not axes:
        notes.append(f"its axes are {recording.axes} ({DESCRIBED[recording.axes]})")
    for trajectory in recording.trajectories:
        name = f"{stem}-{trajectory.name}" if several else stem
        try:
            clip = make_clip(trajectory, source, name, axes or recording.axes, options, measured=recording.measured)
            clips.append(replace(clip, body=recording.body))
            if clip.calibration:
                frames = "first frame" if clip.calibration == 1 else f"first {clip.calibration} frames"
                notes.append(f"{shown(clip.name)} without its {frames}, a pose before the motion; --start 0 keeps it")
        except TrajectoryError as error:
            if not several:
                raise
            notes.append(f"{shown(trajectory.name)} is left out: {error.problem}")
    if not clips:
        raise TrajectoryError(source, "; ".join(notes), "record at least 2 poses of a body")
    return clips, "; ".join(notes)


def make_clip(
    trajectory: Trajectory,
    source: str,
    name: str,
    axes: str,
    options: ReadingOptions = AS_THE_FILE_SAYS,
    *,
    measured: bool = True,
) -> Clip:
    """Return a trajectory, repaired and cut. Raises TrajectoryError if fewer than two poses are left.

    `measured` says that devices recorded it: gaps and jumps of an animation are intended, so there are no warnings on
    them.
    """
    times, poses, repairs = repair(trajectory.times, trajectory.poses, trajectory.rate)
    if len(times) < 2:
        result = "; ".join(map(str, repairs))
        raise TrajectoryError(source, f"{len(times)} usable poses are left: {result}", "record at least 2")
    rest_body, drawn = repaired(trajectory.rest_body) if trajectory.rest_body else (None, ())
    metres = trajectory.metres_per_unit
    warnings, calibration, begin = list(trajectory.warnings), 0, float(times[0])
    if axes == "unreal" and options.scale is None and metres == 1.0 and rest_body is None:
        warnings.append(ClipWarning("its lengths are read as metres, and Unreal has centimetres", "add --scale 0.01"))
    part = _requested_part(source, times - begin, options)
    if rest_body is not None and options.start is None:
        calibration, warning = calibration_pose(times, poses, rest_body, metres)
        part = slice(max(part.start, calibration), part.stop)
        warnings += [warning] if warning else []
    times, poses = times[part], poses[..., part]
    if measured:
        warnings += breaks(times, poses, rest_body, metres, begin)
        lost, repairs = losses(repairs, len(trajectory.times))
        warnings += lost
    notes = (*map(str, warnings), *map(str, repairs), *map(printable, drawn))
    clip = Clip(
        name,
        source,
        axes,
        times,
        poses,
        notes,
        metres,
        rest_body=rest_body,
        rate=trajectory.rate,
        warnings=tuple(warnings),
        calibration=calibration,
    )
    return clip if options.clean is None else cleaned_first(clip, options.clean or None)


def _requested_part(source: str, seconds: np.ndarray, options: ReadingOptions) -> slice:
    """Return the samples from start to end, in seconds since the first. Raises TrajectoryError for fewer than two."""
    first, last = options.start or 0.0, math.inf if options.end is None else options.end
    part = slice(int(np.searchsorted(seconds, first)), int(np.searchsorted(seconds, last, "right")))
    if part.stop - part.start < 2:
        until = f"{last:g} s" if options.end is not None else "its end"
        problem = (
            f"{max(part.stop - part.start, 0)} samples from {first:g} s to {until}, and it lasts {seconds[-1]:.3g} s"
        )
        raise TrajectoryError(source, problem, "give another --start or --end")
    return part


def clip_names(requested: Sequence[tuple[str, str]]) -> list[str]:
    """Return clip names as `folder_names` makes them, from pairs of a requested name and the name of the body.

    The body is empty if the user named none. It is added to the name only if several clips request the same name.
    """
    folded = [_safe(name).casefold() for name, _ in requested]
    alike = Counter(folded)
    return folder_names(
        f"{name}-{body}" if body and alike[same] > 1 else name
        for (name, body), same in zip(requested, folded, strict=True)
    )


def folder_names(requested: Iterable[str]) -> list[str]:
    """Return unique names close to those requested, safe as folder names on every system.

    Letters and digits of any script are kept, as are dots, dashes and underscores inside a name. Uniqueness ignores
    case and the Unicode form of accented letters. No name begins with a character that starts a formula in a
    spreadsheet.
    """
    names: list[str] = []
    unavailable = set(NOT_FOLDERS)
    numbers: dict[str, int] = {}
    for name in requested:
        safe = _safe(name)
        folded = safe.casefold()
        if folded in unavailable:
            number = numbers.get(folded, 2)
            while f"{folded}-{number}" in unavailable:
                number += 1
            numbers[folded] = number + 1
            safe, folded = f"{safe}-{number}", f"{folded}-{number}"
        unavailable.add(folded)
        names.append(safe)
    return names


def _safe(name: str) -> str:
    """Return the requested name, changed to be safe for a folder."""
    safe = re.sub(r"[^\w.-]+", "_", unicodedata.normalize("NFC", name)).strip("._-")[:LONGEST_NAME]
    safe = safe.encode()[:MOST_BYTES].decode(errors="ignore").strip("._-") or "clip"
    return f"clip-{safe}" if safe.casefold().split(".")[0] in DEVICES else safe


MAX_TIME_ROUNDING_S = 6e-4
"""Seconds by which the other motion may begin later or end sooner: times are often rounded to milliseconds."""


def with_against(clip: Clip, source: str, name: str, axes: str | None, options: ReadingOptions) -> tuple[Clip, str]:
    """Return a clip with another motion to compare with, cut to the time that both have, and notes, which may be empty.

    Parameters
    ----------
    clip : Clip
    source : str
        As in `read_trajectories`; one body.
    name : str
        The name for the other motion.
    axes : str, optional
        As for the clip; None for the axes of the source's format.
    options : ReadingOptions
        Options of the clip. Its start and end do not apply to the other motion, which has its own clock.

    Raises
    ------
    TrajectoryError
        If the source cannot be read, lacks joints of the clip, or does not overlap the clip in time.
    """
    honoured = {"scale", *format_of(split_source(source)[0]).honours}
    own = {name: getattr(options, name) for name in options.given if name in honoured}
    others, note = read_source(source, axes, ReadingOptions(**own, start=0.0))
    if len(others) > 1:
        raise TrajectoryError(source, f"{len(others)} bodies", "name the one that moves as the recording does")
    other = others[0]
    result = OtherMotion(name, other.times, _converted_to_clip(clip, other, source))
    first, last = np.searchsorted(clip.times, other.times[[0, -1]] + (-MAX_TIME_ROUNDING_S, MAX_TIME_ROUNDING_S))
    if last - first < 2:
        problem = f"it lasts from {_span(other.times)}, and {clip.source} from {_span(clip.times)}"
        raise TrajectoryError(source, problem, "give both the same clock")
    notes = [note, *(f"{name}: {repair}" for repair in other.repairs)]
    if last - first < len(clip.times):
        part = slice(int(first), int(last))
        said = f"compared from {_span(clip.times[part])} alone, where {name} has a motion too"
        clip = replace(clip, times=clip.times[part], poses=clip.poses[..., part], repairs=(*clip.repairs, said))
    return replace(clip, against=result), "; ".join(filter(None, notes))


def _span(times: np.ndarray) -> str:
    return f"{times[0].round(3):.13g} to {times[-1].round(3):.13g} s"


def _converted_to_clip(clip: Clip, other: Clip, source: str) -> Poses:
    """Return the poses of another clip in the axes, the unit and (for a whole body) the joints of the clip."""
    own, theirs = clip.rest_body, other.rest_body
    poses = from_blender(other.in_blender(other.poses), clip.axes)
    poses = Poses(poses.positions / clip.metres_per_unit, poses.quaternions, poses.scales)
    if own is None and theirs is None:
        return poses
    if own is None or theirs is None:
        kinds = [f"a body of {len(item.joints)} joints" if item else "a single rigid body" for item in (own, theirs)]
        raise TrajectoryError(source, f"this is {kinds[1]}, and {clip.source} {kinds[0]}", "give the same of both")
    places = {name: place for place, name in enumerate(theirs.joints)}
    if missing := [name for name in own.joints if name not in places]:
        has = f"{clip.source} has {'it' if len(missing) == 1 else 'them'}"
        raise TrajectoryError(source, f"it has no joint {listed(missing, 5)}", has)
    world = theirs.skeleton.in_root_space(poses)[[places[name] for name in own.joints]]
    return in_parents(world, own.parents)
