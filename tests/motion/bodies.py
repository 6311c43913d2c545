"""Synthetic recordings of single bodies and skeletons for tests, and their errors by matrices of SciPy."""

import numpy as np
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses, interpolate, twists
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import align_signs, normalise
from tests import balls

RADIUS = 0.1


def wandering(count: int, seed: int, noise: float = 0.0, rough: float = 3.0) -> tuple[np.ndarray, Poses]:
    """Return a recording at uneven times: a smooth random walk of a body, with rests, plus noise."""
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.005, 0.02, count))
    knots = np.linspace(times[0], times[-1], max(4, int(rough * (times[-1] - times[0]))))
    values = np.cumsum(random.normal(size=(len(knots), 6)) * (random.uniform(size=(len(knots), 1)) > 0.3), axis=0)
    rows = np.array([np.interp(times, knots, column) for column in values.T])
    width = min(15, count)
    smooth = np.array([np.convolve(row, np.ones(width) / width, mode="same") for row in rows])
    turn, _ = twists.exponential(np.concatenate((smooth[:3], np.zeros((3, count)))))
    quaternions = turn.T + noise * random.normal(size=(count, 4))
    positions = 0.3 * smooth[3:].T + noise * random.normal(size=(count, 3))
    return times, Poses(positions, align_signs(normalise(quaternions)))


def shell_errors(times: np.ndarray, poses: Poses, keys: np.ndarray, mode: str, radius: float = RADIUS) -> np.ndarray:
    """Return the largest displacement of any point within the radius on every sample."""
    return largest_displacements(matrices(interpolate(times[keys], poses[keys], times, mode)), matrices(poses), radius)


def random_parents(random: np.random.Generator, joints: int) -> np.ndarray:
    """Return the parents of a forest of one or more trees, its joints in any order, shape (joints,)."""
    parents = np.array([random.integers(-1, joint) if random.random() < 0.5 else joint - 1 for joint in range(joints)])
    names = random.permutation(joints)
    shuffled = np.empty(joints, dtype=np.int64)
    shuffled[names] = np.where(parents < 0, -1, names[parents])
    return shuffled


def wandering_body(
    count: int, joints: int, seed: int, *, scaled: bool = False, resting: float = 0.2, noise: float = 0.0
) -> tuple[np.ndarray, Poses, np.ndarray]:
    """Return times (count,), poses (joints, count) and parents (joints,) of a body with some joints at rest."""
    random = np.random.default_rng(seed)
    motions = [wandering(count, int(random.integers(2**16)), noise) for _ in range(joints)]
    positions, quaternions = (
        np.array([getattr(poses, name) for _, poses in motions]) for name in ("positions", "quaternions")
    )
    rests = random.random(joints) < resting
    positions[rests], quaternions[rests] = positions[rests, :1], quaternions[rests, :1]
    times = motions[0][0]
    scales = None
    if scaled:
        waves = np.sin(times * random.uniform(0.5, 5.0, (joints, 1)) + random.uniform(0.0, 6.0, (joints, 1)))
        scales = np.exp(random.normal(scale=0.3, size=(joints, 1)) + 0.3 * waves * (random.random((joints, 1)) < 0.5))
    return times, Poses(positions, quaternions, scales), random_parents(random, joints)


def matrices(poses: Poses) -> np.ndarray:
    """Return poses (...) as matrices (..., 4, 4)."""
    turns = Rotation.from_quat(poses.quaternions.reshape(-1, 4), scalar_first=True).as_matrix()
    result = np.zeros((*poses.shape, 4, 4))
    result[..., :3, :3] = turns.reshape(*poses.shape, 3, 3)
    if poses.scales is not None:
        result[..., :3, :3] *= poses.scales[..., None, None]
    result[..., :3, 3], result[..., 3, 3] = poses.positions, 1.0
    return result


def in_root_space(poses: Poses, parents: np.ndarray) -> np.ndarray:
    """Return the matrices (joints, n, 4, 4) of joints in the root's space, each by going up its chain."""
    own = matrices(poses)
    result = own.copy()
    for joint in range(len(parents)):
        above = parents[joint]
        while above >= 0:
            result[joint] = own[above] @ result[joint]
            above = parents[above]
    return result


def largest_displacements(a: np.ndarray, b: np.ndarray, radii: np.ndarray | float) -> np.ndarray:
    """Return how far apart two matrices (..., 4, 4) move any point of a ball, shape (...); radii are per item of the
    first axis.
    """
    radii = np.reshape(radii, (-1, *[1] * (a.ndim - 1)))
    return balls.largest_displacements((a - b)[..., :3, 3], radii * (a - b)[..., :3, :3])


def body_errors(
    times: np.ndarray, poses: Poses, parents: np.ndarray, keys: tuple[np.ndarray, ...], mode: str, radii: np.ndarray
) -> np.ndarray:
    """Return the errors of a body between keys of its joints, shape (joints, n)."""
    shown = joined([interpolate(times[own], poses[[joint]][:, own], times, mode) for joint, own in enumerate(keys)])
    return largest_displacements(in_root_space(shown, parents), in_root_space(poses, parents), radii)
