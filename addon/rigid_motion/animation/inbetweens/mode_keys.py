"""Choosing modes: which segment is filled in how.

The mode of a transform is in the slot that moves it: in its mode channel, a key of which decides from its frame on
until the next, or else in its record, for all segments. What was chosen before there was a slot waits on the transform.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

import bpy
import numpy as np
from bpy.app.translations import pgettext_rpt as rpt_

from ...motion.modes import no_such_mode
from ..actions.channels import replace_keys
from ..actions.mode_property import await_mode, is_keyed
from ..actions.reading import keyed_in, read
from ..actions.records import record_mode, recorded_mode
from ..actions.refusals import refuse_linked, refuse_numbers
from ..actions.renaming import follow_renamed
from ..actions.slots import SlotTransform, places_of, slot_transforms_of
from ..actions.sources import MODE_NAMES, MODE_NUMBERS, SAME_FRAME, UNKNOWN, Source, distinct
from ..transforms import WIDTHS, Channel, Refused, Transform, transform_of
from . import live
from .acting import Readings, Targets, act_on


def active_place(transform: Transform, places: Iterable[SlotTransform] | None = None) -> SlotTransform | None:
    """The slot whose keys the editors show: that of the Action, in tweak mode that of the strip.

    `places` are those that are known already, else all of the transform's are looked up.
    """
    data = transform.animated.animation_data
    if data is None or data.action is None:
        return None
    active = (data.action, data.action_slot_handle)
    places = slot_transforms_of([transform]) if places is None else places
    return next(
        (place for place in places if (place.slot.action, place.slot.handle) == active and transform in place.users),
        None,
    )


def source_of(carrier: bpy.types.Object | Transform) -> Source | None:
    """What is keyed in the Action, None where nothing is. `Refused` where rigid motion cannot act on it."""
    place = active_place(transform_of(carrier))
    source = None if place is None else read(place)
    return source if source and source.channels else None


def active_places_of(transforms: Sequence[Transform]) -> dict[Transform, SlotTransform]:
    """`active_place` of each that has one, by a single look."""
    wanted, found = set(transforms), {}
    for place in slot_transforms_of(transforms):
        for user in place.users:
            data = user.animated.animation_data
            if user in wanted and (data.action, data.action_slot_handle) == (place.slot.action, place.slot.handle):
                found[user] = place
    return found


def sources_of(places: Sequence[SlotTransform]) -> list[Source | None]:
    """What is keyed in each of these, None where nothing is or rigid motion cannot act on it."""
    found: list[Source | None] = []
    for place, source in zip(places, keyed_in(places), strict=True):
        try:
            if isinstance(source, Source):
                refuse_numbers(place.name, source)
            found.append(source if isinstance(source, Source) and source.channels else None)
        except Refused:
            found.append(None)
    return found


def key_frames(carrier: bpy.types.Object | Transform, *, selected: bool = False) -> np.ndarray:
    """The frames of location, rotation and scale keys, or of the selected ones alone, shape (n,), rising.

    Keys of the mode channel count among the selected ones.
    """
    transform = transform_of(carrier)
    place = active_place(transform, places_of(transform))
    return np.empty(0) if place is None else frames_in(place, selected=selected)


def modes_of(carrier: bpy.types.Object | Transform, frames: np.ndarray) -> list[str]:
    """The modes of the segments at these frames. Without an Action, the mode that is awaited."""
    transform = transform_of(carrier)
    place = active_place(transform, places_of(transform))
    if place is None:
        return [transform.motion.mode or "BLENDER"] * len(frames)
    return [MODE_NAMES[number] for number in _modes_in(place, np.asarray(frames, dtype=np.float64))]


def segment_modes(place: SlotTransform) -> list[str]:
    """The modes of the segments between the keys of a slot, one after the other."""
    return [MODE_NAMES[number] for number in _modes_in(place, frames_in(place)[:-1])]


def frames_in(place: SlotTransform, *, selected: bool = False) -> np.ndarray:
    """`key_frames` in a slot."""
    found = []
    transform = place.users[0]
    for channel, fcurve in place.curves.items():
        path = channel[0].removeprefix(place.prefix)
        if path in WIDTHS or (selected and channel == transform.mode_channel):
            keys = fcurve.keyframe_points
            points, chosen = np.empty(2 * len(keys), np.float32), np.ones(len(keys), dtype=bool)
            keys.foreach_get("co", points)
            if selected:
                keys.foreach_get("select_control_point", chosen)
            found.append(points[::2][chosen])
    frames = np.unique(np.concatenate(found)).astype(np.float64) if found else np.empty(0)
    return distinct(frames)


def _modes_in(place: SlotTransform, frames: np.ndarray) -> list[int]:
    """The numbers of the modes at these frames; Blender's own where there is what is no mode."""
    fcurve = place.curves.get(place.users[0].mode_channel)
    if fcurve is None or fcurve.mute or not fcurve.keyframe_points:
        modes = [recorded_mode(place)] * len(frames)
    else:
        modes = [_value(fcurve, frame) for frame in frames.tolist()]
    return [mode if mode in MODE_NAMES else 0 for mode in modes]


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
        if mode != "BLENDER":
            check(transform, readings)
        places = [place for place, _ in readings]
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
            await_mode(transform, mode)
        for place in places:
            if frames is not None:
                set_mode_in(place, mode, frames)
            elif place.slot.action.is_editable:
                set_whole(place, mode)

    if mode not in MODE_NUMBERS:
        raise Refused(no_such_mode(mode, MODE_NUMBERS))
    whole = None if frames is not None else partial(replace, mode=MODE_NUMBERS[mode])
    act_on(targets, plan, act, refused, whole)


def on_property(transform: Transform) -> None:
    """Take it as a choice for the whole that somebody set the mode property."""
    mode = transform.motion.mode
    places = [place for place in slot_transforms_of([transform]) if place.slot.action.is_editable]
    if not places:
        await_mode(transform, mode)
    follow_renamed(places)
    for place in places:
        if not is_keyed(place):
            record_mode(place, MODE_NUMBERS[mode])
    live.refresh([transform])


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
    wanted = np.where(is_chosen, MODE_NUMBERS[mode], _modes_in(place, keyed))
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


def check(transform: Transform, readings: Readings) -> None:
    """Raise `Refused` where a transform, which is keyed so, cannot have any mode but Blender's own."""
    transform.rotation  # noqa: B018 - raises where it turns by axis and angle
    refuse_linked(transform)
    for _, source in readings:
        if isinstance(source, Refused):
            raise source
        refuse_numbers(transform.name, replace(source, mode=MODE_NUMBERS["dq_sclerp"]))


def _value(fcurve: bpy.types.FCurve, frame: float) -> int:
    """The mode of the segment that begins on this frame, `UNKNOWN` where that is not a number."""
    value = fcurve.evaluate(frame + 0.5 * SAME_FRAME)
    return round(value) if math.isfinite(value) else UNKNOWN


def _new(place: SlotTransform, channel: Channel) -> bpy.types.FCurve:
    fcurve, channelbag, group = place.ensure_curve(channel), place.channelbag, place.users[0].group
    fcurve.group = channelbag.groups.get(group) or channelbag.groups.new(group)
    return fcurve
