"""Files that leave the session: a Blender without the extension plays them alike, and loses nothing in saving them.

That Blender is another process at factory settings, in which nothing of this program is imported.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, problem_of, refresh, set_mode
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones import rigs
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses, names_of
from tests.animation.bones.rigs import INHERIT_SCALES, PLAYED, key_all, moving_rig, new_rig
from tests.animation.bones.test_bone_files import save
from tests.animation.farm import SAVE, on_a_farm, played_on_a_farm
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import Own, assert_shown, expected_worlds, shown_worlds
from tests.animation.scenes import FRAMES, give_own_deltas, key, linked, new_object, own_deltas
from tests.blank import blank
from tests.thoroughness import sample

ORDERS = ("QUATERNION", "XYZ", "ZYX", "AXIS_ANGLE")
ANY_TIME = np.arange(-2.0, 44.0, 0.625)


def assert_same(worlds: Sequence[np.ndarray], expected: Sequence[np.ndarray], tolerance: float = 1e-6) -> None:
    """To this share of the size."""
    for one, other in zip(worlds, expected, strict=True):
        assert np.abs(one - other).max() <= tolerance * max(1.0, np.abs(other).max())


def every_mode_and_kind() -> tuple[list[bpy.types.Object], dict[str, Own]]:
    """An object for each mode, rotation order and kind of trouble, and the delta transforms of their own."""
    objects, owns = [], {}
    parent = key(new_object("Arm", "XYZ"), (1.0, 30.0), seed=99)
    for seed, (mode, order) in enumerate((mode, order) for mode in KEYFRAME_MODES for order in ORDERS):
        obj = new_object(f"{mode} {order}", order)
        scale = (None, "even", "uneven")[seed % 3]
        if seed % 2 and order != "AXIS_ANGLE":
            owns[obj.name] = give_own_deltas(obj, seed)
        if seed % 5 in (1, 2):
            obj.parent, obj.matrix_parent_inverse = parent, np.eye(4) + 0.1 * np.eye(4, k=3)
        key(obj, seed=seed, scale=scale, interpolation=("BEZIER", "LINEAR", "BOUNCE", "CONSTANT")[seed % 4])
        set_mode(obj, mode, None if seed % 4 < 2 else FRAMES[:2])
        objects.append(obj)
    set_mode(parent, "dq_sclerp")
    return [*objects, parent], owns


def named(rig: bpy.types.Object, poses: np.ndarray) -> dict[str, np.ndarray]:
    """Matrices of the bones of a rig (bones, ...) by their names."""
    return dict(zip(names_of(rig), poses, strict=True))


@pytest.mark.parametrize("order", sample(rigs.ORDERS))
def test_every_mode_plays_alike_in_a_blender_without_the_extension(live_file, tmp_path, order):
    objects, owns = every_mode_and_kind()
    rig = key_all(new_rig(rotation_mode=order), scale="even")
    for place, (mode, bone) in enumerate(zip(list(KEYFRAME_MODES) * 2, rig.pose.bones, strict=False)):
        bone.bone.inherit_scale = INHERIT_SCALES[place]
        set_mode(bone, mode)
    set_mode(rig.pose.bones["Lower"], "motor_spline", [FRAMES[1]])
    assert_shown(objects, ANY_TIME, owns)
    shown, posed = shown_worlds(objects, ANY_TIME), expected_poses(rig, ANY_TIME)
    played = played_on_a_farm(save(tmp_path / "shot.blend"), [obj.name for obj in (*objects, rig)], ANY_TIME)
    assert_same(played.worlds[:-1], shown)
    assert_same_poses(rig, ANY_TIME, named(rig, played.poses), posed)
    for obj in objects:
        set_mode(obj, "BLENDER")
    native = shown_worlds(objects, ANY_TIME)
    differing = [np.abs(one - other).max() > 1e-2 for one, other in zip(native, shown, strict=True)]
    assert np.mean(differing) > 0.7, "in most of these the modes are to be seen, or this test says nothing"


def tool_and_rig(mode: str, order: str = "QUATERNION", own: bool = True, **settings: object):
    """An object and a rig that have a mode, and the object's delta transforms of its own."""
    obj = new_object("Tool", order)
    owns = {"Tool": give_own_deltas(obj)} if own else {}
    key(obj, **settings)
    rig = moving_rig(mode, **settings)
    set_mode(obj, mode)
    return obj, rig, owns


@pytest.mark.parametrize(
    ("order", "own"), sample([(order, own) for order in ("ZXY", "QUATERNION") for own in (True, False)])
)
def test_what_a_farm_saves_again_comes_back_whole(live_file, tmp_path, order, own):
    obj, rig, owns = tool_and_rig("cga_slerp", order, own, scale="even")
    set_mode([obj, rig.pose.bones["Hand"]], "dq_sclerp", [11.0])
    keys = [snapshot(obj), snapshot(rig)]
    on_a_farm(SAVE, save(tmp_path / "shot.blend"), tmp_path / "farm.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "farm.blend"))
    obj, rig = bpy.data.objects["Tool"], bpy.data.objects["Rig"]
    assert [snapshot(obj), snapshot(rig)] == keys
    for carrier in (obj, rig.pose.bones["Hand"]):
        assert modes_of(carrier, np.array(FRAMES[:3])) == ["cga_slerp", "dq_sclerp", "cga_slerp"]
    assert {problem_of(carrier) for carrier in (obj, *rig.pose.bones)} == {""}
    assert refresh() == 0, "the in-betweens that are there are those of these keys"
    assert_shown([obj], PLAYED, owns)
    assert_posed(rig, PLAYED)
    set_mode([obj, *rig.pose.bones], "BLENDER")
    assert not any(fcurve.modifiers for carrier in (obj, *rig.pose.bones) for fcurve in curves_of(carrier).values())
    assert own_deltas(obj) == owns.get("Tool", Own())
    assert_posed(rig, PLAYED)


def test_the_numbers_of_modes_in_files_stay_what_they_are(live_file):
    items = bpy.data.objects.new("Any", None).rigid_motion.bl_rna.properties["mode"].enum_items
    numbers = {item.identifier: item.value for item in items}
    assert numbers == {"BLENDER": 0, **{name: mode.number for name, mode in KEYFRAME_MODES.items()}}


def linked_action(path: Path) -> bpy.types.Object:
    """Another object that is given the Action of a file."""
    with bpy.data.libraries.load(str(path), link=True) as (source, chosen):
        chosen.actions = [name for name in source.actions if name.startswith("Tool")]
    obj, (action,) = new_object("Another"), chosen.actions
    obj.animation_data_create().action = action
    obj.animation_data.action_slot = action.slots[0]
    return obj


def appended(path: Path) -> bpy.types.Object:
    with bpy.data.libraries.load(str(path), link=False) as (_, chosen):
        chosen.objects = ["Tool"]
    bpy.context.scene.collection.objects.link(chosen.objects[0])
    return chosen.objects[0]


WAYS = {
    "linked": lambda path: linked(path, "Tool"),
    "overridden": lambda path: linked(path, "Tool").override_create(remap_local_usages=True),
    "made local": lambda path: linked(path, "Tool").make_local(),
    "appended": appended,
    "the Action alone": linked_action,
}


@pytest.mark.parametrize("way", WAYS)
def test_what_comes_from_another_file_moves_as_it_does_there(live_file, tmp_path, way):
    obj, _, _ = tool_and_rig("motor_spline", own=False)
    expected = expected_worlds(obj, ANY_TIME)
    path = save(tmp_path / "library.blend")
    blank()
    obj = WAYS[way](path)
    bpy.context.view_layer.update()
    assert refresh() == 0
    assert_same(shown_worlds([obj], ANY_TIME), [expected], 1e-5)
    other = obj.copy()
    bpy.context.scene.collection.objects.link(other)
    assert_same(shown_worlds([other], ANY_TIME), [expected], 1e-5)
