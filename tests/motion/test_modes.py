"""The table of modes, as files know it."""

from addon.motion import MODES


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
    }


def test_no_two_modes_have_the_same_number_and_none_has_that_of_blenders_own():
    numbers = [mode.number for mode in MODES.values()]
    assert len(set(numbers)) == len(numbers)
    assert 0 not in numbers
