"""The object to show: one of our models or any object of a user's .blend file, as a single new mesh.

The mesh includes everything that makes up the shape (modifiers, curves, text); nothing else of the file remains.
Scripts in the file never run: it is read as data.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import bpy
import numpy as np
from mathutils import Matrix

from rigid_motion.blender import existing, scene
from rigid_motion_batch.command_line import listed

from .settings import SubjectError, place_of_subject

TINTED = "Mode"
"""The name of the material that is replaced by the lane's colour."""


def load_subject(requested: str) -> bpy.types.Mesh:
    """Return the mesh of an object, in its own axes, with its world-space size in its file.

    Parameters
    ----------
    requested : str
        See `place_of_subject`.

    Raises
    ------
    SubjectError
        If the file, the object or its faces are missing.
    """
    return _read_mesh(*place_of_subject(requested))


def vertices_of(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the vertices, shape (n, 3), in metres."""
    flat = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", flat)
    return flat.reshape(-1, 3).astype(np.float64)


def tinted_slots(mesh: bpy.types.Mesh) -> list[int]:
    """Return the material slots that get the lane's colour: those named `TINTED`, or else the first."""
    named = [
        index for index, material in enumerate(mesh.materials) if material and _without_number(material.name) == TINTED
    ]
    return named or [0]


def _without_number(name: str) -> str:
    """Return the name without the number that Blender adds to make it unique."""
    stem, dot, number = name.rpartition(".")
    return stem if dot and number.isdecimal() else name


def _read_mesh(file: Path, name: str) -> bpy.types.Mesh:
    if not file.is_file():
        raise SubjectError(f"{file}: there is no such file")
    before = set(bpy.data.user_map())
    mesh = None
    try:
        libraries: Any = bpy.data.libraries
        with libraries.load(str(file), link=False) as (source, target):
            if name not in source.objects:
                others = listed(sorted(source.objects), 12) or "none"
                raise SubjectError(f"{file}: has no object {name!r}; it has {others}")
            target.objects = [name]
        mesh = _evaluated_copy(target.objects[0])
        names = _own_materials(mesh) if mesh else {}
    except OSError as error:
        raise SubjectError(f"{file}: is not a .blend file that this Blender can read") from error
    finally:
        _discard_all_but(mesh, before)
    if mesh is None:
        raise SubjectError(f"{file}: {name!r} has no faces to show; name a mesh, curve, surface or text object")
    mesh.name = name
    for material, original in names.items():
        material.name = original
    if not mesh.materials:
        mesh.materials.append(None)
    return mesh


def _evaluated_copy(loaded: bpy.types.Object) -> bpy.types.Mesh | None:
    """Return the evaluated mesh, sized as in its file's world; None for objects without faces."""
    objects = scene().collection.objects
    objects.link(loaded)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = loaded.evaluated_get(depsgraph)
    try:
        mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
    except RuntimeError:  # A light, a camera or an empty.
        return None
    finally:
        size = evaluated.matrix_world.to_scale()
        objects.unlink(loaded)
    if not mesh.polygons:
        return None
    mesh.transform(Matrix.Diagonal((size.x, size.y, size.z, 1.0)))
    return mesh


def _own_materials(mesh: bpy.types.Mesh) -> dict[bpy.types.Material, str]:
    """Replace the mesh's materials by copies, and return the copies with the original names.

    Blender stores the full path of the source file in loaded data; copies do not have it. Images are packed, so that
    the saved file can be opened elsewhere.
    """
    names: dict[bpy.types.Material, str] = {}
    for slot, material in enumerate(mesh.materials):
        if material is not None:
            copied = mesh.materials[slot] = material.copy()
            names[existing(copied)] = material.name
    for image in bpy.data.images:
        if image.source == "FILE" and not image.packed_file and Path(bpy.path.abspath(image.filepath)).is_file():
            image.pack()
    return names


def _discard_all_but(mesh: bpy.types.Mesh | None, before: set[bpy.types.ID]) -> None:
    """Remove all data loaded with the object, except the materials and images that the mesh uses."""
    arrived = set(bpy.data.user_map()) - before
    kept: set[bpy.types.ID | None] = {mesh}
    for block in arrived:
        if getattr(block, "animation_data", None) is not None:
            block.animation_data_clear()
    users = bpy.data.user_map(subset=arrived)
    while more := {block for block in arrived - kept if users[block] & kept and not isinstance(block, bpy.types.Text)}:
        kept |= more
    bpy.data.batch_remove(arrived - kept)


MOST_TRIANGLES = 4000
"""Maximum number of triangles: 4000 take about 100 kB in a page."""

MAX_TRIES = 6


def simplified(requested: str, most: int = MOST_TRIANGLES) -> dict[str, np.ndarray]:
    """Return the surface of an object in its own axes, in metres: `vertices` (v, 3), `triangles` (t, 3), `tints` (t,).

    It has at most `most` triangles. Tints are 1 for triangles in the mode's colour, and 0 elsewhere. `requested` is as
    in `load_subject`, and so are the errors raised.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = load_subject(requested)
    obj = bpy.data.objects.new("Subject", mesh)
    scene().collection.objects.link(obj)
    modifier = cast(bpy.types.DecimateModifier, obj.modifiers.new("Fewer", "DECIMATE"))
    modifier.use_collapse_triangulate = True
    for _ in range(MAX_TRIES):
        result = _surface(obj)
        if len(result["triangles"]) <= most:
            return result
        # The modifier may leave more than requested, if the mesh has many loose parts.
        modifier.ratio *= 0.95 * most / len(result["triangles"])
    raise SubjectError(f"{requested}: Blender cannot simplify it to {most} triangles")


def _surface(obj: bpy.types.Object) -> dict[str, np.ndarray]:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = obj.evaluated_get(depsgraph)
    mesh = existing(evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph))
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
