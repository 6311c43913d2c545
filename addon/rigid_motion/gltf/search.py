"""Few keys for the nodes of a clip, found by the search for keys of bodies.

That search knows joints of one size. So nodes are taken as they are large in the world: their translations along the
axes of their parents are as long as these make them. It is the same motion where scales do not change and are even,
and near to it otherwise: what is promised is proven afterwards, on the nodes themselves.
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
"""What glTF calls LINEAR."""


class NodeSearch:
    """The nodes of a world as a body.

    Parameters
    ----------
    world : World
    tracks : mapping
        The tracks that are to have fewer keys, which may be less noisy than the truth.
    fixed : array of bool, shape (n,)
        Nodes whose keys are not asked for.
    run : callable
        What has stretches searched.
    """

    def __init__(self, world: World, tracks: Tracks, fixed: np.ndarray, run: Run) -> None:
        self.world, self.tracks, self.fixed, self.run = world, tracks, fixed, run

    def keys(self, tolerance: float) -> tuple[SeparateKeys, ...]:
        """Return the samples that are keys of each node."""
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
        """Return the samples that are keys of all nodes, those where stretches meet among them."""
        result = [some.start + self._shared(some, tolerance=tolerance) for some in self.world.stretches]
        return np.unique(np.concatenate(result))

    def so_many_key_poses(self, count: int, weights: np.ndarray) -> np.ndarray:
        """Return the samples that are keys of all nodes, whose errors count so many times (n, m)."""
        return self._shared(ALL_ROWS, budget=min(count, len(self.world.times)), weights=weights)

    def _shared(self, samples: slice, **options: Any) -> np.ndarray:
        return cast(np.ndarray, self._reduced(samples, shared=True, **options)[0])

    def _reduced(self, samples: slice, **options: Any) -> tuple[np.ndarray, ...] | tuple[SeparateKeys, ...]:
        world = self.world
        times, poses = world.times[samples], self.poses(samples)
        return reduce_skeleton_keys(times, poses, world.parents, GLTF_MODE, radius=world.radii, **options)

    def poses(self, samples: slice) -> Poses:
        """Return those of the nodes at some of the moments."""
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
