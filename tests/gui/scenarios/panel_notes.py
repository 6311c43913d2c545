"""What the panel shows of one object after the other, on the screen; and the preferences.

That drawing them raises no error, the test sees in Blender's console.
"""

from __future__ import annotations

import math

import addon_utils
import bpy
import numpy as np

from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import cube

SCREW = "dq_sclerp"


def extension() -> bpy.types.Addon:
    """The extension, as Blender's preferences list it."""
    return next(entry for entry in bpy.context.preferences.addons if entry.module.endswith(".rigid_motion"))


def key(turns: dict[int, float]) -> None:
    """Key the cube on these frames, moved along x and turned about z by degrees; from nothing."""
    obj = cube()
    obj.animation_data_clear()
    obj.rotation_mode = "QUATERNION"
    for frame, turn in turns.items():
        obj.location = (frame / 10 - 2, 0, 0)
        angle = math.radians(turn)
        obj.rotation_quaternion = (math.cos(angle / 2), 0, 0, math.sin(angle / 2))
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert("rotation_quaternion", frame=frame)


def scenario(hand: Hand) -> Steps[None]:
    """The cube without keys, with a mode, with something to warn of, and refused; nothing active; the preferences.

    What is told of which object, `tests/ui/test_panels.py` asks without a window.
    """
    view = hand.area("VIEW_3D")
    yield from hand.open_sidebar(view, "Animation")
    seen: list[bytes] = []

    def look(name: str) -> Steps[None]:
        pixels = yield from hand.picture(name, places.box(places.region(view, "UI")))
        seen.append(pixels.tobytes())
        assert len(set(seen)) == len(seen), f"{name}: nothing new in the sidebar"

    yield from look("no-keys")
    key({1: 0, 20: 90, 40: 265})
    bpy.context.scene.frame_set(10)
    yield from look("native")
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    yield from look("screw")
    place = cube().matrix_world.translation
    assert abs(place.y) > 0.05, "the screw is not Blender's straight way"
    assert np.allclose(cube().location, place, atol=1e-5), "the Item tab has what is seen"
    yield from hand.open_sidebar(view, "Item")
    yield from look("item-tab")
    yield from hand.open_sidebar(view, "Animation")
    bpy.context.scene.frame_set(30)
    yield from look("near-half-a-turn")
    cube().rotation_mode = "AXIS_ANGLE"
    yield from look("axis-and-angle")
    bpy.context.view_layer.objects.active = None
    yield from look("nothing-active")
    yield from preferences(hand)


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
