"""World poses that scripts and add-ons assign to held objects as `matrix_world`.

Blender then sets the channels as if no holder held the object. So they are set once more, to give that pose in the
holder, along with any keys just inserted from them. An assignment is recognised by a matrix that differs from Blender's
evaluated one: no edit of channels changes it. With *Keep Transform*, the parent differs as well. For bones there is no
such sign: their `matrix` is only evaluated.
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
"""The rounding error of a matrix set through channels, relative, absolute below 1. A larger one is no assignment."""


class Assigned(NamedTuple):
    """A world pose that was assigned to a held object."""

    transform: Transform
    world: Matrix
    values: np.ndarray
    """The components (10,) that Blender set for the pose."""
    scale: np.ndarray
    """The scale before the assignment, (3,)."""


class Settled(NamedTuple):
    """The components (10,) that put a held object in the wrong place, and the corrected ones."""

    transform: Transform
    before: np.ndarray
    after: np.ndarray


def assigned(objects: Iterable[bpy.types.Object]) -> list[Assigned]:
    """Return the poses assigned to held objects, among these objects, since they were last evaluated."""
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
    """Return the present holder of a transform; None also while it passes to another one."""
    held = [number for number, one in constraints_to(transform).items() if one.influence and not one.mute]
    if len(held) != 1 or any(one.influence for one in passings_of(transform)):
        return None
    return next(one for one in holders_of(transform) if one.number == held[0])


def settled(items: Iterable[Assigned]) -> list[Settled]:
    """Return the components that put objects in their assigned poses, given their holders as evaluated now."""
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
    """Correct the keys of a transform on a frame of the scene that still have the values from before.

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
    """Give a transform its corrected values."""
    for part, prop in item.transform.properties.items():
        setattr(item.transform.carrier, prop, item.after[ROWS[part]][: WIDTHS[prop]])
