"""A key inserted between Bezier keys leaves the motion unchanged, in every mode and with any handles."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import MODE_IDS, curves_of, snapshot
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import new_object

FRAMES = (1.0, 17.0, 25.0, 49.0, 60.0)
POSES = [
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
    ((1.0, 0.4, -0.3), (0.9, 0.1, -0.2, 0.37)),
    ((1.9, 1.5, 0.1), (0.6, 0.3, -0.3, 0.67)),
    ((3.5, 1.9, 0.2), (0.2, 0.5, -0.3, 0.78)),
    ((3.0, 1.0, 1.2), (0.1, 0.2, -0.5, 0.78)),
]
POINTS = np.array(((0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0))).T
"""The origin, and three points 1 m away."""

MILLIMETRE = 1e-3
PLAYED = np.arange(1.0, 60.25, 0.25)


def keyed(carrier, frames=FRAMES, poses=POSES):
    """Key the carrier as I does, with Blender's default handles."""
    for frame, (location, quaternion) in zip(frames, poses, strict=False):
        carrier.location, carrier.rotation_quaternion = location, quaternion / np.linalg.norm(quaternion)
        insert(carrier, frame)
    return carrier


def insert(carrier, frame: float | None = None) -> None:
    """Key all of its transform, at this frame or at that of the scene."""
    for path in ("location", "rotation_quaternion", "scale"):
        carrier.keyframe_insert(path, **({} if frame is None else {"frame": frame}))


def keys_of(carrier):
    for (path, _), fcurve in curves_of(carrier).items():
        if not path.startswith(("rigid_motion", "delta")):
            yield from fcurve.keyframe_points


def pulled(*, apart: bool) -> Callable:
    """Return an edit that sets handles by hand, on frames that the channels share or on frames of their own."""

    def pull(carrier) -> None:
        random = np.random.default_rng(4)
        shares = random.uniform(0.1, 0.6, size=(len(FRAMES), 2))
        for (path, _), fcurve in curves_of(carrier).items():
            points = fcurve.keyframe_points
            if path.startswith(("rigid_motion", "delta")):
                continue
            for number, point in enumerate(points):
                left, right = random.uniform(0.1, 0.6, size=2) if apart else shares[number]
                before = point.co[0] - points[max(number - 1, 0)].co[0]
                behind = points[min(number + 1, len(points) - 1)].co[0] - point.co[0]
                slope = 0.02 * random.normal()
                point.handle_left_type = point.handle_right_type = "FREE"
                point.handle_left = point.co[0] - left * before, point.co[1] - slope * before
                point.handle_right = point.co[0] + right * behind, point.co[1] + slope * behind
            fcurve.update()

    return pull


def partly_linear(carrier) -> None:
    for point in curves_of(carrier)["location", 0].keyframe_points:
        point.interpolation = "LINEAR"


HANDLES = {
    "as I sets them": lambda carrier: None,
    "FREE": pulled(apart=False),
    "FREE, each channel otherwise": pulled(apart=True),
    "one channel linear": partly_linear,
}


def shown(obj: bpy.types.Object) -> np.ndarray:
    """Return the displayed points, shape (m, 3, 4)."""
    return (shown_worlds([obj], PLAYED)[0] @ POINTS)[:, :3]


def largest(now: np.ndarray, then: np.ndarray) -> float:
    return float(np.linalg.norm(now - then, axis=1).max())


def key_on(carrier, frame: int) -> None:
    bpy.context.scene.frame_set(frame)
    bpy.context.view_layer.update()
    insert(carrier)
    bpy.context.view_layer.update()


@pytest.mark.parametrize(("mode", "handles"), in_turn(MODE_IDS, [*HANDLES]))
def test_a_key_in_between_leaves_the_motion_as_it_was(live_file, mode, handles):
    """It is a breakdown where a regular key would change the path. Blender's own segments may change as in Blender."""
    obj = keyed(new_object())
    HANDLES[handles](obj)
    set_mode(obj, mode)
    seen = shown(obj)
    for frame in (31, 34, 9):
        key_on(obj, frame)
        assert mode == "BLENDER" or largest(shown(obj), seen) < MILLIMETRE, f"key on {frame}"
    depends = mode in ("pga_lerp", "cga_lerp", "motor_spline")
    types = {point.co[0]: point.type for point in keys_of(obj)}
    assert {types[frame] for frame in (31.0, 34.0, 9.0)} == {"BREAKDOWN" if depends else "KEYFRAME"}
    assert {types[frame] for frame in FRAMES} == {"KEYFRAME"}


def test_the_handles_beside_it_are_kept(live_file):
    obj = keyed(new_object())
    set_mode(obj, "dq_sclerp")
    before = snapshot(obj)
    key_on(obj, 31)
    for channel, (*_, points) in snapshot(obj).items():
        then = before[channel][-1]
        assert points[2][2:4] == then[2][2:4], "before the key in front of it"
        assert points[4][4:6] == then[3][4:6], "behind the key after it"
        np.testing.assert_allclose([points[i][:6] for i in (0, 1, 5)], [then[i][:6] for i in (0, 1, 4)], atol=1e-5)


def test_a_breakdown_that_is_moved_is_hit_and_takes_along_what_is_beside_it_alone(live_file):
    """A key beside it then changes the motion only up to the surrounding keys."""
    obj = keyed(new_object())
    set_mode(obj, "motor_spline")
    key_on(obj, 31)
    before = shown(obj)
    fcurve = curves_of(obj)["location", 2]
    next(point for point in fcurve.keyframe_points if point.co[0] == 31.0).co_ui.y += 0.4
    fcurve.update()
    bpy.context.view_layer.update()
    after = shown(obj)
    way = np.linalg.norm(after - before, axis=1).max(axis=1)
    assert way[PLAYED == 31.0] == pytest.approx(0.4, abs=1e-5)
    assert way[(PLAYED <= 25.0) | (PLAYED >= 49.0)].max() < 1e-5
    assert np.all(way[(PLAYED > 25.0) & (PLAYED < 31.0)] > 0.0)
    assert way.max() < 0.41
    bends = np.linalg.norm(np.diff(after[(PLAYED > 25.0) & (PLAYED < 48.0), :, 0], n=2, axis=0), axis=1)
    assert bends.max() < 0.01, "and nowhere suddenly"
    key_on(obj, 40)
    way = np.linalg.norm(shown(obj) - after, axis=1).max(axis=1)
    assert way[(PLAYED <= 31.0) | (PLAYED == 40.0) | (PLAYED >= 49.0)].max() < 1e-5
    assert way.max() < 0.4 / 6.0


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline"])
@pytest.mark.parametrize("interpolation", ["BEZIER", "LINEAR"])
def test_it_rests_where_a_pose_was_computed_twice(live_file, mode, interpolation):
    """The poses differ by rounding in single precision, which handles that overshoot their keys must not amplify."""
    place, angles = POSES[1]
    twice = (np.nextafter(np.float32(place), np.float32(9.0)), angles)
    obj = keyed(new_object(), (1.0, 25.0, 49.0, 73.0), [POSES[0], POSES[1], twice, POSES[2]])
    for point in keys_of(obj):
        point.interpolation, point.handle_left_type, point.handle_right_type = interpolation, "AUTO", "AUTO"
    set_mode(obj, mode)
    (resting,) = shown_worlds([obj], np.arange(25.0, 50.0))
    assert np.abs(resting - resting[0]).max() < 2e-6
