"""Reconstructions: what each mode makes of the few keys that are kept of a clip, and how far off that is.

Times and poses are the clip's, errors are in metres (`clips`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from addon.motion import Errors, Poses, interpolate, interpolate_by_segments, rms, shell_error

from .choices import Choice
from .clips import Clip
from .modes import BEST_OF, single_modes

Groups = tuple[tuple[str, ...], ...]
"""Modes, those together that are one motion."""


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A clip under one choice of keys: the keys that each mode kept, and what it filled in between them.

    All modes begin and end with the same samples.
    """

    clip: Clip

    choice: Choice
    """How the keys were chosen."""

    keys: dict[str, np.ndarray]
    """Mode id to the samples that were kept, rising indices into the clip, shape (k,)."""

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
        return min(single_modes(self.keys), key=lambda mode: (len(self.keys[mode]), rms(self.errors[mode].shell)))

    def filled_in(self, mode: str, times: np.ndarray) -> Poses:
        """What a mode makes of its keys at any times."""
        key_times, keys = self.clip.times[self.keys[mode]], self.clip.poses[self.keys[mode]]
        if mode == BEST_OF:
            return interpolate_by_segments(key_times, keys, times, self.segment_modes)
        return interpolate(key_times, keys, times, mode)


def identical_modes(reconstructions: Sequence[Reconstruction]) -> Groups:
    """The modes in groups that gave the same poses in all of these reconstructions.

    The same means: apart by less than a millionth of their error, by the shell measure, or than what rounding does.
    Some modes are one curve by theory (ScLERP and the SLERP of motors); this looks whether they were.
    """
    return joint_groups([_groups(reconstruction) for reconstruction in reconstructions])


def joint_groups(groupings: Iterable[Groups]) -> Groups:
    """The modes in groups that are together in all of these groupings of the same modes."""
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
    groups: list[list[str]] = []
    for mode in reconstruction.poses:
        for group in groups:
            if _same(reconstruction, group[0], mode):
                group.append(mode)
                break
        else:
            groups.append([mode])
    return tuple(map(tuple, groups))


def _same(reconstruction: Reconstruction, first: str, second: str) -> bool:
    poses, others = (reconstruction.clip.in_metres(reconstruction.poses[mode]) for mode in (first, second))
    rounding = 1e-12 * (1.0 + np.abs(poses.positions).max())
    apart = shell_error(poses, others).max()
    return bool(apart <= 1e-6 * reconstruction.errors[first].shell.max() + rounding)
