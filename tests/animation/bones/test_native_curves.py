"""Reducing to Blender's own curves: the keys of an animator come back, within the tolerance on the original frames."""

from __future__ import annotations

from collections import Counter

import bpy
import numpy as np
import pytest

from rigid_motion.animation import FEWEST, NATIVE, bake_poses, reduce_keys_of, reduction_of, restore_keys
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from tests.animation.bones.hand_made import AUTOMATIC, LAST, OF_OLD, THIRD, bake_each_frame, hand_made, keys_of
from tests.animation.bones.poses import shown_of
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, key_frames, mode_at
from tests.animation.scenes import new_object, write
from tests.balls import largest_displacements

FRAMES = np.arange(LAST + 1.0)
EIGHTHS = np.arange(8 * LAST + 1) / 8.0
TOLERANCE, RADIUS = 0.001, 0.06
ROUNDED = 1.0 + 1e-3
"""Allows for the single precision of Blender's matrices."""


def apart(a: np.ndarray, b: np.ndarray, share: float = 1.0) -> float:
    """Return a quantile of the distances of points in the carriers' balls between two sets of matrices (..., 4, 4)."""
    change = a - b
    return float(np.quantile(largest_displacements(change[..., :3, 3], RADIUS * change[..., :3, :3]), share))


def bones(rig: bpy.types.Object) -> list[bpy.types.PoseBone]:
    return list(rig.pose.bones)


def handles_of(rig: bpy.types.Object) -> Counter[str]:
    """Return the number of keys of bones by the type of their right handle."""
    curves = [curve for bone in rig.pose.bones for curve in curves_of(bone).values()]
    return Counter(key.handle_right_type for curve in curves for key in curve.keyframe_points)


CASES = [(THIRD, 1.0), (AUTOMATIC, 1.0), (OF_OLD, 1.1)]


@pytest.mark.parametrize(("case", "rotation_mode"), in_turn(CASES, ("QUATERNION", "XYZ")))
def test_a_hand_made_animation_comes_back_with_its_own_keys(live_file, case, rotation_mode):
    handles, share = case
    rig = hand_made(handles, rotation_mode)
    own, made = keys_of(rig), shown_of(rig, EIGHTHS)
    bake_each_frame(rig)
    baked = shown_of(rig, FRAMES)
    reduction = reduce_keys_of(bones(rig), NATIVE, TOLERANCE, RADIUS)
    found, count = keys_of(rig), sum(map(len, own.values()))
    assert reduction.after == sum(map(len, found.values())) <= share * count
    assert sum(len(np.intersect1d(own[name], found[name])) for name in own) > 0.7 * count
    # Far less than the error of the baked file itself between frames.
    shown = shown_of(rig, EIGHTHS)
    assert reduction.largest_error <= TOLERANCE
    assert apart(shown[:, ::8], baked) <= TOLERANCE * ROUNDED
    if handles != OF_OLD:
        assert apart(shown, made, 0.99) <= TOLERANCE < 0.5 * reduction.between
    assert {mode_at(bone, 60.0) for bone in bones(rig)} == {"BLENDER"}
    kinds = handles_of(rig)
    common = "AUTO_CLAMPED" if handles == AUTOMATIC else "ALIGNED"
    assert handles == OF_OLD or kinds[common] > 0.7 * kinds.total()


STEPS = np.where(FRAMES < 15, 0.0, np.where(FRAMES < 31, 0.5, -0.4))
LINES = np.interp(FRAMES, (0, 20, 40, LAST), (0, 1, 1, 3))
STOPS = np.where(FRAMES < 50, np.clip(FRAMES / 20.0, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(FRAMES / 20.0, 0, 1)), 1.0)
SLOWS = STOPS + np.where(FRAMES > 70, 3.0 * ((FRAMES - 70.0) / 50.0) ** 2, 0.0)


@pytest.mark.parametrize(
    ("values", "expected"), [(STEPS, [0, 15, 31, LAST]), (LINES, [0, 20, 40, LAST]), (SLOWS, [0, 20, 70, LAST])]
)
@pytest.mark.parametrize("path", ["location", "rotation_euler", "scale"])
def test_steps_lines_and_holds_are_what_they_were(live_file, path, values, expected):
    obj = new_object(rotation_mode="XYZ")
    columns = np.column_stack([1.0 + values] * 3 if path == "scale" else (values, 0.0 * values, 0.0 * values))
    write(obj, path, FRAMES, columns)
    reduce_keys_of(obj, NATIVE, TOLERANCE, RADIUS)
    fcurve = curves_of(obj)[path, 0]
    assert key_frames(obj).tolist() == expected
    assert [fcurve.evaluate(frame) for frame in FRAMES] == pytest.approx(columns[:, 0], abs=1e-6)
    if values is STEPS:
        assert [fcurve.evaluate(frame) for frame in (14.9, 15.0, 30.9)] == pytest.approx(columns[[14, 15, 30], 0])
    if values is LINES:
        assert [key.interpolation for key in fcurve.keyframe_points][:3] == ["LINEAR", "BEZIER", "LINEAR"]
        assert fcurve.evaluate(30.5) == pytest.approx(columns[30, 0])


ANGLES = 0.025 * FRAMES
SCREW = Poses(
    np.column_stack((np.cos(2.0 * ANGLES), np.sin(2.0 * ANGLES), 0.1 * ANGLES)),
    np.column_stack((np.cos(ANGLES), 0.0 * ANGLES, 0.0 * ANGLES, np.sin(ANGLES))),
)
CURVE = Poses(
    np.column_stack((np.polyval((1e-5, -1e-3, 2e-2, 0.0), FRAMES), 0.0 * FRAMES, 0.0 * FRAMES)),
    np.tile((1.0, 0.0, 0.0, 0.0), (len(FRAMES), 1)),
)
CORNERS = np.linspace(0.0, LAST, 3)
CORNERED = np.random.default_rng(3).normal(size=(3, 7))
SCREWS = interpolate(CORNERS, Poses(0.3 * CORNERED[:, :3], CORNERED[:, 3:]), FRAMES, "dq_sclerp")


@pytest.mark.any_blender
@pytest.mark.parametrize(("poses", "mode"), [(SCREW, "motor_spline"), (CURVE, NATIVE), (SCREWS, "dq_sclerp")])
def test_what_needs_the_fewest_keys_of_all_is_taken_where_that_is_asked_for(live_file, poses, mode):
    obj = new_object()
    bake_poses(obj, FRAMES, poses)
    reduction = reduce_keys_of(obj, FEWEST, TOLERANCE, RADIUS)
    assert reduction.mode == mode
    assert reduction.needed[mode] == reduction.after == min(reduction.needed.values())
    assert reduction == reduction_of(obj)
    for other in KEYFRAME_MODES:
        restore_keys(obj, refused=[])
        reduce_keys_of(obj, other, TOLERANCE, RADIUS, refused=[])
        assert len(key_frames(obj)) >= reduction.after
