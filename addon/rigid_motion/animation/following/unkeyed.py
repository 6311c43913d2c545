"""Poses without keys: restored after writing a modifier, which makes Blender evaluate the whole Action.

Blender leaves such poses alone while other channels are keyed. A value that differs after the evaluation was not that
of its channel before, unless the channel was edited or has new terms.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import lru_cache
from typing import Any

import bpy
import numpy as np

from ...blender import existing, pose_bones
from ..actions.slots import Curves, Slot
from ..transforms import WIDTHS, Channel, prefix_of, split_path

SAME_VALUE = 1e-6
"""Values that differ by less (relative, absolute below 1) are the same in single precision."""


class UnkeyedPoses:
    """The animated values of a slot's users before something is written.

    Parameters
    ----------
    slot : Slot
    edited : collection of Channel
        Edited channels: their properties follow the channels.
    written : mapping of Channel to FCurve
        Channels about to be written.
    frame : float
        The current frame.
    """

    def __init__(self, slot: Slot, edited: Collection[Channel], written: Curves, frame: float) -> None:
        # Under NLA strips the values of channels are unknown, and Blender evaluates everything in any case.
        self._users = [
            user for user in slot.users if slot.plays_in(user) and not len(existing(user.animation_data).nla_tracks)
        ]
        self._excluded, self._others = set(edited), []
        for fcurve in slot.fcurves if self._users else ():
            path = fcurve.data_path
            if fcurve.mute:
                self._excluded.add((path, fcurve.array_index))
            elif not _is_of_bone(path):
                self._others.append((path, fcurve.array_index))
        for channel in written.keys() - self._excluded if self._users else ():
            shown, value = written[channel].evaluate(frame), _value_of(self._users[0], channel)
            if value is None or abs(value - shown) <= SAME_VALUE * max(1.0, abs(shown)):
                self._excluded.add(channel)
        self._before = [
            (_bone_values(user), [_value_of(user, other) for other in self._others]) for user in self._users
        ]

    def set_again(self) -> bool:
        """Restore all values that have changed. Returns whether there were any."""
        changed = False
        for user, (bones, values) in zip(self._users, self._before, strict=True):
            then = dict(zip(self._others, values, strict=True))
            for name, now in _bone_values(user).items():
                for number, index in np.argwhere(now != bones[name]).tolist():
                    then[prefix_of(pose_bones(user)[number].name) + name, index] = float(bones[name][number, index])
            for channel, value in then.items():
                if channel not in self._excluded and value is not None and _value_of(user, channel) != value:
                    _set_value(user, channel, value)
                    changed = True
        return changed


@lru_cache(maxsize=65536)
def _is_of_bone(path: str) -> bool:
    prefix, prop = split_path(path)
    return bool(prefix) and prop in WIDTHS


def _bone_values(rig: bpy.types.Object) -> dict[str, np.ndarray]:
    """Return the transform properties of all bones, (bones, width) each."""
    result: dict[str, np.ndarray] = {}
    for name, width in WIDTHS.items() if rig.pose is not None and (bones := rig.pose.bones) else ():
        result[name] = np.empty((len(bones), width), np.float32)
        bones.foreach_get(name, result[name].ravel())
    return result


def _value_of(user: bpy.types.Object, channel: Channel) -> Any:
    """Return the value of a channel's property, None if it does not exist or is no number."""
    path, index = channel
    try:
        prop: Any = user.path_resolve(path)
        value = prop if isinstance(prop, int | float) else prop[index]
    except (ValueError, IndexError, TypeError, KeyError):
        return None
    return value if isinstance(value, int | float) else None


def _set_value(user: bpy.types.Object, channel: Channel, value: Any) -> None:
    """Set the property of a channel."""
    path, index = channel
    prop: Any = user.path_resolve(path)
    if not isinstance(prop, int | float):
        prop[index] = value
        return
    is_custom = path.endswith('"]')
    holder, _, name = path[:-2].rpartition('["') if is_custom else path.rpartition(".")
    owner: Any = user.path_resolve(holder) if holder else user
    if is_custom:
        owner[bpy.utils.unescape_identifier(name)] = value
        # Blender does not notice by itself that a custom property was set.
        user.update_tag()
    elif name in owner.bl_rna.properties:
        setattr(owner, name, value)
