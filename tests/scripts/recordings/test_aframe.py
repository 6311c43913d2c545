"""Recordings of A-Frame's motion-capture components."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion_batch.recordings import read_trajectories


def device(offset: float = 0.0, **extra: object) -> dict:
    """A device's recording, as the components write it since 2017."""
    poses = [
        {
            "position": {"x": offset + frame, "y": 1.5, "z": -0.25},
            "rotation": {"x": 10.0, "y": 120.0 + frame, "z": -60.0},
            "timestamp": 306686.13 + 11.0 * frame,
        }
        for frame in range(3)
    ]
    return {"poses": poses, "events": [], **extra}


def test_a_recording_of_a_headset_and_controllers_holds_them_by_name(write) -> None:
    content = {"camera": device(), "left": device(5.0, gamepad={"hand": "left"}), "right": device(7.0)}
    recording = read_trajectories(write("play.json", json.dumps(content)))
    assert [trajectory.name for trajectory in recording.trajectories] == ["camera"]
    assert recording.others == ("left", "right")
    (left,) = read_trajectories(write("play.json", json.dumps(content)) + ":left").trajectories
    np.testing.assert_array_equal(left.poses.positions[:, 0], [5.0, 6.0, 7.0])


def test_times_are_seconds_and_angles_are_turned_in_the_order_y_x_z(write) -> None:
    (trajectory,) = read_trajectories(write("hand.json", json.dumps(device()))).trajectories
    assert trajectory.name == "hand"
    np.testing.assert_allclose(trajectory.times, [306.68613, 306.69713, 306.70813], rtol=1e-15)
    angles = [[120, 10, -60], [121, 10, -60], [122, 10, -60]]
    expected = Rotation.from_euler("YXZ", angles, degrees=True).as_quat()[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(trajectory.poses.quaternions, expected, atol=1e-15)


@pytest.mark.parametrize("bare", [True, False])
def test_the_first_versions_wrote_lists_and_quaternions(write, bare: bool) -> None:
    poses = [{"rotation": [0.1, 0.2, 0.3, 0.9], "position": [1, 2, 3], "timestamp": 10 * t} for t in range(2)]
    content = json.dumps(poses if bare else {"poses": poses, "events": []})
    (trajectory,) = read_trajectories(write("hand.json", content)).trajectories
    np.testing.assert_array_equal(trajectory.poses.positions, [[1, 2, 3]] * 2)
    np.testing.assert_array_equal(trajectory.poses.quaternions, [[0.9, 0.1, 0.2, 0.3]] * 2)


def test_a_controller_that_was_off_is_left_out(write) -> None:
    content = {"camera": device(), "right": {"poses": [], "events": []}}
    recording = read_trajectories(write("play.json", json.dumps(content)) + ":*")
    assert [trajectory.name for trajectory in recording.trajectories] == ["camera"]


def broken(**changes: object) -> str:
    content = device()
    content["poses"][2].update(changes)
    return json.dumps(content)


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("", 1, "this is not JSON"),
        ('{"poses":\n[}', 2, "this is not JSON"),
        ("[" * 200_000, None, "this JSON cannot be a recording"),
        ('{"poses": [%s]}' % ("9" * 5000), None, "this JSON cannot be a recording"),
        ("3", None, "this JSON holds no poses"),
        ('{"camera": 1, "left": {"events": []}}', None, "this JSON holds no poses"),
        ('{"camera": {"poses": []}}', None, "no moving body in this file"),
        ('{"poses": []}', None, "'hand' has 0 samples"),
        ('{"poses": [1, 2]}', None, "pose 0 of 'hand' has no number timestamp"),
        (broken(timestamp="noon"), None, "pose 2 of 'hand' has no number timestamp"),
        (broken(position={"x": 1, "y": 2}), None, "pose 2 of 'hand' has no number position.z"),
        (broken(position={"x": 1, "y": [2], "z": 3}), None, "pose 2 of 'hand' has no number position.y"),
        (broken(position=7), None, "pose 2 of 'hand' has no number position.x"),
        (broken(rotation=[0, 0, 0, 1]), None, "pose 2 of 'hand' has no number rotation.y"),
        (broken(timestamp=10**400), None, "pose 2 of 'hand' has no number timestamp"),
        (b"\x80\x81", 1, "this is not text"),
    ],
)
def test_a_wrong_file_is_told_in_one_line(write, refusal, text: str | bytes, line: int | None, problem: str) -> None:
    told_line, message = refusal(write("hand.json", text))
    assert message.startswith(problem)
    assert told_line == line
