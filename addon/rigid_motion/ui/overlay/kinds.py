"""What the paths of each kind of transform are drawn by."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix

from ...animation.compute.sources import Source
from ...animation.transforms import BoneTransform, ExactObjectTransform, ObjectTransform, Transform
from .bones import axis_length_of_bone, followed, space_of_bone
from .points import Followed, axis_length_of, space_of

Carrier = bpy.types.Object | bpy.types.PoseBone


class PathKind(NamedTuple):
    """How the paths of one kind of transform are drawn."""

    space: Callable[[Carrier, bpy.types.Depsgraph], tuple[Matrix, np.ndarray | None]]
    """Returns where a path leads in the world, and what stands between rotation and location in it,
    None where nothing does."""

    point: Callable[[Carrier, Source, np.ndarray | None], Followed | None]
    """The point that a path is of, None for the origin."""

    axis_length: Callable[[Carrier, Source], float]
    """Returns how long its local axes are."""


OBJECT = PathKind(lambda obj, depsgraph: (space_of(obj, depsgraph), None), lambda *_: None, axis_length_of)

PATH_KINDS: dict[type[Transform], PathKind] = {
    BoneTransform: PathKind(space_of_bone, followed, axis_length_of_bone),
    ObjectTransform: OBJECT,
    ExactObjectTransform: OBJECT,
}
"""A row for each of the `transforms.KINDS`."""
