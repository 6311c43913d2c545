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
        nodes, moving, times = world.nodes, world.moving, world.times
        places = {node: place for place, node in enumerate(moving.tolist())}
        self.parents = np.array([places.get(parent, -1) for parent in nodes.parents[moving].tolist()])
        self.above = np.empty((len(moving), len(times), 3))
        """How long the axes of each node's parent are in the world."""
        lengths = np.linalg.norm(nodes.worlds(moving, world.truth, times).axes, axis=-2)
        for place, (node, parent) in enumerate(zip(moving.tolist(), self.parents.tolist(), strict=True)):
            if parent >= 0:
                self.above[place] = lengths[parent]
            elif nodes.parents[node] >= 0:
                self.above[place] = np.linalg.norm(nodes.resting.axes[nodes.parents[node]], axis=-2)
            else:
                self.above[place] = 1.0
        positions, quaternions = np.empty((*self.above.shape[:2], 3)), np.empty((*self.above.shape[:2], 4))
        for place, node in enumerate(moving.tolist()):
            positions[place], quaternions[place] = _pose(world, tracks, node)
        self.poses = Poses(positions * self.above, align_signs(quaternions))

    def keys(self, tolerance: float, weights: np.ndarray) -> tuple[SeparateKeys, ...]:
        """The samples that are keys of each node, with errors that count so many times, weights (n, m)."""
        return reduce_skeleton_keys(
            self.world.times,
            self.poses,
            self.parents,
            MODE,
            tolerance=tolerance,
            radius=self.world.radii,
            separate=True,
            weights=weights,
            fixed=self.fixed,
        )


def reaches(world: World) -> np.ndarray:
    """How far what hangs on each node is from it at most, with the balls around it, shape (n,); an upper bound."""
    nodes, moving = world.nodes, world.moving
    places = world.places(world.truth, world.times)
    numbers = {node: place for place, node in enumerate(moving.tolist())}
    found = world.radii.copy()
    for place, node in reversed(list(enumerate(moving.tolist()))):
        parent = numbers.get(int(nodes.parents[node]))
        if parent is not None:
            away = float(np.linalg.norm(places[place] - places[parent], axis=-1).max())
            found[parent] = max(found[parent], away + found[place])
    return found


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
