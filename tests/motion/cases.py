"""Pairs of poses for tests: ordinary ones, and corner cases where formulas break."""

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import align_signs, multiply, normalise

PAIRS = 2000


def random_quaternions(random: np.random.Generator, *shape: int) -> np.ndarray:
    """Return uniformly distributed rotations, shape (*shape, 4)."""
    return normalise(random.normal(size=(*shape, 4)))


def pair(angle: np.ndarray | float, size: float = 1.0, scaled: bool = False, seed: int = 0) -> tuple[Poses, Poses]:
    """Return `PAIRS` pairs of poses whose rotations differ by `angle`, with positions of the given size."""
    random = np.random.default_rng(seed)
    half = np.broadcast_to(np.asarray(angle) / 2.0, (PAIRS,))[:, None]
    axes = normalise(random.normal(size=(PAIRS, 3)))
    first = random_quaternions(random, PAIRS)
    second = multiply(np.concatenate((np.cos(half), np.sin(half) * axes), axis=-1), first)
    quaternions = align_signs(np.stack((first, second), axis=1))
    positions = size * random.normal(size=(2, PAIRS, 3))
    scales = np.exp(random.normal(size=(2, PAIRS))) if scaled else (None, None)
    return Poses(positions[0], quaternions[:, 0], scales[0]), Poses(positions[1], quaternions[:, 1], scales[1])


def corners(scaled: bool = False) -> dict[str, tuple[Poses, Poses]]:
    """Return the corner cases: pairs by name."""
    random = np.random.default_rng(42)
    return {
        "random": pair(random.uniform(0.0, np.pi, PAIRS), scaled=scaled),
        "tiny": pair(1e-9, scaled=scaled),
        "no turn": pair(0.0, scaled=scaled),
        "series meets closed form": pair(random.uniform(0.19, 0.21, PAIRS), scaled=scaled),
        "all sizes of angle": pair(10.0 ** random.uniform(-12.0, 0.0, PAIRS), scaled=scaled),
        "near 180 degrees": pair(np.pi - 10.0 ** random.uniform(-9.0, -3.0, PAIRS), scaled=scaled),
        "far away": pair(random.uniform(0.0, np.pi, PAIRS), size=1e4, scaled=scaled),
        "far away and tiny": pair(1e-9, size=1e4, scaled=scaled),
    }


def size_of(*poses: Poses) -> float:
    """Return the largest coordinate, at least 1: the scale for the rounding of positions."""
    return max(1.0, *(float(np.abs(p.positions).max()) for p in poses))


def shares() -> np.ndarray:
    """Return the fraction of the way between the keys of each pair, both ends included."""
    u = np.random.default_rng(1).uniform(size=PAIRS)
    u[0], u[1] = 0.0, 1.0
    return u


def assert_same(poses: Poses, expected: Poses, tolerance: float = 1e-12) -> None:
    """Check that positions agree to `tolerance` of their size, quaternions up to sign, and scales relatively."""
    assert np.abs(poses.positions - expected.positions).max() <= tolerance * size_of(expected)
    signs = np.sign(np.sum(poses.quaternions * expected.quaternions, axis=-1, keepdims=True))
    assert np.abs(poses.quaternions - signs * expected.quaternions).max() <= tolerance
    assert (poses.scales is None) == (expected.scales is None)
    if poses.scales is not None:
        assert np.abs(poses.scales / expected.scales - 1.0).max() <= tolerance
