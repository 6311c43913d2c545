"""Few keys for the nodes of a clip, found by the search for keys of bodies.

That search knows joints of one size. So nodes are taken as they are large in the world: their translations along the
axes of their parents are as long as these make them. It is the same motion where scales do not change and are even,
and near to it otherwise: what is promised is proven afterwards, on the nodes themselves.
"""

from __future__ import annotations

import numpy as np

from ..motion import Poses, SeparateKeys, reduce_skeleton_keys
from ..motion.quaternions import align_signs, from_matrices
from .errors import World
from .nodes import Tracks
from .tracks import ROTATION, TRANSLATION

MODE = "lerp_slerp"
"""What glTF calls LINEAR."""

STRETCH, LONG = 1500, 2
"""Samples of a recording that are searched at once, where there are more than so many times as many."""


class Search:
    """The nodes of a world as a body.

    Parameters
    ----------
    world : World
    tracks : mapping
        The tracks that are to have fewer keys, which may be less noisy than the truth.
    fixed : array of bool, shape (n,)
        Nodes whose keys are not asked for.
    """

    def __init__(self, world: World, tracks: Tracks, fixed: np.ndarray) -> None:
        self.world, self.fixed = world, fixed
        shape = (len(world.moving), len(world.times))
        positions, quaternions = np.empty((*shape, 3)), np.empty((*shape, 4))
        for place, node in enumerate(world.moving.tolist()):
            positions[place], quaternions[place] = _pose(world, tracks, node)
        self.poses = Poses(positions * world.lengths_above, align_signs(quaternions))

    def keys(self, tolerance: float) -> tuple[SeparateKeys, ...]:
        """The samples that are keys of each node."""
        return reduce_skeleton_keys(
            self.world.times,
            self.poses,
            self.world.parents,
            MODE,
            tolerance=tolerance,
            radius=self.world.radii,
            separate=True,
            fixed=self.fixed,
            stretch=STRETCH if len(self.world.times) > LONG * STRETCH else None,
        )

    def key_poses(self, *, tolerance: float | None, count: int | None) -> np.ndarray:
        """The samples that are keys of all nodes."""
        keys = reduce_skeleton_keys(
            self.world.times,
            self.poses,
            self.world.parents,
            MODE,
            tolerance=tolerance,
            budget=None if count is None else min(count, len(self.world.times)),
            radius=self.world.radii,
            shared=True,
        )
        return keys[0]


def _pose(world: World, tracks: Tracks, node: int) -> tuple[np.ndarray, np.ndarray]:
    """The translation and rotation of a node in its parent's space at all times, or where it always is."""
    if node in world.nodes.matrices:
        matrix = world.nodes.matrices[node]
        left, _, right = np.linalg.svd(matrix[:3, :3])
        turn = left @ np.diag((1.0, 1.0, np.linalg.det(left @ right))) @ right
        return matrix[:3, 3], from_matrices(turn)
    translation, rotation = (
        tracks[node, path].at(world.times) if (node, path) in tracks else world.nodes.rest[path][node]
        for path in (TRANSLATION, ROTATION)
    )
    return translation, rotation
