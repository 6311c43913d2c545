"""Tests of plausibility: impossible motions, devices and clocks are refused or reported, ordinary ones are not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.recordings import ReadingOptions, Trajectory, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.plausibility import breaks, implausibilities, require_one_body
from rigid_motion_batch.recordings.times import typical_interval

COUNT = 90


def hand(side: float = 1.0, rate: float = 90.0) -> Trajectory:
    """Return a hand that swings back and forth within half a metre."""
    times = np.arange(COUNT) / rate
    positions = np.stack((side * 0.4 + 0.2 * np.sin(9.0 * times), 1.0 + 0.1 * times, 0.0 * times), axis=-1)
    return Trajectory("hand", times, Poses(positions, np.tile((1.0, 0.0, 0.0, 0.0), (COUNT, 1))))


def mixed(bodies: list[Trajectory], delay: float, order: Callable[[np.ndarray], np.ndarray]) -> Trajectory:
    """Return the rows of several bodies in one, each delayed a little more, sorted by `order` of their times."""
    times = np.concatenate([body.times + delay * place for place, body in enumerate(bodies)])
    rows = np.argsort(order(times), kind="stable")
    poses = Poses(
        *(np.concatenate([getattr(body.poses, part) for body in bodies]) for part in ("positions", "quaternions"))
    )
    return Trajectory("mixed", np.sort(times), poses[rows])


def jittered(times: np.ndarray) -> np.ndarray:
    return times + np.random.default_rng(0).uniform(0.0, 0.02, len(times))


@pytest.mark.parametrize("order", [np.asarray, jittered], ids=["by turns", "in any order"])
@pytest.mark.parametrize("delay", [0.0, 0.002], ids=["at the same times", "one after the other"])
@pytest.mark.parametrize("sides", [(-1.0, 1.0), (-1.0, 0.0, 1.0)], ids=["two", "three"])
@pytest.mark.parametrize("scale", [1.0, 100.0, 1000.0])
def test_devices_that_are_mixed_are_refused(order, delay: float, sides: tuple[float, ...], scale: float) -> None:
    both = mixed([hand(side) for side in sides], delay, order)
    both = replace(both, poses=Poses(scale * both.poses.positions, both.poses.quaternions))
    with pytest.raises(TrajectoryError, match=r"log.csv:1: \d+ of \d+ samples jump .* several devices; split it"):
        require_one_body(both, "log.csv", "split it", 1)


@pytest.mark.parametrize("scale", [1.0, 1000.0])
@pytest.mark.parametrize("rate", [10.0, 90.0, 1000.0])
@pytest.mark.parametrize("rounded_to", [0.0, 1e-4, 1e-2])
def test_one_device_is_not_refused(scale: float, rate: float, rounded_to: float) -> None:
    recorded = hand(rate=rate)
    positions = scale * recorded.poses.positions
    positions = np.round(positions / rounded_to) * rounded_to if rounded_to else positions
    require_one_body(replace(recorded, poses=Poses(positions, recorded.poses.quaternions)), "log.csv", "", 1)


@pytest.mark.parametrize(
    ("trajectory", "told"),
    [
        (hand(rate=4.0), "only 4 samples a second, fewer than any motion needs"),
        (hand(rate=90e3), "9e+04 samples a second, more than any device has"),
        (replace(hand(), metres_per_unit=100.0), "a twentieth of its speeds are above 179 m/s, and it goes 41.1 m far"),
    ],
)
def test_what_nobody_records_is_said(trajectory: Trajectory, told: str) -> None:
    assert str(implausibilities(trajectory)[0]).startswith(told)


@pytest.mark.parametrize(
    ("shift", "scale", "said"), [(1.7, 1.0, 0), (15.0, 1.0, 0), (170.0, 20.0, 1), (67.0, 8.0, 1), (170.0, 300.0, 1)]
)
def test_what_stays_far_from_its_origin_may_be_in_another_unit(shift: float, scale: float, said: int) -> None:
    """A calm head in centimetres or inches is no faster than a quick hand in metres, but as high up as a house."""
    recorded = hand(rate=10.0)
    calm = recorded.poses.positions * scale / 10.0 + np.array((0.0, shift, 0.0))
    result = implausibilities(replace(recorded, poses=Poses(calm, recorded.poses.quaternions)))
    assert len(result) == said
    assert all("--scale 0.01, if inches, --scale 0.0254" in item.way_out for item in result)


LOSSES = {
    "these are several recordings": (
        np.tile(np.arange(COUNT) / 90.0, 2),
        "89 of 180 rows are lost: dropped rows whose",
    ),
    "number them in a column": (
        np.repeat(np.arange(45) / 20.0, 4),
        "135 of 180 rows are lost: dropped rows whose time c",
    ),
    "tracking was lost": (np.where(np.arange(180) % 3, np.arange(180) / 90.0, np.nan), "60 of 180 rows are lost: drop"),
}


@pytest.mark.parametrize("way_out", LOSSES)
def test_a_quarter_of_the_rows_that_is_lost_is_a_warning_and_no_repair(way_out: str) -> None:
    recorded, (times, told) = hand(), LOSSES[way_out]
    poses = Poses(np.tile(recorded.poses.positions, (2, 1)), np.tile(recorded.poses.quaternions, (2, 1)))
    clip = make_clip(Trajectory("two", times, poses), "two.csv", "two", "blender")
    (warning,) = (item for item in clip.warnings if " lost: " in item.text)
    assert warning.text.startswith(told)
    assert way_out in warning.way_out
    assert clip.repairs.count(str(warning)) == 1
    assert not any(sentence.startswith(warning.text.partition(": ")[2]) for sentence in clip.repairs)


@pytest.mark.parametrize("late", [1e-6, 1e-4])
def test_a_stamp_that_is_too_early_or_too_late_is_no_jump(late: float) -> None:
    recorded = hand(rate=1000.0)
    times = np.arange(1000) / 1000.0
    times[500] = times[499] + late
    poses = Poses(
        np.tile(recorded.poses.positions, (12, 1))[:1000], np.tile(recorded.poses.quaternions, (12, 1))[:1000]
    )
    smooth = Poses(np.sin(times)[:, None] * np.ones(3), poses.quaternions)
    assert breaks(times, smooth, None, 1.0, 0.0) == []
    jump = smooth.positions.copy()
    jump[500:] += 1.0
    assert "a jump at" in str(breaks(times, Poses(jump, poses.quaternions), None, 1.0, 0.0)[0])


@pytest.mark.parametrize("row", [0, 40, COUNT - 1])
@pytest.mark.parametrize("time", [-1e25, 0.0, 1e6, 1e25, np.nan])
def test_one_wild_time_stamp_is_no_reason_for_doubts(row: int, time: float) -> None:
    recorded = hand()
    times = 1.7e9 + recorded.times
    times[row] = time
    assert implausibilities(replace(recorded, times=times)) == ()
    assert typical_interval(times) == pytest.approx(1.0 / 90.0, rel=1e-4)


def csv_of(times: list[str]) -> str:
    return "t,x,y,z,qx,qy,qz,qw\n" + "".join(f"{time},0,0,0,0,0,0,1\n" for time in times)


@pytest.mark.parametrize("name", ["take.csv", "take.tum"])
@pytest.mark.parametrize("start", [0, 1_700_000_000], ids=["from 0", "from 1970"])
@pytest.mark.parametrize(
    ("unit", "ticks", "told"),
    [
        ("ms", 1_000, "times are taken for milliseconds, 90.9 samples a second, as seconds would be 11 s apart"),
        ("us", 10**6, "times are taken for microseconds, 90.9 samples a second, as seconds would be 1.1e+04 s apart"),
        ("ns", 10**9, "times are taken for nanoseconds, 90.9 samples a second, as seconds would be 1.1e+07 s apart"),
    ],
)
def test_times_that_cannot_be_seconds_are_in_the_unit_of_a_rate_that_devices_have(
    write, name, start, unit, ticks, told
):
    text = csv_of([str(start * ticks + row * 11 * ticks // 1000) for row in range(9)])
    source = write(name, text if name.endswith(".csv") else "# " + text.replace(",", " "))
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


def test_keys_of_rows_are_no_times(write) -> None:
    source = write("take.csv", csv_of([str(18295873486192640 + row) for row in range(9)]))
    (counted,) = read_trajectories(source, ReadingOptions(frame_rate=90.0)).trajectories
    np.testing.assert_allclose(counted.times - counted.times[0], np.arange(9) / 90.0, atol=1e-8)
