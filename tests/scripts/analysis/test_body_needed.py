"""Tests of the key poses that whole bodies need: they reach the target error, and fewer would not."""

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.analysis.needed import RATES, KeysNeeded, Ways, keys_needed
from tests.motion.bodies import body_errors
from tests.scripts.clips.bodies import JOINTS, PARENTS, swinging_body

MODES = ("lerp_slerp", "dq_sclerp", "cga_slerp", "motor_spline")

RADII = np.linspace(0.02, 0.12, len(JOINTS))

WAYS = Ways(swinging_body(seconds=1.3, seed=6), RADII)


def rms(ways: Ways, keys: np.ndarray, mode: str) -> float:
    """Return the RMS shell error in metres, computed with matrices."""
    clip = ways.clip
    metres = Poses(clip.poses.positions * clip.metres_per_unit, clip.poses.quaternions)
    return float(np.sqrt(np.mean(body_errors(clip.times, metres, PARENTS, (keys,) * len(JOINTS), mode, RADII) ** 2)))


@pytest.fixture(scope="module")
def result() -> KeysNeeded:
    return keys_needed(WAYS, MODES, "lerp_slerp")


@pytest.mark.parametrize("mode", MODES)
def test_the_error_is_that_of_key_poses_in_the_roots_space(mode: str) -> None:
    keys = np.array([0, 4, 9, 20, 39])
    assert WAYS.error(keys, mode) == pytest.approx(rms(WAYS, keys, mode), rel=1e-6)


def test_the_reference_is_evenly_spaced_and_modes_that_are_one_motion_are_one(result: KeysNeeded) -> None:
    assert result.groups[:2] == (("lerp_slerp",), ("dq_sclerp", "cga_slerp"))
    assert result.keys.shape == (3, 2, len(RATES))
    assert result.targets[-1] == pytest.approx(WAYS.between(0, 36).error(np.arange(0, 37, 6), "lerp_slerp"))
    assert result.reference_keys.tolist() == [40, 27, 20, 16, 11, 7]


def test_the_keys_needed_are_as_good_and_those_of_the_motion_are_no_more(result: KeysNeeded) -> None:
    for place in range(1, len(RATES)):
        uniform, adaptive = result.keys[:, 0, place], result.keys[:, 1, place]
        assert uniform[0] == result.reference_keys[place]
        finite = np.isfinite(result.keys[..., place])
        assert (result.reached[..., place][finite] <= result.targets[place] * (1.0 + 1e-9)).all()
        assert (adaptive[np.isfinite(uniform)] <= uniform[np.isfinite(uniform)]).all()
