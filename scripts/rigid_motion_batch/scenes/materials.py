"""Materials that look the same in every engine: Workbench uses their viewport colour, EEVEE and Cycles their nodes."""

from __future__ import annotations

from typing import Any

import bpy

from rigid_motion_batch.palette import Theme, linear

GLOSS_FACTOR, BOUNCE_FACTOR = 0.0142, 0.878
"""Workbench's light `paint.sl` shows a rough colour c that faces the camera as GLOSS_FACTOR + BOUNCE_FACTOR c
(measured)."""


GHOST_CONTRAST = 0.5
"""The contrast of a ghost with its card: a fraction from the card's colour to the ghost's."""


def ghost(theme: Theme) -> bpy.types.Material:
    """Return the recording's material: a mix of its colour and the card's, so that it seems translucent."""
    colours = zip(linear(theme.ghost), linear(theme.card), strict=True)
    return _lit("Recording", tuple(GHOST_CONTRAST * ghost + (1.0 - GHOST_CONTRAST) * card for ghost, card in colours))


def surface(name: str, colour: str, *, alpha: float = 1.0, roughness: float = 0.4) -> bpy.types.Material:
    """Return a lit surface, translucent if alpha is below 1."""
    return _lit(name, linear(colour), alpha, roughness)


def _lit(name: str, rgb: tuple[float, ...], alpha: float = 1.0, roughness: float = 0.4) -> bpy.types.Material:
    material, nodes, output = _new(name)
    material.diffuse_color = (*rgb, alpha)
    material.roughness = roughness
    principled = nodes.new("ShaderNodeBsdfPrincipled")
    principled.inputs["Base Color"].default_value = (*rgb, 1.0)
    principled.inputs["Roughness"].default_value = roughness
    principled.inputs["Alpha"].default_value = alpha
    material.node_tree.links.new(principled.outputs[0], output.inputs["Surface"])
    if alpha < 1.0:
        material.surface_render_method = "BLENDED"
        material.use_transparency_overlap = False
    return material


def ink(name: str, colour: str) -> bpy.types.Material:
    """Return a flat colour that ignores light, for text and symbols."""
    material, nodes, output = _new(name)
    rgb = linear(colour)
    material.diffuse_color = (*(max(0.0, (value - GLOSS_FACTOR) / BOUNCE_FACTOR) for value in rgb), 1.0)
    material.roughness, material.specular_intensity = 1.0, 0.0
    emission = nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (*rgb, 1.0)
    material.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return material


def _new(name: str) -> tuple[Any, Any, Any]:
    material: Any = bpy.data.materials.new(name)
    if material.node_tree is None:  # Blender 5 has a node tree already, and warns about `use_nodes`.
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    return material, nodes, nodes.new("ShaderNodeOutputMaterial")
