"""Cleaned keys, read back from the evaluated scene: closer to the truth, moved by no more than reported, restorable.

Where keys cannot be cleaned, the refusal names the cause and the way out, and nothing changes.
"""

from __future__ import annotations

from itertools import product

import bpy
import numpy as np
import pytest

from rigid_motion.animation import (
    Refused,
    bake_poses,
    channelbag_of,
    clean_motion,
    key_frames,
    restore_keys,
    write_channel,
)
from rigid_motion.animation.baking.cleaning import focus_of, pixels_of
from rigid_motion.animation.transforms.sizes import reaches_of
from rigid_motion.motion import Poses, shell_error, standing
from rigid_motion.motion.contacts import slide, slide_ratios, spans
from rigid_motion.motion.quaternions import turned
from tests.animation.bones.poses import shown_poses
from tests.animation.bones.rigs import Rest, in_turn, new_rig
from tests.animation.keyed import curves_of, snapshot
from tests.animation.scenes import key, new_object
from tests.balls import displaced
from tests.rigs.recorded import FRAMES, recorded_rig
from tests.world_poses import read_poses

COUNT, RADIUS, SIZE, TURN = 300, 0.1, 1e-3, 5e-3
SPIKE = 120


def shaky(obj: bpy.types.Object, *, spike: float = 0.0) -> tuple[np.ndarray, Poses]:
    """Give an object dense keys with jitter and a spike. Return the frames and the poses without both."""
    random, frames = np.random.default_rng(4), np.arange(1.0, COUNT + 1.0)
    places = np.stack((np.sin(frames / 20.0), np.cos(frames / 31.0), frames / 500.0), axis=1)
    angles = np.stack((np.sin(frames / 40.0), 0.0 * frames, np.cos(frames / 50.0)), axis=1)
    truth = Poses(places, turned(np.tile((1.0, 0.0, 0.0, 0.0), (COUNT, 1)), angles))
    places = places + SIZE * random.normal(size=places.shape)
    places[SPIKE] += spike
    turns = turned(truth.quaternions, TURN * random.normal(size=places.shape))
    bake_poses(obj, frames, Poses(places, turns), key_type="KEYFRAME")
    return frames, truth


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def selected_frames(obj: bpy.types.Object) -> list[list[float]]:
    keys = (fcurve.keyframe_points for fcurve in curves_of(obj).values())
    return [[key.co[0] for key in points if key.select_control_point] for points in keys]


@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "XZY", "AXIS_ANGLE"])
@pytest.mark.parametrize("strength", [3.0, 0.5])
def test_it_jitters_less_and_is_moved_by_no_more_than_was_said(live_file, rotation_mode, strength):
    obj = new_object(rotation_mode=rotation_mode)
    obj.delta_location, obj.delta_rotation_euler, obj.delta_scale = (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (1.0, 1.0, 1.0)
    obj.delta_rotation_quaternion = (0.8, 0.0, 0.6, 0.0)
    frames, _ = shaky(obj, spike=0.1)
    before = read_poses(obj, frames)
    (cleaning,) = clean_motion(obj, strength, RADIUS)
    after = read_poses(obj, frames)
    moved = shell_error(after, before, RADIUS)
    assert (cleaning.spikes, cleaning.repeats) == (1, 0)
    assert moved[SPIKE] > 0.1
    assert np.delete(moved, SPIKE).max() == pytest.approx(cleaning.moved, rel=1e-3)
    assert cleaning.moved <= strength * cleaning.jitter * (1.0 + 1e-6)
    # Largest jitter of any point within the radius: that of locations plus that of rotations.
    assert cleaning.jitter == pytest.approx(3.0**0.5 * SIZE + 2.0**0.5 * TURN * RADIUS, rel=0.15)
    assert key_frames(obj).tolist() == frames.tolist()
    assert selected_frames(obj)[:6] == [[frames[SPIKE]]] * 6


def test_selected_keys_alone_are_cleaned_and_join_the_rest(live_file):
    obj = new_object()
    frames, truth = shaky(obj, spike=0.1)
    before, shaken = read_poses(obj, frames), snapshot(obj)
    for fcurve in curves_of(obj).values():
        for point in fcurve.keyframe_points:
            point.select_control_point = 101.0 <= point.co[0] <= 200.0
    (cleaning,) = clean_motion(obj, radius=RADIUS, selected=True)
    after = read_poses(obj, frames)
    moved = shell_error(after, before, RADIUS)
    assert cleaning.spikes == 1
    assert not moved[:101].any()
    assert not moved[199:].any()
    assert moved[101:104].max() < 0.5 * rms(moved[110:190])
    within = slice(110, 190)
    errors = (shell_error(poses[within], truth[within], RADIUS) for poses in (after, before))
    assert rms(next(errors)) < 0.6 * rms(np.delete(next(errors), SPIKE - 110))
    assert shaken.keys() == snapshot(obj).keys()
    restore_keys(obj)
    assert snapshot(obj) == shaken


def displacements(rig: bpy.types.Object, before: dict, after: dict) -> np.ndarray:
    """Return how far any point of each bone's ball was displaced in the rig, shape (bones, n)."""
    reaches = reaches_of(rig)
    return np.array([displaced(after[name], shown, reaches[name]) for name, shown in before.items()])


@pytest.mark.parametrize(
    ("chosen", "moves"),
    in_turn((None, ("Spine", "Hand.L"), ("Arm.R",)), tuple(product(("QUATERNION", "YZX"), (3.0, 0.3)))),
)
def test_no_bone_is_moved_by_more_whatever_it_hangs_on(live_file, chosen, moves):
    rotation_mode, strength = moves
    rig = recorded_rig(rotation_mode)
    rig.scale = (2.0, 2.0, 2.0)
    rig.data.bones["Arm.R"].use_inherit_rotation = False
    bpy.context.view_layer.update()
    (before,) = shown_poses([rig], FRAMES)
    shaken = snapshot(rig)
    bones = [bone for bone in rig.pose.bones if chosen is None or bone.name in chosen]
    (cleaning,) = clean_motion(bones, strength)
    assert not cleaning.spikes
    (after,) = shown_poses([rig], FRAMES)
    moved = 2.0 * displacements(rig, before, after)
    assert 0.0 < moved.max() == pytest.approx(cleaning.moved, rel=1e-3)
    assert cleaning.moved <= strength * cleaning.jitter * (1.0 + 1e-5)
    kept = {
        name: keys for name, keys in snapshot(rig).items() if chosen and not any(f'"{b}"' in name[0] for b in chosen)
    }
    assert all(shaken[name] == keys for name, keys in kept.items())
    if strength > 1.0:
        name = bones[-1].name
        jerks = [np.abs(np.diff(poses[name][:, :3, 1], n=4, axis=0)).mean() for poses in (before, after)]
        # An uncleaned arm in between keeps its jitter.
        assert jerks[1] < (0.9 if chosen == ("Spine", "Hand.L") else 0.7) * jerks[0]


LEG = (
    Rest("Hip", (0.0, 0.0, 1.0), (0.0, 0.001, 0.9)),
    Rest("Thigh", (0.0, 0.0, 0.9), (0.0, 0.001, 0.5), "Hip"),
    Rest("Foot", (0.0, 0.0, 0.1), (0.0, 0.001, 0.05), "Thigh"),
)


def shaky_leg(seed: int) -> bpy.types.Object:
    """Return a leg with IK-like keys: a moving hip with jitter, above a foot that stands and steps forwards in
    five frames out of thirty.
    """
    rig, random = new_rig("Leg", LEG), np.random.default_rng(seed)
    hip, steps = 0.005 * FRAMES + 0.002 * random.normal(size=len(FRAMES)), FRAMES / 30.0
    foot = 0.15 * (np.floor(steps) + np.clip(6.0 * np.mod(steps, 1.0) - 5.0, 0.0, 1.0))
    along = rig.data.bones["Hip"].x_axis.x
    write_channel(rig, 'pose.bones["Hip"].location', FRAMES, np.outer(hip / along, (1.0, 0.0, 0.0)))
    leans = np.outer(np.arcsin((hip - foot - 0.075) / along / 0.8), (0.0, 0.0, 1.0))
    turns = turned(np.tile((1.0, 0.0, 0.0, 0.0), (len(FRAMES), 1)), leans)
    write_channel(rig, 'pose.bones["Thigh"].rotation_quaternion', FRAMES, turns)
    return rig


def origins(rig: bpy.types.Object) -> np.ndarray:
    """Return the evaluated world positions of the bones' heads, shape (bones, n, 3)."""
    (shown,) = shown_poses([rig], FRAMES)
    return np.stack([(np.array(rig.matrix_world) @ poses)[:, :3, 3] for poses in shown.values()])


@pytest.mark.parametrize("upright", [True, False])
def test_a_foot_that_stands_slides_no_further_than_it_did(live_file, upright):
    for seed in range(3):
        rig = shaky_leg(seed)
        if not upright:
            # The axes of the channels are not those of the world.
            rig.parent = new_object("Parent")
            rig.parent.rotation_euler, rig.rotation_euler = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
            bpy.context.view_layer.update()
        before, targets = origins(rig), [*rig.pose.bones][:2]
        stands = standing(FRAMES / bpy.context.scene.render.fps, before, shaky=True)
        assert stands.any(axis=1).tolist() == [False, False, True]
        (cleaning,) = clean_motion(targets)
        after = origins(rig)
        # Cleaned without holding the foot, it slides 1.1 times as far in at least one of these.
        assert slide_ratios(after, before, stands).max() < 1.0 + 1e-4
        slides = slide(after, stands), slide(before, stands)
        assert cleaning.contacts == pytest.approx((len(spans(stands)), *slides), abs=1e-6)
        assert 0.0 < cleaning.moved <= 3.0 * cleaning.jitter


def test_cameras_are_cleaned_in_pixels_of_their_pictures(live_file):
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 1920, 1080, 100
    camera = new_object("Camera", data=bpy.data.cameras.new("Camera"))
    camera.data.dof.focus_distance = 4.0
    frames, _ = shaky(camera)
    (cleaning,) = clean_motion(camera)
    assert cleaning.jitter == pytest.approx(3.0**0.5 * SIZE + 2.0**0.5 * TURN * 4.0, rel=0.15)
    assert focus_of(camera) == 4.0
    # The centre of the picture, and a corner, where a rotation about the camera's axes shows most.
    at_centre = 1920.0 * camera.data.lens / camera.data.sensor_width / 4.0
    corner = 1.0 + (camera.data.sensor_width / camera.data.lens / 2.0) ** 2 * (1.0 + (9.0 / 16.0) ** 2)
    assert pixels_of(camera, 4.0) == pytest.approx(at_centre * corner, rel=1e-4)
    restore_keys(camera)
    (nearer,) = clean_motion(camera, nearest=2.0)
    scene.frame_set(int(frames[-1]))
    assert nearer.after.shape == (1, len(frames), 3)
    assert nearer.after[0, -1] == pytest.approx(np.array(camera.matrix_world.translation), abs=1e-5)
    restore_keys(camera)
    channels = channelbag_of(camera).fcurves
    for index in range(3):
        channels.remove(channels.find("location", index=index))
    (tripod,) = clean_motion(camera, nearest=2.0)
    scene.frame_set(int(frames[-1]))
    place = np.array(camera.matrix_world)[:3] @ (0.0, 0.0, -2.0, 1.0)
    assert tripod.after[0, -1] == pytest.approx(place, abs=1e-5)
    empty = new_object("Target")
    empty.location = (0.0, 0.0, 0.0)
    camera.data.dof.focus_object = empty
    assert focus_of(camera) == pytest.approx(camera.matrix_world.translation.length)


def test_what_has_no_jitter_or_no_dense_keys_says_so_and_others_are_cleaned(live_file):
    calm, sparse, few, held = (new_object(name) for name in ("Calm", "Sparse", "Few", "Shaky"))
    write_channel(calm, "location", FRAMES, np.stack([FRAMES, FRAMES**2 / 90.0, 0.0 * FRAMES], axis=1))
    key(sparse, np.arange(1.0, 300.0, 10.0))
    key(few, (1.0, 2.0, 3.0))
    shaky(held)
    before, refused = {obj: snapshot(obj) for obj in (calm, sparse, few)}, []
    (cleaning,) = clean_motion([calm, sparse, few, held], refused=refused)
    assert [one.name for one in cleaning.transforms] == ["Shaky"]
    assert sorted(map(str, refused)) == [
        "Calm has no jitter: there is nothing to clean",
        "Few has 3 keys of location and rotation: at least 10 are needed to distinguish jitter from motion",
        "Sparse has keys 10 frames apart: only keys on every frame can be cleaned",
    ]
    assert all(snapshot(obj) == keys for obj, keys in before.items())
    for fcurve in curves_of(held).values():
        fcurve.keyframe_points.foreach_set("select_control_point", [False] * len(fcurve.keyframe_points))
    with pytest.raises(Refused, match="no key of location, rotation or scale is selected"):
        clean_motion(held, selected=True)
    with pytest.raises(Refused, match="the strength must be above 0, not 0"):
        clean_motion(held, 0.0)
