"""What is moved: one small interface for whatever has location, rotation and scale, and the object's version of it.

A transform knows whose Action animates it, on which property its channels are, and where the difference between
Blender's in-betweens and the wanted ones goes. For an object these are its delta transforms, which an object may have
of its own as well: those it had before any in-betweens were added are its *original* ones. They are written down on the
object the moment that in-betweens take their place, and given back when these are gone.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from functools import cache

import bpy
import numpy as np

from ..motion.eulers import ORDERS, quaternions_from_eulers
from .sources import LOCATION, REST, ROTATION, ROWS, SCALE

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

    carrier: bpy.types.Object
    """What has the properties."""

    prefix: str = ""
    """From the data-block to the carrier, in data paths."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Transform) and (self.animated, self.prefix) == (other.animated, other.prefix)

    def __hash__(self) -> int:
        return hash((self.animated, self.prefix))

    @property
    def name(self) -> str:
        return self.carrier.name

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
            f"{self.name} turns by axis and angle, which has no rigid in-betweens: "
            "set its rotation mode to Quaternion first (sidebar, Item)"
        )

    @property
    def properties(self) -> dict[str, str]:
        """Location, rotation and scale, and which property each of them is."""
        return properties_for(self.rotation)

    @property
    def channels(self) -> dict[int, Channel]:
        """The channel of each of its components, by their rows."""
        return _channels(self.prefix, self.rotation)

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
    def original(self, filled: Iterable[Channel]) -> np.ndarray:
        """What it has for a difference without in-betweens, as components (10,): rotation as a unit quaternion.

        `filled` are the channels that in-betweens are in.
        """

    @abstractmethod
    def is_noted(self, filled: Iterable[Channel]) -> bool:
        """Whether the original values of these channels are written down."""

    @abstractmethod
    def note_original(self, filled: Iterable[Channel], *, overwritten: bool = False) -> None:
        """Write the original values of these channels down, which in-betweens are about to take the place of.

        `overwritten`: they have done so already, and it has none.
        """

    @abstractmethod
    def follow_original(self, filled: Iterable[Channel]) -> None:
        """Show an edit of what is written down in all components that in-betweens are not in."""

    @abstractmethod
    def restore_original(self, filled: Iterable[Channel]) -> None:
        """Give the original values back, but for these channels, in which there are in-betweens still."""


ORIGINALS = {
    "delta_location": ("own_location", 0),
    "delta_rotation_quaternion": ("own_quaternion", 1),
    "delta_rotation_euler": ("own_euler", 2),
    "delta_scale": ("own_scale", 3),
}
"""Each delta transform: where an object's original is written down, and its place in `filled`. Files have the names."""


class ObjectTransform(Transform):
    """An object. The difference goes into its delta transforms."""

    def __init__(self, obj: bpy.types.Object) -> None:
        self.animated = self.carrier = obj

    def differences_for(self, rotation: str) -> dict[int, Channel]:
        return _channels("delta_", rotation)

    def original(self, filled: Iterable[Channel]) -> np.ndarray:
        motion, noted = self.motion, tuple(self.motion.filled)
        taken = set(filled)

        def values(path: str) -> list[float]:
            original, place = ORIGINALS[path]
            now = getattr(self.carrier, path)[:]
            if not noted[place]:
                return now
            then = getattr(motion, original)[:]
            # In the NLA another strip's in-betweens may be in any of them.
            every = self._is_in_nla
            return [then[i] if every or (path, i) in taken else value for i, value in enumerate(now)]

        rotation = REST[ROWS[ROTATION]]
        if self.carrier.rotation_mode in ORDERS:
            angles = values("delta_rotation_euler")
            if any(angles):
                rotation = quaternions_from_eulers(np.array((angles,)), self.carrier.rotation_mode)[0]
        else:
            quaternion = values("delta_rotation_quaternion")
            if length := math.hypot(*quaternion):
                rotation = [component / length for component in quaternion]
        return np.array((*values("delta_location"), *rotation, *values("delta_scale")))

    @property
    def _is_in_nla(self) -> bool:
        data = self.animated.animation_data
        return data is not None and len(data.nla_tracks) > 0

    def is_noted(self, filled: Iterable[Channel]) -> bool:
        noted = tuple(self.motion.filled)
        return all(noted[ORIGINALS[path][1]] for path in {path for path, _ in filled})

    def note_original(self, filled: Iterable[Channel], *, overwritten: bool = False) -> None:
        motion, noted, filled = self.motion, tuple(self.motion.filled), set(filled)
        for path in {path for path, _ in filled}:
            original, place = ORIGINALS[path]
            if not noted[place]:
                _set_if_other(motion, original, default_of(path) if overwritten else getattr(self.carrier, path))
                motion.filled[place] = True
            elif not self._is_in_nla:
                # The components that in-betweens are not in are still the animator's to edit.
                now, then = getattr(self.carrier, path), getattr(motion, original)
                _set_if_other(
                    motion, original, [then[i] if (path, i) in filled else value for i, value in enumerate(now)]
                )

    def follow_original(self, filled: Iterable[Channel]) -> None:
        filled = set(filled)
        for path, (original, place) in ORIGINALS.items():
            if self.motion.filled[place]:
                now, then = getattr(self.carrier, path)[:], getattr(self.motion, original)[:]
                values = [now[i] if (path, i) in filled else value for i, value in enumerate(then)]
                _set_if_other(self.carrier, path, values)

    def restore_original(self, filled: Iterable[Channel]) -> None:
        motion = self.motion
        taken = {path for path, _ in filled}
        for path, (original, place) in ORIGINALS.items():
            if motion.filled[place] and path not in taken:
                setattr(self.carrier, path, getattr(motion, original))
                motion.filled[place] = False


def _set_if_other(owner: bpy.types.bpy_struct, name: str, values: Iterable[float]) -> None:
    """Set a property where it is not that already: to set it costs an update of the object."""
    values = tuple(values)
    if tuple(getattr(owner, name)) != values:
        setattr(owner, name, values)


def transform_of(carrier: bpy.types.Object | Transform) -> Transform:
    """The transform of something that Blender has, where it is none already."""
    return carrier if isinstance(carrier, Transform) else ObjectTransform(carrier)


@cache
def default_of(path: str) -> tuple[float, ...]:
    """What a delta transform is where an object has none of its own."""
    return tuple(bpy.types.Object.bl_rna.properties[path].default_array)


def properties_for(rotation: str) -> dict[str, str]:
    """Location, rotation and scale, and which property each of them is, for what is turned by this one."""
    return {LOCATION: "location", ROTATION: rotation, SCALE: "scale"}


@cache
def _channels(prefix: str, rotation: str) -> dict[int, Channel]:
    return {
        ROWS[name].start + index: (prefix + prop, index)
        for name, prop in properties_for(rotation).items()
        for index in range(WIDTHS[prop])
    }
