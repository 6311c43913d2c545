"""World matrices that scripts assign to held objects are shown there; other edits are not mistaken for them."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Quaternion

from rigid_motion import animation
from tests.animation.bones.rigs import in_turn, select_only
from tests.animation.holds.model import assert_held
from tests.animation.holds.staging import FRAMES, PROPS, found, go_to, stage, update
from tests.animation.keyed import rotation_path
from tests.animation.oracle import shown_worlds, world_of
from tests.animation.scenes import new_object

__all__ = ["stage"]

THERE = Matrix.LocRotScale((1.0, 2.0, 3.0), Euler((0.3, 0.2, 1.1)), None)


def key_all(prop: bpy.types.Object, frame: float) -> None:
    for path in ("location", rotation_path(prop)):
        prop.keyframe_insert(path, frame=frame)


def off(prop: bpy.types.Object, world: Matrix) -> float:
    return float(np.abs(world_of(prop) - np.array(world)).max())


@pytest.mark.parametrize("name", PROPS[:2])
@pytest.mark.parametrize(
    ("frame", "order"), in_turn((10.0, 25.0, 40.5, 36.0, 55.0), ("QUATERNION", "XZY", "AXIS_ANGLE"))
)
def test_it_is_where_it_is_assigned_to_be_whatever_holds_it(stage, name, frame, order):
    prop = stage(name)
    prop.rotation_mode = order
    update()
    go_to(frame)
    prop.matrix_world = THERE
    for _ in range(2):
        update()
        assert off(prop, THERE) < 1e-5
    key_all(prop, frame)
    go_to(frame)
    assert off(prop, THERE) < 1e-5
    assert_held([prop], FRAMES)


@pytest.mark.parametrize("name", PROPS[:2])
def test_keys_of_what_was_assigned_are_in_the_hand_frame_by_frame(stage, name):
    """As scripts do, without an update in between."""
    prop, frames, random = stage(name), np.arange(21.0, 33.0, 3.0), np.random.default_rng(3)
    worlds = [
        Matrix.LocRotScale(random.normal(size=3), Quaternion(random.normal(size=4)).normalized(), None) for _ in frames
    ]
    for frame, world in zip(frames, worlds, strict=True):
        go_to(frame)
        prop.matrix_world = world
        key_all(prop, frame)
    go_to(1.0)
    assert np.abs(shown_worlds([prop], frames)[0] - np.array(worlds)).max() < 1e-5
    assert_held([prop], FRAMES)


def test_a_hand_and_what_it_holds_are_where_both_are_assigned_to_be(stage):
    prop = stage()
    go_to(25.0)
    prop.matrix_world = THERE
    found("Hand").matrix_world = Matrix.Translation((-1.0, 0.5, 0.2)) @ THERE
    update()
    assert off(prop, THERE) < 1e-5
    assert off(found("Hand"), Matrix.Translation((-1.0, 0.5, 0.2)) @ THERE) < 1e-5


def test_what_has_no_keys_or_is_unlinked_is_so_too(stage):
    prop = stage()
    go_to(25.0)
    prop.animation_data.action = None
    update()
    prop.matrix_world = THERE
    update()
    assert off(prop, THERE) < 1e-5


@pytest.mark.parametrize("name", PROPS[:2])
@pytest.mark.parametrize("keyed", [False, True])
def test_undone_and_redone_it_is_where_it_was(stage, name, keyed):
    """Blender pushes its undo step before it reports the edit."""
    stage(name)
    go_to(25.0)
    bpy.ops.ed.undo_push(message="Frame")
    before = world_of(found(name))
    found(name).matrix_world = THERE
    if keyed:
        key_all(found(name), 25.0)
    bpy.ops.ed.undo_push(message="Assign")
    update()
    assert off(found(name), THERE) < 1e-5
    new_object("Another")
    bpy.ops.ed.undo_push(message="Another")
    update()
    for step, world in ((bpy.ops.ed.undo, THERE), (bpy.ops.ed.undo, before), (bpy.ops.ed.redo, THERE)):
        step()
        update()
        assert off(found(name), world) < 1e-5
        if keyed:
            go_to(25.0)
            assert off(found(name), world) < 1e-5


IN_HAND = (1.0, 0.5, 0.2)
"""The place of a hand."""


def in_a_hand(place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> bpy.types.Object:
    """Return a prop that is held in a hand, at this place in the world."""
    hand, prop = new_object("Hand"), new_object("Tool", "QUATERNION")
    hand.location, prop.location = IN_HAND, place
    update()
    animation.hold_in(prop, hand)
    update()
    return prop


def identities(prop: bpy.types.Object) -> None:
    prop.matrix_basis = Matrix()


def seen_as_channels(prop: bpy.types.Object) -> None:
    prop.matrix_basis = Matrix(world_of(prop))


@pytest.mark.parametrize("edit", [identities, seen_as_channels])
@pytest.mark.parametrize("stand", ["anywhere", "in the origin of the world", "in the origin of the hand"])
def test_channels_that_are_set_are_taken_as_they_are(live_file, edit, stand):
    """Even if they happen to equal the displayed matrix, as Alt G makes them for an object at the world origin."""
    prop = in_a_hand()
    prop.animation_data.action = None
    if stand == "in the origin of the hand":
        prop.matrix_basis = Matrix()
    elif stand == "anywhere":
        prop.matrix_basis = THERE
    update()
    bpy.ops.ed.undo_push(message="Stand")
    edit(bpy.data.objects["Tool"])
    basis = bpy.data.objects["Tool"].matrix_basis.copy()
    bpy.ops.ed.undo_push(message="Edit")
    update()
    assert off(bpy.data.objects["Tool"], Matrix.Translation(IN_HAND) @ basis) < 1e-5
    bpy.ops.ed.undo()
    bpy.ops.ed.redo()
    for _ in range(2):
        update()
        assert np.abs(np.array(bpy.data.objects["Tool"].matrix_basis) - np.array(basis)).max() < 1e-6
        assert off(bpy.data.objects["Tool"], Matrix.Translation(IN_HAND) @ basis) < 1e-5


def test_a_file_that_is_opened_is_as_it_was_saved(live_file, tmp_path):
    """Its matrices are not evaluated yet, and an object held at the origin of a hand has the same channels."""
    in_a_hand(IN_HAND)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "held.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "held.blend"))
    update()
    assert off(bpy.data.objects["Tool"], Matrix.Translation(IN_HAND)) < 1e-5


@pytest.mark.parametrize("cleared", [False, True])
@pytest.mark.parametrize("keyed", [False, True])
def test_it_stays_where_its_parent_is_changed_and_its_transform_is_kept(stage, keyed, cleared):
    prop, parent = stage(), new_object("Table")
    parent.location, parent.rotation_euler = (1.0, -2.0, 0.5), (0.2, 0.4, 0.9)
    if cleared:
        prop.parent = parent
    update()
    go_to(25.0)
    before = world_of(prop)
    select_only(*((prop,) if cleared else (parent, prop)))
    if cleared:
        bpy.ops.object.parent_clear(type="CLEAR_KEEP_TRANSFORM")
    else:
        bpy.ops.object.parent_set(type="OBJECT", keep_transform=True)
    update()
    assert off(prop, before) < 1e-5
    if keyed:
        key_all(prop, 25.0)
    go_to(25.0)
    assert off(prop, before) < 1e-5
    assert_held([prop], FRAMES)
