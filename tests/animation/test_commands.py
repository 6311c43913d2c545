"""Blender's commands do the same on an in-between of a mode as on a key with the same pose.

Two objects or two bones have linear keys on frames 1, 21 and 41, with locations in metres and wild rotations. Their
twins have no modes, but linear keys on all eighths of frames with the values of the displayed channels, and their edits
are not followed. Blender must do the same to both. Poses are compared right after a command, after another frame was
shown, and on the surrounding keys.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from rigid_motion import animation
from rigid_motion.animation import modes_of, set_mode
from tests.animation.bones.rigs import HANDS, in_turn, new_rig, own_clipboard, pose_mode, select_bones, select_only
from tests.animation.keyed import Carrier, curves_of, rotation_path, transform_paths
from tests.animation.oracle import assert_near
from tests.animation.scenes import editor, give_own_deltas, key, key_densely, new_object, push_down
from tests.blank import blank

KEYS = (1.0, 21.0, 41.0)
IN_BETWEEN, AWAY = 11, 12

ORDERS = ("QUATERNION", "XYZ", "AXIS_ANGLE")
KINDS = tuple(itertools.product(("OBJECT", "BONE"), ORDERS))
"""The edited type, and its rotation order."""


@dataclass
class Stage:
    """The edited carriers, selected. The first is active; its parent or its rig is rotated."""

    kind: str
    carriers: list[Carrier]
    auto: bool
    """Whether manual edits are keyed."""

    @property
    def first(self) -> Carrier:
        return self.carriers[0]

    @property
    def owner(self) -> bpy.types.Object:
        return self.first.id_data

    def key(self, carrier: Carrier, *paths: str, index: int = -1) -> None:
        """Key channels as Blender's buttons key typed values; by default all channels."""
        for path in (paths or transform_paths(carrier)) if self.auto else ():
            carrier.keyframe_insert(path, index=index)


def set_stage(kind: str, order: str, mode: str, *, auto: bool = False, of_twins: bool | None = None) -> Stage:
    """Set up a new file on the in-between. With `of_twins` given and quaternions, one object has delta transforms."""
    animation.set_enabled(True)
    blank()
    if kind == "OBJECT":
        root = new_object("Root", "XYZ")
        carriers = [new_object(name, order) for name in ("Tool", "Other")]
        carriers[0].parent = root
        root.scale = (1.5, 1.5, 1.5)
        if of_twins is not None and order == "QUATERNION":
            give_own_deltas(carriers[1])
        select_only(*carriers)
    else:
        root = new_rig("Rig", HANDS, order)
        pose_mode(root, "Hand.L", "Hand.R")
        carriers = [root.pose.bones["Hand.L"], root.pose.bones["Hand.R"]]
    root.location, root.rotation_euler = (0.5, -1.0, 0.3), (0.4, -0.2, 0.9)
    for seed, carrier in enumerate(carriers):
        key(carrier, KEYS, seed=seed, scale="even", interpolation="LINEAR")
    set_mode(carriers, mode)
    if of_twins:
        for carrier in carriers:
            key_densely(carrier)
        animation.set_enabled(False)
    go_to(IN_BETWEEN)
    return Stage(kind, carriers, auto)


def go_to(frame: int) -> None:
    bpy.context.scene.frame_set(frame)
    bpy.context.view_layer.update()


def all_seen() -> np.ndarray:
    """Return the world matrices of all objects and bones in the scene and of the 3D Cursor, shape (n, 4, 4)."""
    bpy.context.view_layer.update()
    depsgraph, result = bpy.context.evaluated_depsgraph_get(), [bpy.context.scene.cursor.matrix]
    for obj in sorted(bpy.context.scene.objects, key=lambda obj: obj.name):
        shown = obj.evaluated_get(depsgraph)
        bones = shown.pose.bones if obj.pose else ()
        result += [shown.matrix_world, *(shown.matrix_world @ bone.matrix for bone in bones)]
    return np.array(result)


def channels_seen(carriers: Sequence[Carrier]) -> np.ndarray:
    """Return the channel values of these carriers, as drivers and scripts read them."""
    return np.concatenate(
        [[*carrier.location, *getattr(carrier, rotation_path(carrier)), *carrier.scale] for carrier in carriers]
    )


CURSOR = (0.7, -0.4, 0.3)
QUARTERS = np.arange(KEYS[0], KEYS[-1] + 0.25, 0.25)
PLACED = Matrix.LocRotScale((1.0, 2.0, -0.5), Matrix.Rotation(0.7, 3, (1.0, 2.0, 0.5)), None)

AUTO_KEYS = {"off": (False, True), "what is needed": (True, True), "all": (True, False)}
"""Whether Auto Key is on, and whether it keys only what is needed."""

Command = Callable[[Stage], object]


def target(name: str = "Target") -> bpy.types.Object:
    obj = new_object(name)
    obj.location, obj.rotation_quaternion = (1.0, 1.0, 1.0), (0.9, 0.1, 0.3, 0.2)
    return obj


def visually_keyed(_: Stage) -> None:
    bpy.ops.anim.keyframe_insert_by_name(type="BUILTIN_KSI_VisualLocRotScale")
    # Blender shows world-space keys only on the next frame; a mode shows them at once.
    go_to(IN_BETWEEN)


def flipped(stage: Stage) -> None:
    bpy.ops.pose.copy()
    stage.first.location.x += 1.0
    stage.first.rotation_euler = (0.3, 0.2, 0.1)
    bpy.ops.pose.paste(flipped=True)


def posed_by_action(stage: Stage) -> None:
    """Apply the pose as the pose library does."""
    asset = stage.owner.animation_data.action.copy()
    stage.owner.pose.apply_pose_from_action(asset, evaluation_time=16.0)
    bpy.data.actions.remove(asset)


def typed(stage: Stage, path: str, index: int, value: float) -> None:
    getattr(stage.first, path)[index] = value
    stage.key(stage.first, path, index=index)


def set_matrix(stage: Stage, number: int, name: str, matrix: Matrix) -> None:
    setattr(stage.carriers[number], name, matrix)
    stage.key(stage.carriers[number])


def parented(stage: Stage, parent: bpy.types.Object, *children: bpy.types.Object) -> None:
    select_only(parent, *children)
    bpy.ops.object.parent_set(type="OBJECT", keep_transform=parent not in stage.carriers)


def baked(stage: Stage, **settings: object) -> None:
    """Bake as the button does: Blender fills in the frames, and Pose Mode the type."""
    kind = "OBJECT" if stage.kind == "OBJECT" else "POSE"
    assert bpy.ops.nla.bake(frame_start=1, frame_end=41, bake_types={kind}, **settings) == {"FINISHED"}
    assert len(curves_of(stage.first)["location", 0].keyframe_points) >= 41


def baked_above_strips(stage: Stage) -> None:
    for obj in {carrier.id_data for carrier in stage.carriers}:
        push_down(obj)
    baked(stage)


COMMANDS: dict[str, Command] = {
    "selection to active": lambda _: bpy.ops.view3d.snap_selected_to_active(),
    "move along local axis": lambda _: bpy.ops.transform.translate(value=(0.3, 0.0, 0.0), orient_type="LOCAL"),
    "one coordinate typed": lambda stage: typed(stage, "location", 1, -0.7),
    "keying set LocRot": lambda _: bpy.ops.anim.keyframe_insert_by_name(type="BUILTIN_KSI_LocRot"),
    "keying set Visual LocRotScale": visually_keyed,
    "matrix set": lambda stage: set_matrix(stage, 0, "matrix_world" if stage.kind == "OBJECT" else "matrix", PLACED),
    "matrix_basis copied": lambda stage: set_matrix(stage, 1, "matrix_basis", stage.first.matrix_basis),
    "bake": baked,
    "bake the first alone": lambda stage: [select(stage, 0), baked(stage, use_current_action=True)],
    "bake above strips": baked_above_strips,
}
OF_OBJECTS: dict[str, Command] = {
    "Alt R": lambda _: bpy.ops.object.rotation_clear(),
    "parent of others": lambda stage: parented(stage, stage.first, target()),
    "duplicate": lambda _: bpy.ops.object.duplicate(),
    "animation to deltas": lambda _: bpy.ops.object.anim_transforms_to_deltas(),
}
OF_BONES: dict[str, Command] = {
    "Alt G": lambda _: bpy.ops.pose.loc_clear(),
    "pose pasted flipped": flipped,
    "pose of an Action": posed_by_action,
    "breakdowner": lambda _: bpy.ops.pose.breakdown(factor=0.3, prev_frame=1, next_frame=21),
}
"""Commands of each kind: those that use displayed poses, channels or keys."""

CASES = [*itertools.product(["OBJECT"], (*COMMANDS, *OF_OBJECTS)), *itertools.product(["BONE"], (*COMMANDS, *OF_BONES))]


def left_by(command: str, kind: str, order: str, auto: str, *, of_twins: bool) -> list[np.ndarray]:
    """Return the matrices after a command: at once, after another frame was shown, and on the keys."""
    is_on, only_needed = AUTO_KEYS[auto]
    stage = set_stage(kind, order, "dq_sclerp", auto=is_on, of_twins=of_twins)
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = is_on
    bpy.context.preferences.edit.use_auto_keyframe_insert_needed = only_needed
    bpy.context.scene.cursor.location = CURSOR
    with editor("VIEW_3D"):
        (COMMANDS | (OF_OBJECTS if kind == "OBJECT" else OF_BONES))[command](stage)
    result = [all_seen(), channels_seen(stage.carriers)]
    go_to(AWAY)
    for frame in (IN_BETWEEN, *map(int, KEYS)):
        go_to(frame)
        result += [all_seen(), channels_seen(stage.carriers)]
    return result


@pytest.mark.parametrize(("case", "way"), in_turn(CASES, [*zip(ORDERS, AUTO_KEYS, strict=True)]))
def test_a_command_does_what_it_does_on_a_key(live_file, tmp_path, case, way):
    (kind, command), (order, auto) = case, way
    with own_clipboard(tmp_path):
        shown, expected = (left_by(command, kind, order, auto, of_twins=of_twins) for of_twins in (False, True))
    for when, (one, other) in enumerate(zip(shown, expected, strict=True)):
        assert_near(one, other, f"{command} at {when}")


def test_what_is_made_deltas_stays_where_it_is_seen(live_file):
    """On the next frame the transform applies twice, as in Blender."""
    stage, before = set_stage("OBJECT", "XYZ", "dq_sclerp"), all_seen()
    bpy.ops.object.transforms_to_deltas(mode="ALL")
    np.testing.assert_allclose(all_seen(), before, atol=1e-5)
    assert tuple(stage.first.location) == (0.0, 0.0, 0.0)


# Keys copied from in-betweens or between transforms


@pytest.mark.parametrize("kind", KINDS[3:], ids="-".join)
def test_a_propagated_pose_is_the_one_that_is_seen(live_file, kind):
    stage = set_stage(*kind, "dq_sclerp")
    before = channels_seen(stage.carriers)
    bpy.ops.pose.propagate(mode="NEXT_KEY")
    go_to(int(KEYS[1]))
    np.testing.assert_allclose(channels_seen(stage.carriers), before, atol=1e-5)


def select(stage: Stage, number: int) -> None:
    if stage.kind == "OBJECT":
        select_only(stage.carriers[number])
    else:
        select_bones(stage.owner, stage.carriers[number].name)


PASTED = itertools.product(("DOPESHEET_EDITOR", "GRAPH_EDITOR"), (0, 60), (("pga_lerp",) * 2, ("dq_sclerp", "BLENDER")))
"""The editor, the offset in frames, and the modes of both segments."""


@pytest.mark.parametrize(("pasted", "kind"), in_turn(PASTED, KINDS))
def test_copied_keys_move_what_they_are_pasted_on_as_they_moved_the_first(live_file, pasted, kind):
    how, later, modes = pasted
    stage = set_stage(*kind, "BLENDER")
    first, other = stage.carriers
    for mode, frame in zip(modes, KEYS, strict=False):
        set_mode(first, mode, [frame])
    curves = curves_of(first).items()
    expected = {name: [curve.evaluate(frame) for frame in QUARTERS] for name, curve in curves}
    space = bpy.ops.action if how == "DOPESHEET_EDITOR" else bpy.ops.graph
    with editor(how, "DOPESHEET" if how == "DOPESHEET_EDITOR" else "FCURVES") as shown:
        shown.dopesheet.show_only_selected = True
        select(stage, 0)
        space.select_all(action="SELECT")
        space.copy()
        select(stage, 1)
        go_to(int(KEYS[0]) + later)
        bpy.ops.anim.channels_select_all(action="SELECT")
        space.paste(offset="START", merge="OVER_ALL" if not later else "MIX")
    for name, curve in curves_of(other).items():
        shown = [curve.evaluate(frame) for frame in QUARTERS + later]
        np.testing.assert_allclose(shown, expected.pop(name), atol=1e-5)
    assert not expected
    assert modes_of(other, np.array(KEYS[:2]) + later) == list(modes)
    assert any(len(fcurve.modifiers) for fcurve in curves_of(other).values())
