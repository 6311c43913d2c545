"""The mode channel: which segment is filled in how. A key of it decides from its frame on, until the next."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np

from . import live
from .reading import mode_of, read
from .slots import GROUP, MODE_PATH, WIDTHS, Curves, Refused, Slot, Transformable, curves_in, slots_of
from .sources import MODE_IDS, SAME_FRAME, UNKNOWN, Source, distinct


def active_slot(obj: bpy.types.Object) -> Slot | None:
    """The slot whose keys the editors show: that of the object's Action, in tweak mode that of the strip."""
    data = obj.animation_data
    if data is None or data.action is None:
        return None
    here = (data.action, data.action_slot_handle)
    return next((slot for slot in slots_of([obj]) if (slot.action, slot.handle) == here), None)


def source_of(obj: bpy.types.Object) -> Source | None:
    """What is keyed in an object's Action, None where nothing is. `Refused` where rigid motion cannot act on it."""
    slot = active_slot(obj)
    source = None if slot is None else read(slot, curves_in(slot.channelbag))
    return source if source and source.channels else None


def key_frames(obj: bpy.types.Object, *, selected: bool = False) -> np.ndarray:
    """The frames of an object's location, rotation and scale keys, or of the selected ones alone, shape (n,), rising.

    Keys of the mode channel count among the selected ones.
    """
    slot = active_slot(obj)
    return _frames_in(curves_in(slot.channelbag if slot else None), selected=selected)


def modes_of(obj: bpy.types.Object, frames: np.ndarray) -> list[str]:
    """The modes of an object's segments at these frames."""
    slot = active_slot(obj)
    curves = curves_in(slot.channelbag if slot else None)
    return [MODE_IDS[number] for number in _modes_in(obj, curves, frames)]


def segment_modes(slot: Slot) -> list[str]:
    """The modes of the segments between the keys of a slot, one after the other."""
    curves = curves_in(slot.channelbag)
    return [MODE_IDS[number] for number in _modes_in(slot.users[0], curves, _frames_in(curves)[:-1])]


def _frames_in(curves: Curves, *, selected: bool = False) -> np.ndarray:
    found = []
    for (path, _), fcurve in curves.items():
        if path in WIDTHS or (selected and path == MODE_PATH):
            keys = fcurve.keyframe_points
            points, chosen = np.empty(2 * len(keys), np.float32), np.ones(len(keys), dtype=bool)
            keys.foreach_get("co", points)
            if selected:
                keys.foreach_get("select_control_point", chosen)
            found.append(points[::2][chosen])
    frames = np.unique(np.concatenate(found)).astype(np.float64) if found else np.empty(0)
    return distinct(frames)


def _modes_in(obj: bpy.types.Object, curves: Curves, frames: np.ndarray) -> list[int]:
    """The modes at these frames, as `MODE_IDS` counts them; Blender's own where there is what is no mode."""
    fcurve = curves.get((MODE_PATH, 0))
    if fcurve is None or fcurve.mute or not fcurve.keyframe_points:
        modes = [mode_of(obj)] * len(frames)
    else:
        modes = [_value(fcurve, frame) for frame in frames.tolist()]
    return [mode if 0 <= mode < len(MODE_IDS) else 0 for mode in modes]


def set_mode(obj: bpy.types.Object, mode: str, frames: Sequence[float] | None = None) -> None:
    """Choose what happens between the keys of an object.

    Parameters
    ----------
    obj : bpy.types.Object
    mode : str
        One of `MODE_IDS`.
    frames : sequence of float, optional
        The frames of the keys that begin the segments meant. They get a key in the mode channel, and so does the key
        behind them where another mode goes on; all other segments keep what they have. Without frames, the object
        gets one mode for all, and the mode channel goes.

    Raises
    ------
    Refused
        Where rigid motion cannot act on the object. Nothing is changed then.
    """
    slots = slots_of([obj])
    if mode != "BLENDER":
        check(obj, slots)
    if frames is None:
        for slot in slots:
            if (fcurve := curves_in(slot.channelbag).get((MODE_PATH, 0))) is not None:
                slot.channelbag.fcurves.remove(fcurve)
        users = {obj, *(user for slot in slots for user in slot.users)}
        with live.paused():
            for user in users:
                user.rigid_motion.mode = mode
        live.refresh(users)
        return
    slot = active_slot(obj)
    if slot is None:
        raise Refused(
            f"{obj.name} has no Action with keys to set a mode on: key it first, or enter a strip (NLA Editor, Tab)"
        )
    set_mode_in(slot, mode, frames)
    live.refresh(slot.users)


def set_mode_in(slot: Slot, mode: str, frames: Sequence[float]) -> None:
    """Key the mode channel of one slot on these frames, and behind them where another mode goes on."""
    curves = curves_in(slot.channelbag)
    chosen, keyed = np.asarray(frames, dtype=np.float64), _frames_in(curves)
    before = _modes_in(slot.users[0], curves, keyed)
    fcurve = curves.get((MODE_PATH, 0)) or _new(slot)
    # Muted it has no say. Now it has, and all other segments keep the mode that they had without.
    fcurve.mute = False
    for frame, old, is_chosen in zip(keyed.tolist(), before, _is_among(chosen, keyed).tolist(), strict=True):
        wanted = MODE_IDS.index(mode) if is_chosen else old
        if is_chosen or not len(fcurve.keyframe_points) or _value(fcurve, frame) != wanted:
            _set_key(fcurve, frame, wanted, selected=is_chosen)
    fcurve.update()


def _is_among(chosen: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Which of the frames (n,) are one of the chosen, shape (n,)."""
    chosen = np.sort(chosen)
    return np.searchsorted(chosen, frames + SAME_FRAME) > np.searchsorted(chosen, frames - SAME_FRAME, side="right")


def check(obj: bpy.types.Object, slots: Sequence[Slot]) -> None:
    """Raise `Refused` where an object, which these slots move, cannot have any mode but Blender's own."""
    what = Transformable.of(obj)
    what.rotation  # noqa: B018 - raises where it turns by axis and angle
    if not obj.is_editable:
        raise Refused(f"{obj.name} is linked from another file: make it local first (Object > Relations > Make Local)")
    for slot in slots:
        read(slot, curves_in(slot.channelbag), mode=1)


def _value(fcurve: bpy.types.FCurve, frame: float) -> int:
    """The mode of the segment that begins on this frame, `UNKNOWN` where that is not a number."""
    value = fcurve.evaluate(frame + 0.5 * SAME_FRAME)
    return round(value) if math.isfinite(value) else UNKNOWN


def _new(slot: Slot) -> bpy.types.FCurve:
    channelbag = slot.channelbag
    fcurve = channelbag.fcurves.new(MODE_PATH)
    fcurve.group = channelbag.groups.get(GROUP) or channelbag.groups.new(GROUP)
    return fcurve


def _set_key(fcurve: bpy.types.FCurve, frame: float, value: int, *, selected: bool) -> None:
    """A key that holds, selected as the key of the pose is, so that both move together."""
    key = fcurve.keyframe_points.insert(frame, value, options={"FAST"})
    key.interpolation = "CONSTANT"
    key.select_control_point = key.select_left_handle = key.select_right_handle = selected
