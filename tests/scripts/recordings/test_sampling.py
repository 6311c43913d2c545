"""Tests of sampling FBX, glTF and .blend files: a sample at every key of every curve, and more where curves bend."""

from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import interpolate
from rigid_motion_batch.recordings import Trajectory, read_trajectories
from tests.scripts.recordings.blends import FPS, added, fcurves, in_blender, key, linear
from tests.scripts.recordings.glbs import Body, Track, chain, curved, mixed_rates, turning

bpy = pytest.importorskip("bpy")

SINGLE = 2e-5
"""Tolerance in metres: single precision in files and in Blender, through a chain of 20 joints."""

WITHIN = 1e-3
"""Allowed error between samples, in metres."""


def read(source: object) -> Trajectory:
    (trajectory,) = read_trajectories(str(source)).trajectories
    return trajectory


def largest_error(trajectory: Trajectory, body: Body, times: np.ndarray) -> float:
    """Return the largest error of a joint's position, with linear in-betweens in the parents' spaces."""
    order = [trajectory.rest_body.joints.index(f"Joint{joint}") for joint in range(len(body.parents))]
    local = interpolate(trajectory.times, trajectory.poses, times, "lerp_slerp")
    seen = trajectory.rest_body.skeleton.in_root_space(local).positions
    return float(np.linalg.norm(seen[order] - body.places(times), axis=-1).max())


def test_the_densest_curve_says_the_rate(tmp_path: Path) -> None:
    body = mixed_rates()
    result = read(body.write(tmp_path / "mixed.glb"))
    assert result.rate == 30.0
    np.testing.assert_allclose(result.times, np.arange(61) / 30.0, atol=1e-6)
    assert largest_error(result, body, np.arange(61) / 30.0) < SINGLE
    assert largest_error(result, body, body.moments) < WITHIN
    assert result.warnings == ()


@pytest.mark.parametrize("size", [1.0, 0.01])
def test_splines_are_read_with_their_tangents(tmp_path: Path, size: float) -> None:
    body = curved(size)
    result = read(body.write(tmp_path / "curved.glb"))
    assert largest_error(result, body, body.moments) < WITHIN
    assert (result.rate, result.warnings) == (60.0, ()), "two keys a second tell no rate"


def test_a_step_is_two_samples_and_is_told(tmp_path: Path) -> None:
    parents, offsets = chain(3, 0.5)
    even = np.arange(31) / 30
    tracks = [
        Track(0, "rotation", even, turning(even, 0.1 * even)),
        Track(1, "rotation", np.array([0.0, 0.4, 1.0]), turning(even[:3], np.array([0.0, 0.8, 0.8])), "STEP"),
    ]
    body = Body(parents, offsets, tracks)
    result = read(body.write(tmp_path / "step.glb"))
    assert len(result.times) == 32
    times = body.moments[(body.moments < 0.4 - 0.03 / 30) | (body.moments > 0.4)]
    assert largest_error(result, body, times) < WITHIN
    (warning,) = result.warnings
    assert "it jumps" in warning.text
    assert "first at 0.3992 s" in warning.text


def in_a_strip(obj: bpy.types.Object, **settings: object) -> bpy.types.NlaStrip:
    """Move the Action of an object into an NLA strip."""
    data = obj.animation_data
    strip = data.nla_tracks.new().strips.new("Strip", 1, data.action)
    if strip.action_slot is None:
        strip.action_slot = data.action.slots[0]
    data.action = None
    for name, value in settings.items():
        setattr(strip, name, value)
    return strip


STRIPS = [{"scale": 1.5}, {"scale": 0.37, "repeat": 3.0}, {"scale": 1.5, "use_reverse": True}, {"frame_start": 5.3}]


@pytest.mark.parametrize("settings", STRIPS)
def test_an_object_in_a_strip_is_read_within_a_millimetre_at_every_eighth(saved, scene, settings: dict) -> None:
    """The object is keyed on every third frame with Blender's default easing, as an animator blocks it out."""
    tool = added("Tool")
    for number, frame in enumerate(range(1, 32, 3)):
        key(tool, frame, location=(0.3 * (number % 2), 0.1 * number, 0))
    strip = in_a_strip(tool, **settings)
    frames = np.arange(np.ceil(8 * strip.frame_start) + 1, 8 * strip.frame_end - 1) / 8
    if "repeat" in settings:
        turns = strip.frame_start + 30 * strip.scale * np.arange(1, 3)
        frames = frames[np.abs(frames - turns[:, None]).min(axis=0) > 0.05]
    (expected,) = in_blender(frames, lambda depsgraph: [tool.evaluated_get(depsgraph).matrix_world.translation])
    result = read(saved())
    made = interpolate(result.times, result.poses, frames / FPS, "lerp_slerp").positions
    assert np.linalg.norm(made - expected, axis=-1).max() < WITHIN


def test_keys_off_whole_frames_are_samples(saved) -> None:
    tool = added("Tool")
    for frame, x in ((1, 0), (2.4, 1), (2.7, -1), (6, 0)):
        key(tool, frame, location=(x, 0, 0))
    linear(tool)
    result = read(saved())
    np.testing.assert_allclose(result.times * FPS, [1, 2, 2.4, 2.7, 3, 4, 5, 6], atol=1e-6)
    np.testing.assert_allclose(result.poses.positions[2:4, 0], [1, -1], atol=1e-6)


def test_angles_that_flip_between_frames_are_no_motion(saved) -> None:
    tool = added("Tool")
    for frame in range(1, 21):
        key(tool, frame, rotation_euler=(0, 0, np.radians((170 + 2 * frame + 180) % 360 - 180)))
    linear(tool)
    recording = read_trajectories(saved())
    assert len(recording.trajectories[0].times) == 20
    assert "taken to go the short way" in recording.note


def test_what_swings_too_fast_is_warned_of_with_how_far_it_is_off(saved) -> None:
    tool = added("Tool")
    for frame in (1, 11):
        key(tool, frame, location=(frame, 0, 0))
    noise = fcurves(tool)[0].modifiers.new("FNGENERATOR")
    noise.function_type, noise.amplitude, noise.phase_multiplier, noise.use_additive = "SIN", 0.5, 400.0, True
    result = read(saved())
    (warning,) = result.warnings
    assert "mm off a straight way" in warning.text
    assert len(result.times) < 300
