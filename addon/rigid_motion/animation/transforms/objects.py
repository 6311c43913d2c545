"""Objects as transforms: what their in-betweens differ in goes into delta transforms.

An object may have delta transforms of its own: those it had before any in-betweens are its *original* ones. They are
written down on the object, component by component, before in-betweens take their place, and given back when these go.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion.eulers import ORDERS, quaternions_from_extrinsic_eulers
from ..compute.components import REST, ROTATION, ROWS
from .transform import LINKED, OWN_WORDS, Channel, Transform, channels_under

GROUP = "Rigid Motion"
"""The group of F-curves that an object's mode channel and its differences are in."""

ORIGINALS = {
    "delta_location": ("own_location", 0),
    "delta_rotation_quaternion": ("own_quaternion", 1),
    "delta_rotation_euler": ("own_euler", 2),
    "delta_scale": ("own_scale", 3),
}
"""Each delta transform: where an object's original is written down, and its place in `filled`. Files have the names."""


_BITS = {
    channel: 1 << bit
    for bit, channel in enumerate(
        (path, index) for path in ORIGINALS for index in range(4 if path.endswith("quaternion") else 3)
    )
}
"""The bit of each component of the delta transforms in `filled_components`."""


class ObjectTransform(Transform):
    """An object. The difference goes into its delta transforms."""

    carrier_type = bpy.types.Object
    is_part = False
    has_difference_slot = False
    label = n_("Object", OWN_WORDS)
    plural = "objects"
    linked_text = LINKED
    differing_text = n_(
        "{name} moves by the same Action slot as {leader}, but has another rotation mode, driver or delta transform; "
        "the in-betweens are those of {leader}: give it an Action of its own (Object > Relations > Make Single User)"
    )
    placed_by = ("TRANSFORM_OT_", "VIEW3D_OT_snap_", "OBJECT_OT_align")
    stored_by = ()
    matrix_lacks_difference = True

    def __init__(self, obj: bpy.types.Object) -> None:
        self.animated = self.carrier = obj

    @classmethod
    def has_prefix(cls, prefix: str) -> bool:
        return not prefix

    @classmethod
    def of(cls, carrier: bpy.types.Object) -> ObjectTransform:
        return ExactObjectTransform(carrier) if carrier.rigid_motion.is_exact else cls(carrier)

    @classmethod
    def in_object(cls, obj: bpy.types.Object, prefix: str) -> ObjectTransform:
        return cls.of(obj)

    @classmethod
    def together(cls, users: tuple[Transform, ...]) -> tuple[Transform, ...]:
        if any(user.has_difference_slot for user in users):
            return tuple(ExactObjectTransform(user.carrier) for user in users)
        return users

    @classmethod
    def difference_group(cls, prefix: str) -> str:
        return GROUP

    @property
    def group(self) -> str:
        return GROUP

    def evaluated(self, depsgraph: bpy.types.Depsgraph) -> bpy.types.Object:
        return self.carrier.evaluated_get(depsgraph)

    def differences_for(self, rotation: str) -> dict[int, Channel]:
        return channels_under("delta_", rotation)

    def original_values(self, path: str) -> Sequence[float]:
        """Return what one of its delta properties has without in-betweens."""
        noted, now = self._recorded, getattr(self.carrier, path)[:]
        if not noted:
            return now
        then = getattr(self.motion, ORIGINALS[path][0])[:]
        return [then[i] if _BITS[path, i] & noted else value for i, value in enumerate(now)]

    def original(self) -> np.ndarray:
        values = self.original_values
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

    def is_recorded(self, filled: Iterable[Channel]) -> bool:
        """Return whether the original values of these channels are written down."""
        noted = self._recorded
        return all(_BITS[channel] & noted for channel in filled if channel in _BITS)

    def is_more_noted(self, filled: Iterable[Channel]) -> bool:
        """Return whether the original values of channels other than these are written down."""
        return bool(self._recorded & ~sum(_BITS[channel] for channel in set(filled) if channel in _BITS))

    def note_original(self, filled: Iterable[Channel], *, overwritten: bool = False) -> None:
        """Write the original values of these channels down, which in-betweens are about to take the place of.

        `overwritten`: they have done so already, and it has none.
        """
        noted = self._recorded
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
        """Show an edit of what is written down in all components that in-betweens are not in."""
        noted = self._recorded
        for path in _paths_in(noted):
            now, then = getattr(self.carrier, path)[:], getattr(self.motion, ORIGINALS[path][0])[:]
            values = [now[i] if _BITS[path, i] & noted else value for i, value in enumerate(then)]
            _set_if_other(self.carrier, path, values)

    def show_original(self) -> None:
        """Set the delta transforms to what is written down, for as long as Blender leaves them so."""
        for path in _paths_in(self._recorded):
            _set_if_other(self.carrier, path, self.original_values(path))

    def restore_original(self, filled: Iterable[Channel]) -> None:
        """Give the original values back, but for these channels, which are animated still."""
        noted = self._recorded
        gone = noted & ~sum(_BITS[channel] for channel in set(filled) if channel in _BITS)
        for path in _paths_in(gone):
            now, then = getattr(self.carrier, path)[:], getattr(self.motion, ORIGINALS[path][0])[:]
            setattr(self.carrier, path, [then[i] if _BITS[path, i] & gone else value for i, value in enumerate(now)])
        if gone:
            self._keep(noted & ~gone)

    @property
    def _recorded(self) -> int:
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


class ExactObjectTransform(ObjectTransform):
    """An object that is to be exact between frames. The difference is put on top of it by a constraint, as on bones:
    samples of delta transforms lie on whole frames.
    """

    has_difference_slot = True
    matrix_lacks_difference = False

    @classmethod
    def of(cls, carrier: bpy.types.Object) -> ObjectTransform:
        return cls(carrier)

    def differences_for(self, rotation: str) -> dict[int, Channel]:
        return channels_under("", rotation)

    @property
    def constraint_settings(self) -> dict[str, object]:
        # Without a parent, an object's local axes are those that it has been turned to.
        space = "WORLD" if self.carrier.parent is None else "LOCAL"
        return super().constraint_settings | {"owner_space": space}


def _paths_in(bits: int) -> set[str]:
    """Return the delta transforms that have any of these components."""
    return {path for (path, _), bit in _BITS.items() if bit & bits}


def _set_if_other(owner: bpy.types.bpy_struct, name: str, values: Iterable[float]) -> None:
    """Set a property where it is not that already: to set it costs an update of the object."""
    values = tuple(values)
    if tuple(getattr(owner, name)) != values:
        setattr(owner, name, values)


@cache
def default_of(path: str) -> tuple[float, ...]:
    """Return what a delta transform is where an object has none of its own."""
    return tuple(bpy.types.Object.bl_rna.properties[path].default_array)
