"""Whole bodies beside Blender's Decimate: on a leg that swings as it goes, with a foot that is fixed to it."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from research.body_reduction import numbers_of
from research.decimating import DecimatedBody, Left, decimate
from rigid_motion.motion import Poses
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.analysis.reconstructions import Reconstruction, reconstruct
from rigid_motion_batch.axes import AXES
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.rest_bodies import RestBody
from tests.balls import largest_displacements

RADIUS = np.array((0.03, 0.05, 0.02, 0.03))

MODE = "motor_spline"

JOINTS = ("Hip", "Knee", "Foot", 'A "bone" of\\any name')

PARENTS = np.array((-1, 0, 1, 0))


def leg(name: str = "leg", samples: int = 40) -> Clip:
    """In centimetres, y upwards."""
    times = 12.5 + np.arange(samples) / 30.0
    places = np.tile(np.array(((0.0, 90.0, 0.0), (0, -45, 0), (0, -45, 0), (10, 0, 0)))[:, None], (1, samples, 1))
    places[0, :, 2] += 60.0 * np.sin(2.0 * times)
    axes = np.array(((1.0, 0.2, 0.0), (1.0, 0.0, 0.3), (0.0, 1.0, 0.0), (0.0, 0.5, 1.0)))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.array((0.7, 1.1, 0.0, 0.5))[:, None] * np.sin(np.array((5.0, 7.0, 0.0, 3.0))[:, None] * times)
    turns = np.concatenate((np.cos(angles / 2)[..., None], np.sin(angles / 2)[..., None] * axes[:, None]), axis=-1)
    poses = Poses(places, turns)
    tails = np.tile((0.0, -20.0, 0.0), (4, 1))
    rest_body = RestBody(JOINTS, PARENTS, poses[:, 0], tails)
    rest = rest_body.skeleton.in_root_space(poses[:, 0])
    return Clip(name, f"{name}.bvh", "opengl", times, poses, (), 0.01, rest_body=replace(rest_body, rest=rest))


def made_of(clip: Clip, *, shared: bool = False, tolerance: str = "1cm") -> Reconstruction:
    return reconstruct(clip, Tolerance(tolerance), [MODE], RADIUS, shared=shared)


def in_world(clip: Clip) -> np.ndarray:
    """Matrices of all joints in Blender's axes and metres, by hand, shape (n, joints, 4, 4)."""
    axes, samples = AXES[clip.axes], len(clip.times)
    world = np.tile(np.eye(4), (samples, len(JOINTS), 1, 1))
    for joint, parent in enumerate(PARENTS):
        own = np.tile(np.eye(4), (samples, 1, 1))
        own[:, :3, :3] = Rotation.from_quat(clip.poses.quaternions[joint], scalar_first=True).as_matrix()
        own[:, :3, 3] = clip.poses.positions[joint] * clip.metres_per_unit
        world[:, joint] = own if parent < 0 else world[:, parent] @ own
    world[..., :3, :3] = axes @ world[..., :3, :3] @ axes.T
    world[..., :3, 3] = world[..., :3, 3] @ axes.T
    return world


def as_blender_shows(body: DecimatedBody) -> np.ndarray:
    """Matrices of all bones in the world, frame by frame, shape (n, joints, 4, 4)."""
    shown = []
    for frame in body.frames:
        bpy.context.scene.frame_set(int(frame))
        rig = body.rig.obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        shown.append([np.array(rig.matrix_world @ rig.pose.bones[name].matrix) for name in body.rig.bones])
    return np.array(shown)


def errors_by_hand(shown: np.ndarray, recorded: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """How far off bones are, shape (joints, n): a bone is turned from its joint, and the stage has its own origin."""
    from_bone = np.linalg.inv(recorded[0, :, :3, :3]) @ truth[0, :, :3, :3]
    origin = recorded[0, 0, :3, 3] - truth[0, 0, :3, 3]
    turns = shown[..., :3, :3] @ from_bone - truth[..., :3, :3]
    offsets = shown[..., :3, 3] - origin - truth[..., :3, 3]
    return np.array([largest_displacements(offsets[:, j], RADIUS[j] * turns[:, j]) for j in range(len(JOINTS))])


def test_errors_of_decimated_curves_are_those_of_what_blender_shows() -> None:
    clip = leg()
    body, truth = DecimatedBody(made_of(clip)), in_world(clip)
    recorded = as_blender_shows(body)
    assert body.errors().max() < 1e-6
    assert errors_by_hand(recorded, recorded, truth).max() < 2e-6
    for margin in (0.003, 0.05):
        decimate(body.rig.obj, mode="ERROR", remove_error_margin=margin)
        result = errors_by_hand(as_blender_shows(body), recorded, truth)
        np.testing.assert_allclose(body.errors(), result, atol=3e-6)
        assert body.left().largest == pytest.approx(result.max(), abs=3e-6)
        assert result.max() > 1e-3


@pytest.mark.parametrize("shared", [False, True])
def test_decimate_is_held_to_an_error_and_all_is_counted(monkeypatch, shared: bool) -> None:
    tried: list[Left] = []
    left = DecimatedBody.left

    def counted(body: DecimatedBody) -> Left:
        curves = body.rig.obj.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
        varying = [curve for curve in curves if (curve.data_path, curve.array_index) in body._counted]
        keys = [[key.co.x for key in curve.keyframe_points] for curve in varying]
        tried.append(left(body))
        assert tried[-1].keys == sum(map(len, keys))
        assert tried[-1].frames == len({frame for own in keys for frame in own})
        assert tried[-1].numbers == 6 * tried[-1].keys
        return tried[-1]

    monkeypatch.setattr(DecimatedBody, "left", counted)
    made = made_of(leg(), shared=shared)
    largest = float(made.shell(MODE).max())
    result = DecimatedBody(made).within(largest)
    assert result in tried
    assert result.keys == min(item.keys for item in tried if item.largest <= largest)
    assert result.keys < max(item.keys for item in tried)
    # The hip moves and turns, two others turn; of key poses the time is there once.
    keys = [joint for joint in made.keys[MODE] if len(joint) > 1]
    channels = sum(len(joint) * (7 if number == 0 else 4) for number, joint in enumerate(keys))
    assert numbers_of(made) == channels + (len(keys[0]) if shared else sum(map(len, keys)))
