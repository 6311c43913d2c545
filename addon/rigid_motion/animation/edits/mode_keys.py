"""Choosing modes: which segment is filled in how, and with how many turns more.

The mode of a transform is in the slot that moves it: in its mode channel, a key of which decides from its frame on
until the next, or else in its record, for all segments. What was chosen before there was a slot waits on the transform.
Turns are in a channel likewise, and without it there are none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import bpy
import numpy as np
from bpy.app.translations import pgettext_rpt as rpt_

from ...motion.modes import no_such_mode
from ..actions.channels import replace_keys
from ..actions.mode_property import is_keyed, set_pending_mode
from ..actions.reading import read
from ..actions.records import record_mode, record_turns_axis
from ..actions.refusals import refuse_linked, refuse_numbers
from ..actions.renaming import follow_renamed
from ..actions.slots import SlotTransform, slot_transforms_of
from ..compute.sources import MODE_NUMBERS, SAME_FRAME
from ..live import follower
from ..queries.keyed import active_place, frames_in, modes_in, turns_in
from ..queries.segments import frame_in_action, segment_at
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
        if mode != "BLENDER":
            check(transform, readings)
        places = [place for place, _ in readings]
        if frames is None:
            return places
        return [_place_of(transform, places)]

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


def set_turns(
    targets: Targets,
    turns: int,
    frames: Sequence[float] | None = None,
    *,
    axis: str | None = None,
    refused: list[Refused] | None = None,
) -> None:
    """Choose how many whole turns more are made between keys.

    Parameters
    ----------
    targets : bpy.types.Object, or several of them
    turns : int
        In the sense in which a segment turns anyway, against it where negative.
    frames : sequence of float, optional
        The frames of the keys that begin the segments meant, all others keep what they have. Without frames, all
        segments have so many.
    axis : str, optional
        One of `TURN_AXES`, for all segments of the Action: what turns are about. Left as it is where it is not given.
    refused : list, optional
        Takes the refusals, and all other targets get the turns.

    Raises
    ------
    Refused
        Where rigid motion cannot act on one of them, and there is no list to take that. Nothing is changed then.
    """

    def plan(transform: Transform, readings: Readings) -> SlotTransform:
        check(transform, readings)
        place = _place_of(transform, [place for place, _ in readings])
        if turns and not any(modes_in(place, frames_in(place) if frames is None else np.asarray(frames))):
            text = rpt_("{name}: Blender's own in-betweens make no turns more: choose a mode first")
            raise Refused(text.format(name=transform.name))
        return place

    def act(_: Transform, place: SlotTransform) -> None:
        if axis is not None:
            record_turns_axis(place, axis)
        set_turns_in(place, turns, frames_in(place)[:-1] if frames is None else frames)

    apply_edit(targets, plan, act, refused)


def _place_of(transform: Transform, places: Sequence[SlotTransform]) -> SlotTransform:
    """The slot whose keys the editors show. `Refused` where there is none."""
    place = active_place(transform, places)
    if place is None:
        raise Refused(
            rpt_(
                "{name} has no Action with keys to set a mode on: key it first, or enter a strip (NLA Editor, Tab)"
            ).format(name=transform.name)
        )
    return place


def on_turns(transform: Transform) -> None:
    """Take it as a choice for the segment on the frame that is shown that somebody set the property of turns."""
    place, turns = active_place(transform), transform.motion.turns
    source = None if place is None or not place.slot.action.is_editable else read(place)
    frame = frame_in_action(transform.animated, bpy.context.scene.frame_current_final)
    segment = segment_at(source, frame) if source is not None and source.channels else None
    if segment is not None:
        set_turns(transform, turns, (segment.key,))


def on_property(transform: Transform) -> None:
    """Take it as a choice for the whole that somebody set the mode property."""
    mode = transform.motion.mode
    places = [place for place in slot_transforms_of([transform]) if place.slot.action.is_editable]
    if not places:
        set_pending_mode(transform, mode)
    follow_renamed(places)
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
    _key_segments(place, place.users[0].mode_channel, MODE_NUMBERS[mode], frames, modes_in)


def set_turns_in(place: SlotTransform, turns: int | Sequence[int], frames: Sequence[float]) -> None:
    """Key the channel of turns likewise, with one number on all of these frames or one on each, rising.

    Where there are none in any segment, the channel goes.
    """
    channel = place.users[0].turns_channel
    _key_segments(place, channel, turns, frames, turns_in)
    if not any(value for _, value, _ in _keys_in(place.curves[channel])):
        place.channelbag.fcurves.remove(place.curves.pop(channel))


def _key_segments(
    place: SlotTransform,
    channel: Channel,
    values: int | Sequence[int],
    frames: Sequence[float],
    values_in: Callable[[SlotTransform, np.ndarray], Sequence[int]],
) -> None:
    """Key values on the frames of keys that begin segments, and behind them where another one goes on.

    `values_in` gives those that segments have so far.
    """
    chosen, keyed = np.asarray(frames, dtype=np.float64), frames_in(place)
    is_chosen = _is_among(chosen, keyed)
    wanted = np.array(values_in(place, keyed))
    wanted[is_chosen] = values
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


def _new(place: SlotTransform, channel: Channel) -> bpy.types.FCurve:
    fcurve, channelbag, group = place.ensure_curve(channel), place.channelbag, place.users[0].group
    fcurve.group = channelbag.groups.get(group) or channelbag.groups.new(group)
    return fcurve
