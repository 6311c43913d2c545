"""Tests of plausibility: impossible motions, devices and clocks, T-poses at the start, gaps and jumps are reported."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.recordings import ReadingOptions, Trajectory, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.plausibility import breaks, implausibilities, require_one_body
from rigid_motion_batch.recordings.times import typical_interval
from tests.scripts.clips.bodies import rest_body_of, turns


def hand(side: float = 0.0, *, count: int = 300, rate: float = 90.0, begin: float = 0.0) -> Trajectory:
    """Return a hand that swings back and forth within half a metre."""
    times = np.arange(count) / rate
    places = 0.4 * side + 0.3 * np.sin(4.0 * times), 1.0 + 0.1 * np.cos(7.0 * times), 0.0 * times
    poses = Poses(np.stack(places, axis=-1), np.tile((1.0, 0.0, 0.0, 0.0), (count, 1)))
    return Trajectory("hand", begin + times, poses)


def scaled(trajectory: Trajectory, factor: float, shift: Sequence[float] = (0.0, 0.0, 0.0)) -> Trajectory:
    positions = factor * trajectory.poses.positions + np.array(shift)
    return replace(trajectory, poses=Poses(positions, trajectory.poses.quaternions))


def clip_of(trajectory: Trajectory, measured: bool = True, **options: float) -> Clip:
    return make_clip(trajectory, "dance.bvh", "dance", "opengl", ReadingOptions(**options), measured=measured)


def mixed(bodies: list[Trajectory], delay: float, order: Callable[[np.ndarray], np.ndarray]) -> Trajectory:
    """Return the rows of several bodies in one, each delayed a little more, sorted by `order` of their times."""
    times = np.concatenate([body.times + delay * place for place, body in enumerate(bodies)])
    rows = np.argsort(order(times), kind="stable")
    positions = np.concatenate([body.poses.positions for body in bodies])
    return Trajectory("mixed", np.sort(times), Poses(positions, np.tile((1.0, 0.0, 0.0, 0.0), (len(times), 1)))[rows])


def jittered(times: np.ndarray) -> np.ndarray:
    return times + np.random.default_rng(0).uniform(0.0, 0.02, len(times))


@pytest.mark.parametrize("order", [np.asarray, jittered], ids=["by turns", "in any order"])
@pytest.mark.parametrize("delay", [0.0, 0.002], ids=["at the same times", "one after the other"])
@pytest.mark.parametrize("sides", [(-1.0, 1.0), (-1.0, 0.0, 1.0)], ids=["two", "three"])
@pytest.mark.parametrize("scale", [1.0, 100.0, 1000.0])
def test_devices_that_are_mixed_are_refused(order, delay: float, sides: tuple[float, ...], scale: float) -> None:
    both = mixed([scaled(hand(side), scale) for side in sides], delay, order)
    with pytest.raises(TrajectoryError, match=r"log.csv:1: \d+ of \d+ samples jump .* several devices; split it"):
        require_one_body(both, "log.csv", "split it", 1)


@pytest.mark.parametrize("scale", [1.0, 1000.0])
@pytest.mark.parametrize("rate", [10.0, 90.0, 1000.0])
@pytest.mark.parametrize("rounded_to", [0.0, 1e-4, 1e-2])
def test_one_device_is_not_refused(scale: float, rate: float, rounded_to: float) -> None:
    recorded = scaled(hand(rate=rate), scale)
    if rounded_to:
        recorded.poses.positions[:] = np.round(recorded.poses.positions / rounded_to) * rounded_to
    require_one_body(recorded, "log.csv", "", 1)


@pytest.mark.parametrize(
    ("trajectory", "told"),
    [
        (hand(rate=4.0), "only 4 samples a second, fewer than any motion needs"),
        (hand(rate=90e3), "9e+04 samples a second, more than any device has"),
        (replace(hand(), metres_per_unit=100.0), "a twentieth of its speeds are above 133 m/s, and it goes 63.2 m far"),
    ],
)
def test_what_nobody_records_is_said(trajectory: Trajectory, told: str) -> None:
    assert str(implausibilities(trajectory)[0]).startswith(told)


@pytest.mark.parametrize(
    ("shift", "scale", "said"), [(1.7, 1.0, 0), (15.0, 1.0, 0), (170.0, 20.0, 1), (67.0, 8.0, 1), (170.0, 300.0, 1)]
)
def test_what_stays_far_from_its_origin_may_be_in_another_unit(shift: float, scale: float, said: int) -> None:
    """A calm head in centimetres or inches is no faster than a quick hand in metres, but as high up as a house."""
    result = implausibilities(scaled(hand(rate=10.0), scale / 10.0, (0.0, shift, 0.0)))
    assert len(result) == said
    assert all("--scale 0.01, if inches, --scale 0.0254" in item.way_out for item in result)


LOSSES = {
    "these are several recordings": (np.tile(np.arange(90) / 90.0, 2), "89 of 180 rows are lost: dropped rows whose"),
    "number them in a column": (
        np.repeat(np.arange(45) / 20.0, 4),
        "135 of 180 rows are lost: dropped rows whose",
    ),
    "tracking was lost": (np.where(np.arange(180) % 3, np.arange(180) / 90.0, np.nan), "60 of 180 rows are lost: drop"),
}


@pytest.mark.parametrize("way_out", LOSSES)
def test_a_quarter_of_the_rows_that_is_lost_is_a_warning_and_no_repair(way_out: str) -> None:
    times, told = LOSSES[way_out]
    clip = clip_of(replace(hand(count=180), times=times))
    (warning,) = (item for item in clip.warnings if " lost: " in item.text)
    assert warning.text.startswith(told)
    assert way_out in warning.way_out
    assert clip.repairs.count(str(warning)) == 1
    assert not any(sentence.startswith(warning.text.partition(": ")[2]) for sentence in clip.repairs)


@pytest.mark.parametrize("late", [1e-6, 1e-4])
def test_a_stamp_that_is_too_early_or_too_late_is_no_jump(late: float) -> None:
    recorded = hand(count=1000, rate=1000.0)
    times, poses = recorded.times, recorded.poses
    times[500] = times[499] + late
    assert breaks(times, poses, None, 1.0, 0.0) == []
    poses.positions[500:] += 1.0
    assert "a jump at" in str(breaks(times, poses, None, 1.0, 0.0)[0])


@pytest.mark.parametrize("row", [0, 40, -1])
@pytest.mark.parametrize("time", [-1e25, 0.0, 1e6, 1e25, np.nan])
def test_one_wild_time_stamp_is_no_reason_for_doubts(row: int, time: float) -> None:
    recorded = hand(count=90, begin=1.7e9)
    recorded.times[row] = time
    assert implausibilities(recorded) == ()
    assert typical_interval(recorded.times) == pytest.approx(1.0 / 90.0, rel=1e-4)


def csv_of(times: list[str]) -> str:
    return "t,x,y,z,qx,qy,qz,qw\n" + "".join(f"{time},0,0,0,0,0,0,1\n" for time in times)


@pytest.mark.parametrize("start", [0, 1_700_000_000], ids=["from 0", "from 1970"])
@pytest.mark.parametrize(
    ("unit", "ticks", "told"),
    [
        ("ms", 1_000, "times are taken for milliseconds, 90.9 samples a second, as seconds would be 11 s apart"),
        ("us", 10**6, "times are taken for microseconds, 90.9 samples a second, as seconds would be 1.1e+04 s apart"),
        ("ns", 10**9, "times are taken for nanoseconds, 90.9 samples a second, as seconds would be 1.1e+07 s apart"),
    ],
)
def test_times_that_cannot_be_seconds_are_in_the_unit_of_a_rate_that_devices_have(write, start, unit, ticks, told):
    source = write("take.csv", csv_of([str(start * ticks + row * 11 * ticks // 1000) for row in range(9)]))
    (trajectory,) = read_trajectories(source).trajectories
    assert trajectory.remark.startswith(told)
    assert trajectory.remark.endswith("(otherwise: --time-unit)")
    (said,) = read_trajectories(source, ReadingOptions(time_unit=unit)).trajectories
    for recorded in (trajectory, said):
        np.testing.assert_array_equal(recorded.times - recorded.times[0], [row * 11 / 1000 for row in range(9)])
    (trajectory,) = read_trajectories(source, ReadingOptions(time_unit="s")).trajectories
    assert typical_interval(trajectory.times) == pytest.approx(11 * ticks / 1000, rel=0.05)


@pytest.mark.parametrize(("ticks", "unit"), [(1, ""), (1000, "milliseconds"), (10**9, "nanoseconds")])
def test_a_clock_that_counts_from_1970_tells_its_unit_at_any_rate(write, ticks: int, unit: str) -> None:
    source = write("slow.csv", csv_of([str((1_700_000_000 + 3 * row) * ticks) for row in range(9)]))
    (trajectory,) = read_trajectories(source).trajectories
    np.testing.assert_array_equal(np.diff(trajectory.times), 3.0)
    assert unit in trajectory.remark
    assert bool(trajectory.remark) == bool(unit)


@pytest.mark.parametrize("wild", ["", "1e25", "-5"])
@pytest.mark.parametrize("row", [0, 5])
def test_a_row_without_its_time_changes_no_unit(write, wild: str, row: int) -> None:
    times = [repr(0.3 * place) for place in range(9)]
    times[row] = wild
    (trajectory,) = read_trajectories(write("take.csv", csv_of(times))).trajectories
    assert trajectory.remark == ""
    assert trajectory.times[8] == 0.3 * 8


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


X, Z = np.eye(3)[[0, 2]]


def dancer(
    rate: float = 30.0, seconds: float = 4.0, held: int = 0, metres: float = 1.0, arms: np.ndarray | None = None
) -> Trajectory:
    """Return a dancer whose arms are at these angles below a T-pose, or swing, after `held` samples of the T-pose."""
    times = np.arange(round(seconds * rate)) / rate
    poses = Poses(np.repeat(OFFSETS[:, None], len(times), axis=1) / metres, np.zeros((len(JOINTS), len(times), 4)))
    poses.quaternions[..., 0] = 1.0
    rest_body = rest_body_of(JOINTS, PARENTS, poses[:, 0], np.ones((len(JOINTS), 3)))
    swing = 1.2 + 0.4 * np.sin(6.0 * times) if arms is None else arms
    swing[:held] = 0.0
    poses.quaternions[2], poses.quaternions[4] = turns(-swing, Z), turns(swing, Z)
    return Trajectory("dancer", times, poses, metres_per_unit=metres, rest_body=rest_body)


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 120.0])
@pytest.mark.parametrize("held", [1, 2, 5])
@pytest.mark.parametrize("metres", [1.0, 0.01])
def test_a_t_pose_in_front_is_left_out_and_said(rate: float, held: int, metres: float) -> None:
    dance = dancer(rate, held=held, metres=metres)
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
    dance.poses.quaternions[2, 0] = turns(np.array(-2.6), X)
    dance.poses.quaternions[4, 0] = turns(np.array(1.4), Z)
    clip = clip_of(dance)
    assert clip.calibration == 0
    (warning,) = [item for item in clip.warnings if "pose of its own" in item.text]
    assert warning.way_out == "leave it out: --start 0.00833"
    assert len(clip_of(dance, start=0.00833).times) == len(dance.times) - 1


MOVING_OUT = np.minimum(1.2, np.arange(120) / 10.0)
WILD = np.where(np.arange(120) % 7 < 3, 0.0, 1.2)


@pytest.mark.parametrize(
    ("dance", "jumps"),
    [(dancer(held=6), 1), (dancer(seconds=0.5, held=1), 0), (dancer(arms=MOVING_OUT), 0), (dancer(arms=WILD), 0)],
    ids=["held long", "few samples", "moving out of it", "as wild all the time"],
)
def test_a_t_pose_that_may_be_a_part_of_the_recording_stays(dance: Trajectory, jumps: int) -> None:
    clip = clip_of(dance)
    assert clip.calibration == 0
    assert ["a jump" in warning.text for warning in clip.warnings] == [True] * jumps


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
    jumping.poses.positions[30::60] += (0.0, 0.8, 0.0)
    for calm in (hand(rate=4.0), recorded, scaled(recorded, 100.0)):
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
    dance.poses.quaternions[2, 300] = turns(np.array(1.0), Z)
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
