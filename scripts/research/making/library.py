"""The models as Blender objects, and the .blend file that holds them."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from .controller import controller
from .drill import drill
from .shells import Shell, corner_normals

MODELS = {"Drill": drill, "Controller": controller}

MATERIALS = {  # linear RGB, metallic, roughness
    "Mode": ((0.62, 0.66, 0.70), 0.0, 0.32),
    "Metal": ((0.60, 0.62, 0.65), 0.7, 0.30),
    "Rubber": ((0.035, 0.038, 0.045), 0.0, 0.60),
}


def build_material(name: str) -> bpy.types.Material:
    """Return a new material of `MATERIALS`, alike in Workbench (viewport) and in EEVEE and Cycles (nodes)."""
    colour, metallic, roughness = MATERIALS[name]
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    surface = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    for socket, value in (("Base Color", (*colour, 1.0)), ("Metallic", metallic), ("Roughness", roughness)):
        surface.inputs[socket].default_value = value
    material.diffuse_color, material.metallic, material.roughness = (*colour, 1.0), metallic, roughness
    return material


def build_mesh(name: str, shell: Shell, materials: dict[str, bpy.types.Material]) -> bpy.types.Mesh:
    """Return a new mesh of a shell, in metres, smooth but for its creases."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((1e-3 * shell.vertices).tolist(), [], shell.faces)
    used = [material for material in materials if material in shell.materials]
    for material in used:
        mesh.materials.append(materials[material])
    numbers = np.array([used.index(name) for name in shell.materials], dtype=np.int32)
    mesh.polygons.foreach_set("material_index", numbers)
    mesh.polygons.foreach_set("use_smooth", np.ones(len(shell.faces), dtype=bool))
    mesh.normals_split_custom_set(corner_normals(shell).tolist())
    mesh.update()
    return mesh


def build_models() -> list[bpy.types.Object]:
    """Return new objects of all models at the origin, in no scene yet."""
    materials = {name: build_material(name) for name in MATERIALS}
    return [bpy.data.objects.new(name, build_mesh(name, model(), materials)) for name, model in MODELS.items()]


def write_models(path: Path) -> None:
    """Write a .blend file with a scene for each model. What is open in Blender stays as it is.

    The scenes are written as a library, so the file carries neither a window layout nor the path it was written to.
    """
    models = build_models()
    scenes = [bpy.data.scenes.new(model.name) for model in models]
    for scene, model in zip(scenes, models, strict=True):
        scene.collection.objects.link(model)
    try:
        bpy.data.libraries.write(str(path), set(scenes), compress=True)
    finally:
        meshes = {model.data for model in models}
        materials = {material for mesh in meshes for material in mesh.materials}
        bpy.data.batch_remove([*scenes, *models, *meshes, *materials])
