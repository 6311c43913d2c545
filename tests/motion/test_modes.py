"""The table of modes, as files know it."""

import re

import pytest

from rigid_motion.motion import MODES, Poses, interpolate, prepare
from rigid_motion.motion.modes import mode_named

KEYS = Poses([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0, 0.0]] * 2)


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


@pytest.mark.parametrize(
    "use",
    [mode_named, lambda mode: interpolate([0.0, 1.0], KEYS, [0.5], mode), lambda mode: prepare([0.0, 1.0], KEYS, mode)],
    ids=["named", "interpolate", "prepare"],
)
def test_a_name_of_no_mode_is_answered_with_those_there_are(use):
    with pytest.raises(ValueError, match=re.escape(f"there is no mode 'bezier'; the modes are {', '.join(MODES)}")):
        use("bezier")
