"""Keys in the slot that the editors show: their frames, and the modes of the segments between them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress

import bpy
import numpy as np

from ..actions.channels import key_points, selected_keys
from ..actions.reading import keyed_in, modes_said, read
from ..actions.refusals import refuse_numbers
from ..actions.slots import Binding, bindings_for, bindings_of
from ..evaluation.components import MODE_NAMES, UNKNOWN_MODE
from ..evaluation.sources import SAME_FRAME, KeyedTransform, Marks, distinct
from ..transforms import Refused, Transform, transform_of


def active_binding(transform: Transform, bindings: Iterable[Binding] | None = None) -> Binding | None:
    """Return the slot whose keys the editors show: that of the Action, or in tweak mode that of the strip.

    `bindings` are those already known. Without them, the transform's own are looked up as if nothing else used them.
    """
    bindings = bindings_for(transform) if bindings is None else bindings
    active = (item for item in bindings if item.slot.plays_in(transform.animated) and transform in item.users)
    return next(active, None)


def active_bindings(transforms: Sequence[Transform]) -> dict[Transform, Binding]:
    """Return `active_binding` of each transform that has one, looking up all bindings once."""
    desired, result = set(transforms), {}
    for binding in bindings_of(transforms):
        for user in binding.users:
            if user in desired and binding.slot.plays_in(user.animated):
                result[user] = binding
    return result


def source_of(carrier: bpy.types.Object | bpy.types.PoseBone | Transform) -> KeyedTransform | None:
    """Return the source in the Action, None if nothing is keyed. Raise `Refused` if rigid motion cannot act on it."""
    binding = active_binding(transform_of(carrier))
    source = None if binding is None else read(binding)
    return source if source and source.channels else None


def sources_of(bindings: Sequence[Binding]) -> list[KeyedTransform | None]:
    """Return the source of each binding; None if nothing is keyed, it is refused, or a driver moves a part of it."""
    result: list[KeyedTransform | None] = []
    for binding, source in zip(bindings, keyed_in(bindings), strict=True):
        result.append(None)
        if isinstance(source, KeyedTransform) and source.channels and not source.driven:
            with suppress(Refused):
                refuse_numbers(binding.name, source)
                result[-1] = source
    return result


def key_frames(carrier: bpy.types.Object | bpy.types.PoseBone | Transform, *, selected: bool = False) -> np.ndarray:
    """Return the frames of location, rotation and scale keys, or only of the selected ones, shape (n,), rising.

    Selected keys of the turns channel count too.
    """
    binding = active_binding(transform_of(carrier))
    return np.empty(0) if binding is None else frames_in(binding, selected=selected)


def modes_of(carrier: bpy.types.Object | bpy.types.PoseBone | Transform, frames: np.ndarray) -> list[str]:
    """Return the modes of the segments at these frames. Without an Action, the mode stored on the transform."""
    transform = transform_of(carrier)
    binding = active_binding(transform)
    if binding is None:
        return [transform.motion.awaited or "BLENDER"] * len(frames)
    return [MODE_NAMES[number] for number in modes_in(binding, np.asarray(frames, dtype=np.float64)).tolist()]


def mode_shown(transform: Transform) -> str:
    """Return the mode of a transform's first segment, in its Action or in the lowest of its strips with keys.

    Without any keys it is the mode stored on the transform.
    """
    bindings = [binding for binding in bindings_for(transform) if binding.is_keyed]
    binding = active_binding(transform, bindings) or next(iter(bindings), None)
    if binding is None:
        return transform.motion.awaited or "BLENDER"
    return MODE_NAMES[int(modes_in(binding, frames_in(binding)[:1])[0])]


def segment_modes(binding: Binding) -> list[str]:
    """Return the modes of the segments between the keys of a slot, in order."""
    return [MODE_NAMES[number] for number in modes_in(binding, frames_in(binding)[:-1]).tolist()]


def frames_in(binding: Binding, *, selected: bool = False) -> np.ndarray:
    """Return the same as `key_frames`, for a slot."""
    curves, frames = [*binding.moving.values()], [np.empty(0)]
    if selected and (turns := binding.curves.get(binding.users[0].turns_channel)) is not None:
        curves.append(turns)
    for fcurve in curves:
        keyed = key_points(fcurve)[:, 0]
        frames.append(keyed[selected_keys(fcurve)] if selected else keyed)
    return distinct(np.unique(np.concatenate(frames)))


def modes_in(binding: Binding, frames: np.ndarray) -> np.ndarray:
    """Return the numbers of the modes at these frames, shape (n,); Blender's own for unknown modes."""
    modes = modes_said(binding)
    numbers = modes.at(frames + 0.5 * SAME_FRAME) if isinstance(modes, Marks) else np.full(len(frames), modes)
    return np.where(numbers == UNKNOWN_MODE, 0, numbers)


def turns_in(binding: Binding, frames: np.ndarray) -> np.ndarray:
    """Return the extra turns of the segments at these frames, shape (n,)."""
    fcurve = binding.curves.get(binding.users[0].turns_channel)
    if fcurve is None or fcurve.mute or not fcurve.keyframe_points:
        return np.zeros(len(frames))
    times, values = key_points(fcurve).T
    at = np.searchsorted(times, frames + 0.5 * SAME_FRAME, side="right")
    return np.nan_to_num(np.insert(values, 0, 0.0)[at])
