"""Operators of Blender and of Rigify that take a pose from the channels, with the pose that is seen in these.

Each of Blender's has its key and menus, and steps in for it only where a selected bone is on an in-between: an operator
whose poll fails leaves its key to the next one.

Rigify's *Switch Parent* keeps a control where it is seen. What it is to be called with stands in the script of the rig
alone, as

    props = group2.operator('pose.rigify_switch_parent_cgj0du4c43f170b6', text='IK Parent', icon='DOWNARROW_HLT')
    props.bone = 'hand_ik.L'
    props.prop_bone = 'upper_arm_parent.L'
    props.prop_id = 'IK_parent'
    props.parent_names = '["None", "Root", "Torso"]'
    props.locks = (False, False, False)
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import lru_cache
from textwrap import dedent
from types import SimpleNamespace
from typing import ClassVar, NamedTuple

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import EnumProperty

from ..animation.live.follower import show_seen_in_channels
from ..animation.queries.polls import with_in_betweens
from ..animation.transforms import Refused, Transform, transform_of
from ..animation.writers.table import shown_components
from .targets import selected

ON_NO_IN_BETWEEN = n_("No selected bone is on an in-between: Blender's own operator does the same")

SAME = 1e-6
"""Components that differ by less are the same."""

BUTTON = re.compile(
    r"^[\x20\t]*props\x20=\x20.+\('pose\.rigify_switch_parent_(?!bake_).+\n(?:[\x20\t]*props\.\w+\x20=\x20.+\n){5}",
    re.MULTILINE,
)

NO_SWITCH = n_("No selected bone has both a parent that Rigify can switch and in-betweens of a mode")


def is_elsewhere(transform: Transform) -> bool:
    """Return whether something is seen elsewhere than its channels have it."""
    try:
        seen = shown_components(transform)
    except Refused:
        return False
    return seen is not None and not np.allclose(seen, transform.components(), rtol=SAME, atol=SAME)


class _OfSeenPose:
    """An operator of Blender's that reads the channels of the selected bones."""

    bl_options: ClassVar[set[str]] = {"REGISTER"}
    blender: ClassVar[Callable[[str], set[str]]]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode == "POSE" and any(map(is_elsewhere, map(transform_of, selected(context)))):
            return True
        cls.poll_message_set(tip_(ON_NO_IN_BETWEEN))
        return False

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        return self._call(context, "INVOKE_DEFAULT")

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self._call(context, "EXEC_DEFAULT")

    def _call(self, context: bpy.types.Context, how: str) -> set[str]:
        show_seen_in_channels(map(transform_of, selected(context)))
        # A dialog that asks for more goes on by itself.
        return self.blender(how) & {"CANCELLED"} or {"FINISHED"}


class RIGID_MOTION_OT_copy_pose(_OfSeenPose, bpy.types.Operator):
    bl_idname = "rigid_motion.copy_pose"
    bl_label = "Copy Pose on Screen"
    bl_description = (
        "Copy the pose of the selected bones as you see it, with the in-betweens. "
        "Until the frame changes their channels have it, too"
    )

    blender = bpy.ops.pose.copy


class RIGID_MOTION_OT_create_pose_asset(_OfSeenPose, bpy.types.Operator):
    bl_idname = "rigid_motion.create_pose_asset"
    bl_label = "Create Pose Asset on Screen"
    bl_description = (
        "Create a pose asset of the selected bones as you see them, with the in-betweens. "
        "Until the frame changes their channels have that pose, too"
    )

    blender = bpy.ops.poselib.create_pose_asset


class Switch(NamedTuple):
    """A button of Rigify's that switches a parent: its label, and how its operator is called."""

    label: str
    operator: str
    bone: str
    prop_bone: str
    prop_id: str
    parent_names: str
    locks: tuple[bool, ...]

    @property
    def parents(self) -> list[str]:
        return json.loads(self.parent_names)


@lru_cache(maxsize=8)
def switches_in(script: str) -> tuple[Switch, ...]:
    """Return the buttons in the script of a rig, without those that are written in another way than expected."""
    result = []
    for button in BUTTON.findall(script):
        with suppress(SyntaxError, ValueError, TypeError, AttributeError, StopIteration, RecursionError, MemoryError):
            first, *lines = ast.parse(dedent(button)).body
            settings = {line.targets[0].attr: ast.literal_eval(line.value) for line in lines}
            label = next(ast.literal_eval(keyword.value) for keyword in first.value.keywords if keyword.arg == "text")
            operator = ast.literal_eval(first.value.args[0]).removeprefix("pose.")
            switch = Switch(label, operator, **settings)
            if all(isinstance(text, str) for text in (*switch[:-1], *switch.parents)) and len(switch.locks) == 3:
                result.append(switch)
    return tuple(result)


def switches_of(context: bpy.types.Context) -> Iterator[Switch]:
    """Yield the parents that can be switched of selected bones with in-betweens of a mode, in the active rig."""
    rig = context.active_object
    script = rig.get("rig_ui") if rig is not None and context.mode == "POSE" else None
    if not isinstance(script, bpy.types.Text):
        return
    bones, selected = rig.pose.bones, {bone.name for bone in context.selected_pose_bones or () if bone.id_data == rig}
    for switch in switches_in(script.as_string()):
        there = switch.bone in bones and switch.prop_bone in bones and switch.prop_id in bones[switch.prop_bone]
        if there and selected & {switch.bone, switch.prop_bone}:
            yield from (switch for _ in with_in_betweens((transform_of(bones[switch.bone]),)))


_items: list[tuple[str, str, str, str, int]] = []
"""Blender keeps the texts of items no longer than we do."""


def _parents(_operator: object, context: bpy.types.Context | None) -> list[tuple[str, str, str, str, int]]:
    _items.clear()
    for switch in () if context is None else switches_of(context):
        _items.append(("", switch.label, "", "NONE", len(_items)))
        present = context.active_object.pose.bones[switch.prop_bone][switch.prop_id]
        for number, name in enumerate(switch.parents):
            icon = "CHECKMARK" if number == present else "BLANK1"
            _items.append(
                (json.dumps((switch.bone, switch.prop_bone, switch.prop_id, number)), name, "", icon, len(_items))
            )
    return _items


class RIGID_MOTION_OT_switch_parent(bpy.types.Operator):
    bl_idname = "rigid_motion.switch_parent"
    bl_label = "Switch Parent on Screen"
    bl_description = (
        "Switch the parent of a control of Rigify, which stays where you see it. "
        "Rigify's own operator takes Blender's in-between"
    )
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    parent: EnumProperty(
        name="New Parent", description="What the control is to hang on", items=_parents, options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if any(True for _ in switches_of(context)):
            return True
        cls.poll_message_set(tip_(NO_SWITCH))
        return False

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if self.properties.is_property_set("parent"):
            return self.execute(context)

        def draw(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
            menu.layout.operator_enum(self.bl_idname, "parent")

        context.window_manager.popup_menu(draw, title=self.bl_label)
        return {"INTERFACE"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self.parent:
            return {"CANCELLED"}
        rig, (*names, number) = context.active_object, json.loads(self.parent)
        switch = next(item for item in switches_of(context) if [item.bone, item.prop_bone, item.prop_id] == names)
        operator = bpy.types.Operator.bl_rna_get_subclass_py(f"POSE_OT_{switch.operator}")
        if operator is None:
            text = rpt_("{name} has no operator of Rigify's: run its script {script} in the Text Editor first")
            self.report({"ERROR"}, text.format(name=rig.name, script=rig["rig_ui"].name))
            return {"CANCELLED"}
        settings = switch._asdict()
        del settings["label"], settings["operator"]
        # Before it has read the names of the parents, as where it is invoked, it takes none of them.
        operator.init_invoke(SimpleNamespace(**settings, report=self.report), context)
        show_seen_in_channels([transform_of(rig.pose.bones[switch.bone])])
        try:
            return getattr(bpy.ops.pose, switch.operator)("EXEC_DEFAULT", selected=str(number), **settings)
        except RuntimeError as error:
            self.report({"ERROR"}, str(error).strip())
            return {"FINISHED"}


def draw_parent_switch(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a button with the parents, where there are any."""
    if RIGID_MOTION_OT_switch_parent.poll(context):
        layout.operator_menu_enum(RIGID_MOTION_OT_switch_parent.bl_idname, "parent", icon="DOWNARROW_HLT")


CLASSES = (RIGID_MOTION_OT_copy_pose, RIGID_MOTION_OT_create_pose_asset, RIGID_MOTION_OT_switch_parent)
