"""An object that is off between frames: the panel says by how much, a click makes it exact, another takes that back."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.oracle import expected_worlds, shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.modes_by_hand import cube, key_the_cube

EIGHTHS = np.arange(8 * 1, 8 * 40 + 1) / 8.0
PROMISED, WORTH_OFFERING = 1e-4, 1e-3


def scenario(hand: Hand) -> Steps[None]:
    """An animator keys a cube, gives it a mode, and looks at the row *Subframes*."""
    key_the_cube()
    view = hand.area("VIEW_3D")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "E", alt=True)
    assert error() > WORTH_OFFERING
    yield from hand.open_sidebar(view, "Animation")
    yield from hand.picture("offered")
    button = yield from hand.find_button(view, "UI", "rigid_motion.exact")
    yield from hand.click(button)
    assert cube().constraints.keys() == ["Rigid Motion"]
    assert error() < PROMISED
    yield from hand.picture("exact")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    assert not cube().constraints
    assert error() > WORTH_OFFERING
    yield from hand.press("Z", ctrl=True, shift=True)
    assert error() < PROMISED
    yield from hand.click(button)
    assert not cube().constraints
    assert error() > WORTH_OFFERING
    yield from hand.picture("as-before")


def error() -> float:
    """How far any corner of the cube is off, at any eighth of a frame."""
    return error_of(cube(), EIGHTHS)


def error_of(obj: bpy.types.Object, frames: np.ndarray) -> float:
    """How far any corner of an object is off, on any of these frames."""
    bpy.context.view_layer.update()
    corners = np.array(obj.bound_box)[:, :, None]
    places_of = [
        worlds[:, None, :3, :3] @ corners + worlds[:, None, :3, 3:]
        for worlds in (shown_worlds([obj], frames)[0], expected_worlds(obj, frames))
    ]
    return float(np.linalg.norm(np.subtract(*places_of), axis=2).max())
