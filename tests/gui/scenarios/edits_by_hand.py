"""A screw that is edited by hand: keys moved and inserted, undone, played, and values typed with Auto Key.

What is on the screen is held against `tests.animation.oracle` on every frame, after every edit.
"""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.keyed import curves_of, key_frames, snapshot
from tests.animation.oracle import assert_shown, expected_worlds, shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube, on_screen

WHOLE = range(1, 61)
SCREW = "dq_sclerp"

ALIKE = 1e-5
"""What poses may differ by that are the same, in metres and in parts of a rotation matrix."""

HALF_WAY = 0.3
"""How far, in metres, the screw of these keys is at least from Blender's own way half-way between them."""


def shown() -> np.ndarray:
    """The cube's world matrices on all frames."""
    return shown_worlds([cube()], WHOLE)[0]


def assert_on_the_screw(*frames: float) -> None:
    """The cube has keys on these frames, and between them it goes the way of the screw."""
    assert key_frames(cube()).tolist() == list(frames), key_frames(cube())
    assert cube().rigid_motion.mode == SCREW
    assert_shown([cube()], WHOLE)


def scenario(hand: Hand) -> Steps[None]:
    """An animator chooses the screw for the cube, edits its keys, and watches it."""
    yield from hand.open_animation_workspace()
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")
    key_the_cube()
    native = shown()

    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "E", alt=True)
    assert_on_the_screw(*FRAMES)
    assert np.linalg.norm((shown() - native)[9, :3, 3]) > HALF_WAY, "the screw is not Blender's own way"

    yield from moved(hand, sheet)
    yield from inserted(hand, view, sheet)
    yield from played(hand, view)
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    yield from typed(hand, sheet)


def moved(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """The key in the middle comes later; undone and redone."""
    yield from hand.click(places.key(sheet, 20))
    yield from hand.press("G")
    yield from hand.glide(places.key(sheet, 28))
    yield from hand.click()
    assert_on_the_screw(1, 28, 40)
    yield from hand.press("Z", ctrl=True)
    assert_on_the_screw(*FRAMES)
    yield from hand.press("Z", ctrl=True, shift=True)
    assert_on_the_screw(1, 28, 40)


def inserted(hand: Hand, view: bpy.types.Area, sheet: bpy.types.Area) -> Steps[None]:
    """A key at the playhead keeps the pose on the screen; undone, the keys around it are as they were."""
    keys, before = snapshot(cube()), shown()
    yield from hand.click(places.playhead(sheet, 15))
    assert bpy.context.scene.frame_current == 15, bpy.context.scene.frame_current
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("I")
    assert_on_the_screw(1, 15, 28, 40)
    np.testing.assert_allclose(shown()[14], before[14], atol=ALIKE)
    np.testing.assert_allclose(shown(), before, atol=1e-3)
    stored = [curves_of(cube())["location", axis].evaluate(15) for axis in range(3)]
    np.testing.assert_allclose(stored, before[14, :3, 3], atol=ALIKE)
    yield from hand.press("Z", ctrl=True)
    assert_on_the_screw(1, 28, 40)
    assert snapshot(cube()) == keys


def played(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """While it plays, each frame that comes by shows the cube where the screw has it."""
    scene = bpy.context.scene
    expected = expected_worlds(cube(), range(1, scene.frame_end + 1))
    seen: dict[int, np.ndarray] = {}

    def note() -> bool:
        seen[scene.frame_current] = np.array(cube().matrix_world)
        return len(seen) > 8

    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("SPACE")
    yield from hand.wait_until(note, "eight frames are played")
    yield from hand.press("SPACE")
    assert not bpy.context.screen.is_animation_playing
    for frame, matrix in seen.items():
        np.testing.assert_allclose(matrix, expected[frame - 1], atol=ALIKE, err_msg=f"frame {frame}")


def typed(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """After the playhead was dragged, a value that is typed into the Properties editor is the value of the key."""
    yield from hand.click(places.playhead(sheet, 35))
    field = yield from hand.find_button(hand.area("PROPERTIES"), "WINDOW", "location")
    yield from hand.enter("5", field)
    yield from hand.wait_until(lambda: 35.0 in key_frames(cube()), "the typed value is keyed")
    assert curves_of(cube())["location", 0].evaluate(35) == 5.0
    assert abs(on_screen("Cube")[0, 3] - 5.0) < ALIKE
    yield from hand.picture("typed")
