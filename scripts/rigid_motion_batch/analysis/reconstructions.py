"""Reconstructions: what each mode makes of the few keys that are kept of a clip, and how far off that is.

Times and poses are the clip's, errors are in metres (`clips`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigid_motion.motion import (
    Errors,
    Poses,
    best_modes,
    interpolate,
    interpolate_by_segments,
    measure,
    rms,
    shell_error,
)
from rigid_motion_batch.recordings.clips import Clip, OtherMotion

from .choices import Choice, Uniform
from .modes import BEST_OF, single_modes

Groups = tuple[tuple[str, ...], ...]
"""Modes, those together that are one motion."""

PROBE = 4
"""Of so many samples one is a key where it is looked which modes are one motion."""

FEWEST_PROBED = 4
"""Keys that are needed to see which modes are one motion: between two, a spline is a screw like any other."""

NO_KEYS = np.array([], dtype=int)
"""Of somebody else's motion: they are not known."""


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A clip under one choice of keys: the keys that each mode kept, and what it filled in between them.

    All modes begin and end with the same samples.
    """

    clip: Clip

    choice: Choice
    """How the keys were chosen."""

    keys: dict[str, np.ndarray]
    """Mode id to the samples that were kept, rising indices into the clip, shape (k,); none of somebody else's motion,
    which comes last."""

    poses: dict[str, Poses]
    """Mode id to the poses at `times`."""

    errors: dict[str, Errors]
    """Mode id to the errors against the clip at `times`."""

    segment_modes: tuple[str, ...] = ()
    """The mode of each segment under `best_of`, k - 1 of them; none where the run does without."""

    @property
    def samples(self) -> slice:
        """The samples of the clip between the first and the last key, both included."""
        keys = next(iter(self.keys.values()))
        return slice(int(keys[0]), int(keys[-1]) + 1)

    @property
    def times(self) -> np.ndarray:
        """The times of `samples`."""
        return self.clip.times[self.samples]

    @property
    def best_mode(self) -> str:
        """The best single mode: with the fewest keys, and of those with the least RMS shell error."""
        counts = {mode: len(self.keys[mode]) for mode in single_modes(self.keys) if len(self.keys[mode])}
        return min(counts, key=lambda mode: (counts[mode], rms(self.errors[mode].shell)))

    def filled_in(self, mode: str, times: np.ndarray) -> Poses:
        """Return what a mode makes of its keys at any times."""
        if not len(self.keys[mode]):
            assert self.clip.against is not None  # it alone has no keys
            return self.clip.against.at(times)
        key_times, keys = self.clip.times[self.keys[mode]], self.clip.poses[self.keys[mode]]
        if mode == BEST_OF:
            return interpolate_by_segments(key_times, keys, times, self.segment_modes)
        return interpolate(key_times, keys, times, mode)


def reconstruct(clip: Clip, choice: Choice, modes: Sequence[str], radius: float) -> Reconstruction | None:
    """Choose keys of the clip for every mode, and fill in between them.

    Parameters
    ----------
    clip : Clip
        What the user compares with it comes after the modes.
    choice : Choice
    modes : sequence of str
        Of `rigid_motion.motion.MODES`, and `BEST_OF` of them.
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
    made = with_best_of(made, radius) if with_best else made
    return with_other(made, clip.against, radius) if clip.against else made


def with_best_of(made: Reconstruction, radius: float) -> Reconstruction:
    """Return the same with `BEST_OF` its modes, which has the keys of the best single one."""
    clip, kept = made.clip, made.keys[made.best_mode]
    tolerance = made.choice.tolerance(clip)
    unit = clip.metres_per_unit
    chosen = best_modes(
        clip.times, clip.poses, kept, made.keys, radius / unit, None if tolerance is None else tolerance / unit
    )
    best = fill_in(clip, made.choice, {BEST_OF: kept}, radius, chosen)
    return replace(best, keys=made.keys | best.keys, poses=made.poses | best.poses, errors=made.errors | best.errors)


def with_other(made: Reconstruction, other: OtherMotion, radius: float) -> Reconstruction:
    """Return the same with somebody else's motion behind its modes, at the samples that these are compared at."""
    clip, poses = made.clip, other.at(made.times)
    truth = clip.in_metres(clip.poses[made.samples])
    errors = measure(made.times, clip.in_metres(poses), truth, radius)
    return replace(
        made,
        keys=made.keys | {other.name: NO_KEYS},
        poses=made.poses | {other.name: poses},
        errors=made.errors | {other.name: errors},
    )


def fill_in(
    clip: Clip, choice: Choice, keys: dict[str, np.ndarray], radius: float, segment_modes: tuple[str, ...] = ()
) -> Reconstruction:
    """Return what each mode makes of its keys, at least two, which begin and end with the same samples.

    `BEST_OF` among them has the modes of its segments from `segment_modes`.
    """
    made = Reconstruction(clip, choice, keys, {}, {}, segment_modes)
    times, truth = made.times, clip.in_metres(clip.poses[made.samples])
    poses = {mode: made.filled_in(mode, times) for mode in keys}
    errors = {mode: measure(times, clip.in_metres(filled), truth, radius) for mode, filled in poses.items()}
    return replace(made, poses=poses, errors=errors)


def same_motions(clip: Clip, modes: tuple[str, ...], radius: float) -> tuple[tuple[str, ...], ...]:
    """Return the modes in groups that are one motion on this clip, seen with about every `PROBE`th sample as a key.

    Each is on its own where there are too few samples to see it.
    """
    probe = reconstruct(replace(clip, against=None), probing(clip), modes, radius)
    if probe is None or len(probe.keys[modes[0]]) < FEWEST_PROBED:
        return tuple((mode,) for mode in modes)
    return identical_modes([probe])


def probing(clip: Clip) -> Uniform:
    """About every `PROBE`th sample as a key."""
    rate = (len(clip.times) - 1) / float(clip.times[-1] - clip.times[0]) / PROBE
    return Uniform(f"{max(rate, 1e-6):.6f}")


def identical_modes(reconstructions: Sequence[Reconstruction]) -> Groups:
    """Return the modes in groups that gave the same poses in all of these reconstructions.

    The same means: apart by less than a millionth of their error, by the shell measure, or than what rounding does.
    Some modes are one curve by theory (ScLERP and the SLERP of motors); this looks whether they were.
    """
    return joint_groups([_groups(reconstruction) for reconstruction in reconstructions])


def joint_groups(groupings: Iterable[Groups]) -> Groups:
    """Return the modes in groups that are together in all of these groupings of the same modes."""
    places: dict[str, list[int]] = {}
    for groups in groupings:
        for place, group in enumerate(groups):
            for mode in group:
                places.setdefault(mode, []).append(place)
    joint: dict[tuple[int, ...], list[str]] = {}
    for mode, where in places.items():
        joint.setdefault(tuple(where), []).append(mode)
    return tuple(map(tuple, joint.values()))


def _groups(reconstruction: Reconstruction) -> Groups:
    poses = {mode: reconstruction.clip.in_metres(own) for mode, own in reconstruction.poses.items()}
    largest = {mode: float(errors.shell.max()) for mode, errors in reconstruction.errors.items()}
    return alike(poses, largest)


def alike(poses: Mapping[str, Poses], largest: Mapping[str, float]) -> Groups:
    """Return modes whose poses are the same but for a millionth of their largest error and for rounding, in metres."""
    groups: list[list[str]] = []
    for mode, own in poses.items():
        for group in groups:
            rounding = 1e-12 * (1.0 + np.abs(poses[group[0]].positions).max())
            if shell_error(poses[group[0]], own).max() <= 1e-6 * largest[group[0]] + rounding:
                group.append(mode)
                break
        else:
            groups.append([mode])
    return tuple(map(tuple, groups))
