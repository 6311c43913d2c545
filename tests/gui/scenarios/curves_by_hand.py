"""Curves that are what is seen: keys and handles dragged in the Graph Editor, and Blender's own commands in between.

While anything is dragged the pose on the screen is held against `tests.animation.oracle` after every redraw.
"""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.keyed import curves_of, key_frames, snapshot
from tests.animation.oracle import assert_shown, expected_worlds
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import FRAMES, cube, key_the_cube, on_screen

ALIKE = 2e-5
"""What poses may differ by that are the same, in metres and in parts of a rotation matrix."""

CURSOR = (1.0, 2.0, 0.5)


def assert_place_on_the_screw() -> None:
    """What is on the screen now is what the mode makes of the keys as they are now."""
    frame = bpy.context.scene.frame_current
    np.testing.assert_allclose(on_screen("Cube"), expected_worlds(cube(), [frame])[0], atol=ALIKE)


def scenario(hand: Hand) -> Steps[None]:
    """An animator chooses the screw, works on its curves, and uses Blender's commands between the keys."""
    yield from hand.open_animation_workspace()
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")
    key_the_cube()
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "E", alt=True)
    sheet.type = "GRAPH_EDITOR"
    yield 0.3
    yield from hand.hover(places.centre(places.region(sheet)))
    yield from hand.press("HOME")
    yield from hand.picture("curves")
    yield from dragged(hand, sheet)
    yield from duplicated(hand, sheet)
    yield from cycled(hand, sheet)
    sheet.type = "DOPESHEET_EDITOR"
    yield 0.3
    yield from commands(hand, view)
    yield from copied(hand, view, sheet)


def dragged(hand: Hand, graph: bpy.types.Area) -> Steps[None]:
    """Keys and handles follow the mouse, and the body with them; Esc lets all be as it was."""
    middle = places.centre(places.region(graph))
    before, there = snapshot(cube()), on_screen("Cube")
    for key, confirm in (("G", False), ("S", True), ("G", True)):
        yield from hand.hover(middle)
        yield from hand.press("A")
        for fcurve in curves_of(cube()).values():
            for point in fcurve.keyframe_points:
                point.select_control_point = point.co.x == FRAMES[1]
                point.select_left_handle = point.select_right_handle = point.select_control_point
        yield from hand.press(key)
        for step in range(1, 9):
            yield from hand.hover((middle[0] + 4 * step, middle[1] + 9 * step))
            yield
            assert_place_on_the_screw()
        yield from (hand.click() if confirm else hand.press("ESC"))
        yield
        assert_shown([cube()], range(1, 61))
        if not confirm:
            assert snapshot(cube()) == before
            np.testing.assert_allclose(on_screen("Cube"), there, atol=ALIKE)
    yield from hand.picture("dragged")
    for _ in range(2):
        yield from hand.press("Z", ctrl=True)
    assert_shown([cube()], range(1, 61))


def duplicated(hand: Hand, graph: bpy.types.Area) -> Steps[None]:
    """Shift D: keys are there twice, and dragged at once."""
    middle = places.centre(places.region(graph))
    yield from hand.hover(middle)
    yield from hand.press("D", shift=True)
    for step in range(1, 9):
        yield from hand.hover((middle[0] + 12 * step, middle[1]))
        yield
    yield from hand.click()
    yield
    assert len(key_frames(cube())) > len(FRAMES), key_frames(cube())
    assert_shown([cube()], range(1, 61))
    yield from hand.press("Z", ctrl=True)


def cycled(hand: Hand, graph: bpy.types.Area) -> Steps[None]:
    """*Make Cyclic* of Blender's, with in-betweens there."""
    region = places.region(graph)
    with bpy.context.temp_override(window=hand.window, area=graph, region=region):
        bpy.ops.graph.select_all(action="SELECT")
        bpy.ops.graph.extrapolation_type(type="MAKE_CYCLIC")
    yield
    if bpy.app.version >= (5, 2):
        assert all(curve.modifiers[0].type == "CYCLES" for curve in curves_of(cube()).values())
        bpy.context.scene.frame_set(10)
        first = on_screen("Cube")
        bpy.context.scene.frame_set(49)
        np.testing.assert_allclose(on_screen("Cube"), first, atol=ALIKE)
        bpy.context.scene.frame_set(10)
    with bpy.context.temp_override(window=hand.window, area=graph, region=region):
        bpy.ops.graph.extrapolation_type(type="CLEAR_CYCLIC")
    yield
    assert_shown([cube()], range(1, 61))


def commands(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Rows 1 to 3 of what Blender's commands do between keys, with Auto Key and without."""
    bpy.context.scene.cursor.location = CURSOR
    for auto in (True, False):
        bpy.context.scene.tool_settings.use_keyframe_insert_auto = auto
        for number, act in enumerate((snapped, turned_back, put_back, grabbed)):
            bpy.context.scene.frame_set(10)
            yield from hand.hover(places.centre(places.region(view)))
            keys, before = snapshot(cube()), on_screen("Cube")
            expected = yield from act(hand, before)
            yield
            np.testing.assert_allclose(
                on_screen("Cube"), expected, atol=ALIKE, err_msg=f"{act.__name__}, Auto Key {auto}"
            )
            yield from hand.picture(f"{act.__name__}{'-keyed' * auto}")
            bpy.context.scene.frame_set(12)
            bpy.context.scene.frame_set(10)
            np.testing.assert_allclose(
                on_screen("Cube"), expected if auto else before, atol=ALIKE, err_msg=act.__name__
            )
            assert (snapshot(cube()) == keys) is not auto
            if auto:
                yield from hand.press("Z", ctrl=True)
                yield
                assert snapshot(cube()) == keys, f"{act.__name__} {number}"
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = False


def snapped(hand: Hand, before: np.ndarray) -> Steps[np.ndarray]:
    """Shift S, Selection to Cursor."""
    yield from hand.pie("S", "N", shift=True)
    expected = before.copy()
    expected[:3, 3] = CURSOR
    return expected


def turned_back(hand: Hand, before: np.ndarray) -> Steps[np.ndarray]:
    """Alt R."""
    yield from hand.press("R", alt=True)
    expected = np.eye(4)
    expected[:3, 3] = before[:3, 3]
    return expected


def put_back(hand: Hand, before: np.ndarray) -> Steps[np.ndarray]:
    """Alt G."""
    yield from hand.press("G", alt=True)
    expected = before.copy()
    expected[:3, 3] = 0.0
    return expected


def grabbed(hand: Hand, before: np.ndarray) -> Steps[np.ndarray]:
    """G, and a value that is typed."""
    yield from hand.press("G")
    yield from hand.press("X")
    yield from hand.type("2")
    yield from hand.press("RET")
    expected = before.copy()
    expected[0, 3] += 2.0
    return expected


def copied(hand: Hand, view: bpy.types.Area, sheet: bpy.types.Area) -> Steps[None]:
    """Row 4: keys that are copied in the Dope Sheet to another object move it as the first."""
    other = bpy.data.objects.new("Other", None)
    other.rotation_mode = "QUATERNION"
    bpy.context.scene.collection.objects.link(other)
    for path in ("location", "rotation_quaternion"):
        other.keyframe_insert(path, frame=1)
    bpy.context.scene.frame_set(1)
    yield
    yield from hand.hover(places.centre(places.region(sheet)))
    yield from hand.press("A")
    yield from hand.press("C", ctrl=True)
    cube().select_set(False)
    other.select_set(True)
    bpy.context.view_layer.objects.active = other
    yield 0.3
    yield from hand.hover(places.centre(places.region(sheet)))
    yield from hand.press("A")
    yield from hand.press("V", ctrl=True)
    yield 0.3
    assert bpy.data.objects["Other"].rigid_motion.mode == "dq_sclerp"
    for frame in range(1, 41):
        bpy.context.scene.frame_set(frame)
        np.testing.assert_allclose(on_screen("Other"), on_screen("Cube"), atol=ALIKE, err_msg=f"frame {frame}")
    yield from hand.picture("copied")
