"""Ghosts of a sword on a moving arm, of bones and of a skinned body; switched on in the panel.

The pixels of the screen show that they are drawn, and in their colours.
"""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
from mathutils import Matrix

from tests.animation.bones.rigs import pose_mode
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import cube, key_the_cube
from tests.rigs.recorded import FRAMES, recorded_rig


def tinted(hand: Hand, view: bpy.types.Area, name: str) -> Steps[np.ndarray]:
    """Take a picture of the viewport, and count its pixels tinted red for the past and cyan for the future."""
    part = places.region(view)
    pixels = yield from hand.picture(name, places.box(part))
    red, green, blue = (pixels[:, : part.width * 2 // 3].astype(float) / 255).transpose(2, 0, 1)
    return np.array([(red - np.maximum(green, blue) > 0.03).sum(), (np.minimum(green, blue) - red > 0.03).sum()])


def scenario(hand: Hand) -> Steps[None]:
    view = hand.area("VIEW_3D")
    space = view.spaces.active.region_3d
    space.view_distance = 16.0
    settings = bpy.context.scene.rigid_motion_overlay
    sword_on_an_arm()
    bpy.context.scene.frame_set(20)
    yield from hand.open_sidebar(view, "Animation")
    without = yield from tinted(hand, view, "without")
    show = yield from hand.find_button(view, "UI", "show_paths", narrow=True)
    yield from hand.click((show[0] + 60, show[1]))  # the header, to unfold the panel
    ghosts = yield from hand.find_button(view, "UI", "show_ghosts", narrow=True)
    yield from hand.click(ghosts)
    assert settings.show_ghosts
    aside = (places.region(view).x + 150, places.region(view).y + 60)
    yield from hand.hover(aside)
    both = yield from tinted(hand, view, "ghosts")
    assert (both > without + 1000).all(), (both, without)
    yield from hand.click(ghosts)
    nothing = yield from tinted(hand, view, "nothing")
    assert (nothing < without + 100).all(), (nothing, without)

    bpy.data.batch_remove(bpy.data.objects)
    rig = recorded_rig()
    rig.select_set(True)
    space.view_location, space.view_distance = (0.0, 0.0, 0.9), 5.0
    bpy.ops.rigid_motion.reduce_keys(by="NUMBER", count=8, mode="motor_spline")
    bpy.context.scene.frame_end = int(FRAMES[-1])
    pose_mode(rig, "Hand.L", "Hand.R")
    bpy.context.scene.frame_set(60)
    without = yield from tinted(hand, view, "bones-without")
    settings.show_ghosts, settings.ghost_step = True, 6
    seen = yield from tinted(hand, view, "bones")
    assert (seen > without + 100).all(), (seen, without)
    skin_of(rig)
    yield
    update = yield from hand.find_button(view, "UI", "rigid_motion.update_path")
    yield from hand.click(update)
    yield from hand.hover(aside)
    bodies = yield from tinted(hand, view, "skinned")
    assert (bodies > seen + 1000).all(), (bodies, seen)


def skin_of(rig: bpy.types.Object) -> None:
    """Make a skinned body with a ball around each bone."""
    mesh = bmesh.new()
    groups = mesh.verts.layers.deform.verify()
    for number, bone in enumerate(rig.data.bones):
        middle = 0.5 * (bone.head_local + bone.tail_local)
        along = bone.matrix_local.to_3x3().to_4x4()
        size = Matrix.Diagonal((0.05, 0.55 * bone.length, 0.05, 1.0))
        ball = bmesh.ops.create_uvsphere(
            mesh, u_segments=16, v_segments=10, radius=1.0, matrix=Matrix.Translation(middle) @ along @ size
        )
        for vertex in ball["verts"]:
            vertex[groups][number] = 1.0
    body = bpy.data.objects.new("Body", bpy.data.meshes.new("Body"))
    mesh.to_mesh(body.data)
    for bone in rig.data.bones:
        body.vertex_groups.new(name=bone.name)
    body.modifiers.new("Armature", "ARMATURE").object = rig
    body.parent = rig
    bpy.context.collection.objects.link(body)


def sword_on_an_arm() -> None:
    """Turn the cube into a sword that swings, on an arm that circles and travels."""
    key_the_cube()
    arm = bpy.data.objects.new("Arm", None)
    bpy.context.collection.objects.link(arm)
    for frame, angle in ((1, 0.0), (40, 2.8)):
        arm.location, arm.rotation_euler.z = (0.1 * frame, 0.0, 0.0), angle
        arm.keyframe_insert("location", frame=frame)
        arm.keyframe_insert("rotation_euler", frame=frame)
    cube().parent, cube().scale = arm, (0.15, 0.15, 1.0)
    bpy.ops.rigid_motion.set_mode(mode="motor_spline", on="WHOLE")
