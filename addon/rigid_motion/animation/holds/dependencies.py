"""Dependency cycles: whether a holder already depends on the object it is about to hold."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import cast

import bpy

from ..transforms import Transform, bone_name, split_path

Node = tuple[bpy.types.Object, str]
"""An object, and the name of one of its bones; "" for the object itself."""


Chain = tuple[bpy.types.Constraint, set[str]]
"""A constraint that moves a chain of bones, and the names of the bones in the chain above its own."""


def node_of(user: Transform) -> Node:
    """Return the node of a transform."""
    return user.animated, user.carrier.name if user.is_part else ""


def follows(node: Node, other: Node) -> bool:
    """Return whether the pose of a node depends on that of another one, or may do so at another time."""
    known, open_nodes, chains = {node}, [node], cache(_chains)
    while open_nodes:
        for leader in _leaders(*open_nodes.pop(), chains):
            if leader == other:
                return True
            if leader not in known:
                known.add(leader)
                open_nodes.append(leader)
    return False


def _leaders(obj: bpy.types.Object, bone: str, chains: Callable[[bpy.types.Object], list[Chain]]) -> Iterator[Node]:
    """Yield the direct dependencies of an object or bone: parents, constraints, IK chains and drivers."""
    pose_bone = obj.pose.bones.get(bone) if bone and obj.pose is not None else None
    if pose_bone is None:
        if obj.parent is not None:
            yield obj.parent, obj.parent_bone if obj.parent_type == "BONE" else ""
        constraints = list(obj.constraints)
    else:
        yield obj, ""
        if pose_bone.parent is not None:
            yield obj, pose_bone.parent.name
        constraints = [*pose_bone.constraints, *(constraint for constraint, above in chains(obj) if bone in above)]
    for constraint in constraints:
        yield from _targets(constraint)
    data = obj.animation_data
    for driver in () if data is None else data.drivers:
        if bone_name(split_path(driver.data_path)[0]) in ("", bone):
            for variable in cast(bpy.types.Driver, driver.driver).variables:
                for target in variable.targets:
                    if isinstance(target.id, bpy.types.Object):
                        yield target.id, target.bone_target or bone_name(split_path(target.data_path)[0])


def _chains(rig: bpy.types.Object) -> list[Chain]:
    """Return all constraint chains of a rig."""
    result = []
    for bone in () if rig.pose is None else rig.pose.bones:
        for constraint in bone.constraints:
            count = getattr(constraint, "chain_count", None)
            if count is not None:
                above = bone.parent_recursive
                result.append((constraint, {parent.name for parent in (above[:count] if count else above)}))
    return result


def _targets(constraint: bpy.types.Constraint) -> Iterator[Node]:
    """Yield the targets of a constraint: all its objects, with the bones named for them."""
    if not constraint.mute:
        for item in (constraint, *getattr(constraint, "targets", ())):
            for prop in item.bl_rna.properties:
                value = getattr(item, prop.identifier) if prop.type == "POINTER" else None
                if isinstance(value, bpy.types.Object):
                    # space_object has space_subtarget, pole_target pole_subtarget, target subtarget.
                    name = prop.identifier.removesuffix("target").removesuffix("object") + "subtarget"
                    yield value, getattr(item, name, "")
