"""A wheel from its first key to its last edit, by hand: keys, a mode, a key between, turns, a breakdown, exactness; and
all of it undone and redone, step by step."""

from __future__ import annotations

import math

import bpy
import numpy as np

from tests.animation.keyed import curve_of, curves_of, snapshot
from tests.animation.oracle import assert_shown, shown_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.exact_between_frames import PROMISED, WORTH_OFFERING, error_of
from tests.gui.scenarios.spins_by_hand import EACH, make_wheel, select, turned, wheel

NAME, FRAMES, EVERY = "Wheel", (1, 25, 49, 73), 2.0 * math.pi / 3.0
EIGHTHS = np.arange(8 * FRAMES[0], 8 * FRAMES[-1] + 1) / 8.0
ALIKE = 1e-5


class Day:
    """What an animator has done, edit by edit: the keys and the motion after each."""

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        self.states = [("nothing", self._state())]

    def note(self, edit: str) -> np.ndarray:
        """Remember what an edit has left, and return the worlds on `EACH` frame."""
        self.states.append((edit, self._state()))
        assert self.states[-1][1][0] != self.states[-2][1][0], f"{edit} changes no key"
        assert_shown([wheel(NAME)], EACH)
        return self.states[-1][1][1]

    def assert_back(self, number: int) -> None:
        """All is as it was after an edit."""
        edit, (keys, worlds) = self.states[number]
        keys_now, worlds_now = self._state()
        assert keys_now == keys, f"back to {edit}"
        np.testing.assert_allclose(worlds_now, worlds, atol=ALIKE, err_msg=f"back to {edit}")

    def _state(self) -> tuple[object, np.ndarray]:
        frame, obj = bpy.context.scene.frame_current, wheel(NAME)
        worlds = shown_worlds([obj], EACH)[0]
        bpy.context.scene.frame_set(frame)
        if not curves_of(obj):  # what is not keyed was set by this script, which undo knows nothing of
            worlds = np.zeros_like(worlds)
        return (snapshot(obj), obj.rigid_motion.mode, obj.constraints.keys()), worlds


def scenario(hand: Hand) -> Steps[None]:
    """A day's edits, each one step of undo."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    make_wheel(NAME, "XYZ", 0.0)
    select(NAME)
    bpy.context.scene.frame_end = FRAMES[-1]
    view = hand.area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 13
    yield from hand.open_sidebar(view, "Animation")
    bpy.ops.ed.undo_push(message="Wheel")
    day = Day(hand)
    yield from keyed(hand, view, day)
    yield from key_between(hand, view, day)
    yield from turns_typed(hand, view, day)
    yield from breakdown_dragged(hand, view, day)
    yield from exact(hand, view, day)
    yield from there_and_back(hand, view, day)


def over(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    yield from hand.hover(places.centre(places.region(view)))


def keyed(hand: Hand, view: bpy.types.Area, day: Day) -> Steps[None]:
    """A key at every third of a turn, and Smooth Screw by the pie: one turn, one way."""
    for number, frame in enumerate(FRAMES):
        bpy.context.scene.frame_set(frame)
        wheel(NAME).location.x = 2.0 * number - 3.0
        wheel(NAME).rotation_euler.y = EVERY * number
        yield from over(hand, view)
        yield from hand.press("I")
        day.note(f"a key on {frame}")
    yield from hand.pie("T", "N", alt=True)
    assert wheel(NAME).rigid_motion.mode == "motor_spline"
    day.note("Smooth Screw")
    angles = turned(NAME)
    assert np.all(np.diff(angles) > 0.0), angles
    np.testing.assert_allclose(angles[-1], 3.0 * EVERY, atol=1e-4)


def key_between(hand: Hand, view: bpy.types.Area, day: Day) -> Steps[None]:
    """I between two keys that Blender made Bezier: the path is as it was."""
    before = day.states[-1][1][1]
    bpy.context.scene.frame_set(60)
    yield from over(hand, view)
    yield from hand.press("I")
    after = day.note("a key on 60")
    assert {key.interpolation for key in curve_of(wheel(NAME), "location").keyframe_points} == {"BEZIER"}
    assert np.abs(after - before).max() < 1e-3, "a key on an in-between leaves the motion as it was"


def turns_typed(hand: Hand, view: bpy.types.Area, day: Day) -> Steps[None]:
    """Two turns more in one segment, typed into the panel."""
    bpy.context.scene.frame_set(30)
    field = yield from hand.find_button(view, "UI", "rigid_motion.turns")
    yield from hand.click(field)
    yield from hand.type("2")
    yield from hand.press("RET")
    day.note("two turns more")
    angles = turned(NAME)
    assert np.all(np.diff(angles) > 0.0), angles
    np.testing.assert_allclose(angles[48] - angles[24], EVERY + 4.0 * math.pi, atol=1e-4)
    yield from hand.picture("turns")


def breakdown_dragged(hand: Hand, view: bpy.types.Area, day: Day) -> Steps[None]:
    """A breakdown in another segment, dragged with the mouse."""
    bpy.context.scene.frame_set(12)
    yield from over(hand, view)
    yield from hand.search("Breakdown along Mode")
    yield 0.2
    x, y = hand.place
    yield from hand.glide((x - 60, y), 4)
    yield from hand.picture("breakdown")
    yield from hand.click()
    day.note("a breakdown on 12")
    frames = [round(key.co.x) for key in curve_of(wheel(NAME), "location").keyframe_points]
    assert frames == [1, 12, 25, 49, 60, 73], frames


def exact(hand: Hand, view: bpy.types.Area, day: Day) -> Steps[None]:
    """The panel offers to be exact between frames; on, off, and on."""
    assert error_of(wheel(NAME), EIGHTHS) > WORTH_OFFERING
    bpy.context.scene.frame_set(30)
    button = yield from hand.find_button(view, "UI", "rigid_motion.exact")
    for edit, is_exact in (("exact", True), ("no longer", False), ("exact again", True)):
        yield from hand.click(button)
        assert bool(wheel(NAME).constraints) == is_exact
        day.note(edit)
    assert error_of(wheel(NAME), EIGHTHS) < PROMISED
    bpy.context.scene.rigid_motion_overlay.show_paths = True
    yield from hand.picture("exact")
    bpy.context.scene.rigid_motion_overlay.show_paths = False


def there_and_back(hand: Hand, view: bpy.types.Area, day: Day) -> Steps[None]:
    """Ctrl Z to the beginning, and Shift Ctrl Z to the end, with all that was there after each edit."""
    yield from over(hand, view)
    for number in reversed(range(len(day.states) - 1)):
        yield from hand.press("Z", ctrl=True)
        day.assert_back(number)
    assert not curves_of(wheel(NAME))
    yield from hand.picture("nothing")
    for number in range(1, len(day.states)):
        yield from hand.press("Z", ctrl=True, shift=True)
        day.assert_back(number)
    yield from hand.picture("all-again")
