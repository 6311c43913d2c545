"""Typed access to Blender's API: properties, base classes, and accessors for values that its type stubs leave open."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar, cast

import bpy

T = TypeVar("T")
Class = TypeVar("Class", bound=type)
Handler = TypeVar("Handler", bound=Callable[..., object])

Returned = set[Literal["RUNNING_MODAL", "CANCELLED", "FINISHED", "PASS_THROUGH", "INTERFACE"]]
"""The return value of an operator's `execute`, `invoke` and `modal`."""

BoolProperty: Any = bpy.props.BoolProperty
CollectionProperty: Any = bpy.props.CollectionProperty
EnumProperty: Any = bpy.props.EnumProperty
FloatProperty: Any = bpy.props.FloatProperty
FloatVectorProperty: Any = bpy.props.FloatVectorProperty
IntProperty: Any = bpy.props.IntProperty
PointerProperty: Any = bpy.props.PointerProperty
StringProperty: Any = bpy.props.StringProperty

persistent: Callable[[Handler], Handler] = bpy.app.handlers.persistent


def with_properties(cls: Class) -> Class:
    """Let a class declare Blender properties with the types of their values: `count: int = IntProperty()`.

    Blender itself expects properties as annotations: `count: IntProperty()`.
    """
    # Blender does not look for properties in bases that are operators themselves.
    of_bases = [item for base in cls.__mro__[:0:-1] for item in vars(base).get("__annotations__", {}).items()]
    for name, value in (*of_bases, *vars(cls).items()):
        if isinstance(value, bpy.props._PropertyDeferred):
            cls.__annotations__[name] = value
            if name in vars(cls):
                delattr(cls, name)
    return cls


class Operator(bpy.types.Operator):
    """An operator whose `layout` is never None, as in `draw`; by default one undo step."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 - Blender reads it
    layout: bpy.types.UILayout


class Panel(bpy.types.Panel):
    """A panel whose `layout` is never None, as in `draw`."""

    layout: bpy.types.UILayout


class Menu(bpy.types.Menu):
    """A menu whose `layout` is never None, as in `draw`."""

    layout: bpy.types.UILayout


def existing(value: T | None) -> T:
    """Return a value that may be None according to Blender's types, but is never None here.

    Raises
    ------
    TypeError
        If the value is None after all.
    """
    if value is None:
        raise TypeError("Blender has none")
    return value


def scene() -> bpy.types.Scene:
    """Return the scene of the context."""
    return existing(bpy.context.scene)


def view_layer() -> bpy.types.ViewLayer:
    """Return the view layer of the context."""
    return existing(bpy.context.view_layer)


def pose_bones(rig: bpy.types.Object) -> bpy.types.bpy_prop_collection[bpy.types.PoseBone]:
    """Return the pose bones of an armature object."""
    return existing(rig.pose).bones


def armature(rig: bpy.types.Object) -> bpy.types.Armature:
    """Return the armature data of an armature object."""
    return cast(bpy.types.Armature, rig.data)


def action_of(obj: bpy.types.Object) -> bpy.types.Action:
    """Return the Action of an object that has one."""
    return existing(existing(obj.animation_data).action)


def channelbag_in(strip: bpy.types.ActionStrip, slot: bpy.types.ActionSlot) -> bpy.types.ActionChannelbag:
    """Return the channelbag of a slot in a keyframe strip; create a missing one."""
    return existing(cast(bpy.types.ActionKeyframeStrip, strip).channelbag(slot, ensure=True))


def enum_value(cls: type[bpy.types.bpy_struct], name: str, item: str) -> int:
    """Return the integer value of an item of an enum property of a class."""
    return cast(bpy.types.EnumProperty, cls.bl_rna.properties[name]).enum_items[item].value


def original_uid(update: bpy.types.DepsgraphUpdate) -> int:
    """Return the session id of the original data-block of a depsgraph update."""
    return existing(existing(update.id).original).session_uid


def assign(obj: bpy.types.Object, action: bpy.types.Action) -> None:
    """Assign an Action to an object, with the Action's first slot."""
    data = existing(obj.animation_data_create())
    data.action = action
    data.action_slot = action.slots[0]
