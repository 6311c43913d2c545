"""Drawing without a window: it stays silent or logs an error once, and never raises."""

from __future__ import annotations

import logging

import bpy

from rigid_motion.ui.overlay import drawing
from tests.animation.scenes import key, new_object
from tests.complaints import complaints


def test_without_a_path_no_graphics_card_is_needed(scene, caplog):
    scene.rigid_motion_overlay.show_paths = True
    new_object().select_set(True)
    drawing.draw_paths()
    assert complaints(caplog) == []


def test_what_is_wrong_is_told_once_and_never_raised(scene, caplog):
    scene.rigid_motion_overlay.show_paths = True
    key(new_object()).select_set(True)
    assert bpy.app.background
    with caplog.at_level(logging.ERROR):
        drawing.draw_paths()
        drawing.draw_paths()
    assert complaints(caplog) == ["The paths could not be drawn"]
    caplog.clear()
