"""What no hand, no device and no clock does is refused or said; what people record is neither."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.recordings import ReadingOptions, Trajectory, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.sense import doubts, require_one_body
from rigid_motion_batch.recordings.times import typical_interval

COUNT = 90


def hand(side: float = 1.0, rate: float = 90.0) -> Trajectory:
    """One that swings to and fro within half a metre."""
    times = np.arange(COUNT) / rate
    positions = np.stack((side * 0.4 + 0.2 * np.sin(9.0 * times), 1.0 + 0.1 * times, 0.0 * times), axis=-1)
    return Trajectory("hand", times, Poses(positions, np.tile((1.0, 0.0, 0.0, 0.0), (COUNT, 1))))


def mixed(bodies: list[Trajectory], delay: float, order: Callable[[np.ndarray], np.ndarray]) -> Trajectory:
    """The rows of several in one, each body a little later than the one before, by what `order` makes of the times."""
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
    one = hand(rate=rate)
    positions = scale * one.poses.positions
    positions = np.round(positions / rounded_to) * rounded_to if rounded_to else positions
    require_one_body(replace(one, poses=Poses(positions, one.poses.quaternions)), "log.csv", "", 1)


@pytest.mark.parametrize(
    ("trajectory", "told"),
    [
        (hand(rate=4.0), "only 4 samples a second, fewer than any motion needs"),
        (hand(rate=90e3), "9e+04 samples a second, more than any device has"),
        (replace(hand(), metres_per_unit=100.0), "a twentieth of its speeds are above 179 m/s, and it goes 41.1 m far"),
    ],
)
def test_what_nobody_records_is_said(trajectory: Trajectory, told: str) -> None:
    assert str(doubts(trajectory)[0]).startswith(told)


@pytest.mark.parametrize(
    ("shift", "scale", "said"), [(1.7, 1.0, 0), (15.0, 1.0, 0), (170.0, 20.0, 1), (67.0, 8.0, 1), (170.0, 300.0, 1)]
)
def test_what_stays_far_from_its_origin_may_be_in_another_unit(shift: float, scale: float, said: int) -> None:
    """A calm head in centimetres or inches is no faster than a quick hand in metres, but as high as a house."""
    one = hand(rate=10.0)
    calm = one.poses.positions * scale / 10.0 + np.array((0.0, shift, 0.0))
    result = doubts(replace(one, poses=Poses(calm, one.poses.quaternions)))
    assert len(result) == said
    assert all("--scale 0.01, if inches, --scale 0.0254" in item.way_out for item in result)


def test_recordings_one_behind_the_other_are_said() -> None:
    one = hand()
    poses = Poses(np.tile(one.poses.positions, (2, 1)), np.tile(one.poses.quaternions, (2, 1)))
    (said,) = doubts(Trajectory("two", np.tile(one.times, 2), poses))
    assert str(said).startswith(
        "its time runs backwards at row 90, and 89 of 180 rows are lost to that: these are several"
    )


@pytest.mark.parametrize("row", [0, 40, COUNT - 1])
@pytest.mark.parametrize("time", [-1e25, 0.0, 1e6, 1e25, np.nan])
def test_one_wild_time_stamp_is_no_reason_for_doubts(row: int, time: float) -> None:
    one = hand()
    times = 1.7e9 + one.times
    times[row] = time
    assert doubts(replace(one, times=times)) == ()
    assert typical_interval(times) == pytest.approx(1.0 / 90.0, rel=1e-4)


def csv_of(times: list[str]) -> str:
    return "t,x,y,z,qx,qy,qz,qw\n" + "".join(f"{time},0,0,0,0,0,0,1\n" for time in times)


@pytest.mark.parametrize("name", ["take.csv", "take.tum"])
@pytest.mark.parametrize("start", [0, 1_700_000_000], ids=["from 0", "from 1970"])
@pytest.mark.parametrize(
    ("unit", "ticks", "told"),
    [
        ("ms", 1_000, "t goes in steps of 11: as seconds that is one sample in 11 s; these look like milliseconds (90"),
        ("us", 10**6, "t goes in steps of 1.1e+04: as seconds that is one sample in 1.1e+04 s; these look like micros"),
        ("ns", 10**9, "t goes in steps of 1.1e+07: as seconds that is one sample in 1.1e+07 s; these look like nanose"),
    ],
)
def test_times_that_are_no_seconds_are_refused_with_their_unit(write, refusal, name, start, unit, ticks, told):
    text = csv_of([str(start * ticks + row * 11 * ticks // 1000) for row in range(9)])
    source = write(name, text if name.endswith(".csv") else "# " + text.replace(",", " "))
    line, message = refusal(source)
    assert line == 1
    assert message.startswith(told)
    assert message.endswith(f"--time-unit {unit}, or --time-unit s if they are seconds")
    (trajectory,) = read_trajectories(source, ReadingOptions(time_unit=unit)).trajectories
    np.testing.assert_array_equal(trajectory.times - trajectory.times[0], [row * 11 / 1000 for row in range(9)])
    (trajectory,) = read_trajectories(source, ReadingOptions(time_unit="s")).trajectories
    assert typical_interval(trajectory.times) == pytest.approx(11 * ticks / 1000, rel=0.05)
