"""Keys inserted on held objects leave them where they were: between keys in a hand, after them, and during a pass."""

from __future__ import annotations

from itertools import product

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.bones.rigs import in_turn
from tests.animation.holds.hands import by_an_object, by_fk, free
from tests.animation.holds.oracle import Carrier, apart
from tests.animation.holds.test_edges import KEPT, edited, thrown
from tests.animation.holds.test_passing import MODES, MOMENTS, MOVING, juggled
from tests.animation.keyed import curve_of, rotation_path
from tests.animation.oracle import shown_worlds

PLACES = 6, 15, 18, 26, 37, 42, 43.5, 46, 60, 64.5, 68, 77
"""Frames between keys, after the last key in a holder, and during the pass from there."""

PASSES = (0, 0, 0, 0), (3, 4, 4, 3)
"""Number of frames of each pass: instant, or smooth."""


def calm(prop: Carrier) -> None:
    """Reduce rotations between keys so that extrapolation never gets half a turn away from the start."""
    curves = [curve_of(prop, "rotation_quaternion", index) for index in range(4)]
    values = 0.15 * np.array([[key.co.y for key in curve.keyframe_points] for curve in curves])
    values += np.array((1.0, 0.3, 0.2, -0.1))[:, None]
    for curve, row in zip(curves, values / np.linalg.norm(values, axis=0), strict=True):
        for key, value in zip(curve.keyframe_points, row, strict=True):
            key.co_ui.y = value
    edited(prop)


def with_key(prop: Carrier, at: float, index: int = -1) -> float:
    """Insert a key of location and rotation, and return how far the object moved at most."""
    (before,) = shown_worlds([prop], MOMENTS)
    bpy.context.scene.frame_set(int(at), subframe=at % 1)
    for path in ("location", rotation_path(prop)) if index < 0 else ("location",):
        prop.keyframe_insert(path, index=index, frame=at)
    bpy.context.view_layer.update()
    (after,) = shown_worlds([prop], MOMENTS)
    return apart(before, after)


@pytest.mark.parametrize(("at", "frames"), in_turn(PLACES, PASSES))
def test_what_rests_in_hands_rests_on(live_file, frames, at):
    prop, _ = free()
    juggled(prop, (by_fk("First", 11), by_an_object("Second", 31)), frames, moves=False)
    assert with_key(prop, at) < KEPT


@pytest.mark.parametrize(("at", "move"), in_turn(PLACES, list(product(MODES, PASSES))))
def test_what_moves_in_hands_moves_on(live_file, at, move):
    mode, frames = move
    prop, _, _ = thrown(frames)
    calm(prop)
    set_mode(prop, mode)
    assert with_key(prop, at) < MOVING
    assert with_key(prop, at + 1.25) < MOVING


@pytest.mark.parametrize("mode", MODES)
def test_a_key_of_a_single_component_does_no_more(live_file, mode):
    prop, _, _ = thrown()
    calm(prop)
    set_mode(prop, mode)
    assert with_key(prop, 26, index=1) < MOVING
    assert with_key(prop, 60, index=0) < MOVING


def test_a_key_at_rest_that_is_moved_is_hit(live_file):
    prop, _, _ = thrown((0, 0, 0, 0))
    calm(prop)
    assert with_key(prop, 60) < MOVING
    bpy.context.scene.frame_set(60)
    prop.location.x += 0.1
    posed = np.array(prop.location)
    prop.keyframe_insert("location", frame=60)
    bpy.context.scene.frame_set(10)
    bpy.context.scene.frame_set(60)
    assert np.abs(np.array(prop.location) - posed).max() < KEPT
