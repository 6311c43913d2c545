"""Whether paths, ghosts and axes are where Blender shows what they are of."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.overlay.cache import drawn_paths
from rigid_motion.ui.overlay.points import DrawnPath
from tests.animation.bones.poses import shown_poses
from tests.animation.keyed import Carrier
from tests.animation.oracle import shown_worlds

WHOLE = np.arange(1.0, 42.0)
"""The whole frames of `tests.ui.rigs.FRAMES`."""

NEAR = 3e-5


def shown(carrier: Carrier) -> np.ndarray:
    """Where Blender shows an object or a bone in the world, on all whole frames, (n, 4, 4)."""
    (worlds,) = shown_worlds([carrier.id_data], WHOLE)
    if isinstance(carrier, bpy.types.PoseBone):
        worlds = worlds @ shown_poses([carrier.id_data], WHOLE)[0][carrier.name]
    return worlds


def assert_where_it_is_seen(carrier: Carrier, scene: bpy.types.Scene, point: tuple = (0.0, 0.0, 0.0)) -> DrawnPath:
    """The path of a point of an object or a bone, its ghosts and its axes, on all frames that it has."""
    scene.rigid_motion_overlay.show_ghosts = True
    bpy.context.view_layer.update()
    expected = shown(carrier)
    (drawn,) = drawn_paths([transform_of(carrier)], bpy.context)
    space, path = np.array(drawn[0]), drawn[1]
    places, ghosts = (expected @ (*point, 1.0))[:, :3], path.ghosts
    whole = WHOLE[(path.frames[0] <= WHOLE) & (path.frames[-1] >= WHOLE)]
    drawn = path.desired[np.searchsorted(path.frames, whole)] @ space[:3, :3].T + space[:3, 3]
    assert drawn == pytest.approx(places[whole.astype(int) - 1], abs=NEAR)
    assert len(ghosts.frames) > 4
    assert space @ ghosts.matrices == pytest.approx(expected[ghosts.frames.astype(int) - 1], abs=NEAR)
    axes, on = path.axes @ space[:3, :3].T + space[:3, 3], path.axis_frames.astype(int) - 1
    assert axes[:, :, 0] == pytest.approx(np.repeat(places[on][:, None], 3, axis=1), abs=NEAR)
    strokes, along = axes[:, :, 1] - axes[:, :, 0], expected[on][:, :3, :3].swapaxes(1, 2)
    strokes, along = (rows / np.linalg.norm(rows, axis=2, keepdims=True) for rows in (strokes, along))
    assert strokes == pytest.approx(along, abs=1e-3)
    return path
