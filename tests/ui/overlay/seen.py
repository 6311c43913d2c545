"""Comparison of paths, ghosts and axes with the places that Blender shows."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.overlay.cache import drawn_paths
from rigid_motion.ui.overlay.parents import maps_of
from rigid_motion.ui.overlay.points import DrawnPath
from tests.animation.held import worlds
from tests.animation.keyed import Carrier

WHOLE = np.arange(1.0, 42.0)
"""The whole frames of `tests.ui.rigs.FRAMES`."""

NEAR = 3e-5


def assert_where_it_is_seen(carrier: Carrier, scene: bpy.types.Scene, point: tuple = (0.0, 0.0, 0.0)) -> DrawnPath:
    """Check the path of a point of an object or a bone, its ghosts and its axes on all its frames; return the path."""
    scene.rigid_motion_overlay.show_ghosts = True
    bpy.context.view_layer.update()
    expected = worlds(carrier, WHOLE)
    ((space, path),) = drawn_paths([transform_of(carrier)], bpy.context)
    places, ghosts = (expected @ (*point, 1.0))[:, :3], path.ghosts
    whole = WHOLE[(path.frames[0] <= WHOLE) & (path.frames[-1] >= WHOLE)]
    drawn = maps_of(space).at(path.desired[np.searchsorted(path.frames, whole)])
    assert drawn == pytest.approx(places[whole.astype(int) - 1], abs=NEAR)
    assert len(ghosts.frames) > 4
    assert np.array(space) @ ghosts.matrices == pytest.approx(expected[ghosts.frames.astype(int) - 1], abs=NEAR)
    axes, on = maps_of(space).at(path.axes), path.axis_frames.astype(int) - 1
    assert axes[:, :, 0] == pytest.approx(np.repeat(places[on][:, None], 3, axis=1), abs=NEAR)
    strokes, along = axes[:, :, 1] - axes[:, :, 0], expected[on][:, :3, :3].swapaxes(1, 2)
    strokes, along = (rows / np.linalg.norm(rows, axis=2, keepdims=True) for rows in (strokes, along))
    assert strokes == pytest.approx(along, abs=1e-3)
    return path
