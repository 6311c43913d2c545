"""Choosing modes: which segment is filled in how.

The mode of a transform is in the slot that moves it: in its mode channel, a key of which decides from its frame on
until the next, or else in its record, for all segments. What was chosen before there was a slot waits on the transform.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import bpy
import numpy as np
from bpy.app.translations import pgettext_rpt as rpt_

from ...motion.modes import no_such_mode
from ..actions.channels import replace_keys
from ..actions.mode_property import is_keyed, set_pending_mode
from ..actions.reading import keyed_in
from ..actions.records import record_mode
from ..actions.refusals import refuse_linked, refuse_numbers
from ..actions.renaming import follow_renamed
from ..actions.slots import SlotTransform, slot_transforms_of
from ..compute.sources import MODE_NUMBERS, SAME_FRAME
from ..live import follower
from ..queries.keyed import active_place, frames_in, modes_in
from ..transforms import Channel, Refused, Transform
from .apply import Readings, Targets, apply_edit


def set_mode(
    targets: Targets, mode: str, frames: Sequence[float] | None = None, *, refused: list[Refused] | None = None
) -> None:
    """Choose what happens between keys.

    Parameters
    ----------
    targets : bpy.types.Object, or several of them
    mode : str
        One of `MODE_IDS`.
    frames : sequence of float, optional
        The frames of the keys that begin the segments meant. They get a key in the mode channel, and so does the key
        behind them where another mode goes on; all other segments keep what they have. Without frames, there is one
        mode for all segments, and the mode channel goes.
    refused : list, optional
        Takes the refusals, and all other targets get the mode.

    Raises
    ------
    Refused
        Where rigid motion cannot act on one of them, and there is no list to take that. Nothing is changed then.
    """

    def plan(transform: Transform, readings: Readings) -> list[SlotTransform]:
        places = [place for place, _ in readings] if mode == "BLENDER" else able(transform, readings)
        if frames is None:
            return places
        place = active_place(transform, places)
        if place is None:
            raise Refused(
                rpt_(
                    "{name} has no Action with keys to set a mode on: key it first, or enter a strip (NLA Editor, Tab)"
                ).format(name=transform.name)
            )
        return [place]

    def act(transform: Transform, places: list[SlotTransform]) -> None:
        if not places:
            set_pending_mode(transform, mode)
        for place in places:
            if frames is not None:
                set_mode_in(place, mode, frames)
            elif place.slot.action.is_editable:
                set_whole(place, mode)

    if mode not in MODE_NUMBERS:
        raise Refused(no_such_mode(mode, MODE_NUMBERS))
    whole = None if frames is not None else partial(replace, mode=MODE_NUMBERS[mode])
    apply_edit(targets, plan, act, refused, whole)


def on_property(transform: Transform) -> None:
    """Take it as a choice for the whole that somebody set the mode property."""
    mode = transform.motion.mode
    places = [place for place in slot_transforms_of([transform]) if place.slot.action.is_editable]
    if not places:
        set_pending_mode(transform, mode)
    follow_renamed(places)
    if mode != "BLENDER":
        with suppress(Refused):
            places = able(transform, list(zip(places, keyed_in(places), strict=True)))
    for place in places:
        if not is_keyed(place):
            record_mode(place, MODE_NUMBERS[mode])
    follower.refresh([transform])


def set_whole(place: SlotTransform, mode: str) -> None:
    """One mode for all segments of a slot."""
    channel = place.users[0].mode_channel
    if channel in place.curves:
        place.channelbag.fcurves.remove(place.curves.pop(channel))
    record_mode(place, MODE_NUMBERS[mode])


def set_mode_in(place: SlotTransform, mode: str, frames: Sequence[float]) -> None:
    """Key the mode channel of a slot on these frames, and behind them where another mode goes on."""
    chosen, keyed = np.asarray(frames, dtype=np.float64), frames_in(place)
    is_chosen = _is_among(chosen, keyed)
    wanted = np.where(is_chosen, MODE_NUMBERS[mode], modes_in(place, keyed))
    channel = place.users[0].mode_channel
    fcurve = place.curves.get(channel) or _new(place, channel)
    # Muted it has no say. Now it has, and all other segments keep the mode that they had without.
    old = [] if fcurve.mute else _keys_in(fcurve)
    fcurve.mute = False
    keys: list[tuple[float, float, bool]] = []
    passed = 0
    for frame, number, meant in zip(keyed.tolist(), wanted.tolist(), is_chosen.tolist(), strict=True):
        while passed < len(old) and old[passed][0] < frame - SAME_FRAME:
            keys.append(old[passed])
            passed += 1
        replaced = passed < len(old) and old[passed][0] <= frame + SAME_FRAME
        if meant or replaced or not keys or round(keys[-1][1]) != number:
            # Selected as the key of the pose is, so that both move together.
            keys.append((frame, number, meant or (replaced and old[passed][2])))
        passed += replaced
    frames, numbers, selected = zip(*keys, *old[passed:], strict=True)
    replace_keys(fcurve, np.array(frames), np.array(numbers), interpolation="CONSTANT", selected=np.array(selected))


def _keys_in(fcurve: bpy.types.FCurve) -> list[tuple[float, float, bool]]:
    """Frame, value and whether it is selected, of each key."""
    points, selected = (
        np.empty(2 * len(fcurve.keyframe_points), np.float32),
        np.empty(len(fcurve.keyframe_points), bool),
    )
    fcurve.keyframe_points.foreach_get("co", points)
    fcurve.keyframe_points.foreach_get("select_control_point", selected)
    return list(zip(points[::2].tolist(), points[1::2].tolist(), selected.tolist(), strict=True))


def _is_among(chosen: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Which of the frames (n,) are one of the chosen, shape (n,)."""
    chosen = np.sort(chosen)
    return np.searchsorted(chosen, frames + SAME_FRAME) > np.searchsorted(chosen, frames - SAME_FRAME, side="right")


def able(transform: Transform, readings: Readings) -> list[SlotTransform]:
    """Return the places of a transform, which is keyed so, that can have a mode beside Blender's own.

    That is its Action at least, or one of its strips where it has none: else `Refused`. Other strips keep Blender's.
    """
    transform.rotation  # noqa: B018 - raises where it turns by axis and angle
    refuse_linked(transform)
    active, found, refusals = active_place(transform, [place for place, _ in readings]), [], []
    for place, source in readings:
        try:
            if isinstance(source, Refused):
                raise source
            refuse_numbers(transform.name, replace(source, mode=MODE_NUMBERS["dq_sclerp"]))
            found.append(place)
        except Refused as refusal:
            if place is active:
                raise
            refusals.append(refusal)
    if refusals and not found:
        raise refusals[0]
    return found


def _new(place: SlotTransform, channel: Channel) -> bpy.types.FCurve:
    fcurve, channelbag, group = place.ensure_curve(channel), place.channelbag, place.users[0].group
    fcurve.group = channelbag.groups.get(group) or channelbag.groups.new(group)
    return fcurve
