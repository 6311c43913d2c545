"""A recording reduced to few keys by a button, other settings in the redo panel, all of it undone, and restored."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import key_frames, modes_of
from rigid_motion.motion import Poses, interpolate_by_segments
from tests.animation.keyed import curves_of
from tests.animation.oracle import shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps

FRAMES = np.arange(1.0, 252.0)
CORNERS = np.array([(x, y, z, 1.0) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]).T


def cube() -> bpy.types.Object:
    """The default cube, asked for anew each time: undo replaces it."""
    return bpy.data.objects["Cube"]


def keys() -> int:
    return len(curves_of(cube())["location", 0].keyframe_points)


def modes() -> set[str]:
    """Those of all segments."""
    return set(modes_of(cube(), key_frames(cube())[:-1]))


def off(truth: np.ndarray) -> float:
    """How far any corner of the cube is off on any frame."""
    moved = (shown_worlds([cube()], FRAMES)[0] - truth) @ CORNERS
    return float(np.linalg.norm(moved[:, :3], axis=1).max())


def record() -> None:
    """A key on every frame of the cube, as imported motion capture has it: first it swings, then it goes straight."""
    random = np.random.default_rng(3)
    poses = Poses(random.normal(size=(9, 3)), random.normal(size=(9, 4)))
    modes = ["motor_spline"] * 4 + ["lerp_slerp"] * 4
    moved = interpolate_by_segments(np.linspace(1.0, 251.0, 9), poses, FRAMES, modes)
    obj = cube()
    obj.rotation_mode = "QUATERNION"
    for frame, position, quaternion in zip(FRAMES, moved.positions, moved.quaternions, strict=True):
        obj.location, obj.rotation_quaternion = position, quaternion
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert("rotation_quaternion", frame=frame)
    bpy.ops.ed.undo_push(message="Recording")


def scenario(hand: Hand) -> Steps[None]:
    """An animator presses the button, asks for more, takes it back, does it again by the menu, and restores."""
    yield from hand.open_animation_workspace()
    view = hand.area("VIEW_3D")
    record()
    truth = shown_worlds([cube()], FRAMES)[0]
    yield from hand.open_sidebar(view, "Animation")
    before = yield from hand.picture("dense")

    button = yield from hand.find_button(view, "UI", "rigid_motion.reduce_keys")
    yield from hand.click(button)
    yield from hand.wait_until(lambda: keys() < 251, "the button reduces")
    fine = keys()
    assert off(truth) < 0.00101
    after = yield from hand.picture("reduced")
    assert (before != after).any()

    redo = places.region(view, "HUD")
    yield from hand.click(places.centre(redo))
    yield from hand.wait_until(lambda: redo.height > 100, "the redo panel unfolds")
    yield from hand.picture("redo-panel", places.box(view))
    yield from hand.hover(places.redo_row(redo, 1))
    yield from hand.press("RET")
    yield from hand.press("A", ctrl=True)
    yield from hand.type("0.1")
    yield from hand.press("RET")
    yield from hand.wait_until(lambda: keys() < fine, "a larger tolerance in the redo panel leaves fewer keys")
    assert 0.01 < off(truth) < 0.1001
    yield from hand.picture("larger-tolerance")
    assert modes() == {"motor_spline"}
    few, single = keys(), off(truth)

    yield from hand.click(places.redo_row(redo, 4, across=0.5))
    yield from hand.wait_until(lambda: len(modes()) > 1, "a box in the redo panel gives segments the best mode each")
    assert keys() == few
    assert off(truth) < 1.1 * single
    yield from hand.picture("best-per-segment")

    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    assert keys() == 251, "one step takes all of it back"
    assert off(truth) < 1e-5
    yield from hand.open_menu(view, "VIEW3D_MT_object")
    yield from hand.choose("Reduce Keys to Poses")
    yield from hand.wait_until(lambda: keys() < 251, "the menu reduces")
    yield from hand.open_menu(view, "VIEW3D_MT_object")
    yield from hand.picture("menu")
    yield from hand.choose("Restore Keys")
    yield from hand.wait_until(lambda: keys() == 251, "Restore Keys gives them back")
    assert off(truth) < 1e-5
    yield from hand.picture("restored")
