"""Tests of numbers at the limits of floats: the result is finite, or an error says where; never a warning."""

import numpy as np
import pytest

from rigid_motion.motion import MODES, Poses, interpolate, reduce_keys


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


@pytest.mark.parametrize("step", [5e-324, 1e-308, 1e-31])
def test_keys_that_no_clock_tells_apart_are_refused(step: float) -> None:
    with pytest.raises(ValueError, match="key 1 is not later than the key before it"):
        interpolate([0.0, step], Poses(np.zeros((2, 3)), np.eye(4)[[0, 0]]), [0.0])


def test_all_of_the_range_of_single_precision_can_be_filled_in() -> None:
    """Blender and its channels can hold such numbers."""
    largest = float(np.finfo(np.float32).max)
    keys = Poses([[-largest] * 3, [largest] * 3, [0.0] * 3], np.eye(4)[[0, 1, 0]])
    for mode in MODES:
        shown = interpolate([0.0, 1.0, 2.0], keys, np.linspace(0.0, 2.0, 41), mode)
        assert np.isfinite(shown.positions).all()


def test_the_numbers_that_files_store_never_change():
    assert {mode: MODES[mode].number for mode in MODES} == {
        "lerp_slerp": 1,
        "dq_sclerp": 2,
        "pga_lerp": 3,
        "pga_slerp": 4,
        "cga_lerp": 5,
        "cga_slerp": 6,
        "motor_spline": 7,
        "motor_spline_causal": 8,
        "bezier": 0,
    }
