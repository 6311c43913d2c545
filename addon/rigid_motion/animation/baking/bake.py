"""Baking: poses written as real keys on an object's own channels, which any Blender plays without this extension.

`bake_poses` writes a motion from elsewhere. `bake` writes the in-betweens of an object's keys to its channels, in the
spaces of its holders; `bake_to_world` writes them in the space of its parent alone. `unbake` restores the previous
keys.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion import Poses
from ..actions.channels import (
    code_of,
    key_fields,
    merged_keys,
    new_key_fields,
    replace_keys,
    set_key_fields,
    write_channel,
)
from ..actions.modifiers import add_cycles, on_top
from ..actions.reading import added_values
from ..actions.refusals import refuse_drivers, refuse_layered, refuse_linked
from ..actions.slots import Binding
from ..edits.apply import Readings, Target, Targets, apply_edit, readable
from ..edits.mode_keys import set_mode_in
from ..evaluation.channel_values import rotation_values
from ..evaluation.components import PART_OF, SCALE
from ..evaluation.marks import near, without
from ..evaluation.runs import Switch
from ..evaluation.sources import SAME_FRAME, KeyedTransform, distinct
from ..fcurves.keys import Cycles
from ..holds.holders import holders_of
from ..holds.placing import poses_of, rows_of
from ..transforms import WIDTHS, Channel, Refused, Transform, transform_of
from .motions import continuous_values
from .originals import BAKED, Originals, last_change, put_back, refuse_without_original
from .worlds import alone_in, arrivals, say_holds, seen_range, worlds_of

NOT_HELD = n_("{name} is not held: Bake without To World makes keys for its in-betweens")

MAX_SCALE_ROUNDING = 1e-5
"""Scales that differ by less count as equal."""

Planned = tuple[Binding, KeyedTransform, np.ndarray, np.ndarray, list[Switch]]
"""One planned bake: a binding, its source, the frames (m,) of the keys, the channel values there (10, m), and the
passes that become keys.
"""

POINT_ATTRIBUTES = ("co", "handle_left", "handle_right")
"""The attributes of a key that store a frame and a value."""


def bake_poses(obj: bpy.types.Object, frames: np.ndarray, poses: Poses, *, key_type: str = "GENERATED") -> None:
    """Key `obj` with one pose per frame, with linear interpolation between them.

    This replaces its location, rotation and (if the poses have scales) scale channels. Frames (n,) rise; poses (n,) are
    in the space of the channels. Raises ValueError if their numbers differ.
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
    """Write in-betweens to their channels as real keys, and return the first and the last frame.

    The animator's keys stay where they are; the new keys are of type GENERATED. Between all keys the interpolation is
    linear or constant. As with Blender's own commands for keys, this affects everything that uses the same Action. The
    previous keys stay in the file, for `unbake`.

    Baked keys of a held object stay in its holders, and it still passes from one to the next. But if the object moves
    as it arrives, for example when thrown, baked keys cannot show how it would have come. That pass gets keys as it is
    now, in the space of the previous holder.

    Parameters
    ----------
    targets, refused
        See `edits.apply`.
    step : float
        Frames from key to key, counted from the first. The animator's own keys stay for any step.
    interpolation : str
        LINEAR, or CONSTANT to hold each pose until the next key: with a step of 2, animation on twos.
    """
    _refuse_options(step, interpolation)
    originals = Originals(BAKED)

    def plan(transform: Transform, readings: Readings) -> list[Planned]:
        refuse_layered(transform)
        live = [(binding, source) for binding, source in readable(transform, readings) if source.is_live]
        if not live:
            raise Refused(
                n_("{name} has no rigid in-betweens to bake: choose a mode for its keys first"), name=transform.name
            )
        result: list[Planned] = []
        for binding, source in live:
            if passes := arrivals(source, step):
                alone_in(transform, [binding for binding, _ in readings])
            frames = _frames(source, *_range(transform, binding, source), step, passes)
            values = _values(transform, binding, source, frames, passes)
            result.append((binding, source, frames, values, passes))
        return result

    def act(transform: Transform, planned: list[Planned]) -> list[float]:
        for place in planned:
            if originals.keep(place[0]):
                _bake_binding(transform, *place, interpolation)
        return [float(frame) for _, _, frames, *_ in planned for frame in frames[[0, -1]]]

    ends = [frame for of_target in apply_edit(targets, plan, act, refused).values() for frame in of_target]
    return min(ends, default=0.0), max(ends, default=0.0)


def bake_to_world(
    targets: Targets, *, step: float = 1.0, interpolation: str = "LINEAR", refused: list[Refused] | None = None
) -> tuple[float, float]:
    """Write keys to a held object that show the same world-space motion without its holders.

    The keys are in the space of its parent, if it has one. Its holders no longer hold it, so editing them does not move
    it. `unbake` makes them hold it again. For all else see `bake`.
    """
    _refuse_options(step, interpolation)
    originals = Originals(BAKED)

    def plan(transform: Transform, readings: Readings) -> Planned:
        keyed = [(binding, source) for binding, source in readable(transform, readings) if source.channels]
        if not any(source.held is not None for _, source in keyed):
            raise Refused(NOT_HELD, name=transform.name)
        binding = alone_in(transform, [binding for binding, _ in keyed])
        refuse_linked(transform, binding)
        (_, source), *_ = keyed
        refuse_drivers(transform, binding, source.driven)
        frames = _frames(source, *seen_range(source, binding.slot.seen), step)
        local = worlds_of(transform, (), frames).local
        return binding, source, frames, rows_of(*poses_of(local), transform, source.values_at(frames[:1])[:, 0]), []

    def act(transform: Transform, planned: Planned) -> list[float]:
        binding, source, frames, rows, _ = planned
        originals.keep(binding)
        own = near(frames, source.keyed_frames)
        types = np.where(own, code_of("type", "KEYFRAME"), code_of("type", "GENERATED"))
        for row, channel in transform.channels.items():
            if PART_OF[row] != SCALE or channel in binding.curves or np.ptp(rows[row]) > MAX_SCALE_ROUNDING:
                fcurve = binding.ensure_curve(channel)
                replace_keys(fcurve, frames, rows[row], interpolation=interpolation, key_type=types)
                for modifier in list(fcurve.modifiers):
                    fcurve.modifiers.remove(modifier)
        return frames[[0, -1]].tolist()

    ends = [frame for of_target in apply_edit(targets, plan, act, refused).values() for frame in of_target]
    return min(ends, default=0.0), max(ends, default=0.0)


def _refuse_options(step: float, interpolation: str) -> None:
    if interpolation not in ("LINEAR", "CONSTANT"):
        raise ValueError(f"interpolation: LINEAR or CONSTANT, not {interpolation!r}")
    if not step > 0.0:
        raise Refused(n_("the step between baked keys must be above zero, not {step}"), step=step)


def unbake(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Restore the keys from before baking exactly, handles included. For targets see `edits.apply`."""
    go_back(targets, (BAKED,), refused)


def go_back(
    targets: Targets,
    kinds: Sequence[str],
    refused: list[Refused] | None,
    by: Callable[[Transform, str, Iterable[Binding]], None] = put_back,
) -> None:
    """Restore the keys from before the last change, for targets and all other users of the same Actions.

    `kinds` are the changes that may be undone. `by` is the function called for each target; the default restores the
    kept keys.
    """

    def plan(transform: Transform, readings: Readings) -> tuple[str, list[Binding]]:
        refuse_layered(transform)
        kind = refuse_without_original(transform, *kinds)
        for binding, _ in readings:
            refuse_linked(transform, binding)
        return kind, [binding for binding, _ in readings]

    apply_edit(targets, plan, lambda transform, planned: by(transform, *planned), refused)


def is_baked(target: Target) -> bool:
    """Return whether the target has baked keys and the keys from before are still in the file."""
    return last_change(transform_of(target)) == BAKED


def _range(transform: Transform, binding: Binding, source: KeyedTransform) -> tuple[float, float]:
    """Return the first and the last frame to bake: those of the keys, or of the visible range if the motion goes on."""
    modifiers = _modifiers(transform, binding, source)
    if source.cyclic is not None and not modifiers:
        # Cycles continue from the outermost keys.
        begin, end = source.cyclic.times[[0, -1]].tolist()
        return begin, end
    begin, end = source.keyed_range
    if source.goes_on or modifiers:
        begin, end = min(begin, binding.slot.seen[0]), max(end, binding.slot.seen[1])
    return begin, end


def _modifiers(transform: Transform, binding: Binding, source: KeyedTransform) -> list[bpy.types.FModifier]:
    """Return the animator's own modifiers, which are baked along with the keys."""
    curves = map(binding.curves.get, _channels(transform, source).values())
    return [modifier for fcurve in curves if fcurve is not None for modifier in on_top(fcurve)]


def _channels(transform: Transform, source: KeyedTransform) -> dict[int, Channel]:
    """Return the channels to bake, by their rows: not muted or driven ones, nor those that no mode changes."""
    parts = source.keyed - (frozenset() if source.uniform_scale else {SCALE})
    channels = transform.channels.items()
    return {row: channel for row, channel in channels if PART_OF[row] in parts and row not in source.driven}


def _frames(source: KeyedTransform, begin: float, end: float, step: float, passes: Iterable[Switch] = ()) -> np.ndarray:
    """Return the frames of every step from begin to end, the keys in between, and all frames of passes to be keyed."""
    keys = distinct(source.keyed_frames)
    passing = (np.arange(np.floor(switch.begin) + 1.0, switch.frame) for switch in passes)
    keys = np.union1d(keys, without(np.concatenate([np.empty(0), *passing]), keys))
    frames = np.append(begin + step * np.arange(np.floor((end - begin) / step + 1e-9) + 1), end)
    return distinct(np.union1d(without(frames, keys), keys))


def _values(
    transform: Transform, binding: Binding, source: KeyedTransform, frames: np.ndarray, passes: Iterable[Switch]
) -> np.ndarray:
    """Return the channel values to bake on frames (m,), shape (10, m)."""
    values = continuous_values(source, frames, added_values(binding, transform, source, frames))
    if _cycles(transform, binding, source) is not None:
        # The next cycle continues from the animator's values, with their sign and turn.
        values[:, -1] = source.values_at(frames[-1:])[:, 0]
    for switch in passes:
        _show_pass(transform, switch, frames, values)
    return values


def _cycles(transform: Transform, binding: Binding, source: KeyedTransform) -> Cycles | None:
    """Return the cycles that continue after the baked keys; None if all rounds are baked."""
    return None if source.cyclic is None or _modifiers(transform, binding, source) else source.cyclic.cycles


def _bake_binding(
    transform: Transform,
    binding: Binding,
    source: KeyedTransform,
    frames: np.ndarray,
    values: np.ndarray,
    passes: Iterable[Switch],
    interpolation: str,
) -> None:
    channels, cycles = _channels(transform, source), _cycles(transform, binding, source)
    for row, channel in channels.items():
        fcurve = binding.ensure_curve(channel)
        _bake_channel(fcurve, frames, values[row], interpolation)
        for modifier in list(fcurve.modifiers):
            fcurve.modifiers.remove(modifier)
        if cycles is not None:
            add_cycles(fcurve, cycles)
    set_mode_in(binding, "BLENDER")
    if source.held is not None:
        say_holds(binding, source.held, [switch.frame for switch in passes])


def _show_pass(transform: Transform, switch: Switch, frames: np.ndarray, values: np.ndarray) -> None:
    """Overwrite channel values (10, m) on frames (m,) with the pass, in the space of the holder it passes from."""
    at = np.flatnonzero((frames > switch.begin + SAME_FRAME) & (frames < switch.frame - SAME_FRAME))
    if len(at):
        holder = next((holder for holder in holders_of(transform) if holder.number == switch.before), None)
        if holder is None or holder.target is None:
            poses = worlds_of(transform, (), frames[at]).local
        else:
            worlds = worlds_of(transform, [(holder.target, holder.bone)], frames[at])
            poses = np.linalg.inv(worlds.nodes[0] @ np.array(holder.offset)) @ worlds.prop
        values[:, at] = rows_of(*poses_of(poses), transform, values[:, at[0] - 1])


def _bake_channel(fcurve: bpy.types.FCurve, frames: np.ndarray, values: np.ndarray, interpolation: str) -> None:
    """Add keys on these frames to the existing ones, and give all keys this interpolation."""
    old = key_fields(fcurve.keyframe_points)
    fields = merged_keys(old, new_key_fields(without(frames, old["co"][:, 0]), 0.0, key_type="GENERATED"))
    fields["interpolation"][:] = code_of("interpolation", interpolation)
    # Handles keep their distance from the key.
    moved = np.interp(fields["co"][:, 0], frames, values) - fields["co"][:, 1]
    for name in POINT_ATTRIBUTES:
        fields[name][:, 1] += moved
    set_key_fields(fcurve, fields)
