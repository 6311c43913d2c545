"""From recordings to clips, and from clips to what each mode makes of a few keys a second of them."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from addon.motion import best_modes, measure, repair
from scripts.trajectories import ReadingOptions, Trajectory, TrajectoryError, read_trajectories
from scripts.trajectories.options import AS_THE_FILE_SAYS
from scripts.trajectories.recordings import shown

from .choices import Choice, Uniform
from .clips import Clip
from .modes import BEST_OF, single_modes
from .reconstructions import Reconstruction, identical_modes

LONGEST_NAME = 80
"""Characters of a clip's name: folders below folders have to fit what file systems allow."""

MOST_BYTES = 240
"""Of a clip's name in UTF-8, in which some characters have four: file systems allow 255."""

NOT_FOLDERS = {"metrics.csv", "keys_needed.csv", "report.html", "manifest.json"}
"""Names that the output needs itself."""

DEVICES = {"con", "prn", "aux", "nul"} | {
    f"{device}{digit}" for device in ("com", "lpt") for digit in "0123456789\u00b9\u00b2\u00b3"
}
"""Names that Windows keeps for devices, whatever follows them after a dot."""

PROBE = 4
"""Of so many samples one is a key where it is looked which modes are one motion."""


def read_clips(
    sources: Iterable[str], axes: str, options: ReadingOptions = AS_THE_FILE_SAYS
) -> tuple[list[Clip], list[str]]:
    """Read, repair and name the clips of all sources.

    Parameters
    ----------
    sources : iterable of str
        As `scripts.trajectories.read_trajectories` takes them.
    axes : str
        A name in `scripts.trajectories.axes.AXES`.
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
    names = folder_names(clip.name for clip in clips)
    return [replace(clip, name=name) for clip, name in zip(clips, names, strict=True)], [
        note for _, note in read if note
    ]


def read_source(source: str, axes: str, options: ReadingOptions = AS_THE_FILE_SAYS) -> tuple[list[Clip], str]:
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
            clips.append(make_clip(trajectory, source, name, axes))
        except TrajectoryError as error:
            if not several:
                raise
            notes.append(f"{shown(trajectory.name)} is left out: {error.problem}")
    if not clips:
        raise TrajectoryError(source, "; ".join(notes), "record at least 2 poses of a body")
    return clips, "; ".join(notes)


def make_clip(trajectory: Trajectory, source: str, name: str, axes: str) -> Clip:
    """A trajectory, repaired. Raises TrajectoryError where fewer than two poses are left of it."""
    times, poses, repairs = repair(trajectory.times, trajectory.poses)
    if len(times) < 2:
        found = "; ".join(map(str, repairs))
        raise TrajectoryError(source, f"{len(times)} usable poses are left: {found}", "record at least 2")
    notes = (*trajectory.warnings, *map(str, repairs))
    return Clip(name, source, axes, times, poses, notes, trajectory.metres_per_unit)


def folder_names(wanted: Iterable[str]) -> list[str]:
    """Names like those wanted that are safe for folders on every system, each unlike all before it.

    Letters and digits of any script stay, and so do dots, dashes and underscores inside. Case makes no difference, nor
    does how a letter with an accent is spelled in Unicode. No name begins with what spreadsheets take for a formula.
    """
    names: list[str] = []
    unavailable, numbers = set(NOT_FOLDERS), {}
    for name in wanted:
        safe = re.sub(r"[^\w.-]+", "_", unicodedata.normalize("NFC", name)).strip("._-")[:LONGEST_NAME]
        safe = safe.encode()[:MOST_BYTES].decode(errors="ignore").strip("._-") or "clip"
        safe = f"clip-{safe}" if safe.casefold().split(".")[0] in DEVICES else safe
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


def reconstruct(clip: Clip, choice: Choice, modes: Sequence[str], radius: float) -> Reconstruction | None:
    """Choose keys of the clip for every mode, and fill in between them.

    Parameters
    ----------
    clip : Clip
    choice : Choice
    modes : sequence of str
        Of `addon.motion.MODES`, and `BEST_OF` of them.
    radius : float
        Of the shell, in metres.

    Returns
    -------
    Reconstruction or None
        None where the clip is too short for two keys.

    Notes
    -----
    Modes that are one motion get one choice of keys, made for the first of them: choosing by the motion takes time,
    and rounding must not make them look different.
    """
    with_best, modes = BEST_OF in modes, single_modes(modes)
    groups = [modes] if choice.decimation == "uniform" else same_motions(clip, modes, radius)
    keys: dict[str, np.ndarray] = {}
    for group in groups:
        keys |= dict.fromkeys(group, choice.keys(clip, group[0], radius))
    if min(map(len, keys.values())) < 2:
        return None
    made = fill_in(clip, choice, {mode: keys[mode] for mode in modes}, radius)
    return with_best_of(made, radius) if with_best else made


def with_best_of(made: Reconstruction, radius: float) -> Reconstruction:
    """The same with `BEST_OF` its modes, which has the keys of the best single one."""
    clip, kept = made.clip, made.keys[made.best_mode]
    tolerance = made.choice.tolerance(clip)
    unit = clip.metres_per_unit
    chosen = best_modes(
        clip.times, clip.poses, kept, made.keys, radius / unit, None if tolerance is None else tolerance / unit
    )
    best = fill_in(clip, made.choice, {BEST_OF: kept}, radius, chosen)
    return replace(best, keys=made.keys | best.keys, poses=made.poses | best.poses, errors=made.errors | best.errors)


def fill_in(
    clip: Clip, choice: Choice, keys: dict[str, np.ndarray], radius: float, segment_modes: tuple[str, ...] = ()
) -> Reconstruction:
    """What each mode makes of its keys, at least two, which begin and end with the same samples.

    `BEST_OF` among them has the modes of its segments from `segment_modes`.
    """
    made = Reconstruction(clip, choice, keys, {}, {}, segment_modes)
    times, truth = made.times, clip.in_metres(clip.poses[made.samples])
    poses = {mode: made.filled_in(mode, times) for mode in keys}
    errors = {mode: measure(times, clip.in_metres(filled), truth, radius) for mode, filled in poses.items()}
    return replace(made, poses=poses, errors=errors)


def same_motions(clip: Clip, modes: tuple[str, ...], radius: float) -> tuple[tuple[str, ...], ...]:
    """The modes in groups that are one motion on this clip, seen with about every `PROBE`th sample as a key."""
    rate = (len(clip.times) - 1) / float(clip.times[-1] - clip.times[0]) / PROBE
    probe = reconstruct(clip, Uniform(f"{max(rate, 1e-6):.6f}"), modes, radius)
    return identical_modes([probe]) if probe else tuple((mode,) for mode in modes)
