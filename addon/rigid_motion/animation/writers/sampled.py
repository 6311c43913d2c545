"""Sampled F-curves: values on whole frames and no keys, out of the animator's way."""

from __future__ import annotations

import math
from collections.abc import Mapping

import bpy
import numpy as np

from ..actions.channels import ensure_group
from ..actions.records import recorded_rows
from ..actions.slots import Binding, Curves
from ..transforms import Channel
from .layout import Layout, Pieces

FARTHEST = 1_000_000
"""Frames from 0 up to which Blender can show any."""


def replace_samples(
    channelbag: bpy.types.ActionChannelbag,
    group: str,
    present: Mapping[Channel, bpy.types.FCurve],
    points: Mapping[Channel, np.ndarray],
    layout: Layout | None,
    pieces: Pieces,
) -> tuple[Curves, list[Channel]]:
    """Have sampled F-curves of a group hold these samples, frame and value of each alternately, and no others.

    Parameters
    ----------
    channelbag, group
        Where they are, or are to be.
    present
        Those that there are.
    points
        The samples of each channel.
    layout
        How they lie, None where there are none.
    pieces
        What is added to them between samples.

    Returns
    -------
    curves, gone
        The F-curves by now, and the channels of those that were taken out.
    """
    curves: Curves = {}
    # Blender goes through all groups for a name.
    home = ensure_group(channelbag, group) if points.keys() - present.keys() else None
    for channel, samples in points.items():
        fcurve = present.get(channel)
        if fcurve is None:
            fcurve = _new(channelbag, home, channel, layout.count)
        elif len(fcurve.sampled_points) != layout.count:
            _resize(fcurve, layout.count)
        fcurve.sampled_points.foreach_set("co", samples)
        layout.modify(fcurve, pieces.get(channel, ()))
        curves[channel] = fcurve
    gone = [channel for channel in present if channel not in points]
    for channel in gone:
        channelbag.fcurves.remove(present[channel])
    if gone:
        remove_if_empty(channelbag, group)
    return curves, gone


def hold_constants(binding: Binding, group: str, present: Curves, held: Mapping[Channel, float]) -> bool:
    """Have sampled F-curves of a group in a slot hold these values, and no others. Whether they did not already."""
    if held == {channel: _constant(fcurve) for channel, fcurve in present.items()}:
        return False
    # Where its own keys begin, for the Action to be no longer than it was. A damaged file may have them anywhere.
    starts = [start for fcurve in binding.curves.values() if abs(start := fcurve.range()[0]) < FARTHEST]
    first = math.floor(min(starts, default=0.0))
    points = {channel: np.array((first, value, first + 1, value), dtype=np.float32) for channel, value in held.items()}
    for channel in present:
        binding.curves.pop(channel, None)
    curves, _ = replace_samples(
        binding.channelbag, group, present, points, Layout(first, first + 1, (first, first + 1)), {}
    )
    binding.curves.update(curves)
    binding.has_filled(curves)
    return True


def _constant(fcurve: bpy.types.FCurve) -> float | None:
    return next((point.co[1] for point in fcurve.sampled_points), None)


def hide_fcurve(fcurve: bpy.types.FCurve, group: bpy.types.ActionGroup) -> None:
    """Take an F-curve out of the animator's way: into a group, locked, and hidden in the Graph Editor."""
    fcurve.group = group
    fcurve.lock = fcurve.hide = True
    fcurve.select = False


def regroup(binding: Binding) -> None:
    """Take F-curves with in-betweens back that have been put into another group, or into none."""
    rows = recorded_rows(binding)
    if len(binding.filled) >= len(rows):
        return
    channelbag, group = binding.home
    if channelbag is None:
        return
    rotations = ("rotation_quaternion", "rotation_euler")
    channels = [binding.users[0].differences_for(rotation) for rotation in rotations]
    for channel in {of_rotation[row] for of_rotation in channels for row in rows if row in of_rotation}:
        fcurve = channelbag.fcurves.find(channel[0], index=channel[1])
        if fcurve is not None and channel not in binding.filled and not fcurve.keyframe_points:
            hide_fcurve(fcurve, ensure_group(channelbag, group))
            binding.has_filled({**binding.filled, channel: fcurve})


def remove_if_empty(channelbag: bpy.types.ActionChannelbag, group: str) -> None:
    """Take out a group that nothing is left in."""
    result = channelbag.groups.get(group)
    if result is not None and not result.channels:
        channelbag.groups.remove(result)


def _new(
    channelbag: bpy.types.ActionChannelbag, group: bpy.types.ActionGroup, channel: Channel, count: int
) -> bpy.types.FCurve:
    path, index = channel
    fcurve = channelbag.fcurves.new(path, index=index)
    hide_fcurve(fcurve, group)
    fcurve.keyframe_points.add(1)
    fcurve.convert_to_samples(0, count)
    return fcurve


def _resize(fcurve: bpy.types.FCurve, count: int) -> None:
    """Give a sampled F-curve room for so many samples."""
    if len(fcurve.sampled_points):
        fcurve.convert_to_keyframes(0, 1)
    else:
        fcurve.keyframe_points.add(1)
    fcurve.convert_to_samples(0, count)
