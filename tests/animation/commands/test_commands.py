"""Blender's commands on an in-between of a mode do what they do on a key with the same pose.

What is seen is compared right after a command, after another frame was shown, and on the keys around.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from tests.animation.bones.rigs import in_turn, own_clipboard
from tests.animation.commands.stage import (
    AWAY,
    IN_BETWEEN,
    KEYS,
    KINDS,
    Stage,
    all_seen,
    channels_seen,
    go_to,
    in_view,
    make_twins,
    set_stage,
)
from tests.animation.scenes import new_object

CURSOR = (0.7, -0.4, 0.3)
PLACED = Matrix.LocRotScale((1.0, 2.0, -0.5), Matrix.Rotation(0.7, 3, (1.0, 2.0, 0.5)), None)

AUTO_KEYS = {"off": (False, True), "what is needed": (True, True), "all": (True, False)}
"""Whether Auto Key is on, and whether it keys only what is needed."""

Command = Callable[[Stage], object]


def visual(stage: Stage) -> None:
    """Apply what a constraint makes of it."""
    target = new_object("Target")
    target.location, target.rotation_euler = (1.0, 1.0, 1.0), (0.0, 0.3, 0.6)
    constraint = stage.first.constraints.new("COPY_LOCATION")
    constraint.target, constraint.use_offset = target, True
    bpy.context.view_layer.update()
    stage.operator("visual_transform_apply")()
    stage.first.constraints.remove(constraint)
    for path in ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale"):
        stage.by_hand(stage.first, path)


def visually_keyed(_: Stage) -> None:
    bpy.ops.anim.keyframe_insert_by_name(type="BUILTIN_KSI_VisualLocRotScale")
    # Blender shows on the next frame what it keyed, which is in the world's space; where a mode is, it is seen at once.
    go_to(IN_BETWEEN)


def child_of(stage: Stage) -> None:
    target = new_object("Target")
    target.location, target.rotation_quaternion = (1.0, 1.0, 1.0), (0.9, 0.1, 0.3, 0.2)
    constraint = stage.first.constraints.new("CHILD_OF")
    constraint.target = target
    bpy.context.view_layer.update()
    owner = {"object": stage.owner, "active_object": stage.owner}
    if stage.kind == "BONE":
        owner |= {"active_pose_bone": stage.first, "pose_bone": stage.first}
    with bpy.context.temp_override(**owner, constraint=constraint):
        bpy.ops.constraint.apply(constraint=constraint.name, owner=stage.kind)
    assert not stage.first.constraints


def pasted(stage: Stage, *, flipped: bool) -> None:
    bpy.ops.pose.copy()
    stage.first.location.x += 1.0
    stage.first.rotation_euler = (0.3, 0.2, 0.1)
    bpy.ops.pose.paste(flipped=flipped)


def not_keyed(stage: Stage) -> None:
    stage.first.location.x += 1.0
    bpy.context.view_layer.update()
    bpy.ops.pose.user_transforms_clear()


def posed_by_action(stage: Stage) -> None:
    """As the pose library does it."""
    asset = stage.owner.animation_data.action.copy()
    stage.owner.pose.apply_pose_from_action(asset, evaluation_time=16.0)
    bpy.data.actions.remove(asset)


def typed(stage: Stage, path: str, index: int, value: float) -> None:
    getattr(stage.first, path)[index] = value
    stage.by_hand(stage.first, path, index)


def placed(stage: Stage) -> None:
    if stage.kind == "OBJECT":
        stage.first.matrix_world = PLACED
    else:
        stage.first.matrix = PLACED
    for path in ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale"):
        stage.by_hand(stage.first, path)


def copied(stage: Stage) -> None:
    other = stage.carriers[1]
    other.matrix_basis = stage.first.matrix_basis
    for path in ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale"):
        stage.by_hand(other, path)


def driven(stage: Stage) -> None:
    reader = new_object("Reader")
    driver = reader.driver_add("location", 2).driver
    variable = driver.variables.new()
    variable.name, variable.targets[0].id = "x", stage.owner
    of_bone = "" if stage.kind == "OBJECT" else f"{stage.first.path_from_id()}."
    variable.targets[0].data_path = f"{of_bone}location[0]"
    driver.expression = "2.0 * x"
    bpy.context.view_layer.update()


def parented(stage: Stage) -> None:
    parent = new_object("Parent")
    parent.location, parent.rotation_quaternion = (1.0, 1.0, 1.0), (0.9, 0.1, 0.3, 0.2)
    parent.select_set(True)
    bpy.context.view_layer.objects.active = parent
    bpy.context.view_layer.update()
    bpy.ops.object.parent_set(type="OBJECT", keep_transform=True)


def parent_of_others(stage: Stage) -> None:
    child = new_object("Child")
    child.location = (1.0, 1.0, 1.0)
    child.select_set(True)
    stage.carriers[1].select_set(False)
    bpy.context.view_layer.objects.active = stage.first
    bpy.ops.object.parent_set(type="OBJECT")


def turned(stage: Stage, pivot: str) -> None:
    bpy.context.scene.tool_settings.transform_pivot_point = pivot
    bpy.ops.transform.rotate(value=0.6, orient_axis="Z", orient_type="GLOBAL")


COMMANDS: dict[str, Command] = {
    "selection to cursor": lambda _: bpy.ops.view3d.snap_selected_to_cursor(use_offset=False),
    "selection to cursor, keeping offset": lambda _: bpy.ops.view3d.snap_selected_to_cursor(use_offset=True),
    "selection to grid": lambda _: bpy.ops.view3d.snap_selected_to_grid(),
    "selection to active": lambda _: bpy.ops.view3d.snap_selected_to_active(),
    "cursor to selected": lambda _: bpy.ops.view3d.snap_cursor_to_selected(),
    "move": lambda _: bpy.ops.transform.translate(value=(0.3, -0.2, 0.5)),
    "move along local axis": lambda _: bpy.ops.transform.translate(value=(0.3, 0.0, 0.0), orient_type="LOCAL"),
    "rotate about the cursor": lambda stage: turned(stage, "CURSOR"),
    "rotate about the median": lambda stage: turned(stage, "MEDIAN_POINT"),
    "rotate each": lambda stage: turned(stage, "INDIVIDUAL_ORIGINS"),
    "resize": lambda _: bpy.ops.transform.resize(value=(1.5, 1.5, 1.5)),
    "mirror": lambda _: bpy.ops.transform.mirror(constraint_axis=(True, False, False)),
    "one coordinate typed": lambda stage: typed(stage, "location", 1, -0.7),
    "one quaternion component typed": lambda stage: typed(stage, "rotation_quaternion", 2, 0.4),
    "one angle typed": lambda stage: typed(stage, "rotation_euler", 2, 0.4),
    "a size typed": lambda stage: typed(stage, "scale", 0, 1.4),
    "keying set Location": lambda _: bpy.ops.anim.keyframe_insert_by_name(type="Location"),
    "keying set LocRot": lambda _: bpy.ops.anim.keyframe_insert_by_name(type="BUILTIN_KSI_LocRot"),
    "keying set Visual LocRotScale": visually_keyed,
    "matrix set": placed,
    "matrix_basis copied": copied,
    "visual transform": visual,
    "Child Of applied": child_of,
    "driver": driven,
}
OF_OBJECTS: dict[str, Command] = {
    "Alt G": lambda _: bpy.ops.object.location_clear(),
    "Alt R": lambda _: bpy.ops.object.rotation_clear(),
    "Alt S": lambda _: bpy.ops.object.scale_clear(),
    "parent set": parented,
    "parent of others": parent_of_others,
    "parent clear": lambda _: bpy.ops.object.parent_clear(type="CLEAR_KEEP_TRANSFORM"),
    "align": lambda _: bpy.ops.object.align(align_mode="OPT_2", relative_to="OPT_3", align_axis={"X", "Z"}),
    "duplicate": lambda _: bpy.ops.object.duplicate(),
    "animation to deltas": lambda _: bpy.ops.object.anim_transforms_to_deltas(),
}
OF_BONES: dict[str, Command] = {
    "Alt G": lambda _: bpy.ops.pose.loc_clear(),
    "Alt R": lambda _: bpy.ops.pose.rot_clear(),
    "Alt S": lambda _: bpy.ops.pose.scale_clear(),
    "clear all": lambda _: bpy.ops.pose.transforms_clear(),
    "pose copied and pasted": lambda stage: pasted(stage, flipped=False),
    "pose pasted flipped": lambda stage: pasted(stage, flipped=True),
    "pose of an Action": posed_by_action,
    "clear what is not keyed": not_keyed,
    "breakdowner": lambda _: bpy.ops.pose.breakdown(factor=0.3, prev_frame=1, next_frame=21),
    "push": lambda _: bpy.ops.pose.push(factor=0.6, prev_frame=1, next_frame=21),
    "relax": lambda _: bpy.ops.pose.relax(factor=0.6, prev_frame=1, next_frame=21),
    "blend to neighbour": lambda _: bpy.ops.pose.blend_to_neighbor(factor=0.7, prev_frame=1, next_frame=21),
    "blend with rest": lambda _: bpy.ops.pose.blend_with_rest(factor=0.4, prev_frame=1, next_frame=21),
}
CASES = [
    (command, kind, order)
    for kind, order in KINDS
    for command in (*COMMANDS, *(OF_OBJECTS if kind == "OBJECT" else OF_BONES))
    if not (("quaternion" in command and order != "QUATERNION") or ("angle" in command and order != "XYZ"))
]


def left_by(command: str, kind: str, order: str, auto: str, *, of_twins: bool) -> list[np.ndarray]:
    """What a command leaves on the in-between: at once, after another frame was shown, and on the keys."""
    is_on, only_needed = AUTO_KEYS[auto]
    stage = set_stage(kind, order, "dq_sclerp", auto=is_on)
    if of_twins:
        make_twins(stage.carriers)
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = is_on
    bpy.context.preferences.edit.use_auto_keyframe_insert_needed = only_needed
    bpy.context.scene.cursor.location = CURSOR
    with in_view():
        (COMMANDS | (OF_OBJECTS if kind == "OBJECT" else OF_BONES))[command](stage)
    result = [all_seen(), channels_seen(stage.carriers)]
    for frame in (AWAY, IN_BETWEEN, *map(int, KEYS)):
        go_to(frame)
        if frame != AWAY:
            result += [all_seen(), channels_seen(stage.carriers)]
    return result


@pytest.mark.parametrize(("case", "auto"), in_turn(CASES, list(AUTO_KEYS)))
def test_a_command_does_what_it_does_on_a_key(live_file, tmp_path, case, auto):
    command, kind, order = case
    with own_clipboard(tmp_path):
        expected = left_by(command, kind, order, auto, of_twins=True)
        shown = left_by(command, kind, order, auto, of_twins=False)
    for when, (one, other) in enumerate(zip(shown, expected, strict=True)):
        off = np.abs(one - other).max()
        assert off < 1e-5 * max(1.0, np.abs(other).max()), f"off by {off} at {when}"


def test_what_is_made_deltas_stays_where_it_is_seen(live_file):
    """Until another frame is shown: then it is moved twice, in Blender, too."""
    stage = set_stage("OBJECT", "XYZ", "dq_sclerp")
    before = all_seen()
    with in_view():
        bpy.ops.object.transforms_to_deltas(mode="ALL")
    np.testing.assert_allclose(all_seen(), before, atol=1e-5)
    assert tuple(stage.first.location) == (0.0, 0.0, 0.0)
