"""A layer on a cube and one on a bone of a rig: added, posed and keyed by hand, looked at, merged, and undone."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import key_frames
from tests.gui import places
from tests.gui.driver import FOLDED_PANEL, Hand, Steps
from tests.gui.keyed import FRAMES, cube, hand_bone, key_the_cube, only_the_hand, pose_the_rig, rig

EVERY = range(FRAMES[0], FRAMES[-1] + 1)


def worlds(name: str, bone: str = "") -> np.ndarray:
    """Where something is on all frames, (m, 4, 4)."""
    scene, result = bpy.context.scene, []
    frame = scene.frame_current
    for number in EVERY:
        scene.frame_set(number)
        obj = bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get())
        result.append(np.array(obj.matrix_world @ obj.pose.bones[bone].matrix if bone else obj.matrix_world))
    scene.frame_set(frame)
    return np.array(result)


def scenario(hand: Hand) -> Steps[None]:
    key_the_cube()
    cube().scale = (0.4, 0.6, 0.25)
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 14
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp")
    bpy.context.scene.frame_end = FRAMES[-1]
    bpy.context.scene.frame_set(1)
    bpy.context.scene.rigid_motion_overlay.show_paths = True
    bpy.ops.ed.undo_push(message="Mode")
    yield from hand.open_sidebar(view, "Animation")
    before = worlds("Cube")
    x, y = yield from hand.find_button(view, "UI", "show_speed", narrow=True)
    yield from hand.click((x + 60, y - FOLDED_PANEL))  # the header of Layer, to unfold it
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Add Layer")
    assert cube().parent.name == "Cube Base"
    assert cube().animation_data.use_tweak_mode
    assert np.abs(worlds("Cube") - before).max() < 1e-5, "a layer at rest moves nothing"
    yield from keyed_by_hand(hand, view, 20)
    offset = np.linalg.inv(before[19]) @ worlds("Cube")[19]
    assert np.abs(offset[:3, 3]).max() > 0.3, "it was moved"
    yield from hand.picture("cube", places.box(places.region(view)))
    layered = worlds("Cube")
    yield from hand.search("Merge Layer")
    assert cube().parent is None
    assert "Cube Base" not in bpy.data.objects
    assert {*FRAMES} <= {*key_frames(cube()).tolist()}
    assert np.abs(worlds("Cube") - layered).max() < 0.002
    yield from hand.picture("merged", places.box(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    assert cube().parent.name == "Cube Base", "one step back, and there is the layer"
    assert np.abs(worlds("Cube") - layered).max() < 1e-4
    yield from hand.press("Z", ctrl=True, shift=True)
    assert cube().parent is None
    yield from of_a_bone(hand)


def keyed_by_hand(hand: Hand, view: bpy.types.Area, frame: int) -> Steps[None]:
    """Move what is selected upwards on a frame, turn it, and key both."""
    bpy.context.scene.frame_set(frame)
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("G")
    yield from hand.press("Z")
    yield from hand.type("1")
    yield from hand.press("RET")
    yield from hand.press("R")
    yield from hand.type("40")
    yield from hand.press("RET")
    yield from hand.press("I")
    yield 0.5


def of_a_bone(hand: Hand) -> Steps[None]:
    view = yield from pose_the_rig(hand)
    bpy.context.scene.frame_set(1)
    yield from hand.open_sidebar(view, "Animation")
    yield from only_the_hand(hand, view)
    before = worlds("Rig", "Hand")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Add Layer")
    assert hand_bone().constraints[0].target.name == "Hand Base"
    assert np.abs(worlds("Rig", "Hand") - before).max() < 1e-5
    bpy.context.scene.frame_set(20)
    seen = worlds("Rig", "Hand")[19]
    yield from keyed_by_hand(hand, view, 20)
    moved = worlds("Rig", "Hand")[19] - seen
    assert np.abs(moved[:3, 3] - (0, 0, 1)).max() < 1e-3, "up by one in the world, whatever the base is turned by"
    yield from hand.picture("bone", places.box(places.region(view)))
    layered = worlds("Rig", "Hand")
    yield from hand.search("Merge Layer")
    assert not len(rig().animation_data.nla_tracks)
    assert np.abs(worlds("Rig", "Hand") - layered).max() < 0.02
    yield from hand.picture("bone-merged", places.box(places.region(view)))
