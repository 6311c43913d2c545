"""Reduced keys, read back from the evaluated scene, stay within their tolerance, and the original keys can be restored.

Where keys cannot be reduced, the refusal names the cause and the way out, and nothing changes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import (
    NATIVE,
    Refused,
    bake,
    bake_poses,
    clean_motion,
    discard_dense_keys,
    hold_facts,
    is_baked,
    is_reduced,
    key_frames,
    reduce_keys_of,
    reduction_of,
    restore_keys,
    unbake,
    write_channel,
)
from rigid_motion.motion import Poses, interpolate, repair
from rigid_motion_batch.recordings import read_trajectories
from tests.animation.bones.rigs import ARM, in_turn, key_all, new_rig
from tests.animation.held import KINDS, handled, new_hands, new_prop, worlds
from tests.animation.keyed import Carrier, curves_of, rotation_path, snapshot
from tests.animation.scenes import key, new_object, put_into_library
from tests.balls import displaced, largest_displacements

ASSETS = Path(__file__).resolve().parents[2] / "assets"
RATE = 30.0
RADIUS = 0.1
TOLERANCE = 0.005


def motion(name: str = "reach") -> tuple[np.ndarray, Poses]:
    """Return one of the clips in assets/, imported with a pose on every frame."""
    trajectory = read_trajectories(str(ASSETS / f"{name}.csv")).trajectories[0]
    times, poses, _ = repair(trajectory.times, trajectory.poses)
    frames = np.arange(np.floor((times[-1] - times[0]) * RATE) + 1.0)
    return 1.0 + frames, interpolate(times - times[0], poses, frames / RATE, "lerp_slerp")


def recorded(name: str = "reach") -> bpy.types.Object:
    """Return an object that moves as recorded."""
    obj = new_object()
    bake_poses(obj, *motion(name))
    return obj


@pytest.mark.parametrize("count", [2, 5, 12])
def test_an_object_gets_as_many_keys_as_were_asked_for_and_their_error_is_said(live_file, count):
    obj = recorded("throw")
    moments = np.arange(8.0 * key_frames(obj)[0], 8.0 * key_frames(obj)[-1] + 1.0) / 8.0
    shown = worlds(obj, moments)
    reduction = reduce_keys_of(obj, "motor_spline", radius=RADIUS, count=count)
    assert len(key_frames(obj)) == reduction.after == count
    assert reduction.largest_error == pytest.approx(displaced(worlds(obj, moments), shown, RADIUS).max(), abs=1e-5)


@pytest.mark.parametrize("keyed", ["location", "rotation"])
def test_what_has_no_keys_gets_none(live_file, keyed):
    obj = recorded()
    obj.location = (1.0, 2.0, 3.0)
    path = "location" if keyed == "rotation" else rotation_path(obj)
    channelbag = obj.animation_data.action.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
    for name, fcurve in list(curves_of(obj).items()):
        if name[0] == path or name == ("location", 1):
            channelbag.fcurves.remove(fcurve)
    expected = set(curves_of(obj))
    frames = np.arange(1.0, key_frames(obj)[-1] + 1.0)
    truth = worlds(obj, frames)
    reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)
    assert displaced(worlds(obj, frames), truth, RADIUS).max() <= TOLERANCE * (1.0 + 1e-5)
    assert set(curves_of(obj)) == expected


GROWS = np.repeat(((1.0,), (1.3,), (0.8,)), 3, axis=1)
STANDS_STILL = ((1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (1.0, 2.0, 0.5), (-1.0, 1.0, 1.0))
DIFFERS = np.array(((1, 1, 1), (1, 2, 0.5), (1, 1, 3)))


@pytest.mark.parametrize("scales", [*(np.tile(scale, (3, 1)) for scale in STANDS_STILL), GROWS, DIFFERS])
def test_a_scale_goes_with_the_keys_but_where_it_differs_from_axis_to_axis(live_file, scales):
    goes_along = scales is not DIFFERS
    obj = recorded()
    frames = key_frames(obj)
    at = frames[[0, 50, 90]]
    keys = frames if goes_along else at
    values = np.column_stack([np.interp(keys, at, column) for column in scales.T])
    write_channel(obj, "scale", keys, values, interpolation="SINE")
    before, truth = snapshot(obj), worlds(obj, frames)
    reduction = reduce_keys_of(obj, "motor_spline", TOLERANCE, RADIUS)
    on = {path: [point.co.x for point in curves_of(obj)[path, 0].keyframe_points] for path in ("scale", "location")}
    assert (on["scale"] == on["location"]) == goes_along
    assert all(snapshot(obj)["scale", index] == before["scale", index] for index in range(3)) != goes_along
    # The radius is that of the ball as displayed before reducing.
    seen = RADIUS / np.cbrt(np.abs(scales[0].prod())) if goes_along else 0.0
    assert 0.0 < displaced(worlds(obj, frames), truth, seen).max() <= TOLERANCE * (1.0 + 1e-5)
    assert reduction.after == len(key_frames(obj)) < 0.5 * reduction.before


@pytest.mark.parametrize("of_bone", [False, True])
def test_cycles_go_on_as_before(live_file, of_bone):
    obj = new_rig(bones=ARM[:1]) if of_bone else new_object()
    target = obj.pose.bones[0] if of_bone else obj
    frames, poses = motion("screw")
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, 500
    for path, values in (("location", poses.positions), ("rotation_quaternion", poses.quaternions)):
        write_channel(obj, target.path_from_id(path), frames + 170.0, values)
    for fcurve in curves_of(obj).values():
        fcurve.modifiers.new("CYCLES")
    seen = np.arange(0.0, 501.0)
    truth = worlds(target, seen)
    reduction = reduce_keys_of(target, "motor_spline", TOLERANCE, RADIUS)
    assert reduction.after < 0.5 * reduction.before
    assert displaced(worlds(target, seen), truth, RADIUS).max() <= TOLERANCE * (1.0 + 1e-5)


def state() -> tuple[dict, bool, bool]:
    obj = bpy.data.objects["Tool"]
    return snapshot(obj), is_baked(obj), is_reduced(obj)


@pytest.mark.parametrize("let_go", [False, True])
def test_what_was_done_last_is_taken_back_first_and_the_file_keeps_dense_keys_until_let_go(live_file, tmp_path, let_go):
    obj = recorded()
    obj["weight"] = 1.0
    write_channel(obj, '["weight"]', np.arange(1.0, 60.0), np.arange(59.0), interpolation="BOUNCE")
    curves_of(obj)['["weight"]', 0].mute = True
    before = [state()]
    clean_motion(obj, radius=RADIUS)
    before.append(state())
    first = reduce_keys_of(obj, tolerance=TOLERANCE, radius=RADIUS)
    before.append(state())
    bake(obj)
    before.append(state())
    with pytest.raises(Refused, match="Tool was baked since it was reduced: Un-Bake first"):
        restore_keys(obj)
    for mode in ("dq_sclerp", NATIVE):
        reduce_keys_of(obj, mode, TOLERANCE, RADIUS)
    with pytest.raises(Refused, match="Tool was reduced since it was baked: Restore Keys first"):
        unbake(obj)
    if let_go:
        discard_dense_keys(obj)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    obj = bpy.data.objects["Tool"]
    if let_go:
        unbake(obj)
        assert (state(), reduction_of(obj)) == ((before[2][0], False, False), first)
        restore_keys(obj)
        assert state() == before[0], "those from before cleaning were not let go"
        with pytest.raises(Refused, match="Tool is neither reduced nor cleaned, or now has another Action"):
            restore_keys(obj)
    else:
        for back in (restore_keys, unbake, restore_keys, restore_keys):
            back(obj)
            assert state() == before.pop()
            assert back != unbake or reduction_of(obj) == first
        with pytest.raises(Refused, match="Tool is not baked"):
            unbake(obj)
    assert [action.name for action in bpy.data.actions] == ["ToolAction"]


COARSE = 0.03
"""Tolerance for objects that move wildly from frame to frame."""


def switches(prop: Carrier) -> list[tuple]:
    """Return the holder, the switch and its number of frames, on every frame."""
    result = []
    for frame in range(1, 91):
        bpy.context.scene.frame_set(frame)
        facts = hold_facts(prop)
        result.append((facts.now and facts.now.name, facts.switch, facts.frames))
    return result


@pytest.mark.parametrize(("kind", "mode"), in_turn(KINDS, ["motor_spline", NATIVE]))
def test_what_is_held_is_baked_and_reduced_in_its_holders_and_passes_as_before(live_file, kind, mode):
    prop, hands = new_prop(kind), new_hands()
    handled(prop, *hands, throw=0)
    played, by_hand, holders = worlds(prop), snapshot(prop), [holder for holder, *_ in switches(prop)]
    assert (holders[9], holders[29], holders[49], holders[69]) == (None, "Hand.L", "Hand.R", None)
    assert bake(prop) == (1.0, 80.0)
    assert key_frames(prop).tolist() == list(range(1, 81))
    assert np.abs(worlds(prop) - played).max() < 1e-5
    assert [holder for holder, *_ in switches(prop)] == holders
    frames = np.arange(1.0, 90.25, 1.0 if mode == NATIVE else 0.25)
    before, truth, keys = switches(prop), worlds(prop, frames), snapshot(prop)
    reduction = reduce_keys_of(prop, mode, COARSE, RADIUS)
    assert reduction.before == 80
    assert reduction.after == len(key_frames(prop)) < 40
    assert {20.0, 40.0, 60.0} <= set(key_frames(prop))
    assert [frame for frame in key_frames(prop) if 40.0 < frame < 60.0] == [], "in this hand it rests"
    assert switches(prop) == before
    apart = worlds(prop, frames) - truth
    # In the last frame before a switch, only the whole frames count.
    # The radius is that of the scene, whatever the scale.
    turned = apart[:, :3, :3] / np.linalg.norm(truth[:, :3, :1], axis=1, keepdims=True)
    error = largest_displacements(apart[:, :3, 3], RADIUS * turned)
    at_once = [np.flatnonzero((frames > frame - 1.0) & (frames < frame)) for frame in (20.0, 60.0)]
    error[np.concatenate(at_once)] = 0.0
    assert 0.0 < error.max() <= COARSE * (1.0 + 1e-3)
    assert reduction.largest_error <= COARSE * (1.0 + 1e-3)
    restore_keys(prop)
    assert snapshot(prop) == keys
    assert switches(prop) == before
    unbake(prop)
    assert snapshot(prop) == by_hand


# Where keys cannot be reduced


def with_(change: Callable[[bpy.types.Object], object]) -> Callable[[], bpy.types.Object]:
    def make() -> bpy.types.Object:
        change(obj := recorded())
        return obj

    return make


def driven(obj: bpy.types.Object) -> bpy.types.Object:
    obj.driver_add("location", 2)
    return obj


def held() -> bpy.types.Object:
    handled(prop := new_prop("free"), *new_hands(), throw=0)
    return prop


def cycle_a_part(obj: bpy.types.Object) -> None:
    path = curves_of(obj)["location", 0]
    while len(path.keyframe_points) > 60:
        path.keyframe_points.remove(path.keyframe_points[-1])
    path.modifiers.new("CYCLES")


NOTHING = "Tool has at most two keys of location, rotation or scale: there is nothing to reduce.*Bake Action"
GOES_ON = "Tool continues beyond its keys.*constant extrapolation"


@pytest.mark.parametrize(
    ("make", "message", "wishes"),
    [
        (new_object, NOTHING, {}),
        (lambda: driven(new_object()), NOTHING, {}),
        (lambda: key_all(new_rig("Tool")), NOTHING, {}),
        (lambda: key(new_object(), [1.0, 9.0]), NOTHING, {}),
        (with_(driven), "Tool: Location Z is driven", {}),
        (
            with_(lambda obj: curves_of(obj)["location", 1].modifiers.new("NOISE")),
            "Tool has other F-curve modifiers: mute them",
            {},
        ),
        (with_(lambda obj: curves_of(obj)["location", 1].convert_to_samples(1, 50)), "Samples to Keys", {}),
        (lambda: key(new_object(), [1.0, 5.0, 9.0]), "Tool needs its 3 keys to stay within the tolerance", {}),
        (lambda: key(new_object(), np.arange(1.0, 30.0), scale="uneven"), "its scale is not uniform", {}),
        (with_(cycle_a_part), GOES_ON, {"tolerance": TOLERANCE, "radius": RADIUS}),
        (lambda: put_into_library(recorded()), "Tool is linked from another file: make it local first", {}),
        (held, r"Tool is held, so each hold is reduced separately.*by a tolerance", {"count": 12}),
        (recorded, "the tolerance must be a number above zero", {"tolerance": 0.0}),
        (recorded, "the tolerance must be a number above zero", {"tolerance": float("nan")}),
        (recorded, "a motion needs at least 2 keys, not 1", {"count": 1}),
        (recorded, "Tool has 143 keys: ask for fewer", {"count": 100000}),
    ],
)
def test_where_nothing_can_be_reduced_it_says_why_and_the_way_out_and_changes_nothing(live_file, make, message, wishes):
    obj = make()
    before, actions = snapshot(obj), list(bpy.data.actions)
    with pytest.raises(Refused, match=message):
        reduce_keys_of(obj, **wishes)
    assert snapshot(obj) == before
    assert list(bpy.data.actions) == actions
    assert not len(obj.rigid_motion.bakes)
    assert reduction_of(obj) is None
