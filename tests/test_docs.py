"""What was measured of the recordings that pages speak of, and what it was compared with."""

import numpy as np
import pytest

from docs import measure_recordings
from research.paper.table import RADIUS
from rigid_motion.motion import curves, decimate
from rigid_motion_batch.analysis.needed import OfRigidBody
from tests.scripts.clips.recordings import swinging_clip

OWN_RULE = "1, none up to 1/16"
"""That of the program; docs/templates/quotes.md has it in bold."""

TIMES = np.array((1.0, 20.0, 1.0, 0.5)), np.array((20.0, 1.0, 1.0, 0.7))
"""Of segments before and after a key."""


def test_the_rule_in_bold_is_that_of_the_program():
    np.testing.assert_array_equal(measure_recordings.RULES[OWN_RULE](*TIMES), curves.twist_shares(*TIMES))


def test_other_rules_are_others():
    own = curves.twist_shares(*TIMES)
    for name, rule in measure_recordings.RULES.items():
        if name != OWN_RULE:
            assert np.abs(rule(*TIMES) - own).max() > 0.01, name


def test_half_of_what_the_parabola_adds_is_the_stream_spline_of_the_program():
    clip = swinging_clip(seed=1)
    half, whole, none = (measure_recordings._errors_of_clips([clip], part) for part in (0.5, 1.0, 0.0))
    keys = decimate(clip.times, 5.0)
    stretch = OfRigidBody(clip, RADIUS).between(0, int(keys[-1]))
    error = stretch.error(keys, "motor_spline_causal") / stretch.error(keys, "lerp_slerp")
    assert half["5"] == pytest.approx(error, rel=1e-12)
    assert abs(whole["5"] - half["5"]) > 1e-3
    assert abs(none["5"] - half["5"]) > 1e-3
