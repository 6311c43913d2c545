"""Where something is seen on any frames, in the world, once for all that draws more of it than its path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ...animation.baking.motions import shown
from ...animation.evaluation.components import MODE_NUMBERS
from ...animation.evaluation.sources import KeyedTransform
from ...animation.transforms import Transform
from ...blender import existing
from ...motion.affine import AffineMaps
from .cache import paths_of
from .ghosts import in_space_of_path
from .held import HolderMotion, carrier_of
from .kinds import axis_length_of, followed, space_of
from .parents import CarriedTargets, Parents, maps_of
from .points import DrawnPath

MAX_FRAMES = 4096
"""The most frames that it is looked at on, in even steps."""


def seen_paths(targets: Sequence[Transform], context: Any) -> list[DrawnPath | None]:
    """Return the paths of targets as the viewports draw them; None where one has none, or is refused."""
    turned = {target: space_of(target, context.view_layer.depsgraph)[1] for target in targets}
    return paths_of(targets, context.scene, turned)


@dataclass(frozen=True, eq=False)
class SeenMotion:
    """Something with keys in its Action, and what carries it."""

    target: Transform
    source: KeyedTransform
    carrier: HolderMotion | Parents | None
    """What holds it or carries it, where that moves."""

    space: tuple[AffineMaps, np.ndarray | None]
    """The map from the space of its channels into the world, and what is between its rotation and that."""

    @classmethod
    def of(cls, target: Transform, depsgraph: bpy.types.Depsgraph) -> SeenMotion:
        """Return the motion of a target that has a path."""
        carried = CarriedTargets()
        source = existing(carried.read([target])[target][1])
        space, turn = space_of(target, depsgraph)
        return cls(target, source, carrier_of(target, source, carried), (maps_of(space), turn))

    @property
    def range(self) -> tuple[int, int]:
        return self.carrier.range if isinstance(self.carrier, HolderMotion) else self.source.seen_range

    @property
    def size(self) -> float:
        """About how far it reaches from its origin."""
        return axis_length_of(self.target, self.source)

    def frames(self, per_frame: int = 1) -> np.ndarray:
        """Return frames from the first to the last, so many in each where these are not too many."""
        first, last = self.range
        return np.linspace(first, last, min(per_frame * (last - first), MAX_FRAMES) + 1)

    def maps(self, frames: np.ndarray, mode: str | None = None) -> AffineMaps:
        """Return where it is in the world on rising frames (n,). ValueError where its numbers make no motion.

        `mode` is in place of those of its segments. Its origin is the point that its path is of.
        """
        if isinstance(self.carrier, HolderMotion):
            return self.carrier.maps(frames, mode)
        source = self.source if mode is None else replace(self.source, mode=MODE_NUMBERS[mode])
        maps, (spaces, turn) = shown(self.target, source, frames)[1], self.space
        if self.carrier is not None:
            spaces, turn = self.carrier.spaces(frames)
        result = spaces @ in_space_of_path(self.target, maps, turn)
        point = np.array(self.target.motion.lead)
        followed_point = followed(self.target, self.source, None)
        if self.target.is_part and not existing(followed_point).moves and not point.any():
            point[1] = self.target.pose_bone.bone.length
        return AffineMaps(result.axes, result.at(point))
