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

SCREW, SPIRAL, STRAIGHT = "dq_sclerp", "cga_slerp", "lerp_slerp"


def cube() -> bpy.types.Object:
    """The default cube, asked for anew each time: undo replaces it."""
    return bpy.data.objects["Cube"]


def extension() -> bpy.types.Addon:
    """The extension, as Blender's preferences list it."""
    return next(entry for entry in bpy.context.preferences.addons if entry.module.endswith(".rigid_motion"))


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
    """The cube without keys, with easy and awkward ones, with mixed modes, refused, baked, out of date, damaged."""
    view = hand.area("VIEW_3D")
    yield from hand.open_sidebar(view, "Animation")
    reader = Reader(hand, view)
    yield from easy(reader)
    yield from awkward(reader)
    yield from edited_beside(reader)
    yield from broken(reader)
    bpy.context.view_layer.objects.active = None
    yield from reader.look("nothing-active")
    yield from preferences(hand)


def easy(reader: Reader) -> Steps[None]:
    """Nothing to warn of."""
    yield from reader.read("no-keys", "No keys")
    key({1: 0, 20: 90})
    bpy.context.scene.frame_set(10)
    yield from reader.read("native", mode="BLENDER")
    assert not bpy.ops.rigid_motion.bake.poll(), "there is nothing to bake"
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    assert bpy.ops.rigid_motion.bake.poll()
    yield from reader.read("screw", mode=SCREW)
    shown = bpy.context.window_manager.rigid_motion_shown
    seen = cube().matrix_basis.translation
    assert (seen - cube().location).length > 0.05, "the object stands elsewhere than the Item tab says"
    assert np.allclose(shown.location, seen, atol=1e-5)
    yield from reader.hand.open_sidebar(reader.view, "Item")
    yield from reader.look("item-tab")
    yield from reader.hand.open_sidebar(reader.view, "Animation")
    key({1: 0, 20: 90}, "XYZ")
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    yield from reader.read("screw-by-euler-angles", mode=SCREW)
    key({1: 0, 20: 90})
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    bpy.context.scene.frame_set(30)
    yield from reader.read("outside-the-keys", "No segment")
    bpy.ops.rigid_motion.bake(step=0.5)
    bpy.context.scene.frame_set(10)
    yield from reader.read("baked", "Un-Bake", mode="BLENDER")
    bpy.ops.rigid_motion.unbake()
    yield from reader.read("un-baked", mode=SCREW)


def awkward(reader: Reader) -> Steps[None]:
    """What an animator may not expect of a motion that is filled in all the same."""
    key({1: 0, 20: 90, 40: 265})
    bpy.context.scene.frame_set(30)
    bpy.ops.rigid_motion.set_mode(mode=SPIRAL, on="CURRENT")
    yield from reader.read("near-half-a-turn", "175.0° is nearly half a turn", mode=SPIRAL)

    key({1: 0, 20: 700}, "XYZ")
    bpy.context.scene.frame_set(10)
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    for frame, scale, angle in ((1, (1, 1, 1), 0.0), (20, (1, 2, 1), 4.0)):
        cube().scale, cube().rotation_euler.x = scale, angle
        cube().keyframe_insert("scale", frame=frame)
        cube().keyframe_insert("rotation_euler", index=0, frame=frame)
    yield from reader.read("two-angles-and-uneven-scale", "larger one", "scale is not the same", mode=SCREW)

    key({1: 0, 20: 90})
    bpy.ops.rigid_motion.set_mode(mode=STRAIGHT)
    extension().preferences.live_update = False
    cube().location.y = 3
    cube().keyframe_insert("location", frame=20)
    yield from reader.read("out-of-date", "Live Update is off", mode=STRAIGHT)
    bpy.ops.rigid_motion.refresh()
    yield from reader.read("refreshed", mode=STRAIGHT)
    extension().preferences.live_update = True


def edited_beside(reader: Reader) -> Steps[None]:
    """Edits that do not last: of delta transforms with in-betweens in them; and another user of the same Action."""
    key({1: 0, 20: 90})
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    cube().delta_location = (0, 1, 0)
    yield from reader.read("delta-edited", "lasts until the frame changes", mode=SCREW)
    bpy.context.scene.frame_set(11)
    yield from reader.read("delta-back", mode=SCREW)

    other = bpy.data.objects.new("Other", cube().data)
    bpy.context.collection.objects.link(other)
    other.rotation_mode, data = "XYZ", other.animation_data_create()
    data.action, data.action_slot = cube().animation_data.action, cube().animation_data.action_slot
    bpy.context.view_layer.objects.active = other
    yield from reader.look("second-user")
    bpy.context.view_layer.objects.active = cube()
    bpy.data.objects.remove(other)


def broken(reader: Reader) -> Steps[None]:
    """What keeps Blender's own in-betweens, all of them or, by a driver, those of one channel."""
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    cube().rotation_mode = "AXIS_ANGLE"
    yield from reader.read("axis-and-angle", "rotation mode to Quaternion")
    cube().rotation_mode = "QUATERNION"

    cube().driver_add("location", 2)
    yield from reader.read("driven", mode=SCREW)
    cube().driver_remove("location", 2)

    action = cube().animation_data.action
    curve = action.layers[0].strips[0].channelbags[0].fcurves.find("location", index=0)
    curve.keyframe_points[0].co.y = math.nan
    yield from reader.read("not-a-number", "not a finite number")
    curve.keyframe_points[0].co.y = 0

    cube().animation_data.action = None
    cube().animation_data.nla_tracks.new().strips.new("Strip", 1, action)
    yield from reader.read("moved-by-strips", "Moved by strips")


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
