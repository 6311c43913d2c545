"""Trails and key marks: the way of one point of the object, drawn around the frame that is shown.

A trail is a tube along a polyline, a mark a small ball at a vertex. Each vertex carries, as the attribute `frame`, when
the object is there; the node groups keep what lies within a window of frames around the current one.
"""

from __future__ import annotations

import bpy
import numpy as np

from .nodes import Group, Socket

FRAME = "frame"
FLASH_FRAMES = 6.0
"""How long a mark takes to swell before its key and to settle after it."""


def polyline(name: str, frames: np.ndarray, points: np.ndarray, *, joined: bool = True) -> bpy.types.Mesh:
    """A mesh of vertices that know their frame, joined one to the next or single.

    Parameters
    ----------
    name : str
    frames : array, shape (n,)
    points : array, shape (n, 3)
    joined : bool
    """
    mesh = bpy.data.meshes.new(name)
    steps = np.arange(len(points))
    edges = np.stack((steps[:-1], steps[1:]), axis=-1) if joined else np.empty((0, 2), dtype=int)
    mesh.from_pydata(points.tolist(), edges.tolist(), [])
    mesh.attributes.new(FRAME, "FLOAT", "POINT").data.foreach_set("value", frames.astype(np.float32))
    return mesh


def trail_group() -> bpy.types.NodeTree:
    """A tube from `Past` frames ago to `Ahead` frames from now, that thins by `Taper` towards its old end."""
    group = Group("Trail", Past="Float", Ahead="Float", Radius="Float", Taper="Float", Material="Material")
    age, points = _within_window(group)
    curve = group.add("GeometryNodeMeshToCurve", points)
    worn = group.math("MULTIPLY", group.math("DIVIDE", age, group.inputs["Past"], clamp=True), group.inputs["Taper"])
    radius = group.math("MULTIPLY", group.inputs["Radius"], group.math("SUBTRACT", 1.0, worn))
    profile = group.add("GeometryNodeCurvePrimitiveCircle", Resolution=6, Radius=1.0)
    tube = _tube(group, curve, profile, radius)
    return group.finish(group.add("GeometryNodeSetMaterial", tube, Material=group.inputs["Material"]))


def marks_group() -> bpy.types.NodeTree:
    """A ball at each key from `Past` frames ago to `Ahead` frames from now; it swells while its key is reached."""
    group = Group("Key marks", Past="Float", Ahead="Float", Radius="Float", Material="Material")
    age, points = _within_window(group)
    near = group.math("SUBTRACT", 1.0, group.math("DIVIDE", group.math("ABSOLUTE", age), FLASH_FRAMES), clamp=True)
    radius = group.math("MULTIPLY", group.inputs["Radius"], group.math("MULTIPLY_ADD", near, 0.6, 1.0))
    ball = group.add("GeometryNodeMeshIcoSphere", 1.0, 2)
    ball = group.add("GeometryNodeSetShadeSmooth", ball)
    ball = group.add("GeometryNodeSetMaterial", ball, Material=group.inputs["Material"])
    return group.finish(group.add("GeometryNodeInstanceOnPoints", points, Instance=ball, Scale=radius))


def _within_window(group: Group) -> tuple[Socket, Socket]:
    """How many frames ago each point was passed, and the points within the window."""
    age = group.math("SUBTRACT", group.frame(), group.attribute(FRAME))
    old = group.math("GREATER_THAN", age, group.inputs["Past"])
    # Frames are single precision: the point of this very frame stays.
    future = group.math("LESS_THAN", group.math("ADD", age, group.inputs["Ahead"]), -1e-3)
    outside = group.math("ADD", old, future)
    kept = group.add("GeometryNodeDeleteGeometry", group.inputs["Geometry"], outside, settings={"domain": "POINT"})
    return age, kept


def _tube(group: Group, curve: Socket, profile: Socket, radius: Socket) -> Socket:
    """Blender 5 takes the radius as an input of the tube, Blender 4.5 from the curve."""
    tube = group.add("GeometryNodeCurveToMesh", None, profile)
    if "Scale" in tube.node.inputs:
        group.tree.links.new(radius, tube.node.inputs["Scale"])
    else:
        curve = group.add("GeometryNodeSetCurveRadius", curve, None, radius)
    group.tree.links.new(curve, tube.node.inputs["Curve"])
    return tube
