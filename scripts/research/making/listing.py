"""The icon of the extension's page: a body that goes from key to key along an arc, and turns with it.

Flat colours with dark outlines, so that it can be told on light and on dark ground, also where it is 32 pixels wide. It
is seen along -z.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

from rigid_motion_batch.scenes.materials import ink

from .rendering import add, empty_scene, look_from, render

SIZE, SAMPLES = 256, 64
BODY, PATH, KEY, OUTLINE = "#38B6FF", "#F2F2F2", "#FFB52E", "#1B1F24"
RADIUS, CENTRE = 0.66, Vector((0.0, -0.22))  # of the arc; the picture goes from -1 to 1
BEGINS, ENDS, BODY_AT = -24, 204, 72  # degrees on the arc: its keys, and where the body is

Shape = Sequence[Vector]


def make(path: Path) -> None:
    """Render the icon into a file."""
    empty_scene()
    arc = [_on_arc(angle) for angle in range(BEGINS, ENDS + 1, 3)]
    _stroke(arc, 0.24, OUTLINE, 0)
    _stroke(arc, 0.12, PATH, 1)
    for angle in (BEGINS, ENDS):
        _outlined([_on_arc(angle) + 0.2 * _towards(turn) for turn in (0, 90, 180, 270)], KEY, 4)
    _outlined([_on_arc(BODY_AT) + 0.4 * _towards(BODY_AT + turn) for turn in (45, 135, 225, 315)], BODY, 8)
    look_from((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), 2.0)
    render(path, (SIZE, SIZE), SAMPLES, transparent=True)


def _towards(degrees: float) -> Vector:
    return Vector((math.cos(math.radians(degrees)), math.sin(math.radians(degrees))))


def _on_arc(degrees: float) -> Vector:
    return CENTRE + RADIUS * _towards(degrees)


def _outlined(corners: Shape, colour: str, layer: int) -> None:
    """Draw a filled shape with round corners, and its outline below it."""
    for colour_of_layer, width, height in ((OUTLINE, 0.21, layer), (colour, 0.1, layer + 1)):
        _fill(corners, colour_of_layer, height)
        _stroke([*corners, corners[0]], width, colour_of_layer, height)


def _fill(corners: Shape, colour: str, layer: int) -> None:
    mesh = bpy.data.meshes.new("Fill")
    mesh.from_pydata([(*corner, 0.05 * layer) for corner in corners], [], [range(len(corners))])
    add("Shape", mesh, bpy.data.materials.get(colour) or ink(colour, colour))


def _stroke(points: Shape, width: float, colour: str, layer: int) -> None:
    """Draw a line with round ends and corners, flat."""
    turns = [2.0 * math.pi * number / 32 for number in range(32)]
    disc = [Vector((0.5 * width * math.cos(turn), 0.5 * width * math.sin(turn))) for turn in turns]
    for point in points:
        _fill([point + offset for offset in disc], colour, layer)
    for start, end in pairwise(points):
        across = 0.5 * width * (Matrix.Rotation(math.radians(90.0), 2) @ (end - start).normalized())
        _fill([start - across, end - across, end + across, start + across], colour, layer)
