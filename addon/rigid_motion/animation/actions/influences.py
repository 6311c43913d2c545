"""How much influence the NLA gives a slot, where that can be made up for."""

from __future__ import annotations

import bpy
import numpy as np

from .slots import Slot

Influence = tuple[tuple[float, float], ...]
"""Frames of the Action, and the influence on them; straight lines between."""


def influence_of(slot: Slot) -> Influence | None:
    """Return the influence of the only strip that shows a slot, with nothing below it;
    None where it is full or another.
    """
    if len(slot.users) != 1 or None in slot.strips or len(slot.strips) != 1:
        return None
    data = slot.users[0].animation_data
    tracks = [
        [strip for strip in track.strips if not strip.mute]
        for track in data.nla_tracks
        if not track.mute and not (any(item.is_solo for item in data.nla_tracks) and not track.is_solo)
    ]
    lowest = next((strips for strips in tracks if strips), [])
    showing = [strip for strips in tracks for strip in strips if strip.action == slot.action]
    if data.use_tweak_mode or len(showing) != 1 or showing[0] not in lowest:
        return None
    return _of_strip(showing[0])


def _of_strip(strip: bpy.types.NlaStrip) -> Influence | None:
    """Return the influence of a strip which replaces what is below, and plays its Action once, forwards."""
    if strip.blend_type != "REPLACE" or strip.repeat != 1.0 or strip.use_reverse or strip.use_animated_time:
        return None
    if strip.use_animated_influence:
        fcurve = strip.fcurves.find("influence")
        frames = np.arange(np.floor(strip.frame_start), np.ceil(strip.frame_end) + 1.0)
        values = [min(max(fcurve.evaluate(frame), 0.0), 1.0) for frame in frames.tolist()]
    else:
        rises, falls = strip.frame_start + strip.blend_in, strip.frame_end - strip.blend_out
        if rises > falls:
            return None
        frames = np.array((strip.frame_start, rises, falls, strip.frame_end))
        values = [0.0 if strip.blend_in else 1.0, 1.0, 1.0, 0.0 if strip.blend_out else 1.0]
    if min(values) == 1.0:
        return None
    frames = strip.action_frame_start + (frames - strip.frame_start) / strip.scale
    return tuple(zip(frames.tolist(), values, strict=True))
