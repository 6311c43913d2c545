"""Baking: poses written as real keys on an object's own channels, which any Blender plays without this extension.

`bake_poses` writes a motion that comes from elsewhere. `bake` puts the in-betweens of an object's keys on its channels,
which are in the spaces of what holds it; `bake_to_world` has them be in that of its parent alone. `unbake` gives back
the keys that there were.
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
"""Scales that differ by less are the same."""

Planned = tuple[Binding, KeyedTransform, np.ndarray, np.ndarray, list[Switch]]
"""What is baked: a binding, what is keyed in it, the frames (m,) of the keys, what channels have there (10, m), and the
passes that become keys.
"""

POINT_ATTRIBUTES = ("co", "handle_left", "handle_right")
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

    What is held stays so by its baked keys, and is passed on. But where it moves as it arrives, as by a throw, these
    cannot say how it would have come: there it gets keys for the pass as it is now, in what held it before.

    Parameters
    ----------
    targets, refused
        See `edits.apply`.
    step : float
        Frames from key to key, counted from the first. The animator's own keys are kept whatever the step.
    interpolation : str
        LINEAR, or CONSTANT to hold each pose until the next key: with a step of 2 the motion is on twos.
    """
    _refuse_wishes(step, interpolation)
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
                _bake_place(transform, *place, interpolation)
        return [float(frame) for _, _, frames, *_ in planned for frame in frames[[0, -1]]]

    ends = [frame for of_target in apply_edit(targets, plan, act, refused).values() for frame in of_target]
    return min(ends, default=0.0), max(ends, default=0.0)


def bake_to_world(
    targets: Targets, *, step: float = 1.0, interpolation: str = "LINEAR", refused: list[Refused] | None = None
) -> tuple[float, float]:
    """Put keys on the channels of what is held that show the same in the world, as if nothing held it.

    They are in the space of its parent, where it has one. What holds it no longer does: it goes nowhere else when that
    is edited. `unbake` has it be held again. For what else there is to it see `bake`.
    """
    _refuse_wishes(step, interpolation)
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


def _refuse_wishes(step: float, interpolation: str) -> None:
    if interpolation not in ("LINEAR", "CONSTANT"):
        raise ValueError(f"interpolation: LINEAR or CONSTANT, not {interpolation!r}")
    if not step > 0.0:
        raise Refused(n_("the step between baked keys must be above zero, not {step}"), step=step)


def unbake(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give the keys back that there were before baking, to the last handle. For targets see `edits.apply`."""
    go_back(targets, (BAKED,), refused)


def go_back(
    targets: Targets,
    kinds: Sequence[str],
    refused: list[Refused] | None,
    by: Callable[[Transform, str, Iterable[Binding]], None] = put_back,
) -> None:
    """Give targets, and all that moves by the same Actions, the keys back from before they were changed last.

    Kinds are the ways in which that may have been. Or do something else to what is kept of these, `by` a function.
    """

    def plan(transform: Transform, readings: Readings) -> tuple[str, list[Binding]]:
        refuse_layered(transform)
        kind = refuse_without_original(transform, *kinds)
        for binding, _ in readings:
            refuse_linked(transform, binding)
        return kind, [binding for binding, _ in readings]

    apply_edit(targets, plan, lambda transform, planned: by(transform, *planned), refused)


def is_baked(target: Target) -> bool:
    """Return whether something moves by baked keys, and those from before are still in the file."""
    return last_change(transform_of(target)) == BAKED


def _range(transform: Transform, binding: Binding, source: KeyedTransform) -> tuple[float, float]:
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


def _modifiers(transform: Transform, binding: Binding, source: KeyedTransform) -> list[bpy.types.FModifier]:
    """Return the modifiers of the animator's that are baked along with keys."""
    curves = map(binding.curves.get, _channels(transform, source).values())
    return [modifier for fcurve in curves if fcurve is not None for modifier in on_top(fcurve)]


def _channels(transform: Transform, source: KeyedTransform) -> dict[int, Channel]:
    """Return the channels that are baked, by their rows: what is muted or driven stays, and what no mode changes."""
    parts = source.keyed - (frozenset() if source.uniform_scale else {SCALE})
    channels = transform.channels.items()
    return {row: channel for row, channel in channels if PART_OF[row] in parts and row not in source.driven}


def _frames(source: KeyedTransform, begin: float, end: float, step: float, passes: Iterable[Switch] = ()) -> np.ndarray:
    """Return every step from begin to end, and the keys in between; and all frames of passes that become keys."""
    keys = distinct(source.keyed_frames)
    passing = (np.arange(np.floor(switch.begin) + 1.0, switch.frame) for switch in passes)
    keys = np.union1d(keys, without(np.concatenate([np.empty(0), *passing]), keys))
    frames = np.append(begin + step * np.arange(np.floor((end - begin) / step + 1e-9) + 1), end)
    return distinct(np.union1d(without(frames, keys), keys))


def _values(
    transform: Transform, binding: Binding, source: KeyedTransform, frames: np.ndarray, passes: Iterable[Switch]
) -> np.ndarray:
    """Return what channels are to have on frames (m,), shape (10, m)."""
    values = continuous_values(source, frames, added_values(binding, transform, source, frames))
    if _cycles(transform, binding, source) is not None:
        # The next round goes on from the animator's values, whatever sign or turn they are in.
        values[:, -1] = source.values_at(frames[-1:])[:, 0]
    for switch in passes:
        _show_pass(transform, switch, frames, values)
    return values


def _cycles(transform: Transform, binding: Binding, source: KeyedTransform) -> Cycles | None:
    """Return the cycles that go on behind baked keys; None where all rounds are baked."""
    return None if source.cyclic is None or _modifiers(transform, binding, source) else source.cyclic.cycles


def _bake_place(
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
    """Have values (10, m) of channels on frames (m,) show how something passes, in what it passes from."""
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
    """Put keys on these frames, all of this interpolation, beside those that there are."""
    old = key_fields(fcurve.keyframe_points)
    fields = merged_keys(old, new_key_fields(without(frames, old["co"][:, 0]), 0.0, key_type="GENERATED"))
    fields["interpolation"][:] = code_of("interpolation", interpolation)
    # Handles keep their distance from the key.
    moved = np.interp(fields["co"][:, 0], frames, values) - fields["co"][:, 1]
    for name in POINT_ATTRIBUTES:
        fields[name][:, 1] += moved
    set_key_fields(fcurve, fields)
