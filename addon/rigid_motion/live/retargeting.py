"""Poses of a stream's skeleton as poses of a rig: which joint moves which bone, and what that bone does then.

What is carried over is how far each bone is turned from where it would be if both were at rest alike. Poses are in the
space of the roots here, metres, Blender's axes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..motion import Poses
from ..motion.humanoid import SPINE, alignments, humanoid_bones, plain_name
from ..motion.quaternions import conjugate, multiply, rotate


def matched(sources: Sequence[str], targets: Sequence[str]) -> dict[str, str]:
    """Which target each source moves: of the same skeleton that of its name. Otherwise that which is the same humanoid
    bone; or else of the same name, or the same but for case, namespace and how sides are written.
    """
    if set(sources) <= set(targets):
        return {name: name for name in sources}
    ours, theirs = humanoid_bones(sources), humanoid_bones(targets)
    # Spines of other lengths have their upper ends in common.
    spines = [[bone for bone in SPINE if bone in bones][::-1] for bones in (ours, theirs)]
    same = {bone: bone for bone in ours if bone in theirs and bone not in SPINE} | dict(zip(*spines, strict=False))
    pairs = {sources[ours[bone]]: targets[theirs[other]] for bone, other in same.items()}
    plain = {plain_name(name): name for name in reversed(targets)}
    for name in sources:
        target = name if name in targets else plain.get(plain_name(name))
        if target is not None and name not in pairs and target not in pairs.values():
            pairs[name] = target
    return {name: pairs[name] for name in sources if name in pairs}


class Retargeting:
    """Poses of a source's joints as poses of a target's, pair by pair.

    Parameters
    ----------
    source, target : Poses, shape (joints,)
        Both at rest, in the space of their roots.
    pairs : array of int, shape (pairs, 2)
        Numbers of joints, parents before their children.
    parents : array of int, shape (pairs,)
        The pair that each hangs on in the source, -1 for none.
    bones : dict
        The pair that each humanoid bone is.
    sliding : array of bool, shape (pairs,)
        Which pairs have places of their own.
    """

    def __init__(
        self,
        source: Poses,
        target: Poses,
        pairs: np.ndarray,
        parents: np.ndarray,
        bones: dict[str, int],
        sliding: np.ndarray,
    ) -> None:
        self.sources, self.sliding = pairs[:, 0], sliding
        source, target = source[pairs[:, 0]], target[pairs[:, 1]]
        arms = [np.where(sliding[parents] | (parents < 0), 0.0, _lengths(rest, parents)) for rest in (source, target)]
        both = (arms[0] > 1e-6) & (arms[1] > 1e-6)
        self.has_places = bool(np.any(_lengths(source, parents) > 1e-6)) or len(pairs) == 1
        legs = [row for bone, row in bones.items() if bone.endswith(("LowerLeg", "Foot")) and both[row]]
        self.scale = float(np.median(arms[1][both] / arms[0][both])) if both.any() else 1.0
        if legs:
            # Then feet are on the same ground.
            self.scale = float(np.sum(arms[1][legs]) / np.sum(arms[0][legs]))
        hips = [row for bone, row in bones.items() if bone.endswith("UpperLeg")]
        aligned = alignments(bones, target.positions, source.positions) if self.has_places else {}
        turns = target.quaternions.copy()
        for bone, turn in aligned.items():
            turns[bones[bone]] = multiply(turn, turns[bones[bone]])
        self._from_rest = multiply(conjugate(source.quaternions), turns)
        """What turns a source's pose into the target's."""
        self._beside = np.zeros((len(pairs), 3))
        """Where the target is, seen from the source's joint at rest: such that what hangs on it is in one place."""
        for pair in np.flatnonzero(sliding):
            children = np.flatnonzero(parents == pair)
            if len(children):
                of_hips = [child for child in children.tolist() if child in hips]
                children = np.array(of_hips) if of_hips else children
                theirs = (source.positions[children] - source.positions[pair]).mean(axis=0)
                ours = (target.positions[children] - target.positions[pair]).mean(axis=0)
                self._beside[pair] = rotate(conjugate(source.quaternions[pair]), self.scale * theirs - ours)

    def __call__(self, poses: Poses) -> Poses:
        """Return the poses (pairs, ...) of the target of those of the source (joints, ...)."""
        poses = poses[self.sources]
        extra = (slice(None), *(None,) * (poses.quaternions.ndim - 2))
        positions = self.scale * poses.positions + rotate(poses.quaternions, self._beside[extra])
        return Poses(positions, multiply(poses.quaternions, self._from_rest[extra]))


def _lengths(rest: Poses, parents: np.ndarray) -> np.ndarray:
    return np.linalg.norm(rest.positions - rest.positions[parents], axis=1)
