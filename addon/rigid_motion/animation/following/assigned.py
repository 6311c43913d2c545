"""Poses of the world that scripts and add-ons assign to held objects, as `matrix_world`.

Blender gives the channels what is seen then where nothing holds the object. So they are set once more, to what is seen
there in the hand, and with them keys that were inserted of it. What tells is that the matrix is other than Blender has
evaluated it: no edit of channels does that, whatever their values. With *Keep Transform* it is the parent that is
another one. Of bones nothing tells: `matrix` is only evaluated.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Matrix

from ...blender import view_layer
from ..evaluation.components import ROWS, SCALE
from ..evaluation.sources import SAME_FRAME
from ..holds.holders import Holder, basis_in, constraints_to, holders_of, passings_of, world_in
from ..holds.placing import poses_of, rows_of
from ..queries.keyed import active_binding
from ..queries.segments import frame_in_action
from ..transforms import WIDTHS, Transform
from .changes import graphs_of

MAX_MATRIX_ROUNDING = 1e-4
"""What channels lose of a matrix, relative to it and absolute below 1. Where they lose more it was not for them."""


class Assigned(NamedTuple):
    """A pose in the world that was assigned to an object that is held."""

    transform: Transform
    world: Matrix
    values: np.ndarray
    """The components (10,) that Blender took it for."""
    scale: np.ndarray
    """What it was scaled by before, (3,)."""


class Settled(NamedTuple):
    """What had something held be elsewhere, and what is there in place of it: components (10,) each."""

    transform: Transform
    before: np.ndarray
    after: np.ndarray


def assigned(objects: Iterable[bpy.types.Object]) -> list[Assigned]:
    """Return what poses were assigned to held ones among objects since they were evaluated."""
    graphs = [graph for scene in bpy.data.scenes for graph in graphs_of(scene)]
    held = (obj for obj in objects if len(obj.constraints) and obj.is_editable)
    return [item for obj in held if (item := _assigned(obj, graphs)) is not None]


def _assigned(obj: bpy.types.Object, graphs: Iterable[bpy.types.Depsgraph]) -> Assigned | None:
    transform, known = Transform(obj), [one for graph in graphs if (one := obj.evaluated_get(graph)).is_evaluated]
    as_known = any(one.matrix_world == obj.matrix_world and _parent(one) == obj.parent for one in known)
    if not known or as_known or _holder_of(transform) is None:
        return None
    taken = world_in(transform, None, obj.matrix_basis, view_layer().depsgraph)
    if not np.allclose(np.array(taken), np.array(obj.matrix_world), rtol=MAX_MATRIX_ROUNDING, atol=MAX_MATRIX_ROUNDING):
        return None
    return Assigned(transform, obj.matrix_world.copy(), transform.components(), np.array(known[0].scale))


def _parent(evaluated: bpy.types.Object) -> bpy.types.Object | None:
    return evaluated.parent and evaluated.parent.original


def _holder_of(transform: Transform) -> Holder | None:
    """Return what holds something now; None where it passes, too."""
    held = [number for number, one in constraints_to(transform).items() if one.influence and not one.mute]
    if len(held) != 1 or any(one.influence for one in passings_of(transform)):
        return None
    return next(one for one in holders_of(transform) if one.number == held[0])


def settled(items: Iterable[Assigned]) -> list[Settled]:
    """Return what has things be where they were assigned to be, in what holds them as they are evaluated."""
    result, depsgraph = [], view_layer().depsgraph
    for item in items:
        transform, holder = item.transform, _holder_of(item.transform)
        if holder is not None and holder.target is not None:
            basis = np.array(basis_in(transform, holder, item.world, depsgraph))
            values = rows_of(*poses_of(basis[None]), transform, item.values)[:, 0].astype(np.float32)
            if np.allclose(values[ROWS[SCALE]], item.scale, rtol=MAX_MATRIX_ROUNDING):
                values[ROWS[SCALE]] = item.scale
            result.append(Settled(transform, item.values, values))
    return result


def set_keys(item: Settled, frame: float) -> bool:
    """Give the keys of a transform on a frame of the scene other values where they have those before.

    Returns whether there are any.
    """
    transform, binding = item.transform, active_binding(item.transform)
    if binding is None or not binding.slot.is_editable:
        return False
    at, found = frame_in_action(transform.animated, frame), False
    curves = ((row, binding.curves.get(channel)) for row, channel in transform.channels.items())
    for row, fcurve in ((row, fcurve) for row, fcurve in curves if fcurve is not None):
        for key in fcurve.keyframe_points:
            if abs(key.co.x - at) < SAME_FRAME and key.co.y == np.float32(item.before[row]):
                key.co_ui.y, found = item.after[row], True
                fcurve.update()
    return found


def set_values(item: Settled) -> None:
    """Give a transform its other values."""
    for part, prop in item.transform.properties.items():
        setattr(item.transform.carrier, prop, item.after[ROWS[part]][: WIDTHS[prop]])
