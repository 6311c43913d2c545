"""Keys of one track, fitted, rounded and repaired: errors stay within the limit, and a larger limit saves bytes."""

import numpy as np
import pytest

from rigid_motion.gltf.packed_keys import SHARED_TIMES, Aim, fitted
from rigid_motion.motion.quaternions import normalise

TIMES = np.arange(121) / 30
SAMPLES = np.union1d(TIMES, TIMES[:-1] + 1 / 60)


def aim(*, turns: bool, allowed: float) -> Aim:
    waves = np.sin(np.outer(SAMPLES, (1.0, 1.7, 2.3))) * 0.2
    values = normalise(np.column_stack((np.ones(len(SAMPLES)), waves))) if turns else waves

    def measure(shown: np.ndarray, some: np.ndarray | slice) -> np.ndarray:
        return np.linalg.norm(shown - values[some], axis=1) / allowed

    return Aim(SAMPLES, values, 1.0 / allowed, measure, turns)


@pytest.mark.parametrize("turns", [True, False])
@pytest.mark.parametrize("allowed", [1e-2, 3e-3, 1e-3])
def test_keys_are_never_farther_off_than_allowed(turns: bool, allowed: float) -> None:
    own = aim(turns=turns, allowed=allowed)
    keys, stricter = own.keys(TIMES, SHARED_TIMES), aim(turns=turns, allowed=allowed / 4).keys(TIMES, SHARED_TIMES)
    assert keys is not None
    assert stricter is not None
    assert own.measure(keys.shown, slice(None)).max() <= 1.0
    assert keys.size < stricter.size < own.finest(TIMES).size


@pytest.mark.parametrize("turns", [True, False])
def test_what_few_keys_cannot_show_is_refused(turns: bool) -> None:
    assert aim(turns=turns, allowed=1e-3).keys(TIMES[::20], SHARED_TIMES) is None


def test_lines_are_fitted_exactly() -> None:
    keys = np.linspace(0.0, 4.0, 9)
    values = np.cos(np.outer(keys, (1.0, 2.0)))
    shown = np.stack([np.interp(SAMPLES, keys, column) for column in values.T], axis=1)
    np.testing.assert_allclose(fitted(keys, SAMPLES, shown, np.ones(len(SAMPLES))), values, atol=1e-3)
