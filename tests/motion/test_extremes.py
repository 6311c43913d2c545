"""Numbers at the ends of what floats hold: a result that is finite, or an error that says where; never a warning."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

from rigid_motion.motion import MODES, Poses, decimate, interpolate, measure, reduce_keys, repair

WILD = (
    *(0.0, -0.0, 1.0, -1.0, 1e308, -1e308, 1e-308, 5e-324, -5e-324, 1e155, 1e-160, 1e100, 9e99),
    *(1e41, 9e39, -9e39, 3.4e38, 1e30, 1e-30, 2e-30, 1e15, 1e-15, 1e-6, 1.1e-6, 9e5, np.nan, np.inf, -np.inf),
)

WANTED = ({"tolerance": 0.01}, {"tolerance": 0.01, "rms": True}, {"budget": 2}, {"budget": 3, "rms": True})


def wild_recording(chance: Random) -> tuple[np.ndarray, Poses]:
    """Some samples of a motion, a share of whose numbers are wild."""
    count, sound = chance.randint(2, 12), chance.random()

    def numbers(*shape: int) -> np.ndarray:
        size = int(np.prod(shape))
        drawn = [chance.uniform(-3.0, 3.0) if chance.random() < sound else chance.choice(WILD) for _ in range(size)]
        return np.array(drawn).reshape(shape)

    times = np.where(np.array([chance.random() < sound for _ in range(count)]), np.arange(count) / 50.0, numbers(count))
    times = np.sort(times) if chance.random() < 0.5 else times
    scales = np.abs(numbers(count)) if chance.random() < 0.5 else None
    return times, Poses(numbers(count, 3), numbers(count, 4), scales)


@pytest.mark.parametrize("mode", MODES)
def test_whatever_is_repaired_can_be_filled_in_measured_and_thinned(mode: str) -> None:
    usable = 0
    for seed in range(120):
        times, poses, repairs = repair(*wild_recording(Random(seed)))
        assert all(str(repaired) for repaired in repairs)
        if len(times) < 2:
            continue
        usable += 1
        shown = interpolate(times, poses, np.linspace(times[0], times[-1], 30), mode)
        assert np.isfinite(shown.positions).all()
        assert np.isfinite(shown.quaternions).all()
        assert shown.scales is None or np.isfinite(shown.scales).all()
        kept = decimate(times, 10.0)
        errors = measure(times, interpolate(times[kept], poses[kept], times, mode), poses)
        assert all(np.isfinite(values).all() for values in vars(errors).values())
        for wanted in WANTED:
            keys = reduce_keys(times, poses, mode, **wanted)
            assert keys[0] == 0
            assert keys[-1] == len(times) - 1
    assert usable > 30


@pytest.mark.parametrize("value", [1e308, -1e308, np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", ["time", "position", "quaternion", "scale"])
def test_what_is_no_measurement_is_refused_with_its_place(field: str, value: float) -> None:
    times = np.arange(5.0)
    numbers = {"position": np.ones((5, 3)), "quaternion": np.ones((5, 4)), "scale": np.ones(5), "time": times}
    numbers[field][2] = value
    poses = Poses(numbers["position"], numbers["quaternion"], numbers["scale"])
    for mode in MODES:
        with pytest.raises(ValueError, match=rf"key [23] .*({field}|later)"):
            interpolate(times, poses, [1.5], mode)
        with pytest.raises(ValueError, match=r"sample [23] "):
            reduce_keys(times, poses, mode, tolerance=0.1)


@pytest.mark.parametrize("value", [5e-324, 1e-308, 1e-41, 0.0, -1.0])
def test_so_is_a_scale_that_is_none(value: float) -> None:
    poses = Poses(np.zeros((3, 3)), np.eye(4)[[0, 0, 0]], [1.0, value, 1.0])
    with pytest.raises(ValueError, match="key 1 has a scale"):
        interpolate([0.0, 1.0, 2.0], poses, [0.5])
    with pytest.raises(ValueError, match="sample 1 has a scale"):
        reduce_keys(np.arange(3.0), poses, tolerance=0.1)


@pytest.mark.parametrize("step", [5e-324, 1e-308, 1e-31])
def test_keys_that_no_clock_tells_apart_are_refused(step: float) -> None:
    with pytest.raises(ValueError, match="key 1 is not later than the key before it"):
        interpolate([0.0, step], Poses(np.zeros((2, 3)), np.eye(4)[[0, 0]]), [0.0])


def test_errors_of_what_is_not_finite_are_not_finite() -> None:
    truth = Poses(np.zeros((3, 3)), np.eye(4)[[0, 0, 0]])
    lost = Poses([[0, 0, 0], [np.inf, 0, 0], [np.nan, 0, 0]], np.eye(4)[[0, 0, 0]])
    errors = measure(np.arange(3.0), lost, truth)
    assert np.isfinite(errors.shell).tolist() == [True, False, False]
    assert np.isfinite(errors.position).tolist() == [True, False, False]


def test_all_of_the_range_of_single_precision_can_be_filled_in() -> None:
    """Blender holds such numbers, and a channel may."""
    largest = float(np.finfo(np.float32).max)
    keys = Poses([[-largest] * 3, [largest] * 3, [0.0] * 3], np.eye(4)[[0, 1, 0]])
    for mode in MODES:
        shown = interpolate([0.0, 1.0, 2.0], keys, np.linspace(0.0, 2.0, 41), mode)
        assert np.isfinite(shown.positions).all()
