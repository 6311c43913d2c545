"""The table of modes, as files know it."""

from rigid_motion.motion import MODES


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
