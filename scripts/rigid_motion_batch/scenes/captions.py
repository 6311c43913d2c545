"""Captions on the stage: text, changing numbers, and the cards behind them. Units are those of the frame (`layout`).

Text is made of text objects. Changing numbers are node groups that write an animated value, so the .blend plays
without scripts. Numbers are right-aligned, and Blender's font has digits of equal width, so they do not jump.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, cast

import bpy
import numpy as np

from rigid_motion.animation import write_channel
from rigid_motion.blender import action_of, scene, view_layer

from .nodes import Group, Socket, apply_group, input_path, node_of

CORNER_RATIO = 0.012


def card(
    name: str, width: float, height: float, material: bpy.types.Material, corner: float = CORNER_RATIO
) -> bpy.types.Mesh:
    """Return a rectangle with rounded corners, centred on the origin."""
    corner = min(corner, width / 2.0, height / 2.0)
    angles = np.radians(np.arange(0.0, 91.0, 15.0))
    arc = corner * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    middle = np.array((width / 2.0 - corner, height / 2.0 - corner))
    quarters = [
        (arc + middle),
        (arc + middle)[::-1] * (-1.0, 1.0),
        (arc + middle) * (-1.0, -1.0),
        (arc + middle)[::-1] * (1.0, -1.0),
    ]
    outline = np.concatenate(quarters)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.pad(outline, ((0, 0), (0, 1))).tolist(), [], [list(range(len(outline)))])
    mesh.materials.append(material)
    return mesh


def words(name: str, text: str, size: float, material: bpy.types.Material, align: str = "LEFT") -> bpy.types.Object:
    """Return a line of text, aligned at the new object's origin.

    The outlines are not offset: offset outlines of an M would cross, and Blender before 5.2 fills crossing outlines as
    one blot.
    """
    curve: Any = bpy.data.curves.new(name, "FONT")
    curve.body = text
    curve.size = size
    curve.align_x = align
    curve.resolution_u = 4
    curve.materials.append(material)
    return bpy.data.objects.new(name, curve)


def wrapped(parts: Sequence[str], width: float) -> str:
    """Return the parts joined by commas, wrapped into lines at most `width` wide unless a line is a single part."""
    lines = [parts[0]]
    for part in parts[1:]:
        if width_of(f"{lines[-1]}, {part},") <= width:
            lines[-1] += f", {part}"
        else:
            lines[-1] += ","
            lines.append(part)
    return "\n".join(lines)


def put(
    frame: bpy.types.Object,
    collection: bpy.types.Collection,
    obj: bpy.types.Object,
    x: float,
    y: float,
    lift: int = 2,
) -> None:
    """Place an object on the frame. A higher lift is nearer to the camera."""
    obj.location = (x, y, 1e-3 * lift)
    obj.parent = frame
    collection.objects.link(obj)


@cache
def width_of(text: str) -> float:
    """Return the width of `words` of size 1."""
    curve = cast(bpy.types.TextCurve, bpy.data.curves.new("Measured", "FONT"))
    curve.body = text
    obj = bpy.data.objects.new("Measured", curve)
    scene().collection.objects.link(obj)
    view_layer().update()
    width = float(obj.dimensions.x)
    bpy.data.curves.remove(curve)
    return width


def readout_group(name: str, decimals: int, material: bpy.types.Material) -> bpy.types.NodeTree:
    """Return a node group that writes the number `Value`, right-aligned at the origin, in letters of size 1."""
    group = Group(name, Value="Float")
    string = group.add("FunctionNodeValueToString", group.inputs["Value"], decimals)
    curves = group.add("GeometryNodeStringToCurves", string, 1.0)
    node = node_of(curves)
    if "Align X" in node.inputs:  # Blender 5 made this an input.
        node.inputs["Align X"].default_value = "Right"
    else:
        node.align_x = "RIGHT"
    return _fill_letters(group, curves, material)


def decimals_for(largest: float) -> int:
    """Return the number of decimals that gives the largest number three digits; at least one decimal below 1000."""
    if largest <= 0.0:
        return 1
    return int(np.clip(2 - np.floor(np.log10(largest)), 1 if largest < 1000.0 else 0, 4))


def choice_group(name: str, texts: Sequence[str], material: bpy.types.Material) -> bpy.types.NodeTree:
    """Return a node group that writes the text with the index `Value`, from the origin on, in letters of size 1."""
    group = Group(name, Value="Float")
    chosen = node_of(group.add("GeometryNodeIndexSwitch", settings={"data_type": "STRING"}))
    while len(chosen.index_switch_items) < len(texts):
        chosen.index_switch_items.new()
    # Blender truncates numbers to get an index.
    group.tree.links.new(group.math("ADD", group.inputs["Value"], 0.5), chosen.inputs[0])
    for socket, text in zip(chosen.inputs[1:], texts, strict=False):
        socket.default_value = text
    return _fill_letters(group, group.add("GeometryNodeStringToCurves", chosen.outputs[0], 1.0), material)


def _fill_letters(group: Group, curves: Socket, material: bpy.types.Material) -> bpy.types.NodeTree:
    filled = group.add("GeometryNodeFillCurve", curves)
    return group.finish(group.add("GeometryNodeSetMaterial", filled, Material=material))


def changes(frames: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return only the frames and values where the value differs from the one before."""
    new = np.append(True, np.diff(values) != 0)
    return frames[new], values[new]


def readout(
    name: str,
    group: bpy.types.NodeTree,
    size: float,
    frames: np.ndarray,
    values: np.ndarray,
    interpolation: str = "LINEAR",
) -> bpy.types.Object:
    """Return an object with a node group whose input `Value` is animated: values (n,) at `frames` (n,)."""
    obj = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    obj.scale = (size, size, size)
    modifier = apply_group(obj, group, Value=float(values[0]))
    write_channel(obj, input_path(modifier, "Value"), frames, values, interpolation=interpolation)
    action_of(obj).name = name
    return obj
