"""Keys set, moved, taken back and played by hand in the windows of Blender itself: the ground the others stand on."""

from __future__ import annotations

import bpy
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from tests.gui import places
from tests.gui.driver import Hand, Steps


def key_frames() -> list[float]:
    """The frames at which the cube's x location has keys."""
    animation = bpy.data.objects["Cube"].animation_data
    curves = action_get_channelbag_for_slot(animation.action, animation.action_slot).fcurves
    return [key.co.x for key in curves.find("location", index=0).keyframe_points]


def scenario(hand: Hand) -> Steps[None]:
    """An animator keys the default cube at two frames, moves the second key, undoes that, and plays."""
    scene = bpy.context.scene
    hand.window.workspace = bpy.data.workspaces["Animation"]
    yield from hand.wait_until(lambda: hand.window.screen.name == "Animation", "the Animation workspace opens")
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")

    yield from hand.click(places.point(view, (0, 0, 0)))
    assert bpy.context.view_layer.objects.active.name == "Cube", "a click on the cube selects it"

    yield from hand.press("I")
    scene.frame_set(20)
    yield from hand.press("G")
    yield from hand.type("x3")
    yield from hand.press("RET")
    yield from hand.press("I")
    assert bpy.data.objects["Cube"].location.x == 3
    assert key_frames() == [1, 20]
    yield from hand.picture("two-keys")

    yield from hand.click(places.key(sheet, 20))
    yield from hand.press("G")
    yield from hand.glide(places.key(sheet, 30))
    yield from hand.picture("key-on-the-move")
    yield from hand.click()
    assert key_frames() == [1, 30], key_frames()
    yield from hand.picture("key-moved")

    yield from hand.press("Z", ctrl=True)
    assert key_frames() == [1, 20], key_frames()
    yield from hand.picture("undone")

    before = bpy.context.scene.frame_current
    yield from hand.press("SPACE")
    yield from hand.wait_until(lambda: bpy.context.scene.frame_current > before + 3, "playback goes on")
    assert bpy.context.screen.is_animation_playing
    yield from hand.press("SPACE")
    assert not bpy.context.screen.is_animation_playing
