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

from ..motion.eulers import ORDERS, quaternions_from_extrinsic_eulers
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
    def original(self) -> np.ndarray:
        """What it has for a difference without in-betweens, as components (10,): rotation as a unit quaternion."""

    @abstractmethod
    def is_noted(self, filled: Iterable[Channel]) -> bool:
        """Whether the original values of these channels are written down."""

    @abstractmethod
    def note_original(self, filled: Iterable[Channel], *, overwritten: bool = False) -> None:
        """Write the original values of these channels down, which in-betweens are about to take the place of.

        `overwritten`: they have done so already, and it has none.
        """

    @abstractmethod
    def follow_original(self) -> None:
        """Show an edit of what is written down in all components that in-betweens are not in."""

    @abstractmethod
    def restore_original(self, filled: Iterable[Channel]) -> None:
        """Give the original values back, but for these channels, which are animated still."""


ORIGINALS = {
    "delta_location": ("own_location", 0),
    "delta_rotation_quaternion": ("own_quaternion", 1),
    "delta_rotation_euler": ("own_euler", 2),
    "delta_scale": ("own_scale", 3),
}
"""Each delta transform: where an object's original is written down, and its place in `filled`. Files have the names."""


_BITS = {
    channel: 1 << place
    for place, channel in enumerate(
        (path, index) for path in ORIGINALS for index in range(4 if path.endswith("quaternion") else 3)
    )
}
"""The bit of each component of the delta transforms in `filled_components`."""


class ObjectTransform(Transform):
    """An object. The difference goes into its delta transforms."""

    def __init__(self, obj: bpy.types.Object) -> None:
        self.animated = self.carrier = obj

    def differences_for(self, rotation: str) -> dict[int, Channel]:
        return _channels("delta_", rotation)

    def original(self) -> np.ndarray:
        noted = self._noted

        def values(path: str) -> list[float]:
            now = getattr(self.carrier, path)[:]
            if not noted:
                return now
            then = getattr(self.motion, ORIGINALS[path][0])[:]
            return [then[i] if _BITS[path, i] & noted else value for i, value in enumerate(now)]

        rotation = REST[ROWS[ROTATION]]
        if self.carrier.rotation_mode in ORDERS:
            angles = values("delta_rotation_euler")
            if any(angles):
                rotation = quaternions_from_extrinsic_eulers(np.array((angles,)), self.carrier.rotation_mode)[0]
        else:
            quaternion = values("delta_rotation_quaternion")
            if length := math.hypot(*quaternion):
                rotation = [component / length for component in quaternion]
        return np.array((*values("delta_location"), *rotation, *values("delta_scale")))

    def is_noted(self, filled: Iterable[Channel]) -> bool:
        noted = self._noted
        return all(_BITS[channel] & noted for channel in filled if channel in _BITS)

    def note_original(self, filled: Iterable[Channel], *, overwritten: bool = False) -> None:
        noted = self._noted
        added = [channel for channel in filled if channel in _BITS and not _BITS[channel] & noted]
        for path in {path for path, _ in added}:
            now, then = getattr(self.carrier, path), list(getattr(self.motion, ORIGINALS[path][0]))
            for i, value in enumerate(now):
                if (path, i) in added and overwritten:
                    then[i] = default_of(path)[i]
                elif not _BITS[path, i] & noted:
                    then[i] = value
            _set_if_other(self.motion, ORIGINALS[path][0], then)
        self._keep(noted | sum(_BITS[channel] for channel in set(added)))

    def follow_original(self) -> None:
        noted = self._noted
        for path in _paths_in(noted):
            now, then = getattr(self.carrier, path)[:], getattr(self.motion, ORIGINALS[path][0])[:]
            values = [now[i] if _BITS[path, i] & noted else value for i, value in enumerate(then)]
            _set_if_other(self.carrier, path, values)

    def restore_original(self, filled: Iterable[Channel]) -> None:
        noted = self._noted
        gone = noted & ~sum(_BITS[channel] for channel in set(filled) if channel in _BITS)
        for path in _paths_in(gone):
            now, then = getattr(self.carrier, path)[:], getattr(self.motion, ORIGINALS[path][0])[:]
            setattr(self.carrier, path, [then[i] if _BITS[path, i] & gone else value for i, value in enumerate(now)])
        if gone:
            self._keep(noted & ~gone)

    @property
    def _noted(self) -> int:
        """The bits of the components that are written down."""
        motion = self.motion
        if noted := motion.filled_components:
            return noted
        # Files of a version that took all components of a delta transform, or none, have only `filled`.
        taken = motion.filled[:]
        return sum(bit for (path, _), bit in _BITS.items() if taken[ORIGINALS[path][1]]) if any(taken) else 0

    def _keep(self, noted: int) -> None:
        motion = self.motion
        if motion.filled_components != noted:
            motion.filled_components = noted
        paths = _paths_in(noted)
        summary = [path in paths for path in ORIGINALS]
        if list(motion.filled) != summary:
            motion.filled = summary


def _paths_in(bits: int) -> set[str]:
    """The delta transforms that have any of these components."""
    return {path for (path, _), bit in _BITS.items() if bit & bits}


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
