"""Which keys a source can do without: the plan for one transform in one slot, as arrays.

The few keys are poses: all channels have them on the same frames, with the values that the recording has there. Frames
are those of the Action, lengths those of its channels. Keys are searched for among those of the recording and whole
frames; between these, too, it is proven that what Blender shows is within the tolerance, and given more keys where not.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...gltf.errors import PARTS
from ...motion import KEYFRAME_MODES, Poses, reduce_keys, shell_error
from ...motion.affine import AffineMaps, displacement_over, largest_displacement
from ...motion.best_of import least_errors
from ..actions.slots import Binding
from ..evaluation.components import MODE_NUMBERS, PART_OF, ROWS, SCALE
from ..evaluation.sources import SAME_FRAME, Marks, Source, distinct
from ..fcurves.keys import CODE, CONSTANT, LINEAR, Keys
from ..transforms import Refused, Transform
from ..transforms.sizes import into_scene, scale_in_scene
from .motions import SMALLEST, NotPromised, continuous_values, shown

NO_FRAMES = np.empty(0)


class NeedsItsKeys(Refused):
    """Something is as reduced as the tolerance allows."""


@dataclass(frozen=True)
class WholeRig:
    """What became of all bones of a rig that were given fewer keys together. Lengths are in the scene's units."""

    frames: int
    """On how many frames any of them has keys by now."""

    slide_before: float
    """The distance that what stands on the ground slid there as it was recorded."""

    slide_after: float
    largest_error: float
    """The largest error of all bones that the tolerance is promised for, with keys or without."""

    not_promised: NotPromised


@dataclass(frozen=True, eq=False)
class FewerKeys:
    """The keys that one slot is to have, and those that it has."""

    binding: Binding
    source: Source
    fewer: Source
    largest_error: float
    """In the scene's units."""

    rig: WholeRig | None = None
    """The result for the rig that it is a bone of."""

    @cached_property
    def before(self) -> int:
        return count_of(self.source)

    @cached_property
    def after(self) -> int:
        return count_of(self.fewer)

    @property
    def keeps_scale(self) -> bool:
        """Return whether a scale keeps the keys it has."""
        return has_uneven_scale(self.source)


def count_of(source: Source) -> int:
    """Return on how many frames a source has keys."""
    return len(distinct(source.keyed_frames))


def fewer_keys(
    transform: Transform,
    binding: Binding,
    source: Source,
    mode: str,
    tolerance: float,
    radius: float,
    *,
    best_of: bool,
    more_frames: np.ndarray = NO_FRAMES,
    count: int | None = None,
) -> FewerKeys:
    """Return the keys that one slot needs, which may be those that it has. Lengths are the scene's units.

    The tolerance holds at all `moments` of what is seen, and of `more_frames`. With a count there are so many keys
    instead, those with the smallest largest error that is found.
    """
    frames = samples_of(source)
    placing, radius = into_scene(transform), radius / scale_in_scene(transform)
    unit = float(np.linalg.norm(placing, 2))
    seen = np.union1d(seen_frames(frames, [source]), more_frames)
    seen = moments(seen, [source])
    poses, truth = shown(transform, source, seen)
    samples = np.searchsorted(seen, frames)
    size = float(np.sqrt(np.einsum("nij,nij->nj", truth.axes, truth.axes).max()))
    rounding = SMALLEST * unit * (float(np.abs(truth.origins).max()) + radius * size)
    allowed = tolerance + rounding
    truth = AffineMaps(placing, np.zeros(3)) @ truth

    def maps_of(fewer: Source) -> AffineMaps:
        return AffineMaps(placing, np.zeros(3)) @ shown(transform, fewer, seen)[1]

    if not source.uniform_scale:
        # The scale stays what it is, and makes the object this large.
        poses, searched = Poses(poses.positions, poses.quaternions), radius * size
    else:
        searched = radius
        if not np.all(poses.scales > 0.0):
            raise Refused(
                n_("{name}: its scale passes zero between two keys: ease those in another way (Dope Sheet, T)"),
                name=transform.name,
            )
    wish = {"tolerance": tolerance / unit} if count is None else {"budget": count}
    chosen = samples[reduce_keys(frames, poses[samples], mode, radius=searched, **wish)]
    values = values_on(transform, source, seen)
    while True:
        fewer = with_keys(source, seen[chosen], {row: column[chosen] for row, column in values.items()}, mode)
        maps = maps_of(fewer)
        if count is not None:
            allowed = largest_displacement(maps, truth, radius)
        error = displacement_over(maps, truth, radius, allowed)
        if error.max() <= allowed:
            break
        more = _worst(chosen, error, samples, allowed)
        if not len(more) and error[chosen[0] : chosen[-1] + 1].max() <= allowed:
            raise goes_elsewhere(transform.name)
        if not len(more) or count_of(fewer) >= count_of(source):
            return FewerKeys(binding, source, source, 0.0)
        samples, chosen = np.union1d(samples, more), np.union1d(chosen, more)
    if best_of:
        inside = poses[samples]
        mixed = with_best_modes(transform, fewer, seen[samples], inside, searched, rounding / unit, allowed / unit)
        maps_of_mixed = maps_of(mixed)
        # Outside of the keys cycles of different lengths may meet in other segments than inside.
        if displacement_over(maps_of_mixed, truth, radius, allowed).max() <= allowed:
            fewer, maps = mixed, maps_of_mixed
    return FewerKeys(binding, source, fewer, largest_displacement(maps, truth, radius))


def with_best_modes(
    transform: Transform,
    source: Source,
    frames: np.ndarray,
    truth: Poses,
    radius: float,
    rounding: float,
    allowed: float,
) -> Source:
    """Return the source with the best mode in each segment, of those within what is allowed on these frames."""
    keys = distinct(source.keyed_frames)
    numbers = np.array([source.mode, *(mode.number for mode in KEYFRAME_MODES.values() if mode.number != source.mode)])
    alike = [shown(transform, replace(source, mode=int(number)), frames)[0] for number in numbers]
    if truth.scales is None:
        alike = [Poses(poses.positions, poses.quaternions) for poses in alike]
    errors = np.stack([shell_error(poses, truth, radius) for poses in alike])
    best = least_errors(errors, np.searchsorted(frames, keys - SAME_FRAME), rounding, allowed)
    return replace(source, mode=Marks(keys, numbers[[*best, best[-1]]]))


def _worst(chosen: np.ndarray, error: np.ndarray, samples: np.ndarray, allowed: float) -> np.ndarray:
    """Return where keys are put back: in each segment between those chosen at the moment that is
    furthest off, if too far.

    Moments that are no samples count for the samples around them, as long as one of these is no key.
    """
    if len(chosen) == 1:
        inside = error[samples[0] : samples[-1] + 1]
        return samples[[0, -1]] if len(samples) > 1 and inside.max() > allowed else chosen[:0]
    more = []
    for first, last in itertools.pairwise(chosen.tolist()):
        if last - first > 1:
            worst = first + 1 + int(np.argmax(error[first + 1 : last]))
            if error[worst] > allowed:
                between = samples[(samples > first) & (samples < last)]
                more.append(int(between[np.argmin(np.abs(between - worst))]) if len(between) else worst)
    return np.array(more, dtype=np.int64)


def samples_of(source: Source) -> np.ndarray:
    """Return where the recording is looked at: on its keys, and on whole frames where those are further apart."""
    keys = distinct(source.keyed_frames)
    whole = np.arange(np.ceil(keys[0]), np.floor(keys[-1]) + 1.0)
    index = np.clip(np.searchsorted(keys, whole), 1, max(len(keys) - 1, 1))
    before, behind = keys[index - 1], keys[np.minimum(index, len(keys) - 1)]
    apart = (whole - before > SAME_FRAME) & (behind - whole > SAME_FRAME) & (behind - before > 1.0 + SAME_FRAME)
    return np.union1d(keys, whole[apart])


def seen_frames(frames: np.ndarray, sources: Sequence[Source]) -> np.ndarray:
    """Return these frames and all whole ones that are seen: between them, and outside of keys that go on."""
    first, last = min(source.seen_range[0] for source in sources), max(source.seen_range[1] for source in sources)
    return np.union1d(frames, np.arange(np.floor(first), np.ceil(last) + 1.0))


def moments(frames: np.ndarray, sources: Sequence[Source]) -> np.ndarray:
    """Return these frames and the moments between them that are looked at: eighths, and those just before jumps."""
    jumps = [
        keys.times[1:][(keys.interpolation[:, :-1] == CONSTANT).any(axis=0)] - 2.0 * SAME_FRAME
        for source in sources
        for keys in source.curves
    ]
    eighths = np.arange(np.floor(frames[0]) * PARTS, np.ceil(frames[-1]) * PARTS + 1.0) / PARTS
    more = np.concatenate((eighths, *jumps))
    more = more[(more > frames[0]) & (more < frames[-1])]
    behind = np.searchsorted(frames, more)
    apart = np.minimum(more - frames[behind - 1], frames[behind] - more)
    return np.union1d(frames, more[apart > SAME_FRAME])


def goes_elsewhere(name: str) -> Refused:
    """Return why something cannot have fewer keys, although those that are left say all about the time between them."""
    return Refused(
        n_(
            "{name} goes on outside of its keys, and with fewer of them would go elsewhere there: "
            "give its channels constant extrapolation and no cycles, or cycles that all have the same range"
        ),
        name=name,
    )


def values_on(transform: Transform, source: Source, frames: np.ndarray) -> dict[int, np.ndarray]:
    """Return what the channels that get other keys have on these frames, each (n,), by the rows of components."""
    values, keyed = continuous_values(source, frames), {row for rows, _ in source.channels for row in rows}
    rows = [row for row in transform.channels if PART_OF[row] in source.keyed]
    if has_uneven_scale(source):
        rows = [row for row in rows if PART_OF[row] != SCALE]
    return {row: values[row] for row in rows if row in keyed or not _is_constant(values[row])}


def has_uneven_scale(source: Source) -> bool:
    """Return whether a scale is keyed that differs from axis to axis as it changes."""
    if SCALE not in source.keyed or source.uniform_scale:
        return False
    return not np.all(_is_constant(source.values_at(source.keyed_frames)[ROWS[SCALE]].T))


def _is_constant(columns: np.ndarray) -> np.ndarray:
    return np.ptp(columns, axis=0) <= SMALLEST * np.maximum(np.abs(columns).max(axis=0), 1.0)


def with_keys(source: Source, frames: np.ndarray, values: dict[int, np.ndarray], mode: str) -> Source:
    """Return the source with these keys alone in the channels that have values: straight lines between them, and holds
    where all channels held.
    """
    codes = _interpolations(source, frames)
    old = {row: keys for keyed_rows, keys in source.channels for row in keyed_rows}
    alike: dict[tuple, list[int]] = {}
    for row in values:
        alike.setdefault((old[row].linear, old[row].cycles) if row in old else (False, None), []).append(row)
    channels = []
    for (linear, cycles), rows in alike.items():
        points = np.empty((len(rows), len(frames), 2), np.float32)
        points[..., 0], points[..., 1] = frames, [values[row] for row in rows]
        channels.append((rows, Keys(points, np.tile(codes, (len(rows), 1)), linear=linear, cycles=cycles)))
    for keyed_rows, keys in source.channels:
        indices = [index for index, row in enumerate(keyed_rows) if row not in values]
        if indices:
            channels.append(([keyed_rows[index] for index in indices], keys.only(indices)))
    rest = {row: value for row, value in source.rest.items() if row not in values}
    return replace(source, channels=tuple(channels), rest=rest, mode=MODE_NUMBERS[mode], turns=None)


def _interpolations(source: Source, frames: np.ndarray) -> np.ndarray:
    """Return the codes of keys on these frames: whether all channels of the source hold until the next, shape (k,)."""
    codes = np.full(len(frames), LINEAR, CODE)
    keys, moving = source.key_frames, np.append(0, np.cumsum(~source.holds))
    begins = np.searchsorted(keys, frames[:-1] + SAME_FRAME, side="right") - 1
    ends = np.searchsorted(keys, frames[1:] - SAME_FRAME)
    codes[:-1][moving[np.clip(begins, 0, None)] == moving[np.clip(ends, None, len(keys) - 1)]] = CONSTANT
    return codes
