"""Evaluation times: at which frame of the differences a constraint is, animated beside the bone's own channels.

A time goes from 0 for frame 0, which no sample is before, to 1 for a power of two: so Blender comes to whole frames
again without an error, in single precision. It is an F-curve without keys, a line, and goes through strips as keys do.

Where several Actions of a rig fill in the same bone, in strips of the NLA, each has a constraint of its own, of another
name, that has no influence while another Action plays. From one strip to the next both influences blend, as Blender
blends what is keyed, and so that the times do not, each Action has the time of the others as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np

from ..actions.channels import add_cycles, ensure_group, read_cycles, read_steps, replace_keys
from ..actions.records import recorded
from ..actions.slots import Binding, Slot, strips_of
from ..compute.samples import MOST_SAMPLES
from ..compute.sources import Source
from ..curves.keys import Stepped
from ..transforms import CONSTRAINT, Channel
from .sampled import Layout, add_modifiers, hide_fcurve, remove_if_empty

MOST_FRAMES = 1_048_574
"""The last frame that Blender lets a constraint have."""

Line = tuple[float, float]
"""The value of a channel at frame 0, and by how much it grows in a frame."""


def name_of(binding: Binding) -> str:
    """Return what the constraint of a slot is called."""
    return recorded(binding).constraint or CONSTRAINT


def path_of(binding: Binding, prop: str, name: str = "") -> str:
    """Return the data path of a property of a slot's constraint, or of a constraint of this name."""
    return f'{binding.prefix}constraints["{bpy.utils.escape_identifier(name or name_of(binding))}"].{prop}'


def time_of(binding: Binding) -> bpy.types.FCurve | None:
    """Return the channel of its own constraint's evaluation time."""
    return binding.curves.get((path_of(binding, "eval_time"), 0)) if binding.filled else None


def span_of(binding: Binding) -> tuple[int, int]:
    """Return the frames of the differences at evaluation times 0 and 1, counted in samples."""
    (_, last), rate = next(iter(binding.filled.values())).range(), recorded(binding).rate
    return 0, _duration(math.ceil(last / rate)) * rate


def most_samples(source: Source) -> int:
    """Return how many samples a frame can have for a constraint to show all of them."""
    first, last = source.frame_range
    fit = MOST_FRAMES // _duration(last + max(0, -first))
    return min(1 << max(fit.bit_length() - 1, 0), MOST_SAMPLES)


def _duration(last: int) -> int:
    """Return the power of two that this frame of the samples is not behind."""
    return min(1 << max(last - 1, 0).bit_length(), MOST_FRAMES)


def held_by(binding: Binding, beside: Sequence[Binding]) -> dict[Channel, Line]:
    """Return what an Action has of constraints in the NLA of a rig: of its own the influence,
    of the others the time too.

    The others are among what is `beside` it there.
    """
    held: dict[Channel, Line] = {}
    for user in binding.users if binding.is_keyed else ():
        if not len(user.animated.animation_data.nla_tracks):
            continue
        others = [
            other for other in beside if user in other.users and other.slot.key != binding.slot.key and other.is_keyed
        ]
        for other in others:
            if other.filled:
                held[path_of(other, "influence"), 0] = (0.0, 0.0)
                held[path_of(other, "eval_time"), 0] = _time_seen_from(binding, other, user.animated)
        if others and binding.filled:
            held[path_of(binding, "influence"), 0] = (1.0, 0.0)
    return held


def _time_seen_from(binding: Binding, other: Binding, rig: bpy.types.Object) -> Line:
    """Return the time of another Action's constraint at frames of this one, that of its first where it has several."""
    line = next((_line_of(fcurve) for fcurve in (time_of(other),) if fcurve is not None), None)
    frames, others = (_frames_of(rig, item.slot) for item in (binding, other))
    if line is None or frames is None or others is None:
        return 0.0, 0.0
    # From this Action's frames to the scene's, on to the other's, and on to its time.
    (begin, speed), (other_begin, other_speed), (time, rate) = frames, others, line
    return (
        time + rate * (begin - other_begin) / other_speed,
        rate * speed / other_speed,
    )


def _frames_of(rig: bpy.types.Object, slot: Slot) -> Line | None:
    """Return the scene's frames by those of an Action, where it plays once."""
    lines: list[Line | None] = [(0.0, 1.0)] if slot.plays_in(rig) else []
    for strip in strips_of(rig):
        if (strip.action, strip.action_slot_handle) == slot.key and not strip.mute:
            if strip.repeat > 1.0 or strip.use_animated_time:
                lines.append(None)
            elif strip.use_reverse:
                lines.append((strip.frame_start + strip.action_frame_end * strip.scale, -strip.scale))
            else:
                lines.append((strip.frame_start - strip.action_frame_start * strip.scale, strip.scale))
    return lines[0] if len(lines) == 1 else None


def write_time(binding: Binding, layout: Layout) -> None:
    if (present := time_of(binding)) is not None:
        if says(present, layout):
            return
        remove_time(binding)
    path = path_of(binding, "eval_time")
    if layout.cycles is None:
        add_modifiers(write_line(binding, path, _line(layout)), layout.stepping)
        return
    fcurve = binding.curves[path, 0] = binding.channelbag.fcurves.new(path)
    frames, times = np.array(_seams(layout)).T
    replace_keys(fcurve, frames, times)
    add_cycles(fcurve, layout.cycles.without_offset)
    add_modifiers(fcurve, layout.stepping)
    hide_fcurve(fcurve, ensure_group(binding.channelbag, binding.group))


def write_line(binding: Binding, path: str, line: Line) -> bpy.types.FCurve:
    """Return an F-curve beside those of a transform that is a line, without keys."""
    fcurve = binding.curves[path, 0] = new_line(binding.channelbag, binding.group, (path, 0), line)
    return fcurve


def new_line(channelbag: bpy.types.ActionChannelbag, group: str, channel: Channel, line: Line) -> bpy.types.FCurve:
    """Return an F-curve in a group that is a line, without keys."""
    path, index = channel
    fcurve = channelbag.fcurves.new(path, index=index)
    generator = fcurve.modifiers.new("GENERATOR")
    generator.poly_order = 1
    generator.coefficients = line
    hide_fcurve(fcurve, ensure_group(channelbag, group))
    return fcurve


def says(fcurve: bpy.types.FCurve, layout: Layout) -> bool:
    """Return whether an evaluation time goes through the samples as they lie."""
    if layout.cycles is None:
        return is_line(fcurve, _line(layout), layout.steps)
    kinds = [modifier.type for modifier in fcurve.modifiers]
    if fcurve.mute or kinds[:1] != ["CYCLES"] or not _holds(fcurve, layout.steps):
        return False
    is_cyclic = read_cycles(fcurve.modifiers) == layout.cycles.without_offset
    return is_cyclic and np.array_equal([key.co for key in fcurve.keyframe_points], np.float32(_seams(layout)))


def is_line(fcurve: bpy.types.FCurve, line: Line, steps: tuple[Stepped, ...] = ()) -> bool:
    return _line_of(fcurve) == tuple(np.float32(line).tolist()) and _holds(fcurve, steps)


def _holds(fcurve: bpy.types.FCurve, steps: tuple[Stepped, ...]) -> bool:
    """Return whether the modifiers of an F-curve are one, and behind it those that hold these frames."""
    return len(fcurve.modifiers) == 1 + len(steps) and (not steps or read_steps(fcurve.modifiers) == steps)


def _line_of(fcurve: bpy.types.FCurve) -> Line | None:
    """Return the line that an F-curve is, None where it is none, or has been changed."""
    modifiers = list(fcurve.modifiers)
    plain = len(modifiers) > 0 and not (fcurve.mute or len(fcurve.keyframe_points) or len(fcurve.sampled_points))
    if not plain or modifiers[0].type != "GENERATOR" or modifiers[0].mute or modifiers[0].poly_order != 1:
        return None
    return tuple(modifiers[0].coefficients)


def _line(layout: Layout) -> Line:
    """Return the line from frames to the evaluation times of their samples."""
    duration = _duration(layout.frames[1] + layout.shift)
    return layout.shift / duration, 1.0 / duration


def _seams(layout: Layout) -> list[tuple[float, float]]:
    """Return the outermost frames, and the evaluation times of their samples."""
    start, step = _line(layout)
    return [(frame, start + step * frame) for frame in layout.frames]


def remove_time(binding: Binding) -> None:
    fcurve = binding.curves.pop((path_of(binding, "eval_time"), 0), None)
    if fcurve is not None:
        binding.channelbag.fcurves.remove(fcurve)
        remove_if_empty(binding.channelbag, binding.group)
