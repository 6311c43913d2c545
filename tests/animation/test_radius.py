"""The radius that errors are measured at: how far an object reaches from its origin."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion.animation import radius_of
from tests.animation.scenes import new_object


def box(obj_size: float) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new("Box")
    mesh.from_pydata([(0, 0, 0), (obj_size, 2 * obj_size, 2 * obj_size)], [(0, 1)], [])
    return mesh


def test_the_radius_is_how_far_an_object_reaches_from_its_origin(live_file):
    obj = new_object(data=box(1.0))
    assert radius_of(obj) == pytest.approx(3.0)
    obj.scale = (2.0, 2.0, 2.0)
    root = new_object("Root")
    root.scale = (3.0, 3.0, 3.0)
    obj.parent = root
    assert radius_of(obj) == pytest.approx(18.0)


def test_empties_and_cameras_are_as_large_as_they_are_drawn(live_file):
    empty, camera = new_object("Empty"), new_object("Camera", data=bpy.data.cameras.new("Camera"))
    empty.empty_display_size, camera.data.display_size = 0.25, 0.5
    empty.scale = (2.0, 2.0, 2.0)
    assert (radius_of(empty), radius_of(camera)) == (pytest.approx(0.5), pytest.approx(0.5))


def test_an_object_reaches_what_is_parented_to_it(live_file):
    pivot, arm, tip = new_object("Pivot"), new_object("Arm", data=box(1.0)), new_object("Tip")
    arm.parent, arm.location = pivot, (4.0, 0.0, 0.0)
    tip.parent, tip.location = arm, (0.0, -8.0, 3.0)
    pivot.location, pivot.empty_display_size = (10.0, 0.0, 0.0), 0.5
    assert radius_of(pivot) == pytest.approx((4.0**2 + 8.0**2 + 3.0**2) ** 0.5)
    assert radius_of(arm) == pytest.approx((8.0**2 + 3.0**2) ** 0.5)


def test_what_has_no_size_counts_as_ten_centimetres(live_file):
    light = new_object("Lamp", data=bpy.data.lights.new("Lamp", "POINT"))
    assert radius_of(light) == pytest.approx(0.1)
    bpy.context.scene.unit_settings.scale_length = 0.01
    assert radius_of(light) == pytest.approx(10.0)
