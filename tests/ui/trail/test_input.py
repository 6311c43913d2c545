"""Mouse and keyboard input during a drag of keys, as in Blender's own transforms. Events are made up."""

from __future__ import annotations

from types import MethodType, SimpleNamespace

import numpy as np
import pytest
from mathutils import Matrix, Quaternion, Vector

from rigid_motion.ui.mouse_input import SHIFT_RATIO
from rigid_motion.ui.trail import dragging
from rigid_motion.ui.trail.dragging import DragInput

pytestmark = pytest.mark.any_blender


def event(kind: str, x: float = 0.0, y: float = 0.0, value: str = "PRESS", unicode: str = "", **held: bool):
    given = {"ctrl": False, "shift": False} | held
    return SimpleNamespace(type=kind, value=value, mouse_region_x=x, mouse_region_y=y, unicode=unicode, **given)


@pytest.fixture
def given() -> DragInput:
    return DragInput(np.array((100.0, 50.0)))


def test_the_mouse_moves_and_shift_makes_that_fine(given):
    assert given.handle(event("MOUSEMOVE", 130.0, 60.0, "NOTHING"))
    assert given.place.tolist() == [130.0, 60.0]
    given.handle(event("MOUSEMOVE", 140.0, 60.0, "NOTHING", shift=True))
    assert given.place.tolist() == [130.0 + 10.0 * SHIFT_RATIO, 60.0]
    assert given.first.tolist() == [100.0, 50.0]


def test_an_axis_is_locked_and_free_again(given):
    for key, axis in (("X", 0), ("Z", 2), ("Z", None), ("Y", 1)):
        assert given.handle(event(key))
        assert given.axis == axis


def test_a_number_that_is_typed_counts_for_more_than_the_mouse(given):
    assert given.number is None
    for kind, unicode in (("MINUS", "-"), ("ONE", "1"), ("COMMA", ","), ("FIVE", "5")):
        given.handle(event(kind, unicode=unicode))
    assert given.number == -1.5
    for _ in range(4):
        given.handle(event("BACK_SPACE"))
    assert given.number is None


def test_other_keys_are_none_of_its(given):
    assert not given.handle(event("W", unicode="w"))
    assert not given.handle(event("X", value="RELEASE"))


WIDTH = 200
"""Width in pixels of a viewport that looks down on the world, ten units wide."""


def dragged(given: DragInput, kind: str) -> SimpleNamespace:
    """Return an operator that drags a key at the origin, in an orthographic view along -Z."""
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


def mouse_at(x: float, y: float, *others: SimpleNamespace) -> DragInput:
    """Return an input that began 40 pixels to the right of the viewport's centre."""
    given = DragInput(np.array((140.0, 100.0)))
    for one in (*others, event("MOUSEMOVE", x, y, "NOTHING", **({"ctrl": True} if others[-1:] == (CTRL,) else {}))):
        given.handle(one)
    return given


CTRL = event("LEFT_CTRL", ctrl=True)


def test_a_key_goes_as_far_as_the_mouse():
    assert dragged(mouse_at(157.0, 66.0), "move").value[:] == pytest.approx((0.85, -1.7, 0.0), abs=1e-5)


def test_it_goes_along_an_axis_that_is_locked():
    assert dragged(mouse_at(157.0, 66.0, event("Y")), "move").value[:] == pytest.approx((0.0, -1.7, 0.0), abs=1e-5)


def test_it_goes_in_steps_with_ctrl():
    assert dragged(mouse_at(157.0, 66.0, CTRL), "move").value[:] == pytest.approx((1.0, -2.0, 0.0), abs=1e-5)


@pytest.mark.parametrize(("keys", "value"), [((), (2.0, 0.0, 0.0)), ((event("Z"),), (0.0, 0.0, 2.0))])
def test_it_goes_by_a_number(keys, value):
    assert dragged(mouse_at(157.0, 66.0, *keys, event("TWO", unicode="2")), "move").value[:] == value


def test_keys_turn_with_the_mouse_about_their_middle_and_in_steps():
    around = (100.0 + 40.0 * np.cos(0.5), 100.0 + 40.0 * np.sin(0.5))
    assert dragged(mouse_at(*around), "rotate").angle == pytest.approx(0.5, abs=1e-5)
    assert np.degrees(dragged(mouse_at(*around, CTRL), "rotate").angle) == pytest.approx(30.0)
    assert np.degrees(dragged(mouse_at(*around, event("NINE", unicode="9")), "rotate").angle) == pytest.approx(9.0)
