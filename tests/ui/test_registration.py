"""Registering the extension and its shortcuts, and its preferences when it is installed as Blender does it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import bpy
import numpy as np
import pytest

import rigid_motion
from rigid_motion.animation import set_mode
from rigid_motion.animation.following import follower
from rigid_motion.ui import keymap, menus
from rigid_motion.ui.preferences import EXTENSION, UNCHANGED, preferences
from tests.animation.keyed import curves_of
from tests.ui.conftest import keyed


def footprint():
    """Return what the extension may add to in Blender: classes, properties, menus, keymaps, handlers."""
    keymaps = bpy.context.window_manager.keyconfigs.addon.keymaps
    places = dict.fromkeys((shortcut.keymap, shortcut.space) for shortcut in keymap.SHORTCUTS)
    result = [keymaps.find(name, space_type=space) for name, space in places]
    lists = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers) if not name.startswith("_"))
    return {
        "classes": {name for name in dir(bpy.types) if "rigid_motion" in name.lower() or "RigidMotion" in name},
        "properties": [hasattr(kind, "rigid_motion") for kind in (bpy.types.Object, bpy.types.PoseBone)],
        "of scenes": hasattr(bpy.types.Scene, "rigid_motion_overlay"),
        "operators": dir(bpy.ops.rigid_motion),
        "menus": [len(getattr(bpy.types, menu)._dyn_ui_initialize()) for menu in menus.ENTRIES],
        "keymaps": sum(len(item.keymap_items) if item else 0 for item in result),
        "handlers": [list(item) for item in lists if isinstance(item, list)],
    }


def test_switched_off_it_leaves_nothing_behind_however_often(empty_file):
    before = footprint()
    for _ in range(2):
        rigid_motion.register()
        on = footprint()
        assert on["operators"]
        assert on["keymaps"] == before["keymaps"] + len(keymap.SHORTCUTS)
        assert on["menus"] == [count + 1 for count in before["menus"]]
        assert on["handlers"] != before["handlers"]
        rigid_motion.unregister()
        assert footprint() == before


def test_a_look_through_the_file_that_still_waits_is_called_off(empty_file):
    """In a window Blender runs the first look through the file as soon as it is idle."""
    rigid_motion.register()
    bpy.app.timers.register(follower.first_look, first_interval=1.0)
    rigid_motion.unregister()
    assert not bpy.app.timers.is_registered(follower.first_look)


@pytest.fixture
def chosen(empty_file):
    """The preferences of the extension, registered as Blender does it."""
    entry = bpy.context.preferences.addons.new()
    entry.module = EXTENSION
    rigid_motion.register()
    yield preferences()
    rigid_motion.unregister()
    bpy.context.preferences.addons.remove(entry)


def test_where_it_is_no_extension_all_is_as_before_anybody_has_changed_it(chosen):
    for name, value in vars(UNCHANGED).items():
        is_number = isinstance(value, tuple | float)
        assert np.allclose(getattr(chosen, name), value) if is_number else getattr(chosen, name) == value, name


def test_the_mode_where_none_is_named_is_the_default_one(chosen):
    assert chosen.default_mode == "motor_spline"
    chosen.default_mode = "pga_lerp"
    obj = keyed("Tool")
    bpy.ops.rigid_motion.set_mode()
    assert obj.rigid_motion.mode == "pga_lerp"


@pytest.mark.parametrize("again", [False, True], ids=["switched off", "switched off before the extension is on"])
def test_without_live_update_edits_wait_until_it_is_on_again(chosen, again):
    chosen.live_update = False
    if again:
        rigid_motion.unregister()
        rigid_motion.register()
    obj = keyed("Tool")
    set_mode(obj, "dq_sclerp")
    bpy.context.scene.frame_set(6)
    before = obj.location.y
    curves_of(obj)["location", 0].keyframe_points[1].co_ui.y += 3.0
    bpy.context.scene.frame_set(6)
    assert obj.location.y == pytest.approx(before)
    preferences().live_update = True
    bpy.context.scene.frame_set(6)
    assert obj.location.y != pytest.approx(before)


SHARED = {"Window", "Screen", "Screen Editing", "Frames", "Animation", "Markers", "View2D", "Animation Channels"}
"""Keymaps that apply in all editors, or in parts of them."""

OF_EDITORS = {"3D View", "3D View Generic", "Object Mode", "Object Non-modal", "Pose"}
OF_EDITORS |= {"Dopesheet", "Dopesheet Generic", "Graph Editor", "Graph Editor Generic"}


def keymaps_of_blender(name):
    """Yield the keymaps of a key configuration: the name, and the operator, key and modifiers of each item."""
    path = Path(bpy.utils.system_resource("SCRIPTS")) / "presets/keyconfig/keymap_data" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for keymap_name, _, content in module.generate_keymaps(module.Params()):
        yield keymap_name, [item[:2] for item in content["items"]]


@pytest.mark.parametrize("name", ["blender_default", "industry_compatible_data"])
def test_the_shortcut_is_free(name):
    looked_through = set()
    for keymap_name, items in keymaps_of_blender(name):
        if keymap_name in SHARED | OF_EDITORS:
            looked_through.add(keymap_name)
            taken = [event for _, event in items if event["type"] == "T" and (event.get("alt") or event.get("any"))]
            assert not [event for event in taken if not event.get("ctrl")], keymap_name
    assert looked_through == SHARED | OF_EDITORS
