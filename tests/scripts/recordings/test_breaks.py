"""Tests of breaks in recordings: T-poses at the start, gaps, jumps, and the part that a user selects."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.recordings import ReadingOptions, Trajectory, TrajectoryError
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.rest_bodies import RestBody

JOINTS = {
    "Hips": (-1, (0, 1.0, 0)),
    "Head": (0, (0, 0.7, 0)),
    "LeftArm": (0, (0.2, 0.45, 0)),
    "LeftHand": (2, (0.65, 0, 0)),
    "RightArm": (0, (-0.2, 0.45, 0)),
    "RightHand": (4, (-0.65, 0, 0)),
    "LeftFoot": (0, (0.1, -0.95, 0)),
    "RightFoot": (0, (-0.1, -0.95, 0)),
}
"""Parents, and rest positions of joints in their parents' spaces: a T-pose in metres, y up."""

PARENTS = np.array([parent for parent, _ in JOINTS.values()])
OFFSETS = np.array([offset for _, offset in JOINTS.values()])


def turned(angle: np.ndarray, axis: int) -> np.ndarray:
    quaternions = np.zeros((*np.shape(angle), 4))
    quaternions[..., 0], quaternions[..., 1 + axis] = np.cos(angle / 2.0), np.sin(angle / 2.0)
    return quaternions


def dancer(rate: float = 30.0, seconds: float = 4.0, arms: float = 1.2, held: int = 0) -> Trajectory:
    """Return a dancer whose arms swing about the angle `arms` below a T-pose, after `held` samples of the T-pose."""
    times = np.arange(round(seconds * rate)) / rate
    poses = Poses(np.repeat(OFFSETS[:, None], len(times), axis=1), np.zeros((len(JOINTS), len(times), 4)))
    poses.quaternions[..., 0] = 1.0
    swing = arms + 0.4 * np.sin(6.0 * times)
    swing[:held] = 0.0
    poses.quaternions[2], poses.quaternions[4] = turned(-swing, 2), turned(swing, 2)
    places = np.where(PARENTS[:, None] > 0, OFFSETS + OFFSETS[PARENTS], OFFSETS)
    places[1:] += OFFSETS[0]
    rest = Poses(places, np.tile((1.0, 0.0, 0.0, 0.0), (len(JOINTS), 1)))
    return Trajectory(
        "dancer", times, poses, rest_body=RestBody(tuple(JOINTS), PARENTS, rest, np.ones((len(JOINTS), 3)))
    )


def clip_of(trajectory: Trajectory, measured: bool = True, **options: float) -> Clip:
    return make_clip(trajectory, "dance.bvh", "dance", "opengl", ReadingOptions(**options), measured=measured)


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 120.0])
@pytest.mark.parametrize("held", [1, 2, 5])
@pytest.mark.parametrize("metres", [1.0, 0.01])
def test_a_t_pose_in_front_is_left_out_and_said(rate: float, held: int, metres: float) -> None:
    dance = dancer(rate, held=held)
    positions = dance.poses.positions / metres
    rest = Poses(dance.rest_body.rest.positions / metres, dance.rest_body.rest.quaternions)
    dance = replace(
        dance,
        poses=Poses(positions, dance.poses.quaternions),
        rest_body=replace(dance.rest_body, rest=rest),
        metres_per_unit=metres,
    )
    clip = clip_of(dance)
    assert clip.calibration == held
    assert len(clip.times) == len(dance.times) - held
    assert clip.times[0] == dance.times[held]
    (warning,) = clip.warnings
    assert re.search(r"a T-pose and left out: from there to the next 'LeftHand' jumps 0\.[6-9]\d? m, ", warning.text)
    assert warning.way_out == "--start 0 keeps it"
    assert (warning.start_s, warning.end_s) == (0.0, dance.times[held])
    assert str(warning) in clip.repairs
    assert clip_of(dance, start=0.0).calibration == 0


def test_another_pose_in_front_stays_and_is_said() -> None:
    dance = dancer(rate=120.0)
    dance.poses.quaternions[2, 0] = turned(np.array(-2.6), 0)
    dance.poses.quaternions[4, 0] = turned(np.array(1.4), 2)
    clip = clip_of(dance)
    assert clip.calibration == 0
    (warning,) = [item for item in clip.warnings if "pose of its own" in item.text]
    assert warning.way_out == "leave it out: --start 0.00833"
    assert len(clip_of(dance, start=0.00833).times) == len(dance.times) - 1


@pytest.mark.parametrize("dance", [dancer(held=6), dancer(seconds=0.5, held=1)], ids=["held long", "few samples"])
def test_a_t_pose_that_may_be_a_part_of_the_recording_stays(dance):
    assert clip_of(dance).calibration == 0


def test_who_moves_out_of_a_t_pose_keeps_it() -> None:
    dance = dancer(held=1)
    swing = np.minimum(1.2, 3.0 * dance.times)
    dance.poses.quaternions[2], dance.poses.quaternions[4] = turned(-swing, 2), turned(swing, 2)
    assert clip_of(dance).calibration == 0
    assert clip_of(dance).warnings == ()


def test_who_dances_all_the_time_as_wildly_as_from_a_t_pose_keeps_it() -> None:
    dance = dancer(held=1)
    wild = np.where(np.arange(len(dance.times)) % 7 < 3, 0.0, 1.2)
    dance.poses.quaternions[2] = turned(-wild, 2)
    assert clip_of(dance).calibration == 0


def hand(count: int = 300, rate: float = 90.0, begin: float = 0.0) -> Trajectory:
    times = np.arange(count) / rate
    positions = np.stack((0.3 * np.sin(4.0 * times), 1.0 + 0.1 * np.cos(7.0 * times), 0.0 * times), axis=-1)
    return Trajectory("hand", begin + times, Poses(positions, np.tile((1.0, 0.0, 0.0, 0.0), (count, 1))))


def without(trajectory: Trajectory, *parts: tuple[float, float]) -> Trajectory:
    seconds = trajectory.times - trajectory.times[0]
    kept = ~np.any([(seconds > first) & (seconds < last) for first, last in parts], axis=0)
    return replace(trajectory, times=trajectory.times[kept], poses=trajectory.poses[kept])


@pytest.mark.parametrize("begin", [0.0, 1.7e9])
def test_a_gap_longer_than_keys_are_apart_is_said_with_its_times(begin: float) -> None:
    clip = clip_of(without(hand(begin=begin), (1.001, 1.299), (2.001, 2.099), (2.501, 3.099)))
    first, second = clip.warnings
    assert str(first) == (
        "no samples from 1.00 s to 1.30 s (one of 2 gaps): no error is measured there; "
        "take a part without it: --start and --end"
    )
    assert (first.start_s - begin, first.end_s - begin) == pytest.approx((1.0, 1.3), abs=1e-6)
    assert (second.start_s - begin, second.end_s - begin) == pytest.approx((2.5, 3.1), abs=1e-6)
    assert clip_of(without(hand(begin=begin), (1.001, 1.299)), start=1.299).warnings == ()


def test_who_is_slow_fast_or_jumps_all_the_time_is_not_warned() -> None:
    recorded, jumping = hand(), hand()
    fast = replace(recorded, poses=Poses(100.0 * recorded.poses.positions, recorded.poses.quaternions))
    jumping.poses.positions[30::60] += (0.0, 0.8, 0.0)
    for calm in (hand(rate=4.0), recorded, fast):
        assert clip_of(calm).warnings == ()
    assert "jump" not in "".join(map(str, clip_of(jumping).warnings))


def test_a_jump_is_said_with_its_time() -> None:
    recorded = hand()
    recorded.poses.positions[180:] += (0.0, 0.8, 0.0)
    (warning,) = clip_of(recorded).warnings
    assert warning.text.startswith("a jump at 1.99 s: 0.79 m in one sample, at 71.3 m/s")
    assert (warning.start_s, warning.end_s) == (recorded.times[179], recorded.times[180])
    assert clip_of(recorded, start=2.0).warnings == ()
    assert clip_of(recorded, measured=False).warnings == (), "an animation may jump"


def test_a_joint_that_jumps_is_said() -> None:
    dance = dancer(rate=120.0)
    dance.poses.quaternions[2, 300] = turned(np.array(1.0), 2)
    there, back = clip_of(dance).warnings
    assert there.text.startswith("a jump at 2.49 s (one of 2 jumps)")
    assert (there.end_s, back.start_s) == (dance.times[300], dance.times[300])


@pytest.mark.parametrize("begin", [0.0, 12.5, 1.7e9])
@pytest.mark.parametrize(
    ("options", "count"),
    [({}, 300), ({"start": 1.0}, 210), ({"end": 2.0}, 181), ({"start": 1.0, "end": 2.0}, 91), ({"end": 99.0}, 300)],
)
def test_start_and_end_count_from_the_first_sample(begin: float, options: dict, count: int) -> None:
    recorded = hand(begin=begin)
    clip = clip_of(
        replace(recorded, times=np.round(recorded.times, 6)),
        **{name: x - 1e-6 if name == "start" else x + 1e-6 for name, x in options.items()},
    )
    assert len(clip.times) == count
    assert clip.times[0] - begin == pytest.approx(options.get("start", 0.0), abs=1e-5)
    recorded.times[0] = -1e9  # A wild time in front does not move the start.
    assert clip_of(recorded, start=1.0).times[0] - begin == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"start": 5.0}, "0 samples from 5 s to its end, and it lasts 3.32 s; give another --start or --end"),
        ({"start": 1.0, "end": 1.005}, "1 samples from 1 s to 1.005 s, and it lasts 3.32 s"),
    ],
)
def test_a_part_without_samples_is_refused_with_what_there_is(options: dict, told: str) -> None:
    with pytest.raises(TrajectoryError, match=told):
        clip_of(hand(), **options)


def test_lengths_in_unreals_axes_are_said_to_be_centimetres_unless_the_user_says_what_they_are() -> None:
    said = make_clip(hand(), "hand.csv", "hand", "unreal").warnings
    assert [*map(str, said)] == ["its lengths are read as metres, and Unreal has centimetres; add --scale 0.01"]
    assert make_clip(hand(), "hand.csv", "hand", "unreal", ReadingOptions(scale=1.0)).warnings == ()
    assert make_clip(hand(), "hand.csv", "hand", "unity").warnings == ()
