"""What has location, rotation and scale, and is moved: the interface that objects and pose bones have."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cache
from typing import ClassVar

import bpy
import numpy as np
from bpy.app.translations import pgettext_rpt as rpt_

from ...motion.eulers import ORDERS
from ..compute.components import LOCATION, REST, ROTATION, ROWS, SCALE

MODE_PROPERTY = "rigid_motion.mode"

WIDTHS = {LOCATION: 3, "rotation_quaternion": 4, "rotation_euler": 3, SCALE: 3}

Channel = tuple[str, int]
"""Data path, from what is animated on, and index."""


class Refused(ValueError):
    """Why rigid motion cannot act on something: names it, and the way out."""


class Transform(ABC):
    """Something with location, rotation and scale, as its animated data-block's Action moves it."""

    animated: bpy.types.Object
    """The data-block whose Action it is."""

    carrier: bpy.types.Object | bpy.types.PoseBone
    """What has the properties."""

    prefix: str = ""
    """From the data-block to the carrier, in data paths."""

    placed_by: ClassVar[tuple[str, ...]]
    """How the names of operators begin that set its properties to bring what is on the screen to a certain place."""

    stored_by: ClassVar[tuple[str, ...]]
    """How the names of operators begin that set its properties to a pose that was kept elsewhere."""

    matrix_lacks_difference: ClassVar[bool]
    """Whether Blender takes the difference off where the properties are set from a matrix."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Transform) and (self.animated, self.prefix) == (other.animated, other.prefix)

    def __hash__(self) -> int:
        return hash((self.animated, self.prefix))

    @property
    def name(self) -> str:
        return self.carrier.name

    @property
    def location_axes(self) -> np.ndarray | None:
        """The axes that it is moved along, as columns (3, 3) in those that it turns about; None where they are one."""
        return None

    @property
    @abstractmethod
    def group(self) -> str:
        """The group of F-curves that its mode channel is in."""

    @abstractmethod
    def evaluated(self, depsgraph: bpy.types.Depsgraph) -> bpy.types.Object | bpy.types.PoseBone | None:
        """The carrier as it was evaluated last, None where it was not there yet."""

    @property
    def motion(self) -> bpy.types.PropertyGroup:
        """What this extension keeps on it."""
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
            rpt_(
                "{name} turns by axis and angle, which has no rigid in-betweens: "
                "set its rotation mode to Quaternion first (sidebar, Item)"
            ).format(name=self.name)
        )

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

    def components(self) -> np.ndarray:
        """Its properties as they are now, as the ten components of a source."""
        found = REST.copy()
        found[ROWS[LOCATION]], found[ROWS[SCALE]] = self.carrier.location, self.carrier.scale
        if self.carrier.rotation_mode == "QUATERNION":
            found[ROWS[ROTATION]] = self.carrier.rotation_quaternion
        elif self.carrier.rotation_mode in ORDERS:
            found[3:6] = self.carrier.rotation_euler
        return found

    @property
    def differences(self) -> dict[int, Channel]:
        """The channel that the difference of each component goes into, by their rows."""
        return self.differences_for(self.rotation)

    @abstractmethod
    def differences_for(self, rotation: str) -> dict[int, Channel]:
        """The same for something that this property turns."""

    @abstractmethod
    def original(self) -> np.ndarray:
        """What it has for a difference without in-betweens, as components (10,): rotation as a unit quaternion."""


def properties_for(rotation: str) -> dict[str, str]:
    """Location, rotation and scale, and which property each of them is, for what is turned by this one."""
    return {LOCATION: "location", ROTATION: rotation, SCALE: "scale"}


@cache
def channels_under(prefix: str, rotation: str) -> dict[int, Channel]:
    """The channels of a transform's components whose data paths begin so, by their rows."""
    return {
        ROWS[name].start + index: (prefix + prop, index)
        for name, prop in properties_for(rotation).items()
        for index in range(WIDTHS[prop])
    }
