"""From recordings to clips, and from clips to what each mode makes of a few keys a second of them."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

from rigid_motion.motion import repair
from rigid_motion_batch.command_line import printable
from rigid_motion_batch.recordings import ReadingOptions, Trajectory, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.figures import repaired
from rigid_motion_batch.recordings.options import AS_THE_FILE_SAYS
from rigid_motion_batch.recordings.recordings import shown

from .clips import Clip

LONGEST_NAME = 80
"""Characters of a clip's name: folders below folders have to fit what file systems allow."""

MOST_BYTES = 240
"""Of a clip's name in UTF-8, in which some characters have four: file systems allow 255."""

NOT_FOLDERS = {
    *("metrics.csv", "metrics_joints.csv", "decimated.csv", "keys_needed.csv", "report.html", "manifest.json"),
}
"""Names that the output needs itself."""

DEVICES = {"con", "prn", "aux", "nul"} | {
    f"{device}{digit}" for device in ("com", "lpt") for digit in "0123456789\u00b9\u00b2\u00b3"
}
"""Names that Windows keeps for devices, whatever follows them after a dot."""


def read_clips(
    sources: Iterable[str], axes: str | None, options: ReadingOptions = AS_THE_FILE_SAYS
) -> tuple[list[Clip], list[str]]:
    """Read, repair and name the clips of all sources.

    Parameters
    ----------
    sources : iterable of str
        As `rigid_motion_batch.recordings.read_trajectories` takes them.
    axes : str or None
        A name in `rigid_motion_batch.axes.AXES`; None for those of each format.
    options : ReadingOptions
        What the files do not say of themselves.

    Returns
    -------
    clips : list of Clip
    notes : list of str
        What the user should know of what was read, a line each.

    Raises
    ------
    TrajectoryError
        For the first source that cannot be read, or of which fewer than two poses are left.
    """
    read = [read_source(source, axes, options) for source in sources]
    clips = [clip for some, _ in read for clip in some]
    names = clip_names([(clip.name, clip.body) for clip in clips])
    return [replace(clip, name=name) for clip, name in zip(clips, names, strict=True)], [
        note for _, note in read if note
    ]


def read_source(source: str, axes: str | None, options: ReadingOptions = AS_THE_FILE_SAYS) -> tuple[list[Clip], str]:
    """The clips of one source, repaired but not yet told apart by their names, and a note on it, which may be empty.

    Of several bodies those are left out, with a note, that there are no two poses of. Raises TrajectoryError where the
    source cannot be read, or nothing of it is left.
    """
    recording = read_trajectories(source, options)
    stem, several = recording.path.stem, len(recording.trajectories) > 1
    clips, notes = [], [recording.note] if recording.note else []
    for trajectory in recording.trajectories:
        name = f"{stem}-{trajectory.name}" if several else stem
        try:
            clip = make_clip(trajectory, source, name, axes or recording.axes)
            clips.append(replace(clip, body=recording.body))
        except TrajectoryError as error:
            if not several:
                raise
            notes.append(f"{shown(trajectory.name)} is left out: {error.problem}")
    if not clips:
        raise TrajectoryError(source, "; ".join(notes), "record at least 2 poses of a body")
    return clips, "; ".join(notes)


def make_clip(trajectory: Trajectory, source: str, name: str, axes: str) -> Clip:
    """A trajectory, repaired. Raises TrajectoryError where fewer than two poses are left of it."""
    times, poses, repairs = repair(trajectory.times, trajectory.poses, trajectory.rate)
    if len(times) < 2:
        found = "; ".join(map(str, repairs))
        raise TrajectoryError(source, f"{len(times)} usable poses are left: {found}", "record at least 2")
    figure, drawn = repaired(trajectory.figure) if trajectory.figure else (None, ())
    notes = (*trajectory.warnings, *map(str, repairs), *map(printable, drawn))
    return Clip(
        name, source, axes, times, poses, notes, trajectory.metres_per_unit, figure=figure, rate=trajectory.rate
    )


def clip_names(wanted: Sequence[tuple[str, str]]) -> list[str]:
    """Names for clips, as `folder_names` gives them, of what each would like to be called and of its body.

    The body, empty where the user named none, is part of the name only where several would like to be called the same.
    """
    folded = [_safe(name).casefold() for name, _ in wanted]
    alike = Counter(folded)
    return folder_names(
        f"{name}-{body}" if body and alike[same] > 1 else name
        for (name, body), same in zip(wanted, folded, strict=True)
    )


def folder_names(wanted: Iterable[str]) -> list[str]:
    """Names like those wanted that are safe for folders on every system, each unlike all before it.

    Letters and digits of any script stay, and so do dots, dashes and underscores inside. Case makes no difference, nor
    does how a letter with an accent is spelled in Unicode. No name begins with what spreadsheets take for a formula.
    """
    names: list[str] = []
    unavailable, numbers = set(NOT_FOLDERS), {}
    for name in wanted:
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
    """A name like the one wanted that is safe for a folder."""
    safe = re.sub(r"[^\w.-]+", "_", unicodedata.normalize("NFC", name)).strip("._-")[:LONGEST_NAME]
    safe = safe.encode()[:MOST_BYTES].decode(errors="ignore").strip("._-") or "clip"
    return f"clip-{safe}" if safe.casefold().split(".")[0] in DEVICES else safe
