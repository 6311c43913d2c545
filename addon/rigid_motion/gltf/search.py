"""Search for few keys for the nodes of a clip, using the key search for bodies.

That search assumes joints without scale. So nodes are used at their world size: translations are multiplied by the
world length of the parent's axes. The motion is the same if scales are constant and even, and similar otherwise: the
tolerance is proven afterwards, on the nodes themselves.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from ..motion import Poses, SeparateKeys, Skeleton, reduce_skeleton_keys
from ..motion.bodies import Body
from ..motion.quaternions import align_signs, from_matrices
from ..motion.skeleton_stretches import Run, keys_in_stretches
from .accessors import ALL_ROWS
from .errors import World
from .tracks import ROTATION, TRANSLATION, Tracks

GLTF_MODE = "lerp_slerp"
"""The interpolation that glTF calls LINEAR."""


class NodeSearch:
    """The nodes of a world as a body.

    Parameters
    ----------
    world : World
    tracks : mapping
        Tracks that will have fewer keys; they may be less noisy than the truth.
    fixed : array of bool, shape (n,)
        Nodes that need no keys.
    run : callable
        Runs the search over stretches.
    """

    def __init__(self, world: World, tracks: Tracks, fixed: np.ndarray, run: Run) -> None:
        self.world, self.tracks, self.fixed, self.run = world, tracks, fixed, run

    def keys(self, tolerance: float) -> tuple[SeparateKeys, ...]:
        """Return the key samples of each node."""
        world = self.world
        if len(world.stretches) == 1:
            keys = self._reduced(ALL_ROWS, tolerance=tolerance, separate=True, fixed=self.fixed)
            return cast(tuple[SeparateKeys, ...], keys)
        skeleton, free = Skeleton(world.parents), ~self.fixed

        def part(some: slice) -> Body:
            poses = self.poses(some)
            return Body(
                world.times[some], poses, skeleton, GLTF_MODE, world.radii, np.broadcast_to(1.0, poses.shape), free
            )

        keys = keys_in_stretches(part, tolerance, True, world.stretches, self.run)
        return cast(tuple[SeparateKeys, ...], keys)

    def key_poses(self, tolerance: float) -> np.ndarray:
        """Return the key samples shared by all nodes, including those where stretches meet."""
        result = [some.start + self._shared(some, tolerance=tolerance) for some in self.world.stretches]
        return np.unique(np.concatenate(result))

    def so_many_key_poses(self, count: int, weights: np.ndarray) -> np.ndarray:
        """Return `count` key samples shared by all nodes, with errors multiplied by `weights` (n, m)."""
        return self._shared(ALL_ROWS, budget=min(count, len(self.world.times)), weights=weights)

    def _shared(self, samples: slice, **options: Any) -> np.ndarray:
        return cast(np.ndarray, self._reduced(samples, shared=True, **options)[0])

    def _reduced(self, samples: slice, **options: Any) -> tuple[np.ndarray, ...] | tuple[SeparateKeys, ...]:
        world = self.world
        times, poses = world.times[samples], self.poses(samples)
        return reduce_skeleton_keys(times, poses, world.parents, GLTF_MODE, radius=world.radii, **options)

    def poses(self, samples: slice) -> Poses:
        """Return the poses of the nodes at some of the moments."""
        world, times = self.world, self.world.times[samples]
        shape = (len(world.moving), len(times))
        positions, quaternions = np.empty((*shape, 3)), np.empty((*shape, 4))
        for row, node in enumerate(world.moving.tolist()):
            if node in world.nodes.matrices:
                matrix = world.nodes.matrices[node]
                left, _, right = np.linalg.svd(matrix[:3, :3])
                turn = left @ np.diag((1.0, 1.0, np.linalg.det(left @ right))) @ right
                positions[row], quaternions[row] = matrix[:3, 3], from_matrices(turn)
            else:
                positions[row] = world.nodes.channel(node, TRANSLATION, self.tracks, times)
                quaternions[row] = world.nodes.channel(node, ROTATION, self.tracks, times)
        return Poses(positions * world.lengths_above(times), align_signs(quaternions))
