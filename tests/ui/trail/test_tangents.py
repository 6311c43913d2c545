"""Tangents at keys: speeds are as Blender shows them, and the path stays, or leaves its key along a handle."""

from __future__ import annotations

from itertools import product
from types import FunctionType, MethodType, SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import key_frames, set_mode
from rigid_motion.ui.trail.arms import arms_of, frame_rate
from rigid_motion.ui.trail.handles import handles_of
from rigid_motion.ui.trail.tangents import RIGID_MOTION_OT_drag_path_tangent
from tests.animation.bones.rigs import in_turn
from tests.animation.held import worlds
from tests.animation.keyed import Carrier, curves_of, snapshot
from tests.animation.scenes import FRAMES, new_object, write
from tests.ui.trail.carriers import MIDDLE, carrier_of, choose

pytestmark = pytest.mark.any_blender

operators = bpy.ops.rigid_motion

DENSE = np.arange(FRAMES[0], FRAMES[-1] + 0.125, 0.25)
INSTANT = 1.0 / 64.0
"""Frames over which a velocity is measured."""

NEAR = 2e-6
"""Relative difference of poses in single precision, as a fraction of the largest number in them."""

SIDES = {False: (FRAMES[0], MIDDLE), True: (MIDDLE, FRAMES[2])}
"""The segments before and after the key."""


def arc(mode: str, handle_type: str = "AUTO_CLAMPED") -> Carrier:
    """Return an object on a gently curved path, with its second key selected."""
    tool = new_object()
    write(tool, "location", np.array(FRAMES), np.array([(0, 0, 0), (3, 1, 0.5), (5, 4, 1), (4, 7, 2)]), "BEZIER")
    angles = (0, 0, 0), (0.2, 0.3, 0.5), (0.5, 0.2, 1.2), (0.3, 0, 1.8)
    quaternions = np.array([Euler(angle).to_quaternion() for angle in angles])
    write(tool, "rotation_quaternion", np.array(FRAMES), quaternions, "BEZIER")
    for fcurve in curves_of(tool).values():
        fcurve.auto_smoothing = "CONT_ACCEL"
        for key in fcurve.keyframe_points:
            key.handle_left_type = key.handle_right_type = handle_type
        fcurve.update()
    set_mode(tool, mode)
    return choose(tool, MIDDLE)


def velocity(carrier: Carrier, after: bool) -> np.ndarray:
    """Return the velocity after or before the middle key, pointing away from it, in units per second."""
    at, beside = worlds(carrier, [MIDDLE, MIDDLE + (INSTANT if after else -INSTANT)])[:, :3, 3]
    return (beside - at) / INSTANT * frame_rate()


def assert_same(now: np.ndarray, before: np.ndarray) -> None:
    np.testing.assert_allclose(now, before, atol=NEAR * max(1.0, np.abs(before).max()))


def outside(ends: tuple[float, float], frames: np.ndarray = DENSE) -> np.ndarray:
    return frames[(frames <= ends[0]) | (frames >= ends[1])]


MODES = ("motor_spline", "dq_sclerp", "lerp_slerp")


@pytest.mark.parametrize(
    ("kind", "how"),
    in_turn(("QUATERNION", "XYZ", "with deltas", "parented", "bone"), tuple(product(MODES, SIDES))),
)
def test_the_path_stays_and_so_does_all_else(scene, kind, how):
    mode, after = how
    carrier = choose(carrier_of(kind), MIDDLE)
    stop_parents(carrier)
    set_mode(carrier, mode)
    path, others = worlds(carrier, np.linspace(*SIDES[after], 1500)), worlds(carrier, outside(SIDES[after]))
    assert operators.drag_path_tangent(speed=4.0, after=after, frame=MIDDLE, target=handle().target.name) == {
        "FINISHED"
    }
    assert_same(worlds(carrier, outside(SIDES[after])), others)
    now = worlds(carrier, np.linspace(*SIDES[after], 60))
    off = np.abs(now[:, None] - path).max(axis=(2, 3)).min(axis=1)
    steps = np.abs(np.diff(path, axis=0)).max()
    assert off.max() < max(steps, 1e-4), "each pose is one of those before, but for the distance between these"


def stop_parents(carrier: Carrier) -> None:
    """Stop the motion of the parents."""
    if isinstance(carrier, bpy.types.PoseBone):
        fcurves = carrier.id_data.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
        for fcurve in [fcurve for fcurve in fcurves if carrier.name not in fcurve.data_path]:
            fcurves.remove(fcurve)
    elif carrier.parent is not None:
        carrier.parent.animation_data_clear()


def handle():
    (one,) = handles_of(bpy.context)
    return one


@pytest.mark.parametrize(
    ("mode", "after", "speed"),
    [("motor_spline", True, 0.0), ("dq_sclerp", False, 3.0), ("motor_spline", False, 9.0), ("dq_sclerp", True, 12.0)],
)
def test_a_body_is_as_fast_as_was_asked_for_on_one_side(scene, mode, after, speed):
    tool = arc(mode)
    other, others = velocity(tool, not after), worlds(tool, outside(SIDES[after]))
    operators.drag_path_tangent(speed=speed, after=after, frame=MIDDLE, target=tool.name)
    assert np.linalg.norm(velocity(tool, after)) == pytest.approx(speed, abs=0.15 + 0.02 * speed)
    assert velocity(tool, not after) == pytest.approx(other, abs=1e-3)
    assert_same(worlds(tool, outside(SIDES[after])), others)


@pytest.mark.parametrize("after", SIDES)
def test_a_handle_is_as_long_as_the_body_is_fast(scene, after):
    tool = arc("motor_spline")
    arm = arms_of(handle().path)[0][1, int(after)] * frame_rate()
    assert arm == pytest.approx(velocity(tool, after), rel=0.02, abs=0.05)


def test_a_linear_segment_gets_handles_and_keeps_its_other_speed(scene):
    tool = arc("dq_sclerp")
    for fcurve in curves_of(tool).values():
        for key in fcurve.keyframe_points:
            key.interpolation = "LINEAR"
    bpy.context.view_layer.update()
    before = np.diff(worlds(tool, [FRAMES[2] - INSTANT, FRAMES[2]])[:, :3, 3], axis=0)
    operators.drag_path_tangent(speed=3.0, after=True, frame=MIDDLE, target=tool.name)
    assert np.linalg.norm(velocity(tool, True)) == pytest.approx(3.0, abs=0.1)
    assert np.diff(worlds(tool, [FRAMES[2] - INSTANT, FRAMES[2]])[:, :3, 3], axis=0) == pytest.approx(before, rel=0.02)


def bending_operator(tool: Carrier, after: bool) -> SimpleNamespace:
    """Return the operator in the state of dragging a tangent, with B pressed."""
    cls = RIGID_MOTION_OT_drag_path_tangent
    operator = SimpleNamespace(_hit=None, target=tool.name, frame=MIDDLE, after=after, speed=0.0, bend=(0.0, 0.0, 0.0))
    for name, method in vars(cls).items():
        if isinstance(method, FunctionType):
            setattr(operator, name, MethodType(method, operator))
    assert operator.read(handles_of(bpy.context))
    operator.begin(None)
    assert operator._ensure_bending_key()
    operator._measure_bending()
    return operator


@pytest.mark.parametrize(("mode", "after"), [*zip(MODES, (True, False, True), strict=True)])
def test_a_path_leaves_its_key_where_the_tangent_is_bent_to(scene, mode, after):
    tool = arc(mode)
    before, keys, others = snapshot(tool), worlds(tool, FRAMES), worlds(tool, outside(SIDES[after]))
    arm = velocity(tool, after) @ np.array(Euler((0.3, -0.2, 0.4)).to_matrix())
    operator = bending_operator(tool, after)
    for factor in (2.0, 1.0):
        operator.bend, operator.speed = tuple(operator._bend_towards(factor * arm)), float(np.linalg.norm(arm))
        operator.apply()
    now = velocity(tool, after)
    assert now @ arm > np.cos(np.radians(1.5)) * np.linalg.norm(now) * np.linalg.norm(arm)
    assert np.linalg.norm(now) == pytest.approx(np.linalg.norm(arm), rel=0.05)
    assert_same(worlds(tool, FRAMES), keys)
    assert key_frames(tool, selected=True).tolist() == [MIDDLE]
    if mode != "motor_spline":  # it has no corners, so its path also bends on the other side
        assert_same(worlds(tool, outside(SIDES[after])), others)
    bent = worlds(tool, DENSE)
    operator._edits.cancel()
    assert snapshot(tool) == before
    bpy.context.view_layer.update()
    done = operators.drag_path_tangent(
        speed=operator.speed, bend=operator.bend, after=after, frame=MIDDLE, target=tool.name
    )
    assert done == {"FINISHED"}
    assert worlds(tool, DENSE) == pytest.approx(bent, abs=1e-5), "and so it is where it is done once more"


def test_a_path_without_a_frame_between_its_keys_is_not_bent(scene):
    tool = arc("dq_sclerp")
    operators.retime_path_keys(frames=-500.0)
    before = snapshot(tool)
    bpy.context.view_layer.update()
    frame = FRAMES[0] + 1.0
    operators.drag_path_tangent(speed=3.0, bend=(0.0, 0.0, 1.0), after=False, frame=frame, target=tool.name)
    assert key_frames(tool).tolist() == [key[0] for key in next(iter(before.values()))[-1]]


@pytest.mark.parametrize("what", ["BLENDER", "eased", "no segment"])
def test_what_has_no_tangent_is_refused(scene, what):
    tool = arc("BLENDER" if what == "BLENDER" else "dq_sclerp")
    if what == "eased":
        for fcurve in curves_of(tool).values():
            for key in fcurve.keyframe_points:
                key.interpolation = "BOUNCE"
        bpy.context.view_layer.update()
    before = snapshot(tool)
    frame = FRAMES[-1] if what == "no segment" else MIDDLE
    assert operators.drag_path_tangent(speed=3.0, after=True, frame=frame, target=tool.name) == {"CANCELLED"}
    assert snapshot(tool) == before
