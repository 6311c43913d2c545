"""What has location, rotation and scale, and is moved: the interface of every kind, see `kinds`."""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from typing import ClassVar

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..evaluation.components import LOCATION, REST, ROTATION, ROWS, SCALE

OWN_WORDS = "Rigid Motion"
"""The context of words that Blender has another translation for, or one that is too long where they are shown."""

LINKED = n_("{name} is linked from another file: make it local first (Object > Relations > Make Local)")
"""The reason why a data-block cannot be edited, and the way out."""

TURNS_PROPERTY = "rigid_motion.turns"
"""The property by whose keys segments make whole turns more."""

GROUP = "Rigid Motion"
"""The group of F-curves that the channel of turns of an object is in."""

WIDTHS = {LOCATION: 3, "rotation_quaternion": 4, "rotation_euler": 3, "rotation_axis_angle": 4, SCALE: 3}
"""The properties that move something, and how many components each has."""

_ROTATIONS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}

Channel = tuple[str, int]
"""Data path, from what is animated on, and index."""


class Refused(ValueError):
    """Why rigid motion cannot act on something: names it, and the way out.

    Parameters
    ----------
    text : str
        In English, with placeholders.
    facts
        What stands for these in the user's language. Without any, the text stays as it is.
    """

    def __init__(self, text: str, **facts: object) -> None:
        super().__init__(rpt_(text).format(**facts) if facts else text)


class Transform:
    """Something with location, rotation and scale, as its animated data-block's Action moves it.

    A subclass is a kind of such things. What differs from kind to kind is asked of it, never guessed from data paths.
    """

    is_part: ClassVar[bool]
    """True if it is a part of its data-block, with a name that can be changed, and not the data-block itself."""

    label: ClassVar[str]
    """The name in front of its mode."""

    plural: ClassVar[str]
    """The name of several, in English."""

    linked_text: ClassVar[str]
    """Why it cannot be edited where its data-block {name} is linked, and the way out."""

    differing_text: ClassVar[str]
    """Why the motion of its slot, which is that of {leader}, does not fit it, and the way out."""

    animated: bpy.types.Object
    """The data-block whose Action it is."""

    carrier: bpy.types.Object | bpy.types.PoseBone
    """The object or bone that has the properties."""

    prefix: str = ""
    """From the data-block to the carrier, in data paths."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Transform) and (self.animated, self.prefix) == (other.animated, other.prefix)

    def __hash__(self) -> int:
        return hash((self.animated, self.prefix))

    @property
    def identity(self) -> tuple[int, str]:
        """What it is known by where nothing of Blender's can be kept: its data-block's session id, and its prefix."""
        return self.animated.session_uid, self.prefix

    @property
    def name(self) -> str:
        return self.carrier.name

    @property
    def location_axes(self) -> np.ndarray | None:
        """The axes that it is moved along, as columns (3, 3) in those that it turns about; None where they are one."""
        return None

    @property
    def motion(self) -> bpy.types.PropertyGroup:
        """The properties that this extension keeps on it."""
        return self.carrier.rigid_motion

    @property
    def rotation(self) -> str:
        """The property that turns it."""
        return _ROTATIONS.get(self.carrier.rotation_mode, "rotation_euler")

    @property
    def order(self) -> str | None:
        """None where it turns by quaternions, AXIS_ANGLE, or the order of its Euler angles."""
        mode = self.carrier.rotation_mode
        return None if mode == "QUATERNION" else mode

    @property
    def properties(self) -> dict[str, str]:
        """Location, rotation and scale, and which property each of them is."""
        return properties_for(self.rotation)

    @property
    def channels(self) -> dict[int, Channel]:
        """The channel of each of its components, by their rows."""
        return channels_under(self.prefix, self.rotation)

    @property
    def turns_channel(self) -> Channel:
        return self.prefix + TURNS_PROPERTY, 0

    def components(self) -> np.ndarray:
        """Return its properties as they are now, as the ten components of a source."""
        result = REST.copy()
        result[ROWS[LOCATION]], result[ROWS[SCALE]] = self.carrier.location, self.carrier.scale
        rotation = getattr(self.carrier, self.rotation)
        result[3 : 3 + len(rotation)] = rotation
        return result

    def set_components(self, components: np.ndarray, parts: Collection[str]) -> None:
        """Set its properties for these of location, rotation and scale to components (10,)."""
        for part, prop in self.properties.items():
            if part in parts:
                setattr(self.carrier, prop, components[ROWS[part]][: WIDTHS[prop]])

    def original(self) -> np.ndarray:
        """Return what comes on top of its channels, as components (10,): rotation as a unit quaternion."""
        return REST.copy()


def properties_for(rotation: str) -> dict[str, str]:
    """Return location, rotation and scale, and which property each of them is, for what is turned by this one."""
    return {LOCATION: "location", ROTATION: rotation, SCALE: "scale"}


@cache
def channels_under(prefix: str, rotation: str) -> dict[int, Channel]:
    """Return the channels of a transform's components whose data paths begin so, by their rows."""
    return {
        ROWS[name].start + index: (prefix + prop, index)
        for name, prop in properties_for(rotation).items()
        for index in range(WIDTHS[prop])
    }
