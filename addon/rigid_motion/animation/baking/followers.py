"""Which bones of a rig follow constraints or drivers: their channels do not say where they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy

from ..actions.slots import slots_of
from ..transforms import WIDTHS, shows_differences, split_path

MOVING = {*WIDTHS, "rotation_axis_angle", "rotation_mode"}
"""Properties of bones that a driver moves them by."""

CHAINS = ("IK", "SPLINE_IK")
"""Constraints that move bones above the one that has them."""


@dataclass(frozen=True)
class NotPromised:
    """The bones that a tolerance is not promised for, by their names."""

    followers: tuple[str, ...] = ()
    """Bones that follow constraints or drivers."""

    below: tuple[str, ...] = ()
    """Bones that hang on these."""

    def __bool__(self) -> bool:
        return bool(self.followers)

    def __contains__(self, name: str) -> bool:
        return name in self.followers or name in self.below


ALL_PROMISED = NotPromised()


def not_promised(rig: bpy.types.Object) -> NotPromised:
    """Return the bones of a rig whose motion is not that of their channels, and of those above them, alone."""
    followers = {*_constrained(rig), *_driven(rig)}
    bones = rig.pose.bones
    below = {bone.name for bone in bones if any(parent.name in followers for parent in bone.parent_recursive)}
    ordered = [bone.name for bone in bones]
    return NotPromised(
        tuple(name for name in ordered if name in followers),
        tuple(name for name in ordered if name in below - followers),
    )


def _constrained(rig: bpy.types.Object) -> Iterator[str]:
    animated = _animated_paths(rig)
    for bone in rig.pose.bones:
        for constraint in bone.constraints:
            if shows_differences(constraint):
                continue
            path = constraint.path_from_id()
            is_switched = any(f"{path}.{name}" in animated for name in ("influence", "mute", "enabled"))
            if is_switched or (not constraint.mute and constraint.influence > 0.0):
                yield bone.name
                if constraint.type in CHAINS:
                    # The bone itself is the last of a chain, unless that is to reach for its head.
                    count = constraint.chain_count - getattr(constraint, "use_tail", True)
                    above = bone.parent_recursive[:count] if constraint.chain_count else bone.parent_recursive
                    yield from (parent.name for parent in above)


def _driven(rig: bpy.types.Object) -> Iterator[str]:
    names = {f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].': bone.name for bone in rig.pose.bones}
    for driver in _drivers(rig):
        prefix, prop = split_path(driver.data_path)
        if prefix in names and prop in MOVING and not driver.mute:
            yield names[prefix]


def _drivers(rig: bpy.types.Object) -> Iterator[bpy.types.FCurve]:
    data = rig.animation_data
    yield from data.drivers if data is not None else ()


def _animated_paths(rig: bpy.types.Object) -> set[str]:
    """Return the data paths that drivers or F-curves of the rig set."""
    bags = (slot.channelbag for slot in slots_of([rig]))
    curves = {fcurve.data_path for bag in bags if bag is not None for fcurve in bag.fcurves}
    return curves | {driver.data_path for driver in _drivers(rig)}
