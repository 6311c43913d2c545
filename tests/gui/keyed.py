"""Objects for scenarios, the default cube or an arm with a hand; looked up each time, since undo replaces them."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Quaternion

from tests.animation.bones.rigs import Rest, new_rig
from tests.animation.held import put
from tests.gui import places
from tests.gui.driver import Hand, Steps

FRAMES = (1, 20, 40)
AXIS = (0.6, 0.0, 0.8)


def extension() -> bpy.types.Addon:
    """Return the entry of the extension in Blender's preferences."""
    return next(entry for entry in bpy.context.preferences.addons if entry.module.endswith(".rigid_motion"))


def cube() -> bpy.types.Object:
    return bpy.data.objects["Cube"]


def key_the_cube() -> None:
    """Set three keys, with different places and rotations about a tilted axis."""
    obj = cube()
    obj.rotation_mode = "QUATERNION"
    for frame, location, angle in zip(FRAMES, ((-3, 0, 0), (0, 1, 1), (3, -1, 0)), (0, 1.8, 3.0), strict=True):
        put(obj, frame, location, Quaternion(AXIS, angle))
    bpy.context.scene.frame_set(10)
    bpy.ops.ed.undo_push(message="Keys")


def on_screen(name: str) -> np.ndarray:
    """Return the world matrix of an object as it is on the screen, without evaluating it again."""
    return np.array(bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)


def rig() -> bpy.types.Object:
    return bpy.data.objects["Rig"]


def hand_bone() -> bpy.types.PoseBone:
    return rig().pose.bones["Hand"]


def now() -> np.ndarray:
    """Return the visible matrix of the hand, in the space of its channels."""
    bone = rig().evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones["Hand"]
    above = {"parent_matrix": bone.parent.matrix, "parent_matrix_local": bone.parent.bone.matrix_local}
    return np.array(bone.bone.convert_local_to_pose(bone.matrix, bone.bone.matrix_local, **above, invert=True))


def make_the_rig() -> None:
    """Make the only object: a rig of an arm and a separate hand, both moving and rotating from key to key."""
    bpy.data.batch_remove(bpy.data.objects)
    obj = new_rig("Rig", (Rest("Arm", (0, 0, 0), (0, 0.2, 1.5)), Rest("Hand", (0, 0.3, 1.7), (0.4, 0.3, 2.6), "Arm")))
    for number, bone in enumerate(obj.pose.bones):
        for frame, x, angle in zip(FRAMES, (-1, 0, 1), (0, 1.6, 3.0), strict=True):
            turn = Quaternion(AXIS, angle * (0.5 + number) / 1.5)
            put(bone, frame, (x, 0.3 * number * x, 0.4 * abs(x)), turn)
    bpy.context.scene.frame_set(10)


def pose_the_rig(hand: Hand) -> Steps[bpy.types.Area]:
    """Make the rig in the Animation workspace, in Pose Mode with all bones selected by hand; return the viewport."""
    yield from hand.open_animation_workspace()
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance, view.spaces.active.region_3d.view_location = 5, (0, 0, 1.2)
    make_the_rig()
    bpy.ops.ed.undo_push(message="Rig")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("TAB", ctrl=True)
    assert bpy.context.mode == "POSE", bpy.context.mode
    yield from hand.press("A")
    return view
