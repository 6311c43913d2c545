"""What has location, rotation and scale, and is moved: the interface of every kind, see `kinds`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from functools import cache
from typing import ClassVar

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from mathutils import Euler, Quaternion

from ...motion.eulers import ORDERS
from ..compute.components import LOCATION, REST, ROTATION, ROWS, SCALE

OWN_WORDS = "Rigid Motion"
"""The context of words that Blender has another translation for, or one that is too long where they are shown."""

LINKED = n_("{name} is linked from another file: make it local first (Object > Relations > Make Local)")
"""The reason why a data-block cannot be edited, and the way out."""

MODE_PROPERTY, TURNS_PROPERTY = "rigid_motion.mode", "rigid_motion.turns"

SEGMENT_PROPERTIES = (MODE_PROPERTY, TURNS_PROPERTY)
"""Properties by which keys say something about the segments that they begin."""

WIDTHS = {LOCATION: 3, "rotation_quaternion": 4, "rotation_euler": 3, SCALE: 3}

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


class Transform(ABC):
    """Something with location, rotation and scale, as its animated data-block's Action moves it.

    A subclass is a kind of such things. What differs from kind to kind is asked of it, never guessed from data paths.
    """

    is_part: ClassVar[bool]
    """True if it is a part of its data-block, with a name that can be changed, and not the data-block itself."""

    has_difference_slot: ClassVar[bool]
    """True if its differences are in a slot of their own, where they take the place of nothing that an animator edits.
    Otherwise they are beside its keys, and overwrite properties whose original values are kept meanwhile."""

    label: ClassVar[str]
    """The name in front of its mode."""

    plural: ClassVar[str]
    """The name of several, in English."""

    linked_text: ClassVar[str]
    """Why it cannot be edited where its data-block {name} is linked, and the way out."""

    differing_text: ClassVar[str]
    """The reason why it is not moved by in-betweens of its own: {leader} is the user of its slot whose they are."""

    animated: bpy.types.Object
    """The data-block whose Action it is."""

    carrier: bpy.types.Object | bpy.types.PoseBone
    """The object or bone that has the properties."""

    prefix: str = ""
    """From the data-block to the carrier, in data paths."""

    placed_by: ClassVar[tuple[str, ...]]
    """The beginnings of names of operators that bring what is on the screen to a certain place."""

    stored_by: ClassVar[tuple[str, ...]]
    """The beginnings of the names of operators that set its properties to a whole pose, whatever they had before."""

    @classmethod
    @abstractmethod
    def difference_group(cls, prefix: str) -> str:
        """Return the group of F-curves that its differences are in, and its channels of modes and turns."""

    @classmethod
    def together(cls, users: tuple[Transform, ...]) -> tuple[Transform, ...]:
        """Return users of one slot as what they are there, where all have the same differences."""
        return users

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

    def is_as_seen(self, _evaluated: bpy.types.Object | bpy.types.PoseBone) -> bool:
        """Return whether its properties were set to what was seen when it was evaluated, difference and all."""
        return False

    @property
    def motion(self) -> bpy.types.PropertyGroup:
        """The properties that this extension keeps on it."""
        return self.carrier.rigid_motion

    @property
    def rotation(self) -> str:
        """The property that turns it. `Refused` where that is an axis and an angle."""
        mode = self.carrier.rotation_mode
        if mode == "QUATERNION":
            return "rotation_quaternion"
        if mode in ORDERS:
            return "rotation_euler"
        raise Refused(
            n_(
                "{name} turns by axis and angle, which has no rigid in-betweens: "
                "set its rotation mode to Quaternion first (sidebar, Item)"
            ),
            name=self.name,
        )

    @property
    def order(self) -> str | None:
        """The order of the Euler angles that it turns by, None for quaternions. `Refused` like `rotation`."""
        return None if self.rotation == "rotation_quaternion" else self.carrier.rotation_mode

    @property
    def properties(self) -> dict[str, str]:
        """Location, rotation and scale, and which property each of them is."""
        return properties_for(self.rotation)

    @property
    def channels(self) -> dict[int, Channel]:
        """The channel of each of its components, by their rows."""
        return channels_under(self.prefix, self.rotation)

    @property
    def mode_channel(self) -> Channel:
        return self.prefix + MODE_PROPERTY, 0

    @property
    def turns_channel(self) -> Channel:
        return self.prefix + TURNS_PROPERTY, 0

    def components(self) -> np.ndarray:
        """Return its properties as they are now, as the ten components of a source."""
        result = REST.copy()
        result[ROWS[LOCATION]], result[ROWS[SCALE]] = self.carrier.location, self.carrier.scale
        if self.carrier.rotation_mode == "QUATERNION":
            result[ROWS[ROTATION]] = self.carrier.rotation_quaternion
        elif self.carrier.rotation_mode in ORDERS:
            result[3:6] = self.carrier.rotation_euler
        return result

    def set_components(self, components: np.ndarray, parts: Collection[str]) -> None:
        """Set its properties for these of location, rotation and scale to components (10,)."""
        for part, prop in self.properties.items():
            if part in parts:
                setattr(self.carrier, prop, components[ROWS[part]][: WIDTHS[prop]])

    @property
    def differences(self) -> dict[int, Channel]:
        """The channel that the difference of each component goes into, by their rows."""
        return self.differences_for(self.rotation)

    @abstractmethod
    def differences_for(self, rotation: str) -> dict[int, Channel]:
        """Return what `differences` does, for something that this property turns."""

    @abstractmethod
    def original(self) -> np.ndarray:
        """Return its difference without in-betweens, as components (10,): rotation as a unit quaternion."""

    @property
    def constraint_settings(self) -> dict[str, object]:
        """The settings by which a constraint mixes its difference in: location added, rotation from the left, scale
        multiplied, and transforms by hand see it.
        """
        return {
            "use_eval_time": True,
            "mix_mode": "BEFORE_SPLIT",
            "owner_space": "LOCAL",
            "target_space": "LOCAL",
        }


def rotation_of(components: np.ndarray, order: str | None) -> Quaternion:
    """Return the rotation among components (10,): of Euler angles in this order, or a quaternion."""
    if order is None:
        return Quaternion(components[ROWS[ROTATION]])
    return Euler(components[3:6], order).to_quaternion()


def set_rotation(
    components: np.ndarray, order: str | None, rotation: Quaternion, near: np.ndarray | None = None
) -> None:
    """Set the rotation among components (10,), in the sign or the turn that others have which it is to be near to."""
    if order is not None:
        compatible = () if near is None else (Euler(near[3:6], order),)
        components[3:6] = rotation.to_euler(order, *compatible)
    else:
        is_other_sign = near is not None and rotation.dot(Quaternion(near[ROWS[ROTATION]])) < 0.0
        components[ROWS[ROTATION]] = -rotation if is_other_sign else rotation


def visible_components(
    components: np.ndarray, original: np.ndarray, difference: np.ndarray, order: str | None, parts: Collection[str]
) -> np.ndarray:
    """Return what the properties would have to be to look the same with the original difference alone.

    Parameters
    ----------
    components : array, shape (10,)
        What the properties are.
    original : array, shape (10,)
        The difference without in-betweens: rotation as a unit quaternion.
    difference : array, shape (10,)
        The one that there is: rotation as the properties have it.
    order : str or None
        Of Euler angles, or None for quaternions.
    parts : collection of str
        Which of location, rotation and scale in-betweens are in. The others stay what they are, to the last bit.

    Returns
    -------
    array, shape (10,)
    """
    seen = components.copy()
    location, scale = ROWS[LOCATION], ROWS[SCALE]
    if LOCATION in parts:
        seen[location] += difference[location] - original[location]
    if SCALE in parts:
        seen[scale] *= difference[scale] / np.where(original[scale] == 0.0, 1.0, original[scale])
    if ROTATION in parts:
        taken_off, added = Quaternion(original[ROWS[ROTATION]]).inverted(), rotation_of(difference, order).normalized()
        set_rotation(seen, order, taken_off @ added @ rotation_of(components, order), components)
    return seen


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
