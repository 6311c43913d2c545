"""Which keys a source can do without: the plan for one transform in one slot, as arrays.

The few keys are poses: all channels have them on the same frames, with the values that the recording has there. Frames
are those of the Action, lengths those of its channels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from bpy.app.translations import pgettext_rpt as rpt_

from ...motion import KEYFRAME_MODES, Poses, reduce_keys, shell_error
from ...motion.best_of import least_errors
from ..actions.slots import SlotTransform
from ..compute.components import ROWS, SCALE
from ..compute.differences import in_betweens
from ..compute.sources import MODE_NUMBERS, SAME_FRAME, Source, distinct
from ..curves import CODE, CONSTANT, LINEAR, Keys
from ..transforms import Channel, Refused, Transform
from ..writers.channel_values import channel_values
from .sizes import in_channels

SMALLEST = 1e-6
"""Errors of single precision, relative to how far something gets."""


class NeedsItsKeys(Refused):
    """Something is as reduced as the tolerance allows."""


@dataclass(frozen=True)
class WholeRig:
    """What became of all bones of a rig that were given fewer keys together."""

    frames: int
    """On how many frames any of them has keys by now."""

    slide_before: float
    """How far what stands on the ground slid there as it was recorded, in the scene's units."""

    slide_after: float
    """How far it does now."""


@dataclass(frozen=True, eq=False)
class FewerKeys:
    """The keys that one slot is to have, and what had them before."""

    place: SlotTransform
    before: int
    frames: np.ndarray
    """Shape (k,)."""

    values: dict[Channel, np.ndarray]
    """What is written on these frames, by data path and index, each of shape (k,)."""

    key_frames: np.ndarray
    """The same with frames of keys that a scale keeps, shape (n,)."""

    modes: np.ndarray
    """The numbers of the modes that go on from each of these, shape (n,)."""

    keeps_scale: bool

    largest_error: float
    """In the scene's units."""

    rig: WholeRig | None = None
    """What became of the rig that it is a bone of."""

    @classmethod
    def planned(
        cls,
        transform: Transform,
        place: SlotTransform,
        source: Source,
        fewer: Source,
        frames: np.ndarray,
        values: dict[int, np.ndarray],
        largest_error: float,
        rig: WholeRig | None = None,
    ) -> FewerKeys:
        """From what was keyed to what is to be: values (k,) by the rows of components, on frames (k,)."""
        key_frames = distinct(fewer.keyed_frames)
        return cls(
            place,
            len(distinct(source.keyed_frames)),
            frames,
            {transform.channels[row]: column for row, column in values.items()},
            key_frames,
            fewer.modes_at(key_frames + SAME_FRAME),
            SCALE in source.keyed and ROWS[SCALE].start not in values,
            largest_error,
            rig,
        )


def fewer_keys(
    transform: Transform,
    place: SlotTransform,
    source: Source,
    mode: str,
    tolerance: float,
    radius: float,
    *,
    best_of: bool,
) -> FewerKeys:
    """The keys that one slot needs, which may be as many as it has."""
    frames = samples_of(source)
    seen = seen_frames(frames, [source])
    truth, own = shown_poses(source, seen), np.isin(seen, frames)
    unit, radius = in_channels(transform, radius, truth.scales is not None)
    tolerance /= unit
    rounding = SMALLEST * (float(np.abs(truth.positions).max()) + radius)
    allowed = tolerance + rounding
    values = values_on(transform, source, frames)
    chosen = _chosen(transform, source, frames, truth[own], mode, tolerance, radius)
    while True:
        fewer = with_keys(source, frames[chosen], {row: column[chosen] for row, column in values.items()}, mode)
        error = shell_error(shown_poses(fewer, seen), truth, radius)
        if error.max() <= allowed:
            break
        more = _worst(chosen, error[own], allowed)
        if not len(more):
            raise goes_elsewhere(transform.name)
        chosen = np.union1d(chosen, more)
    if best_of:
        mixed = with_best_modes(fewer, frames, truth[own], radius, rounding, allowed)
        error_of_mixed = shell_error(shown_poses(mixed, seen), truth, radius)
        # Outside of the keys cycles of different lengths may meet in other segments than inside.
        if error_of_mixed.max() <= allowed:
            fewer, error = mixed, error_of_mixed
    columns = {row: column[chosen] for row, column in values.items()}
    return FewerKeys.planned(transform, place, source, fewer, frames[chosen], columns, float(error.max()) * unit)


def _chosen(
    transform: Transform,
    source: Source,
    frames: np.ndarray,
    poses: Poses,
    mode: str,
    tolerance: float,
    radius: float,
) -> np.ndarray:
    """The samples that are to be keys, if nothing but poses counted."""
    if poses.scales is not None and not source.uniform_scale:
        # It stays what it is, and makes the object this large.
        radius, poses = radius * float(np.abs(poses.scales).max()), Poses(poses.positions, poses.quaternions)
    elif poses.scales is not None and not np.all(poses.scales > 0.0):
        raise Refused(
            rpt_("{name}: its scale passes zero between two keys: ease those in another way (Dope Sheet, T)").format(
                name=transform.name
            )
        )
    return reduce_keys(frames, poses, mode, tolerance, radius)


def with_best_modes(
    source: Source, frames: np.ndarray, truth: Poses, radius: float, rounding: float, allowed: float
) -> Source:
    """The source with the best mode in each segment, of those that keep within what is allowed on these frames."""
    keys = distinct(source.keyed_frames)
    numbers = np.array([source.mode, *(mode.number for mode in KEYFRAME_MODES.values() if mode.number != source.mode)])
    errors = np.stack([shell_error(shown_poses(replace(source, mode=int(n)), frames), truth, radius) for n in numbers])
    best = least_errors(errors, np.searchsorted(frames, keys - SAME_FRAME), rounding, allowed)
    points = np.stack((keys, numbers[[*best, best[-1]]]), axis=-1)[None].astype(np.float32)
    return replace(source, mode=Keys(points, np.full(points.shape[:2], CONSTANT, CODE)))


def _worst(chosen: np.ndarray, error: np.ndarray, allowed: float) -> np.ndarray:
    """In each segment between chosen samples the one that is furthest off, where it is too far."""
    error[chosen] = 0.0
    segment = np.searchsorted(chosen, np.arange(len(error)), side="right")
    order = np.lexsort((error, segment))
    furthest = order[np.flatnonzero(np.diff(segment[order], append=-1))]
    return furthest[error[furthest] > allowed]


def samples_of(source: Source) -> np.ndarray:
    """Where the recording is looked at: on its keys, and on whole frames where those are further apart."""
    keys = distinct(source.keyed_frames)
    whole = np.arange(np.ceil(keys[0]), np.floor(keys[-1]) + 1.0)
    place = np.clip(np.searchsorted(keys, whole), 1, max(len(keys) - 1, 1))
    before, behind = keys[place - 1], keys[np.minimum(place, len(keys) - 1)]
    apart = (whole - before > SAME_FRAME) & (behind - whole > SAME_FRAME) & (behind - before > 1.0 + SAME_FRAME)
    return np.union1d(keys, whole[apart])


def seen_frames(frames: np.ndarray, sources: Sequence[Source]) -> np.ndarray:
    """These frames and, since what goes on outside of the keys has to stay as well, all that are seen around them."""
    first, last = min(source.seen_range[0] for source in sources), max(source.seen_range[1] for source in sources)
    around = np.arange(first, last + 1.0)
    return np.union1d(frames, around[(around < frames[0]) | (around > frames[-1])])


def goes_elsewhere(name: str) -> Refused:
    """Why something cannot have fewer keys, although those that are left say all about the time between them."""
    return Refused(
        rpt_(
            "{name} goes on outside of its keys, and with fewer of them would go elsewhere there: "
            "give its channels constant extrapolation and no cycles, or cycles that all have the same range"
        ).format(name=name)
    )


def shown_poses(source: Source, frames: np.ndarray) -> Poses:
    """What is to be seen of a source, with a scale wherever it has keys of it."""
    wanted = in_betweens(source, frames).wanted
    if wanted.scales is not None or SCALE not in source.keyed:
        return wanted
    return Poses(
        wanted.positions,
        wanted.quaternions,
        (source.values_at(frames)[ROWS[SCALE]] * source.original[ROWS[SCALE], None]).mean(axis=0),
    )


def values_on(transform: Transform, source: Source, frames: np.ndarray) -> dict[int, np.ndarray]:
    """What the channels that get other keys have on these frames, each (n,), by their rows among the components."""
    by_path = channel_values(transform, source, in_betweens(source, frames))
    if SCALE in source.keyed and not source.uniform_scale:
        scale = source.values_at(frames)[ROWS[SCALE]].T
        if np.all(_is_constant(scale)):
            by_path[transform.prefix + transform.properties[SCALE]] = scale
    keyed = {row for own, _ in source.channels for row in own}
    columns = {row: by_path[path][:, index] for row, (path, index) in transform.channels.items() if path in by_path}
    return {row: column for row, column in columns.items() if row in keyed or not _is_constant(column)}


def _is_constant(columns: np.ndarray) -> np.ndarray:
    return np.ptp(columns, axis=0) <= SMALLEST * np.maximum(np.abs(columns).max(axis=0), 1.0)


def with_keys(source: Source, frames: np.ndarray, values: dict[int, np.ndarray], mode: str) -> Source:
    """The source with these keys alone in the channels that have values, straight lines between them."""
    old = {row: keys for own, keys in source.channels for row in own}
    alike: dict[tuple, list[int]] = {}
    for row in values:
        alike.setdefault((old[row].linear, old[row].cycles) if row in old else (False, None), []).append(row)
    channels = []
    for (linear, cycles), rows in alike.items():
        points = np.empty((len(rows), len(frames), 2), np.float32)
        points[..., 0], points[..., 1] = frames, [values[row] for row in rows]
        codes = np.full(points.shape[:2], LINEAR, CODE)
        channels.append((rows, Keys(points, codes, linear=linear, cycles=cycles)))
    for own, keys in source.channels:
        places = [place for place, row in enumerate(own) if row not in values]
        if places:
            channels.append(([own[place] for place in places], keys.only(places)))
    rest = {row: value for row, value in source.rest.items() if row not in values}
    return replace(source, channels=tuple(channels), rest=rest, mode=MODE_NUMBERS[mode])
