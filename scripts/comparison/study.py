"""From recordings to clips, and from clips to what each mode makes of a few keys a second of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from addon.motion import best_modes, interpolate, interpolate_by_segments, measure, repair, rms
from scripts.trajectories import Trajectory, TrajectoryError, read_trajectories

from .choices import Choice, Uniform
from .clips import Clip
from .modes import BEST_OF, single_modes
from .reconstructions import Reconstruction, identical_modes

LONGEST_NAME = 80
"""Characters of a clip's name: folders below folders have to fit what file systems allow."""

NOT_FOLDERS = {"metrics.csv", "keys_needed.csv", "report.html", *["con", "prn", "aux", "nul"]} | {
    f"{device}{digit}" for device in ("com", "lpt") for digit in range(1, 10)
}
"""Names that the output needs itself, or that Windows keeps for devices."""

PROBE = 4
"""Of so many samples one is a key where it is looked which modes are one motion."""


def read_clips(sources: Iterable[str], axes: str) -> tuple[list[Clip], list[str]]:
    """Read, repair and name the clips of all sources.

    Parameters
    ----------
    sources : iterable of str
        As `scripts.trajectories.read_trajectories` takes them.
    axes : str
        A name in `scripts.trajectories.axes.AXES`.

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
    clips: list[Clip] = []
    notes: list[str] = []
    for source in sources:
        recording = read_trajectories(source)
        if recording.note:
            notes.append(recording.note)
        stem = recording.path.stem
        for trajectory in recording.trajectories:
            name = f"{stem}-{trajectory.name}" if len(recording.trajectories) > 1 else stem
            clips.append(make_clip(trajectory, source, folder_name(name, [clip.name for clip in clips]), axes))
    return clips, notes


def make_clip(trajectory: Trajectory, source: str, name: str, axes: str) -> Clip:
    """A trajectory, repaired. Raises TrajectoryError where fewer than two poses are left of it."""
    times, poses, repairs = repair(trajectory.times, trajectory.poses)
    if len(times) < 2:
        found = "; ".join(map(str, repairs))
        raise TrajectoryError(source, f"{len(times)} usable poses are left: {found}", "record at least 2")
    return Clip(name, source, axes, times, poses, tuple(map(str, repairs)), trajectory.metres_per_unit)


def folder_name(wanted: str, taken: Iterable[str]) -> str:
    """A name like the one wanted that is safe for a folder on every system, and unlike those that are taken.

    Letters and digits of any script stay, and so do dots inside, dashes and underscores. Case makes no difference.
    """
    safe = re.sub(r"[^\w.-]+", "_", wanted)[:LONGEST_NAME].strip("._ ") or "clip"
    unavailable = NOT_FOLDERS | {name.casefold() for name in taken}
    # Windows takes "nul.txt" for the device too.
    if safe.casefold() in unavailable or safe.casefold().split(".")[0] in NOT_FOLDERS:
        number = 2
        while f"{safe}-{number}".casefold() in unavailable:
            number += 1
        return f"{safe}-{number}"
    return safe


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
    """The same with `BEST_OF` its modes, which has the keys of the best of them: the fewest, then the least error."""
    clip, modes = made.clip, tuple(made.keys)
    kept = made.keys[min(modes, key=lambda mode: (len(made.keys[mode]), rms(made.errors[mode].shell)))]
    tolerance = made.choice.tolerance(clip)
    unit = clip.metres_per_unit
    chosen = best_modes(
        clip.times, clip.poses, kept, modes, radius / unit, None if tolerance is None else tolerance / unit
    )
    poses = interpolate_by_segments(clip.times[kept], clip.poses[kept], made.times, chosen)
    errors = measure(made.times, clip.in_metres(poses), clip.in_metres(clip.poses[made.samples]), radius)
    return replace(
        made,
        keys=made.keys | {BEST_OF: kept},
        poses=made.poses | {BEST_OF: poses},
        errors=made.errors | {BEST_OF: errors},
        segment_modes=chosen,
    )


def fill_in(clip: Clip, choice: Choice, keys: dict[str, np.ndarray], radius: float) -> Reconstruction:
    """What each mode makes of its keys, at least two, which begin and end with the same samples."""
    ends = next(iter(keys.values()))
    samples = slice(int(ends[0]), int(ends[-1]) + 1)
    times, truth = clip.times[samples], clip.in_metres(clip.poses[samples])
    poses = {mode: interpolate(clip.times[kept], clip.poses[kept], times, mode) for mode, kept in keys.items()}
    errors = {mode: measure(times, clip.in_metres(filled), truth, radius) for mode, filled in poses.items()}
    return Reconstruction(clip, choice, keys, poses, errors)


def same_motions(clip: Clip, modes: tuple[str, ...], radius: float) -> tuple[tuple[str, ...], ...]:
    """The modes in groups that are one motion on this clip, seen with about every `PROBE`th sample as a key."""
    rate = (len(clip.times) - 1) / float(clip.times[-1] - clip.times[0]) / PROBE
    probe = reconstruct(clip, Uniform(f"{max(rate, 1e-6):.6f}"), modes, radius)
    return identical_modes([probe]) if probe else tuple((mode,) for mode in modes)
