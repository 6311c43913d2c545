"""A path that jumps is shown without its jumps, and is itself again when they have faded."""

from __future__ import annotations

import numpy as np
import pytest

from research.paper.streaming import fading
from research.paper.streaming.fading import Jumps, fade
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import angle_between, normalise
from tests.motion.cases import random_quaternions

TIMES = np.arange(11.0)
REST = np.array((1.0, 0.0, 0.0, 0.0))


def turned(angle: np.ndarray | float) -> np.ndarray:
    """Rotations about z."""
    half = np.asarray(angle) / 2.0
    return np.stack((np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)), axis=-1)


def at_rest(count: int = len(TIMES)) -> Poses:
    return Poses(np.zeros((count, 3)), np.tile(REST, (count, 1)))


def test_a_jump_fades_by_the_square_of_the_time_that_is_left():
    old = Poses([[8.0, 0.0, -4.0]], turned([1.6]))
    shown = fade(TIMES, at_rest(), Jumps.between(np.array([2.0]), np.array([4.0]), old, at_rest(1)))
    left = np.clip(1.0 - (TIMES - 2.0) / 4.0, 0.0, 1.0) ** 2 * (TIMES > 2.0)
    assert shown.positions == pytest.approx(left[:, None] * (8.0, 0.0, -4.0))
    assert shown.quaternions == pytest.approx(turned(1.6 * left))


def test_a_turn_fades_the_short_way_whatever_the_signs():
    old = Poses([[0.0, 0.0, 0.0]], -turned([1.6]))
    jumps = Jumps.between(np.array([0.0]), np.array([2.0]), old, at_rest(1))
    assert angle_between(fade(TIMES, at_rest(), jumps).quaternions[1], REST) == pytest.approx(0.4)


@pytest.mark.parametrize("at_once", [1, 3, 1024])
def test_a_path_that_jumps_at_every_frame_goes_on_from_every_frame(at_once, monkeypatch):
    """With fades that hardly begin, every frame stays where the first was."""
    monkeypatch.setattr(fading, "AT_ONCE", at_once)
    random = np.random.default_rng(1)
    path = Poses(random.normal(size=(11, 3)), random_quaternions(random, 11))
    jumps = Jumps.between(TIMES[:-1], np.full(10, 1e9), path[:-1], path[1:])
    shown = fade(TIMES, path, jumps)
    assert shown.positions == pytest.approx(path.positions[[0] * 11], abs=1e-6)
    assert angle_between(shown.quaternions, path.quaternions[[0] * 11]).max() < 1e-6


def test_where_nothing_jumps_the_path_is_shown():
    random = np.random.default_rng(2)
    path = Poses(random.normal(size=(11, 3)), normalise(random.normal(size=(11, 4))))
    for count in (0, 10):
        jumps = Jumps.between(TIMES[:count], np.full(count, 3.0), path[1 : count + 1], path[1 : count + 1])
        shown = fade(TIMES, path, jumps)
        assert shown.positions == pytest.approx(path.positions, abs=1e-15)
        assert angle_between(shown.quaternions, path.quaternions).max() < 1e-15


def test_a_body_that_turns_does_not_swing_what_is_left_of_a_distance_about():
    spinning = Poses(np.zeros((11, 3)), turned(2.0 * TIMES))
    old = Poses([[5.0, 0.0, 0.0]], turned([0.0]))
    shown = fade(TIMES, spinning, Jumps.between(np.array([0.0]), np.array([8.0]), old, spinning[:1]))
    assert np.all(shown.positions[:, 1:] == 0.0)
    assert np.all(np.diff(shown.positions[1:, 0]) <= 0.0)
