"""Dense keys become holds where a hand held an object, within the tolerance on every frame as Blender shows it.

Displayed poses are compared point by point without using the program. Objects that only lie about get no hold.
"""

from __future__ import annotations

from functools import partial

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion

from rigid_motion.animation import (
    Refused,
    held_segments,
    key_frames,
    reduce_into_holds,
    reduction_of,
    restore_keys,
    set_mode,
)
from tests.animation.held import KINDS, holders_on, in_holder, new_prop, raise_keys, wander, worlds
from tests.animation.keyed import Carrier, curves_of, rotation_path, snapshot
from tests.animation.scenes import new_object, write
from tests.balls import displaced
from tests.rigs.recorded import FRAMES, recorded_rig

RADIUS, TOLERANCE = 0.1, 0.001
NOISE = 1e-4

GRIP = np.array(Matrix.LocRotScale((0.02, 0.1, 0.03), Quaternion((0.9, 0.2, 0.3, 0.1)).normalized(), None))
OTHER = np.array(Matrix.LocRotScale((0.05, 0.08, -0.02), Quaternion((0.3, -0.2, 0.8, 0.4)).normalized(), None))


def record(prop: Carrier, places: np.ndarray) -> None:
    """Key the carrier at these world matrices, on every frame."""
    scene = bpy.context.scene
    for frame, place in zip(FRAMES.tolist(), places, strict=True):
        scene.frame_set(int(frame))
        if prop == prop.id_data:
            prop.matrix_world = Matrix(place.tolist())
        else:
            prop.matrix = prop.id_data.matrix_world.inverted() @ Matrix(place.tolist())
        bpy.context.view_layer.update()
        for path in ("location", rotation_path(prop)):
            prop.keyframe_insert(path, frame=frame)
    for fcurve in curves_of(prop).values():
        for point in fcurve.keyframe_points:
            point.interpolation = "LINEAR"
    scene.frame_set(1)


def moved(pick: int = 20, put_down: int = 60, over: int = 40) -> np.ndarray:
    """Return the matrices of a tool that rests, is held in the right hand, passed to the left one, and put down."""
    body = bpy.data.objects["Body"].pose.bones
    right, left = worlds(body["Hand.R"], FRAMES) @ GRIP, worlds(body["Hand.L"], FRAMES) @ OTHER
    number = np.clip(FRAMES, pick, put_down)
    held = number.astype(int) - 1
    places = np.where((number < over)[:, None, None], right[held], left[held])
    places[:, :3, 3] += np.random.default_rng(0).uniform(-NOISE, NOISE, (len(FRAMES), 3))
    return places


def in_hands(kind: str = "free", **how: int) -> Carrier:
    """Return a prop that was recorded in the hands of a rig."""
    prop, _ = new_prop(kind), recorded_rig()
    record(prop, moved(**how))
    return prop


@pytest.mark.parametrize("kind", KINDS)
def test_what_hands_held_gets_a_key_for_each_time_and_is_shown_within_the_tolerance(live_file, kind):
    prop, body = in_hands(kind), bpy.data.objects["Body"]
    before, keys = worlds(prop), snapshot(prop)
    bpy.context.scene.frame_set(33)
    found = held_segments(prop, [body], TOLERANCE, RADIUS)
    assert bpy.context.scene.frame_current == 33
    assert snapshot(prop) == keys
    left, right = found
    # Where a hand starts to move, one frame more or less is within the tolerance.
    assert (left.name, left.first, right.name, right.last) == ("Hand.L", 40.0, "Hand.R", 39.0)
    assert right.first in (20.0, 21.0)
    assert left.last in (59.0, 60.0)
    done = reduce_into_holds(prop, [body], TOLERANCE, RADIUS)
    assert done == [right, left]
    inside = (right.first <= FRAMES) & (left.last >= FRAMES)
    assert key_frames(prop).tolist() == sorted({*FRAMES[~inside], right.first, 40.0})
    assert holders_on(prop, (19, 21, 39, 40, 59, 61)) == ["", "Hand.R", "Hand.R", "Hand.L", "Hand.L", ""]
    error = displaced(worlds(prop), before, RADIUS)
    assert error[~inside].max() < 1e-5
    largest = max(left.largest, right.largest)
    assert largest == pytest.approx(error[inside].max(), abs=2e-6)
    # The noise has this size along each axis, and the movement of a hand in one frame may add as much.
    assert 0.5 * NOISE < largest < 0.5 * TOLERANCE
    reduction = reduction_of(prop)
    assert (reduction.before, reduction.after) == (90, len(key_frames(prop)))
    assert reduction.largest_error == pytest.approx(largest)
    assert [tuple(one) for one in reduction.held] == [
        (one.name, one.first, one.last, one.keys_before) for one in (right, left)
    ]
    # It follows the hand, wherever the hand is now.
    grip = in_holder(prop, body.pose.bones["Hand.L"], [45.0])
    raise_keys(body.pose.bones["Hand.L"], 0.1)
    assert np.abs(in_holder(prop, body.pose.bones["Hand.L"], [55.0]) - grip).max() < 1e-5
    assert np.abs(worlds(prop, [45.0]) - before[44:45]).max() > 0.01
    restore_keys(prop)
    # Its constraints stay, but have no effect.
    assert {name: rows for name, rows in snapshot(prop).items() if name in keys} == keys
    assert holders_on(prop, (30, 50)) == ["", ""]


def test_all_rigs_are_looked_at_and_those_segments_that_are_wanted_are_done(live_file):
    prop = in_hands()
    left, right = held_segments(prop, tolerance=TOLERANCE, radius=RADIUS)
    assert held_segments(prop, tolerance=TOLERANCE, radius=RADIUS, least=25) == []
    reduce_into_holds(prop, segments=[right])
    assert holders_on(prop, (30, 50)) == ["Hand.R", ""]
    # Existing holds stay.
    assert held_segments(prop, tolerance=TOLERANCE, radius=RADIUS) == [left]
    reduce_into_holds(prop, tolerance=TOLERANCE, radius=RADIUS)
    assert holders_on(prop, (20, 30, 50, 61)) == ["", "Hand.R", "Hand.L", ""]
    assert displaced(worlds(prop), moved(), RADIUS).max() <= TOLERANCE
    restore_keys(prop)
    assert key_frames(prop).tolist() == FRAMES.tolist()


def test_of_bones_that_do_not_move_against_one_another_the_nearest_holds(live_file):
    prop, body = new_prop("free"), recorded_rig(still=("Hand.R", "Arm.R", "Spine", "Head"))
    record(prop, worlds(body.pose.bones["Hand.R"], FRAMES) @ GRIP)
    (found,) = held_segments(prop, [body], TOLERANCE, RADIUS)
    assert (found.name, found.first, found.last) == ("Hand.R", 1.0, 90.0)
    reduce_into_holds(prop, [body], TOLERANCE, RADIUS)
    assert key_frames(prop).tolist() == [1.0]
    assert displaced(worlds(prop), worlds(body.pose.bones["Hand.R"], FRAMES) @ GRIP, RADIUS).max() < 1e-5


def test_objects_hold_too_but_not_those_that_follow_it(live_file):
    prop, cart, child = new_prop("free"), new_object("Cart"), new_object("Child")
    wander(cart, 3)
    child.parent = prop
    record(prop, worlds(cart) @ GRIP)
    bpy.context.view_layer.update()
    assert [one.name for one in held_segments(prop, [child, prop, cart], TOLERANCE, RADIUS)] == ["Cart"]
    with pytest.raises(Refused, match="There is nothing that could hold Tool: select objects or rigs, too"):
        held_segments(prop, [child, prop], TOLERANCE, RADIUS)


def lying() -> Carrier:
    """Return a tool that lies beside a hand that rests."""
    prop, body = new_prop("free"), recorded_rig(still=("Root", "Spine", "Head", "Arm.R", "Hand.R"))
    record(prop, worlds(body.pose.bones["Hand.R"]) @ GRIP)
    return prop


def moving_past() -> Carrier:
    prop, _ = new_prop("free"), recorded_rig()
    wander(prop, 5)
    write(prop, "location", FRAMES, np.stack((np.sin(0.2 * FRAMES), 0.1 * FRAMES, 0.0 * FRAMES), axis=1))
    return prop


def far_apart() -> Carrier:
    prop = in_hands()
    for fcurve in curves_of(prop).values():
        for _ in range(61, 70):
            fcurve.keyframe_points.remove(fcurve.keyframe_points[60])
    set_mode(prop, "motor_spline")
    return prop


def growing() -> Carrier:
    prop = in_hands()
    write(prop, "scale", FRAMES[[0, -1]], np.array(((1.0, 1.0, 1.0), (2.0, 2.0, 2.0))))
    return prop


def unkeyed() -> Carrier:
    recorded_rig()
    return new_prop("free")


NOT_HELD = "Tool is at rest in none of 7 bones and objects for 5 frames"


@pytest.mark.parametrize(
    ("make", "message", "wishes"),
    [
        (lying, NOT_HELD, {}),
        (moving_past, NOT_HELD, {}),
        (partial(in_hands, pick=40, put_down=45, over=1), NOT_HELD, {}),
        (far_apart, "Tool has distant keys around frame 60.*bake them first", {}),
        (growing, "Tool grows or shrinks, but held things have a constant size", {}),
        (unkeyed, "Tool has no keys of location or rotation to reduce", {}),
        (in_hands, "the tolerance must be a number above zero", {"tolerance": float("nan")}),
    ],
)
def test_where_nothing_can_be_held_it_says_why_and_the_way_out_and_changes_nothing(live_file, make, message, wishes):
    prop = make()
    before = snapshot(prop)
    with pytest.raises(Refused, match=message):
        reduce_into_holds(prop, **{"tolerance": TOLERANCE, "radius": RADIUS} | wishes)
    assert snapshot(prop) == before
    assert not len(prop.constraints)
    assert not len(prop.rigid_motion.bakes)
