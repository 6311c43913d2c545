"""Paths of objects and bones with offset layers: where Blender shows them, or none."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import add_layer
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.overlay import cache
from rigid_motion.ui.overlay.parents import maps_of
from tests.animation.bones.rigs import in_turn
from tests.animation.held import worlds
from tests.animation.layered import key_base, key_influence, key_offset, new

pytestmark = pytest.mark.any_blender

FRAMES = np.arange(1, 41)


@pytest.mark.parametrize(
    ("kind", "modes"),
    in_turn(
        ("object", "child", "on a bone", "root", "bone"), (("dq_sclerp", "motor_spline"), ("motor_spline", "BLENDER"))
    ),
)
def test_a_path_is_where_it_is_seen_from_the_first_to_the_last_key_of_the_base(extension, kind, modes):
    carrier = key_base(new(kind, "XYZ"), modes[0])
    bpy.context.scene.frame_set(1)
    add_layer(carrier)
    key_offset(carrier, modes[1], frames=(1.0, 15.0, 33.0))
    bpy.context.view_layer.update()
    seen = worlds(carrier, FRAMES)[:, :3, 3]
    ((space, path),) = cache.drawn_paths([transform_of(carrier)], bpy.context)
    assert path.in_world or kind == "object"
    assert (path.frames[0], path.frames[-1]) == (1.0, 40.0)
    drawn = np.stack([np.interp(FRAMES, path.frames, column) for column in path.line.T], axis=1)
    assert np.abs(maps_of(space).at(drawn) - seen).max() < 2e-3


def test_where_the_influence_is_not_one_or_the_strip_is_left_there_is_no_path(extension):
    tool = key_base(new("object", "XYZ"), "dq_sclerp")
    add_layer(tool)
    key_offset(tool)
    key_influence(tool, (1.0, 1.0), (20.0, 0.5))
    bpy.context.view_layer.update()
    assert cache.path_of(tool, bpy.context) is None
    key_influence(tool, (1.0, 1.0))
    bpy.context.view_layer.update()
    assert cache.path_of(tool, bpy.context) is not None
    tool.animation_data.use_tweak_mode = False
    bpy.context.view_layer.update()
    assert cache.path_of(tool, bpy.context) is None
    assert cache.path_of(transform_of(tool).motion.base, bpy.context) is not None
