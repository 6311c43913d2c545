"""How far the points of balls get off that are turned, scaled unevenly, mirrored or sheared."""

import numpy as np
import pytest

from rigid_motion.motion.affine import AffineMaps, ball_displacement, displacement_bound
from rigid_motion.motion.quaternions import normalise

COUNT = 400
RADIUS = 0.7


def differences(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (n, 3) and matrices (n, 3, 3), of all sizes."""
    random = np.random.default_rng(7)
    offsets, turns = random.normal(size=(COUNT, 3)), random.normal(size=(COUNT, 3, 3))
    offsets *= np.exp(3.0 * random.normal(size=(COUNT, 1)))
    turns *= np.exp(3.0 * random.normal(size=(COUNT, 1, 1)))
    if kind == "flat":
        turns[:, :, 0] = 0.0
    elif kind == "no offset":
        offsets[:] = 0.0
    elif kind == "no turn":
        turns[:] = 0.0
    elif kind == "across the longest axis":
        turns[:], offsets[:, [0, 2]] = np.diag((3.0, 2.0, 1.0)), 0.0
    elif kind == "two axes alike":
        turns[:] = np.diag((3.0, 3.0, 1.0))
    return offsets, turns


@pytest.mark.parametrize("kind", ["any", "flat", "no offset", "no turn", "across the longest axis", "two axes alike"])
def test_no_point_of_a_ball_is_off_by_more_and_some_point_is_off_by_as_much(kind):
    offsets, turns = differences(kind)
    none, radii = AffineMaps(np.zeros_like(turns), np.zeros_like(offsets)), np.full(COUNT, RADIUS)
    largest = ball_displacement(AffineMaps(turns, offsets), none, radii)
    points = RADIUS * normalise(np.random.default_rng(8).normal(size=(20000, 3)))
    result = np.array(
        [np.linalg.norm(points @ turn.T + off, axis=1).max() for off, turn in zip(offsets, turns, strict=True)]
    )
    assert np.all(result <= largest * (1.0 + 1e-9))
    assert np.all(result >= largest * 0.999)
    bound = displacement_bound(AffineMaps(turns, offsets), none, radii)
    assert np.all(bound >= largest * (1.0 - 1e-12))
    assert np.all(bound <= 1.8 * largest + 1e-12)
