"""Captions: what is written on the stage, and the cards it stands on. Units are those of the frame (`layout`).

Words are text objects. Numbers that change are node groups that write an animated number, so the .blend needs no script
to play them; they end at a fixed place and Blender's own font has digits of one width, so they do not jump.
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
    """Return a rectangle with round corners around the origin."""
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
    """Return a line of text, from or to the origin of the new object.

    Its outlines stay as the font has them: moved outwards, those of an M cross, which Blender before 5.2 fills as one
    blot.
    """
    curve: Any = bpy.data.curves.new(name, "FONT")
    curve.body = text
    curve.size = size
    curve.align_x = align
    curve.resolution_u = 4
    curve.materials.append(material)
    return bpy.data.objects.new(name, curve)


def wrapped(parts: Sequence[str], width: float) -> str:
    """Return the parts with commas between them, in lines that are no wider than that where they have several parts."""
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
    """Place an object on the frame. What has more lift lies nearer to the camera."""
    obj.location = (x, y, 1e-3 * lift)
    obj.parent = frame
    collection.objects.link(obj)


@cache
def width_of(text: str) -> float:
    """Return how wide `words` of size 1 are."""
    curve = cast(bpy.types.TextCurve, bpy.data.curves.new("Measured", "FONT"))
    curve.body = text
    obj = bpy.data.objects.new("Measured", curve)
    scene().collection.objects.link(obj)
    view_layer().update()
    width = float(obj.dimensions.x)
    bpy.data.curves.remove(curve)
    return width


def readout_group(name: str, decimals: int, material: bpy.types.Material) -> bpy.types.NodeTree:
    """Return the number `Value`, written to the left of the origin in letters of size 1."""
    group = Group(name, Value="Float")
    string = group.add("FunctionNodeValueToString", group.inputs["Value"], decimals)
    curves = group.add("GeometryNodeStringToCurves", string, 1.0)
    node = node_of(curves)
    if "Align X" in node.inputs:  # Blender 5 made it an input.
        node.inputs["Align X"].default_value = "Right"
    else:
        node.align_x = "RIGHT"
    return _lettered(group, curves, material)


def decimals_for(largest: float) -> int:
    """Return the decimals that leave the largest of some numbers three digits, or one decimal up to a thousand."""
    if largest <= 0.0:
        return 1
    return int(np.clip(2 - np.floor(np.log10(largest)), 1 if largest < 1000.0 else 0, 4))


def choice_group(name: str, texts: Sequence[str], material: bpy.types.Material) -> bpy.types.NodeTree:
    """Return one of some texts, that with the number `Value`, written from the origin on in letters of size 1."""
    group = Group(name, Value="Float")
    chosen = node_of(group.add("GeometryNodeIndexSwitch", settings={"data_type": "STRING"}))
    while len(chosen.index_switch_items) < len(texts):
        chosen.index_switch_items.new()
    # Numbers are cut off to be an index.
    group.tree.links.new(group.math("ADD", group.inputs["Value"], 0.5), chosen.inputs[0])
    for socket, text in zip(chosen.inputs[1:], texts, strict=False):
        socket.default_value = text
    return _lettered(group, group.add("GeometryNodeStringToCurves", chosen.outputs[0], 1.0), material)


def _lettered(group: Group, curves: Socket, material: bpy.types.Material) -> bpy.types.NodeTree:
    filled = group.add("GeometryNodeFillCurve", curves)
    return group.finish(group.add("GeometryNodeSetMaterial", filled, Material=material))


def changes(frames: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frames and values only where a value is not that before."""
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
    """Return a number, or another object of a group, in which `Value` has these values at `frames`, each (n,)."""
    obj = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    obj.scale = (size, size, size)
    modifier = apply_group(obj, group, Value=float(values[0]))
    write_channel(obj, input_path(modifier, "Value"), frames, values, interpolation=interpolation)
    action_of(obj).name = name
    return obj
