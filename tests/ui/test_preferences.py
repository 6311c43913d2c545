"""The preferences of the package, installed as an extension of Blender."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

import rigid_motion
from rigid_motion.animation import set_mode
from rigid_motion.ui.preferences import EXTENSION, UNCHANGED, preferences
from tests.animation.keyed import curves_of
from tests.ui.conftest import keyed


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
