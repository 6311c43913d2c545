"""The object that is shown as few triangles, for the viewer of a report."""

from __future__ import annotations

import bpy
import numpy as np

from .settings import SubjectError
from .subject import load_subject, tinted_slots, vertices_of

MOST_TRIANGLES = 4000
"""So many are some 100 kB in a page."""

TRIES = 6


def simplified(requested: str, most: int = MOST_TRIANGLES) -> dict[str, np.ndarray]:
    """Return the surface of an object in its own axes, in metres: `vertices` (v, 3), `triangles` (t, 3), `tints` (t,).

    It has so many triangles at most. Tints are 1 where a triangle has the colour of its mode, and 0 elsewhere.
    `requested` is as in `load_subject`, whose errors it raises.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = load_subject(requested)
    obj = bpy.data.objects.new("Subject", mesh)
    bpy.context.scene.collection.objects.link(obj)
    modifier = obj.modifiers.new("Fewer", "DECIMATE")
    modifier.use_collapse_triangulate = True
    for _ in range(TRIES):
        result = _surface(obj)
        if len(result["triangles"]) <= most:
            return result
        # It may leave more than it is asked to, where much hangs on nothing.
        modifier.ratio *= 0.95 * most / len(result["triangles"])
    raise SubjectError(f"{requested}: Blender cannot simplify it to {most} triangles")


def _surface(obj: bpy.types.Object) -> dict[str, np.ndarray]:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = obj.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
    slots = np.empty(len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    mesh.loop_triangles.foreach_get("material_index", slots)
    result = {
        "vertices": vertices_of(mesh),
        "triangles": triangles.reshape(-1, 3),
        "tints": np.isin(slots, tinted_slots(mesh)).astype(float),
    }
    evaluated.to_mesh_clear()
    return result
