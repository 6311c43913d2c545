"""Tests of path lengths, turning and velocity jumps on circles and screws of known speed."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion.affine import AffineMaps
from rigid_motion.motion.speeds import jumps, ways_and_turns

TIMES = np.arange(0.0, 60.0)


def about_z(angles: np.ndarray) -> np.ndarray:
    zero, one = np.zeros(len(angles)), np.ones(len(angles))
    rows = ((np.cos(angles), -np.sin(angles), zero), (np.sin(angles), np.cos(angles), zero), (zero, zero, one))
    return np.moveaxis(np.array(rows), -1, 0)


def screw() -> AffineMaps:
    """Return a screw: 2 units from the axis, 0.05 radians and 0.1 units along the axis per step."""
    angles = 0.05 * TIMES
    return AffineMaps(about_z(angles), np.stack((2.0 * np.cos(angles), 2.0 * np.sin(angles), 0.1 * TIMES), axis=1))


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_screw_goes_and_turns_evenly(scale):
    maps = screw()
    ways, turns = ways_and_turns(AffineMaps(scale * maps.axes, maps.origins))
    assert ways == pytest.approx(np.hypot(4.0 * np.sin(0.025), 0.1))
    assert turns == pytest.approx(0.05)


def test_half_turns_are_half_turns():
    ways, turns = ways_and_turns(AffineMaps(about_z(np.array((0.0, np.pi, np.pi + 1e-9))), np.zeros((3, 3))))
    assert ways.tolist() == [0.0, 0.0]
    assert turns == pytest.approx((np.pi, 1e-9))


def test_what_goes_evenly_has_no_jumps():
    assert jumps(screw(), 1.0)[1:-1] == pytest.approx(1.0, abs=1e-6)
    straight = AffineMaps(about_z(0.0 * TIMES), np.outer(TIMES, (0.3, 0.1, -0.2)))
    assert jumps(straight, 1.0).max() < 1.0, "but rounding"
    assert jumps(straight[:2], 1.0).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("kind", ["pop", "kink", "turn"])
def test_a_pop_a_kink_and_a_turn_that_pops_are_where_they_are(kind):
    maps = screw()
    if kind == "pop":
        maps.origins[30] += 0.05
    elif kind == "kink":
        maps.origins[30:] += np.outer(TIMES[30:] - 30.0, (0.1, 0.0, 0.0))
    else:
        maps.axes[30] = maps.axes[30] @ about_z(np.array((0.1,)))[0]
    measured = jumps(maps, 1.0)
    assert measured.argmax() == 30
    assert measured[30] > 8.0
    assert (np.delete(measured, (29, 30, 31)) < 2.0).all()
