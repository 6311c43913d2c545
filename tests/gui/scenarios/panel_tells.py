"""What the panel in the viewport tells of one object after the other; that it draws without an error, the test sees."""

from __future__ import annotations

import math

import addon_utils
import bpy

from tests.gui.driver import Hand, Steps


def cube() -> bpy.types.Object:
    """The default cube, asked for anew each time: undo replaces it."""
    return bpy.data.objects["Cube"]


def key(turns: dict[int, float], order: str = "QUATERNION") -> None:
    """Key the cube on these frames, moved along x and turned about z by degrees; from nothing."""
    obj = cube()
    obj.animation_data_clear()
    obj.rotation_mode = order
    for frame, turn in turns.items():
        obj.location = (frame / 10 - 2, 0, 0)
        angle = math.radians(turn)
        obj.rotation_quaternion = (math.cos(angle / 2), 0, 0, math.sin(angle / 2))
        obj.rotation_euler = (0, 0, angle)
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert("rotation_quaternion" if order == "QUATERNION" else "rotation_euler", frame=frame)


def scenario(hand: Hand) -> Steps[None]:
    """The cube without keys, with easy and awkward ones, with mixed modes, refused, baked, out of date, damaged."""
    view = hand.area("VIEW_3D")
    yield from hand.open_sidebar(view, "Animation")
    yield from hand.picture("no-keys")

    key({1: 0, 20: 90})
    bpy.context.scene.frame_set(10)
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp")
    yield from hand.picture("screw")

    key({1: 0, 20: 90, 40: 265})
    bpy.context.scene.frame_set(30)
    bpy.ops.rigid_motion.set_mode(mode="cga_slerp", on="CURRENT")
    yield from hand.picture("near-half-a-turn")

    key({1: 0, 20: 700}, "XYZ")
    bpy.context.scene.frame_set(10)
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp")
    cube().scale = (1, 1, 1)
    cube().keyframe_insert("scale", frame=1)
    cube().scale = (1, 2, 1)
    cube().keyframe_insert("scale", frame=20)
    yield from hand.picture("long-way-and-uneven-scale")

    key({1: 0, 20: 90})
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp")
    cube().driver_add("location", 2)
    yield from hand.picture("driven")

    cube().driver_remove("location", 2)
    bpy.ops.rigid_motion.bake(step=0.5)
    yield from hand.picture("baked")
    bpy.ops.rigid_motion.unbake()

    bpy.context.scene.frame_set(30)
    yield from hand.picture("outside-the-keys")

    extension().preferences.live_update = False
    bpy.context.scene.frame_set(10)
    cube().location.y = 3
    cube().keyframe_insert("location", frame=20)
    yield from hand.picture("out-of-date")
    extension().preferences.live_update = True

    action = cube().animation_data.action
    curve = action.layers[0].strips[0].channelbags[0].fcurves.find("location", index=0)
    curve.keyframe_points[0].co.y = math.nan
    yield from hand.picture("not-a-number")

    curve.keyframe_points[0].co.y = 0
    cube().animation_data.action = None
    cube().animation_data.nla_tracks.new().strips.new("Strip", 1, action)
    yield from hand.picture("moved-by-strips")

    bpy.context.view_layer.objects.active = None
    yield from hand.picture("nothing-active")
    yield from preferences(hand)


def extension() -> bpy.types.Addon:
    """The extension, as Blender's preferences list it."""
    return next(entry for entry in bpy.context.preferences.addons if entry.module.endswith(".rigid_motion"))


def preferences(hand: Hand) -> Steps[None]:
    """The preferences of the extension, in the window that Blender opens for its own."""
    module = next(module for module in addon_utils.modules() if module.__name__ == extension().module)
    addon_utils.module_bl_info(module)["show_expanded"] = True
    bpy.context.window_manager.addon_search = "Rigid Motion"
    bpy.ops.screen.userpref_show()
    yield from hand.wait_until(lambda: len(bpy.context.window_manager.windows) == 2, "the preferences open")
    bpy.context.preferences.active_section = "ADDONS"
    yield 1.0
    yield from hand.picture("preferences")
