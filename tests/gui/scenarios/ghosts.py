"""Ghosts of a sword that hangs on a moving arm, its path in the world, and ghosts of bones; switched on in the panel.

That they are drawn, and in their colour, is counted in the pixels of the screen.
"""

from __future__ import annotations

import bpy

from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import cube, key_the_cube
from tests.rigs.recorded import FRAMES, recorded_rig


def bluish(hand: Hand, view: bpy.types.Area, name: str) -> Steps[int]:
    """Keep a picture of the viewport, and count its pixels that are tinted blue."""
    part = places.region(view)
    pixels = yield from hand.picture(name, places.box(part))
    shown = pixels[:, : part.width * 2 // 3].astype(float) / 255
    return int(((shown[..., 2] - shown[..., 0]) > 0.04).sum())


def scenario(hand: Hand) -> Steps[None]:
    view = hand.area("VIEW_3D")
    space = view.spaces.active.region_3d
    space.view_distance = 16.0
    settings = bpy.context.scene.rigid_motion_overlay
    sword_on_an_arm()
    yield from hand.open_sidebar(view, "Animation")
    without = yield from bluish(hand, view, "without")
    show = yield from hand.find_button(view, "UI", "show_paths", narrow=True)
    yield from hand.click(show)
    assert settings.show_paths
    yield from hand.click((show[0] + 60, show[1]))  # the header, to unfold the panel
    path = yield from bluish(hand, view, "path-in-the-world")
    assert path > without + 200, (path, without)
    ghosts = yield from hand.find_button(view, "UI", "show_ghosts", narrow=True)
    yield from hand.click(ghosts)
    assert settings.show_ghosts
    both = yield from bluish(hand, view, "ghosts")
    assert both > 2 * path, (both, path)
    yield from hand.click(show)
    alone = yield from bluish(hand, view, "ghosts-alone")
    assert alone > path, (alone, path)
    yield from hand.click(ghosts)
    assert (yield from bluish(hand, view, "nothing")) < without + 50

    bpy.data.batch_remove(bpy.data.objects)
    rig = recorded_rig()
    rig.select_set(True)
    space.view_location, space.view_distance = (0.0, 0.0, 0.9), 5.0
    bpy.ops.rigid_motion.reduce_keys(by="NUMBER", count=8, mode="motor_spline")
    bpy.context.scene.frame_end = int(FRAMES[-1])
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("TAB", ctrl=True)
    assert bpy.context.mode == "POSE", bpy.context.mode
    for bone in rig.pose.bones:
        bone.select = bone.name in ("Hand.L", "Hand.R")
    rig.data.bones.active = rig.data.bones["Hand.L"]
    without = yield from bluish(hand, view, "bones-without")
    settings.show_ghosts, settings.show_paths, settings.ghost_step = True, True, 6
    seen = yield from bluish(hand, view, "bones")
    assert seen > without + 500, (seen, without)


def sword_on_an_arm() -> None:
    """The cube as a sword that swings, on an arm that goes round and along."""
    key_the_cube()
    arm = bpy.data.objects.new("Arm", None)
    bpy.context.collection.objects.link(arm)
    for frame, angle in ((1, 0.0), (40, 2.8)):
        arm.location, arm.rotation_euler.z = (0.1 * frame, 0.0, 0.0), angle
        arm.keyframe_insert("location", frame=frame)
        arm.keyframe_insert("rotation_euler", frame=frame)
    cube().parent, cube().scale = arm, (0.15, 0.15, 1.0)
    bpy.ops.rigid_motion.set_mode(mode="motor_spline", on="WHOLE")
