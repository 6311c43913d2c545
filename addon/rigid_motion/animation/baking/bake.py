"""Baking: poses written as real keys on an object's own channels, which any Blender plays without this extension.

`bake_poses` writes a motion that comes from elsewhere. `bake` puts the in-betweens of an object's keys on its channels,
and `unbake` puts the keys back that there were.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion import Poses
from ..actions.channels import code_of, empty_key_fields, key_fields, set_key_fields, write_channel
from ..actions.modifiers import add_cycles, on_top
from ..actions.reading import added_values
from ..actions.refusals import refuse_linked
from ..actions.slots import Binding
from ..edits.apply import Readings, Target, Targets, apply_edit, readable
from ..edits.mode_keys import set_mode_in
from ..evaluation.components import PART_OF, SCALE
from ..evaluation.sources import Source, distinct
from ..transforms import WIDTHS, Channel, Refused, Transform, transform_of
from .motions import continuous_values, rotation_values, without
from .originals import BAKED, Originals, last_change, put_back, refuse_without_original

POINTS = ("co", "handle_left", "handle_right")
"""What a key has of frame and value."""


def bake_poses(obj: bpy.types.Object, frames: np.ndarray, poses: Poses, *, key_type: str = "GENERATED") -> None:
    """Key `obj` with one pose per frame, straight lines between them.

    Its location, rotation and (where poses have scales) scale channels are replaced. Frames (n,) rise, poses (n,) are
    those of the channels. A ValueError says where they differ in number.
    """
    if poses.shape != np.shape(frames):
        raise ValueError(f"{obj.name}: {np.shape(frames)} frames do not fit poses of shape {poses.shape}")
    order, rotation = Transform(obj).order, Transform(obj).rotation
    turns = rotation_values(poses.quaternions, np.zeros(4), order)[: WIDTHS[rotation]].T
    channels = [("location", poses.positions), (rotation, turns)]
    if poses.scales is not None:
        channels.append(("scale", np.repeat(poses.scales[:, None], 3, axis=1)))
    for data_path, values in channels:
        write_channel(obj, data_path, frames, values, key_type=key_type, group="Object Transforms")


def bake(
    targets: Targets, *, step: float = 1.0, interpolation: str = "LINEAR", refused: list[Refused] | None = None
) -> tuple[float, float]:
    """Put in-betweens on the channels that they are between, as real keys, and return the first and the last frame.

    The animator's keys stay where they are; the others are of type GENERATED, and straight lines or holds run between
    all of them. As with Blender's own commands that change keys, all that moves by the same Action has them. What there
    was stays in the file, for `unbake`.

    Parameters
    ----------
    targets, refused
        See `edits.apply`.
    step : float
        Frames from key to key, counted from the first. The animator's own keys are kept whatever the step.
    interpolation : str
        LINEAR, or CONSTANT to hold each pose until the next key: with a step of 2 the motion is on twos.
    """
    if interpolation not in ("LINEAR", "CONSTANT"):
        raise ValueError(f"interpolation: LINEAR or CONSTANT, not {interpolation!r}")
    if not step > 0.0:
        raise Refused(n_("the step between baked keys has to be above zero, not {step}"), step=step)
    originals = Originals(BAKED)

    def plan(transform: Transform, readings: Readings) -> list[tuple[Binding, Source, np.ndarray]]:
        live = [(binding, source) for binding, source in readable(transform, readings) if source.is_live]
        if not live:
            raise Refused(
                n_("{name} has no rigid in-betweens to bake: choose a mode for its keys first"), name=transform.name
            )
        return [(*item, _frames(item[1], *_range(transform, *item), step)) for item in live]

    def act(transform: Transform, planned: list[tuple[Binding, Source, np.ndarray]]) -> list[float]:
        for binding, source, frames in planned:
            if originals.keep(binding):
                _bake_place(transform, binding, source, frames, interpolation)
        return [float(frame) for *_, frames in planned for frame in frames[[0, -1]]]

    ends = [frame for of_target in apply_edit(targets, plan, act, refused).values() for frame in of_target]
    return min(ends, default=0.0), max(ends, default=0.0)


def unbake(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give the keys back that there were before baking, to the last handle. For targets see `edits.apply`."""
    go_back(targets, BAKED, refused)


def go_back(
    targets: Targets,
    kind: str,
    refused: list[Refused] | None,
    by: Callable[[Transform, str, Iterable[Binding]], None] = put_back,
) -> None:
    """Give targets, and all that moves by the same Actions, the keys back from before they were changed so.

    Or do something else to what is kept of these, `by` a function.
    """

    def plan(transform: Transform, readings: Readings) -> list[Binding]:
        refuse_without_original(transform, kind)
        for binding, _ in readings:
            refuse_linked(transform, binding)
        return [binding for binding, _ in readings]

    apply_edit(targets, plan, lambda transform, bindings: by(transform, kind, bindings), refused)


def is_baked(target: Target) -> bool:
    """Return whether something moves by baked keys, and those from before are still in the file."""
    return last_change(transform_of(target)) == BAKED


def _range(transform: Transform, binding: Binding, source: Source) -> tuple[float, float]:
    """Return the first and the last frame to bake: of the keys, or of all that is seen where anything goes on."""
    modifiers = _modifiers(transform, binding, source)
    if source.cyclic is not None and not modifiers:
        # Cycles go on from the outermost keys.
        begin, end = source.cyclic.times[[0, -1]].tolist()
        return begin, end
    begin, end = source.keyed_range
    if source.goes_on or modifiers:
        begin, end = min(begin, binding.slot.seen[0]), max(end, binding.slot.seen[1])
    return begin, end


def _modifiers(transform: Transform, binding: Binding, source: Source) -> list[bpy.types.FModifier]:
    """Return the modifiers of the animator's that are baked along with keys."""
    curves = map(binding.curves.get, _channels(transform, source).values())
    return [modifier for fcurve in curves if fcurve is not None for modifier in on_top(fcurve)]


def _channels(transform: Transform, source: Source) -> dict[int, Channel]:
    """Return the channels that are baked, by their rows: what is muted or driven stays, and what no mode changes."""
    parts = source.keyed - (frozenset() if source.uniform_scale else {SCALE})
    channels = transform.channels.items()
    return {row: channel for row, channel in channels if PART_OF[row] in parts and row not in source.driven}


def _frames(source: Source, begin: float, end: float, step: float) -> np.ndarray:
    """Return every step from begin to end, and the keys in between."""
    keys = distinct(source.keyed_frames)
    frames = np.append(begin + step * np.arange(np.floor((end - begin) / step + 1e-9) + 1), end)
    return distinct(np.union1d(without(frames, keys), keys))


def _bake_place(transform: Transform, binding: Binding, source: Source, frames: np.ndarray, interpolation: str) -> None:
    channels, cycles = _channels(transform, source), None
    values = continuous_values(source, frames, added_values(binding, transform, source, frames))
    if source.cyclic is not None and not _modifiers(transform, binding, source):
        cycles = source.cyclic.cycles
        # The next round goes on from the animator's values, whatever sign or turn they are in.
        values[:, -1] = source.values_at(frames[-1:])[:, 0]
    for row, channel in channels.items():
        fcurve = binding.ensure_curve(channel)
        _bake_channel(fcurve, frames, values[row], interpolation)
        for modifier in list(fcurve.modifiers):
            fcurve.modifiers.remove(modifier)
        if cycles is not None:
            add_cycles(fcurve, cycles)
    set_mode_in(binding, "BLENDER")


def _bake_channel(fcurve: bpy.types.FCurve, frames: np.ndarray, values: np.ndarray, interpolation: str) -> None:
    """Put keys on these frames, all of this interpolation, beside those that there are."""
    old, code = key_fields(fcurve.keyframe_points), code_of("interpolation", interpolation)
    at = old["co"][:, 0]
    added = without(frames, at)
    new = empty_key_fields(len(added))
    new["type"][:] = code_of("type", "GENERATED")
    for name in POINTS:
        new[name][:, 0] = added
    order = np.argsort(np.append(at, added), kind="stable")
    fields = {name: np.concatenate((numbers, new[name]))[order] for name, numbers in old.items()}
    times = fields["co"][:, 0]
    fields["interpolation"][:] = code
    # Handles keep their distance from the key.
    moved = np.interp(times, frames, values) - fields["co"][:, 1]
    for name in POINTS:
        fields[name][:, 1] += moved
    set_key_fields(fcurve, fields)
