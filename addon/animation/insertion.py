"""The one place where a key of the animator's is changed: a key inserted in between keeps the pose on the screen.

The screen shows Blender's own in-between with the delta transform; the new key is given Blender's own alone, and the
object would jump. So the new key gets what was to be seen, in all channels of the object. A key with any other value
than the object had at that moment was meant to have it (pasted, typed, written by a script), and stays as it is.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from .slots import WIDTHS, Curves, Slot, Transformable
from .sources import LOCATION, REST, ROTATION, SAME_FRAME, SCALE, Source

REMEMBERED = 4096
"""Sources kept for comparison: as many as a long session undoes."""

TOLERANCE = 1e-5
"""Differences of single precision, relative to the value or absolute below 1."""

_sources: OrderedDict[str, Source] = OrderedDict()
_posed: dict[int, tuple[float, np.ndarray]] = {}
_inserted: dict[tuple[str, str], np.ndarray] = {}
"""What undo and redo bring back is decided as it was: what was on the screen, by the digests before and after."""


def remember(source: Source) -> None:
    """Keep what a slot is filled in from, by its digest."""
    _sources[source.digest] = source
    _sources.move_to_end(source.digest)
    if len(_sources) > REMEMBERED:
        _sources.popitem(last=False)


def notice_pose(obj: bpy.types.Object, frame: float) -> None:
    """Keep how an object was posed by hand, without a key yet, on the frame that is shown."""
    _posed[obj.session_uid] = frame, _components(obj)


def forget_poses(objects: Iterable[bpy.types.Object] | None = None) -> None:
    """Forget how these objects were posed by hand, or all of them: their Actions have moved them again."""
    if objects is None:
        _posed.clear()
    else:
        for obj in objects:
            _posed.pop(obj.session_uid, None)


def keep_pose(slot: Slot, curves: Curves, before: str, source: Source, frame: float, *, again: bool) -> bool:
    """Give a key that was inserted in between the pose on the screen.

    Parameters
    ----------
    slot, curves, source
        As they are now, with the new key.
    before : str
        The digest of the source that the slot is filled in from.
    frame : float
        The frame that is shown.
    again : bool
        Whether undo or redo brought the key back, and not an edit.

    Returns
    -------
    bool
        Whether there was such a key.
    """
    old = _sources.get(before)
    if old is None or source.key_count <= old.key_count:
        return False
    obj = next((user for user in slot.users if user.animation_data.action == slot.action), None)
    if obj is None or old.order != source.order:
        return False
    if obj.animation_data.use_tweak_mode:
        frame = obj.animation_data.nla_tweak_strip_time_to_scene(frame, invert=True)
    if not _is_inserted(old, source, frame):
        return False
    shown = _inserted.get((before, source.digest)) if again else None
    if shown is None:
        shown = _before_the_key(obj, old, frame)
        if not _has_values(source, frame, shown):
            return False
        _inserted[before, source.digest] = shown
    what = Transformable.of(obj)
    for prop, values in _on_screen(what, curves, old, shown, frame).items():
        for index, value in enumerate(values):
            if (fcurve := curves.get((what.prefix + prop, index))) is not None:
                _set_key(fcurve, frame, value)
    return True


def _is_inserted(old: Source, new: Source, frame: float) -> bool:
    """Whether the only change of key times is one more, on this frame, in a segment that is not Blender's own."""
    before, after = old.keyed_frames, new.keyed_frames
    if not before[0] < frame < before[-1] or np.abs(before - frame).min() < SAME_FRAME:
        return False
    others = after[np.abs(after - frame) >= SAME_FRAME]
    return len(others) < len(after) and np.array_equal(others, before) and bool(old.modes_at(np.array([frame]))[0])


def _before_the_key(obj: bpy.types.Object, old: Source, frame: float) -> np.ndarray:
    """The components (10,) that the object's properties had when the key was made."""
    posed_on, components = _posed.get(obj.session_uid, (None, None))
    if posed_on == frame:
        return components
    return old.values_at(np.array([frame]))[:, 0]


def _has_values(source: Source, frame: float, shown: np.ndarray) -> bool:
    """Whether every key on this frame has the value that the property had."""
    for rows, keys in source.channels:
        place = int(np.argmin(np.abs(keys.times - frame)))
        if abs(keys.times[place] - frame) < SAME_FRAME:
            had = shown[rows]
            if np.any(np.abs(keys.values[:, place] - had) > TOLERANCE * np.maximum(1.0, np.abs(had))):
                return False
    return True


def _on_screen(
    what: Transformable, curves: Curves, old: Source, shown: np.ndarray, frame: float
) -> dict[str, np.ndarray]:
    """The values of the object's properties that, with its own delta transforms alone, look as the screen does."""
    properties = what.properties

    def delta(name: str, default: np.ndarray) -> np.ndarray:
        path = f"{what.prefix}delta_{properties[name]}"
        channels = [curves.get((path, index)) for index in range(WIDTHS[properties[name]])]
        return default if None in channels else np.array([fcurve.evaluate(frame) for fcurve in channels])

    own = {LOCATION: old.own[:3], ROTATION: old.own[3:7], SCALE: old.own[7:]}
    values = {
        properties[LOCATION]: shown[:3] + delta(LOCATION, own[LOCATION]) - own[LOCATION],
        properties[SCALE]: shown[7:] * delta(SCALE, own[SCALE]) / np.where(own[SCALE] == 0.0, 1.0, own[SCALE]),
    }
    if old.order is None:
        turned = Quaternion(shown[3:7])
        seen = Quaternion(own[ROTATION]).inverted() @ Quaternion(delta(ROTATION, own[ROTATION])) @ turned
        if seen.dot(turned) < 0.0:
            seen.negate()
        values[properties[ROTATION]] = np.array(seen)
    else:
        angles = Euler(shown[3:6], old.order)
        added = delta(ROTATION, None)
        added = Quaternion(own[ROTATION]) if added is None else Euler(added, old.order).to_quaternion()
        seen = Quaternion(own[ROTATION]).inverted() @ added @ angles.to_quaternion()
        values[properties[ROTATION]] = np.array(seen.to_euler(old.order, angles))
    return values


def _set_key(fcurve: bpy.types.FCurve, frame: float, value: float) -> None:
    """Give a key this value, handles along with it; insert one that the channel lacks."""
    keys = fcurve.keyframe_points
    for key in keys:
        if abs(key.co.x - frame) < SAME_FRAME:
            key.co_ui.y = value
            break
    else:
        before = max((key for key in keys if key.co.x < frame), key=lambda key: key.co.x, default=None)
        # Read first: an insertion moves the other keys elsewhere in memory.
        eased = None if before is None else (before.interpolation, before.easing)
        key = keys.insert(frame, value)
        if eased is not None:
            key.interpolation, key.easing = eased
    fcurve.update()


def _components(obj: bpy.types.Object) -> np.ndarray:
    """An object's properties as the ten components of a source."""
    shown = REST.copy()
    shown[:3], shown[7:] = obj.location, obj.scale
    if obj.rotation_mode == "QUATERNION":
        shown[3:7] = obj.rotation_quaternion
    else:
        shown[3:6] = obj.rotation_euler
    return shown
