"""Bodies for tests: random skeletons that move, and how far off they are, by matrices and apart from the program."""

import numpy as np
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses, interpolate
from tests.motion.test_reduction import wandering


def random_parents(random: np.random.Generator, joints: int) -> np.ndarray:
    """A forest of one or more trees, its joints in any order, shape (joints,)."""
    parents = np.array([random.integers(-1, joint) if random.random() < 0.5 else joint - 1 for joint in range(joints)])
    names = random.permutation(joints)
    shuffled = np.empty(joints, dtype=np.int64)
    shuffled[names] = np.where(parents < 0, -1, names[parents])
    return shuffled


def wandering_body(
    count: int, joints: int, seed: int, *, scaled: bool = False, resting: float = 0.2, noise: float = 0.0
) -> tuple[np.ndarray, Poses, np.ndarray]:
    """Times (count,), poses (joints, count) and parents (joints,) of a body some of whose joints stand still."""
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
    """Poses (...) as matrices (..., 4, 4)."""
    turns = Rotation.from_quat(poses.quaternions.reshape(-1, 4), scalar_first=True).as_matrix()
    result = np.zeros((*poses.shape, 4, 4))
    result[..., :3, :3] = turns.reshape(*poses.shape, 3, 3)
    if poses.scales is not None:
        result[..., :3, :3] *= poses.scales[..., None, None]
    result[..., :3, 3], result[..., 3, 3] = poses.positions, 1.0
    return result


def in_root_space(poses: Poses, parents: np.ndarray) -> np.ndarray:
    """The matrices (joints, n, 4, 4) of joints in the root's space, each by going up its own chain."""
    own = matrices(poses)
    result = own.copy()
    for joint in range(len(parents)):
        above = parents[joint]
        while above >= 0:
            result[joint] = own[above] @ result[joint]
            above = parents[above]
    return result


def largest_displacements(a: np.ndarray, b: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """How far matrices (joints, n, 4, 4) move any point of a ball (joints,) from one another, shape (joints, n).

    The ball becomes an ellipsoid with an axis of symmetry, the shortest one. The point that gets furthest is in the
    plane of that axis and the displacement of the centre; it is searched for.
    """
    axes, sizes, _ = np.linalg.svd(radii[:, None, None, None] * (a - b)[..., :3, :3])
    moved = np.abs(np.einsum("jnik,jni->jnk", axes, (a - b)[..., :3, 3]))
    along, across = moved[..., 2], np.hypot(moved[..., 0], moved[..., 1])

    def reached(angles: np.ndarray) -> np.ndarray:
        return np.hypot(along + sizes[..., 2] * np.sin(angles), across + sizes[..., 0] * np.cos(angles))

    middle, width = np.full(along.shape, np.pi / 4.0), np.pi / 4.0
    while width > 1e-9:
        angles = np.clip(middle + width * np.linspace(-1.0, 1.0, 33)[:, None, None], 0.0, np.pi / 2.0)
        middle = np.take_along_axis(angles, np.argmax(reached(angles), axis=0)[None], axis=0)[0]
        width /= 8.0
    return reached(middle)


def body_errors(
    times: np.ndarray, poses: Poses, parents: np.ndarray, keys: tuple[np.ndarray, ...], mode: str, radii: np.ndarray
) -> np.ndarray:
    """How far off a body is between keys of its joints, shape (joints, n)."""
    shown = [interpolate(times[own], poses[joint][own], times, mode) for joint, own in enumerate(keys)]
    scales = None if poses.scales is None else [joint.scales for joint in shown]
    shown = Poses([joint.positions for joint in shown], [joint.quaternions for joint in shown], scales)
    return largest_displacements(in_root_space(shown, parents), in_root_space(poses, parents), radii)
