"""Breakdown, Push and Relax as operators: by a factor, and by made-up events of the mouse."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.motion import Poses, interpolate
from rigid_motion.ui.breakdown import MOUSE_TRAVEL_PX, Slider
from tests.ui.conftest import FRAMES

pytestmark = pytest.mark.any_blender

operators = bpy.ops.rigid_motion


def event(kind: str, value: str = "PRESS", x: float = 0.0, unicode: str = "", **held: bool) -> SimpleNamespace:
    return SimpleNamespace(type=kind, value=value, mouse_x=x, unicode=unicode, **{"ctrl": False, "shift": False} | held)


def test_a_breakdown_is_keyed_by_its_factor(tool):
    animation.set_mode(tool, "dq_sclerp")
    bpy.context.scene.frame_set(14)
    assert operators.breakdown(factor=0.25) == {"FINISHED"}
    # A quarter of the quarter turn about an axis off the origin: x and y follow an arc.
    keys = Poses(
        [[2.0, 0.0, 0.0], [4.0, 0.0, 0.0]], [[np.cos(a), 0.0, 0.0, np.sin(a)] for a in np.pi * np.arange(1, 3) / 4]
    )
    expected = interpolate((0.0, 1.0), keys, np.array([0.25]), "dq_sclerp")
    np.testing.assert_allclose(tool.location, expected.positions[0], atol=1e-5)
    assert animation.key_frames(tool).tolist() == sorted([*FRAMES.tolist(), 14.0])


def test_the_mouse_moves_the_factor_and_stops_at_the_ends(extension):
    slider = Slider(0.5, 100.0, 1.0)
    assert slider.handle(event("MOUSEMOVE", "NOTHING", 100.0 + 0.2 * MOUSE_TRAVEL_PX))
    assert slider.factor == pytest.approx(0.7)
    slider.handle(event("MOUSEMOVE", "NOTHING", 100.0 + 2.0 * MOUSE_TRAVEL_PX))
    assert slider.factor == 1.0
    slider.handle(event("MOUSEMOVE", "NOTHING", 100.0 + 1.9 * MOUSE_TRAVEL_PX))
    assert slider.factor == pytest.approx(0.9), "it comes back at once"


def test_e_lets_it_go_beyond_the_ends(extension):
    slider = Slider(0.5, 0.0, 1.0)
    slider.handle(event("E"))
    slider.handle(event("MOUSEMOVE", "NOTHING", MOUSE_TRAVEL_PX))
    assert slider.factor == pytest.approx(1.5)
    slider.handle(event("E"))
    assert slider.factor == 1.0


def test_a_number_is_typed_in_per_cent(extension):
    slider = Slider(0.5, 0.0, 1.0)
    for kind, unicode in (("MINUS", "-"), ("TWO", "2"), ("NUMPAD_5", "5"), ("COMMA", ","), ("FIVE", "5")):
        assert slider.handle(event(kind, unicode=unicode))
    assert slider.factor == pytest.approx(-0.255)
    for _ in range(10):
        slider.handle(event("BACK_SPACE"))
    assert slider.factor == 0.5
