"""How far affine maps are off: one by one as among many, and by their bounds as by all of them."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion.affine import AffineMaps, ball_displacement, displacement_over, largest_displacement
from rigid_motion.motion.quaternions import matrices, normalise

COUNT = 200


@pytest.fixture
def pairs() -> tuple[AffineMaps, AffineMaps, np.ndarray]:
    """Balls that are turned about their origins, and half of them moved, stretched and sheared as well."""
    random = np.random.default_rng(3)
    turned = [np.moveaxis(matrices(normalise(random.normal(size=(COUNT, 4)))), -1, 0) for _ in range(2)]
    shear, moved = random.normal(size=(COUNT, 3, 3)), random.normal(size=(COUNT, 3))
    moved[::2], shear[::2] = 0.0, np.eye(3)
    return (
        AffineMaps(turned[0] @ shear, moved),
        AffineMaps(turned[1], np.zeros((COUNT, 3))),
        random.uniform(0, 1, COUNT),
    )


def test_one_ball_is_off_as_far_as_among_many(pairs):
    maps, truth, radii = pairs
    among_many = ball_displacement(maps, truth, radii)
    one_by_one = [ball_displacement(maps[at], truth[at], radii[at]) for at in range(COUNT)]
    assert one_by_one == pytest.approx(among_many.tolist(), rel=1e-12)


def test_the_largest_and_those_over_a_limit_are_found_by_bounds(pairs):
    maps, truth, radii = pairs
    every = ball_displacement(maps, truth, radii)
    assert largest_displacement(maps, truth, radii) == every.max()
    limit = float(np.median(every))
    over = displacement_over(maps, truth, radii, limit)
    assert np.array_equal(over > limit, every > limit)
    assert np.array_equal(over[every > limit], every[every > limit])
