"""What the panel shows of one object after the other, in its words and on the screen; and the preferences.

The words are those of the installed extension. That drawing them raises no error, the test sees in Blender's console.
"""

from __future__ import annotations

import math
from importlib import import_module

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


class Reader:
    """Reads the panel in the sidebar of a viewport, state by state."""

    def __init__(self, hand: Hand, view: bpy.types.Area) -> None:
        self.hand, self.view = hand, view
        self.panels = import_module(f"{extension().module}.ui.panels")
        self.before = np.empty(0)

    def read(self, name: str, *words: str, mode: str | None = None) -> Steps[None]:
        """Keep a picture of the sidebar, which tells exactly as many things as there are words, and each of them.

        Parameters
        ----------
        name
            Of the picture, which differs from the one before.
        words
            A part of each thing that is told.
        mode
            That of the segment under the playhead, None where the panel shows no segment.
        """
        yield
        segment, notes = self.panels.facts_and_notes(cube(), bpy.context.scene.frame_current)
        assert (segment.mode if segment else None) == mode, segment
        assert len(notes) == len(words), notes
        for (_, text), part in zip(notes, words, strict=True):
            assert part in text, text
        yield from self.look(name)

    def look(self, name: str) -> Steps[None]:
        """Keep a picture of the sidebar, which differs from the one before."""
        sidebar = places.region(self.view, "UI")
        pixels = yield from self.hand.picture(name, places.box(sidebar))
        assert pixels.shape != self.before.shape or (pixels != self.before).any(), f"{name}: nothing new in the sidebar"
        self.before = pixels


def scenario(hand: Hand) -> Steps[None]:
    """The cube without keys, with a mode, with something to warn of, and refused; nothing active; the preferences.

    What is told of which object, `tests/ui/test_panels.py` asks without a window.
    """
    view = hand.area("VIEW_3D")
    yield from hand.open_sidebar(view, "Animation")
    reader = Reader(hand, view)
    yield from reader.read("no-keys", "No keys")
    key({1: 0, 20: 90, 40: 265})
    bpy.context.scene.frame_set(10)
    yield from reader.read("native", mode="BLENDER")
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    yield from reader.read("screw", mode=SCREW)
    shown = bpy.context.window_manager.rigid_motion_shown
    seen = cube().matrix_basis.translation
    assert (seen - cube().location).length > 0.05, "the object stands elsewhere than the Item tab says"
    assert np.allclose(shown.location, seen, atol=1e-5)
    yield from hand.open_sidebar(view, "Item")
    yield from reader.look("item-tab")
    yield from hand.open_sidebar(view, "Animation")
    bpy.context.scene.frame_set(30)
    yield from reader.read("near-half-a-turn", "175.0° is nearly half a turn", mode=SCREW)
    cube().rotation_mode = "AXIS_ANGLE"
    yield from reader.read("axis-and-angle", "rotation mode to Quaternion")
    bpy.context.view_layer.objects.active = None
    yield from reader.look("nothing-active")
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
