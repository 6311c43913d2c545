"""Tests of exponentials and logarithms of twists against SciPy's of matrices."""

import numpy as np
import pytest
from scipy.linalg import expm

from rigid_motion.motion import Poses, twists
from tests.motion.bodies import matrices

ANGLES = [0.0, 1e-12, 1e-6, 1e-3, 0.02999, 0.03001, 0.5, 2.0, 3.1, np.pi - 1e-9]


def matrix_of(twist: np.ndarray) -> np.ndarray:
    """Return the 4 x 4 matrix of a twist (6,)."""
    (x, y, z), advance = twist[:3], twist[3:]
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    matrix[:3, 3] = advance
    return matrix


def some_twists(angle: float, count: int = 20) -> np.ndarray:
    random = np.random.default_rng(3)
    axes = random.normal(size=(3, count))
    return np.concatenate((angle * axes / np.linalg.norm(axes, axis=0), random.normal(size=(3, count))))


@pytest.mark.parametrize("angle", [*ANGLES, 3.5, 6.0, 9.0])
def test_exponentials_are_those_of_matrices(angle):
    given = some_twists(angle)
    quaternions, translations = twists.exponential(given)
    result = matrices(Poses(translations.T, quaternions.T))
    np.testing.assert_allclose(result, [expm(matrix_of(twist)) for twist in given.T], rtol=0, atol=1e-13)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("angle", ANGLES)
def test_a_logarithm_leads_back(angle, sign):
    given = some_twists(angle)
    quaternions, translations = twists.exponential(given)
    result = twists.logarithm(sign * quaternions, translations)
    # Near half a turn the axis is only as exact as the rounding of w, and its error counts twice.
    np.testing.assert_allclose(result, given, rtol=0, atol=1e-12)
