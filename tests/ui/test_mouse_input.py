"""Mouse and keyboard input during a drag of keys or of a factor, as in Blender's own transforms. Events are made up."""

from __future__ import annotations

from types import MethodType, SimpleNamespace

import numpy as np
import pytest
from mathutils import Matrix, Quaternion, Vector

from rigid_motion.ui.breakdown import MOUSE_TRAVEL_PX, Slider
from rigid_motion.ui.mouse_input import SHIFT_RATIO
from rigid_motion.ui.trail import dragging
from rigid_motion.ui.trail.dragging import DragInput

pytestmark = pytest.mark.any_blender


def event(kind: str, x: float = 0.0, y: float = 0.0, value: str = "PRESS", unicode: str = "", **held: bool):
    given = {"ctrl": False, "shift": False} | held
    place = {"mouse_x": x, "mouse_region_x": x, "mouse_region_y": y}
    return SimpleNamespace(type=kind, value=value, unicode=unicode, **place, **given)


def moved(x: float, y: float = 0.0, **held: bool) -> SimpleNamespace:
    return event("MOUSEMOVE", x, y, "NOTHING", **held)


def test_the_mouse_moves_a_factor_which_stops_at_the_ends_unless_e_lets_it_go_beyond():
    slider = Slider(0.5, 100.0, 1.0)
    for travel, factor in ((0.2, 0.7), (2.0, 1.0), (1.9, 0.9)):
        assert slider.handle(moved(100.0 + travel * MOUSE_TRAVEL_PX))
        assert slider.factor == pytest.approx(factor), "it comes back at once"
    slider.handle(event("E"))
    slider.handle(moved(100.0 + 2.5 * MOUSE_TRAVEL_PX))
    assert slider.factor == pytest.approx(1.5)
    slider.handle(event("E"))
    assert slider.factor == 1.0


def test_a_number_that_is_typed_counts_for_more_than_the_mouse_and_is_a_factor_in_per_cent():
    slider = Slider(0.5, 0.0, 1.0)
    for kind, unicode in (("MINUS", "-"), ("TWO", "2"), ("NUMPAD_5", "5"), ("COMMA", ","), ("FIVE", "5")):
        assert slider.handle(event(kind, unicode=unicode))
    assert slider.factor == pytest.approx(-0.255)
    for _ in range(10):
        slider.handle(event("BACK_SPACE"))
    assert slider.factor == 0.5


@pytest.fixture
def given() -> DragInput:
    return DragInput(np.array((100.0, 50.0)))


def test_the_mouse_moves_keys_and_shift_makes_that_fine(given):
    assert given.handle(moved(130.0, 60.0))
    assert given.place.tolist() == [130.0, 60.0]
    given.handle(moved(140.0, 60.0, shift=True))
    assert given.place.tolist() == [130.0 + 10.0 * SHIFT_RATIO, 60.0]
    assert given.first.tolist() == [100.0, 50.0]


def test_an_axis_is_locked_and_free_again(given):
    for key, axis in (("X", 0), ("Z", 2), ("Z", None), ("Y", 1)):
        assert given.handle(event(key))
        assert given.axis == axis


def test_other_keys_are_none_of_its(given):
    assert not given.handle(event("W", unicode="w"))
    assert not given.handle(event("X", value="RELEASE"))


WIDTH = 200
"""Width in pixels of a viewport that looks down on the world, ten units wide."""

TWO, NINE = event("TWO", unicode="2"), event("NINE", unicode="9")


def dragged(kind: str, x: float, y: float, *keys: SimpleNamespace, **held: bool) -> SimpleNamespace:
    """Return an operator that drags a key at the origin, in an orthographic view along -Z.

    The drag begins 40 pixels to the right of the viewport's centre.
    """
    given = DragInput(np.array((140.0, 100.0)))
    for one in (*keys, moved(x, y, **held)):
        given.handle(one)
    view = SimpleNamespace(
        is_perspective=False,
        view_perspective="ORTHO",
        view_matrix=Matrix.Translation((0.0, 0.0, -50.0)),
        perspective_matrix=Matrix.Diagonal((0.2, 0.2, -0.01, 1.0)) @ Matrix.Translation((0.0, 0.0, -50.0)),
        view_rotation=Quaternion(),
    )
    region = SimpleNamespace(width=WIDTH, height=WIDTH)
    system = SimpleNamespace(ui_scale=1.0)
    context = SimpleNamespace(region=region, region_data=view, preferences=SimpleNamespace(system=system))
    cls = getattr(dragging, f"RIGID_MOTION_OT_{kind}_path_keys")
    operator = SimpleNamespace(_input=given, _pivot=Vector(), apply=lambda: None)
    if kind == "move":
        operator.at = MethodType(cls.at, operator)
    else:
        cls.begin(operator, context)
    cls.drag(operator, context)
    return operator


@pytest.mark.parametrize(
    ("keys", "ctrl", "value"),
    [
        ((), False, (0.85, -1.7, 0.0)),
        ((), True, (1.0, -2.0, 0.0)),
        ((event("Y"),), False, (0.0, -1.7, 0.0)),
        ((TWO,), False, (2.0, 0.0, 0.0)),
        ((event("Z"), TWO), False, (0.0, 0.0, 2.0)),
    ],
)
def test_a_key_goes_as_far_as_the_mouse_or_in_steps_or_along_an_axis_or_by_a_number(keys, ctrl, value):
    assert dragged("move", 157.0, 66.0, *keys, ctrl=ctrl).value[:] == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize(
    ("keys", "ctrl", "degrees"), [((), False, np.degrees(0.5)), ((), True, 30.0), ((NINE,), False, 9.0)]
)
def test_keys_turn_with_the_mouse_about_their_middle_or_in_steps_or_by_a_number(keys, ctrl, degrees):
    around = (100.0 + 40.0 * np.cos(0.5), 100.0 + 40.0 * np.sin(0.5))
    assert np.degrees(dragged("rotate", *around, *keys, ctrl=ctrl).angle) == pytest.approx(degrees, abs=1e-3)
