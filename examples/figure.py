"""A visible body for a rig (one mesh with a capsule around each deforming bone), and props such as boxes and balls."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

import bpy
import numpy as np
from mathutils import Matrix, Vector

RADII = {
    "spine.006": (0.095, 0.115),
    "spine.005": (0.055, 0.055),
    "spine.004": (0.055, 0.055),
    "spine.003": (0.155, 0.10),
    "spine.002": (0.155, 0.11),
    "spine.001": (0.135, 0.10),
    "spine": (0.15, 0.11),
    "shoulder": (0.06, 0.06),
    "upper_arm": (0.05, 0.05),
    "forearm": (0.04, 0.04),
    "hand": (0.024, 0.036),
    "palm": (0.013, 0.013),
    "f_": (0.0105, 0.0105),
    "thumb": (0.012, 0.012),
    "thigh": (0.078, 0.078),
    "shin": (0.056, 0.056),
    "foot": (0.04, 0.04),
    "toe": (0.036, 0.024),
}
"""Half the width and depth of a body part in metres, by the start of its bone's name after DEF-."""

HEAD = "DEF-spine.006"
"""The bone of the head, whose capsule hardly extends beyond the bone."""

SIDES, RINGS = 16, 5
"""Corners around a capsule, and rings at each of its ends."""

Box = tuple[Sequence[float], Sequence[float]]
"""Middle and size of a box, per axis."""


def clothe(rig: bpy.types.Object, material: bpy.types.Material) -> bpy.types.Object:
    """Add a body mesh in rest pose that the rig deforms."""
    corners: list[np.ndarray] = []
    faces: list[tuple[int, ...]] = []
    owners: dict[str, range] = {}
    for bone in rig.data.bones:
        size = _size(bone)
        if size:
            first = sum(map(len, corners))
            points, around = _capsule(bone.length, size, 0.7 if bone.name == HEAD else 0.0)
            corners.append(points @ np.array(bone.matrix_local.to_3x3()).T + np.array(bone.head_local))
            faces += [tuple(first + corner for corner in face) for face in around]
            owners[bone.name] = range(first, first + len(points))
    mesh = bpy.data.meshes.new("Body")
    mesh.from_pydata(np.concatenate(corners), [], faces)
    mesh.shade_smooth()
    mesh.materials.append(material)
    body = bpy.data.objects.new("Body", mesh)
    for name, rows in owners.items():
        body.vertex_groups.new(name=name).add(list(rows), 1.0, "REPLACE")
    body.modifiers.new("Armature", "ARMATURE").object = rig
    body.parent = rig
    bpy.context.scene.collection.objects.link(body)
    return body


def _size(bone: bpy.types.Bone) -> tuple[float, float] | None:
    if not bone.use_deform:
        return None
    name = bone.name.removeprefix("DEF-")
    return next((size for start, size in RADII.items() if name.startswith(start)), None)


def _capsule(length: float, size: tuple[float, float], inset: float = 0.0) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Return the corners and faces of a capsule along Y, from the origin to `length`, with round caps beyond both ends.

    `inset` is the fraction of the caps that lies within `length`.
    """
    reach = min(size)
    angles = np.linspace(0.0, 0.5 * math.pi, RINGS + 1)[1:]
    start = [(-reach * math.cos(angle), math.sin(angle)) for angle in angles]
    rings = start + [(length - along, share) for along, share in reversed(start)]
    turn = np.linspace(0.0, 2.0 * math.pi, SIDES, endpoint=False)
    points = [(0.0, -reach, 0.0)]
    points += [
        (share * size[0] * math.cos(a), along, share * size[1] * math.sin(a)) for along, share in rings for a in turn
    ]
    points.append((0.0, length + reach, 0.0))
    corners = np.array(points)
    corners[:, 1] += inset * reach
    corners[len(corners) // 2 :, 1] -= 2.0 * inset * reach
    last = len(points) - 1
    faces: list[tuple[int, ...]] = []
    for side, beside in ((i, (i + 1) % SIDES) for i in range(SIDES)):
        faces.append((0, 1 + side, 1 + beside))
        faces.append((last, last - SIDES + beside, last - SIDES + side))
        for ring in range(len(rings) - 1):
            here, there = 1 + ring * SIDES, 1 + (ring + 1) * SIDES
            faces.append((here + side, there + side, there + beside, here + beside))
    return corners, faces


def boxes(name: str, material: bpy.types.Material, *parts: Box) -> bpy.types.Object:
    """Add an object made of boxes around its origin."""
    corners: list[list[float]] = []
    faces: list[list[int]] = []
    sides = (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)
    for middle, size in parts:
        first = len(corners)
        unit = itertools.product((-0.5, 0.5), repeat=3)
        corners += [[m + s * u for m, s, u in zip(middle, size, corner, strict=True)] for corner in unit]
        faces += [[first + corner for corner in side] for side in sides]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def ball(name: str, material: bpy.types.Material, radius: float) -> bpy.types.Object:
    """Add a ball around its origin."""
    points, faces = _capsule(0.0, (radius, radius))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    mesh.shade_smooth()
    mesh.materials.append(material)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def trail(
    name: str, material: bpy.types.Material, points: Iterable[Sequence[float]], radius: float
) -> bpy.types.Object:
    """Add a line through points."""
    points = [Vector(point) for point in points]
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", radius, 3
    curve.materials.append(material)
    spline = curve.splines.new("POLY")
    spline.points.add(len(points) - 1)
    spline.points.foreach_set("co", [value for point in points for value in (*point, 1.0)])
    obj = bpy.data.objects.new(name, curve)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def hold(obj: bpy.types.Object, rig: bpy.types.Object, bone: str, in_bone: Matrix) -> None:
    """Parent an object to a bone, with this matrix in the bone's own space, relative to its head."""
    obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", bone
    # Blender measures from the tail.
    obj.matrix_local = Matrix.Translation((0.0, -rig.data.bones[bone].length, 0.0)) @ in_bone
