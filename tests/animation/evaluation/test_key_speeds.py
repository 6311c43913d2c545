"""How fast Smooth Screw runs along its path: as the easing and the handles of its keys say."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.actions.reading import keyed_in
from rigid_motion.animation.actions.slots import bindings_of
from rigid_motion.animation.evaluation.differences import in_betweens
from rigid_motion.animation.transforms import transform_of
from tests.animation.following.test_kept_motion import POSES, keyed, keys_of
from tests.animation.keyed import curves_of
from tests.animation.oracle import matrices, shown_worlds
from tests.animation.scenes import new_object


def set_slopes(carrier, frame: float, factor: float) -> None:
    """Make the handles of a key so many times as steep."""
    for point in keys_of(carrier):
        if point.co.x == frame:
            for side in ("left", "right"):
                setattr(point, f"handle_{side}_type", "FREE")
                handle = getattr(point, f"handle_{side}")
                handle.y = point.co.y + factor * (handle.y - point.co.y)


def worlds(obj, mode: str, frames) -> np.ndarray:
    set_mode(obj, mode)
    return shown_worlds([obj], frames)[0]


def speeds(obj, frame: float, step: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """The twist by differences, as matrices (4, 4) for a frame, before and after a key."""
    (source,) = keyed_in(bindings_of([transform_of(obj)]))
    at = frame + step * np.array((-2.0, -1.0, 0.0, 1.0, 2.0))
    poses = in_betweens(source, at).desired
    world = matrices(poses.positions, poses.quaternions, np.ones((5, 3)))
    before = (1.5 * world[2] - 2.0 * world[1] + 0.5 * world[0]) / step
    after = (-1.5 * world[2] + 2.0 * world[3] - 0.5 * world[4]) / step
    return before, after


def test_it_passes_keys_at_one_speed_rests_where_handles_are_flat_and_hurries_where_they_are_steep(live_file):
    lengths = {}
    for factor in (0.0, 1.0, 1.5):
        obj = keyed(new_object(f"Tool {factor}"), (1.0, 13.0, 25.0, 41.0))
        set_slopes(obj, 13.0, factor)
        set_mode(obj, "motor_spline")
        lengths[factor] = [np.linalg.norm(side) for side in speeds(obj, 13.0)]
        for before, after in map(speeds, (obj, obj), (13.0, 25.0)) if factor == 1.0 else ():
            assert np.abs(after).max() > 0.01
            assert np.abs(before - after).max() < 0.02 * np.abs(after).max()
    assert max(lengths[0.0]) < 2e-3 * min(lengths[1.0])
    np.testing.assert_allclose(lengths[1.5], 1.5 * np.array(lengths[1.0]), rtol=0.02)


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline"])
@pytest.mark.parametrize("interpolation", ["BEZIER", "LINEAR"])
def test_it_rests_where_a_pose_was_computed_twice(live_file, mode, interpolation):
    """Off by rounding of single precision, of which handles that swing beyond their keys make nothing more."""
    place, angles = POSES[1]
    twice = (np.nextafter(np.float32(place), np.float32(9.0)), angles)
    obj = keyed(new_object(), (1.0, 25.0, 49.0, 73.0), [POSES[0], POSES[1], twice, POSES[2]])
    for fcurve in curves_of(obj).values():
        for point in fcurve.keyframe_points:
            point.interpolation, point.handle_left_type, point.handle_right_type = interpolation, "AUTO", "AUTO"
        fcurve.update()
    shown = worlds(obj, mode, np.arange(25.0, 50.0))
    assert np.abs(shown - shown[0]).max() < 2e-6
