"""Trails, key marks and graphs: what was and what will be, drawn around the frame that is shown.

A trail is a tube along the way of one point of the object, a mark a small ball at a vertex, a graph an area that grows
from left to right. Each vertex carries its moment as the attribute `frame`; the node groups keep what lies within a
window of frames around the current one, and of trails what lies within a window of the picture.
"""

from __future__ import annotations

import bpy
import numpy as np

from .nodes import Group, Socket, add_attribute, node_of

FRAME = "frame"
FLASH_FRAMES = 6.0
"""The frames that a mark takes to swell before its key and to settle after it."""


def polyline(name: str, frames: np.ndarray, points: np.ndarray, *, joined: bool = True) -> bpy.types.Mesh:
    """Return a mesh of vertices that know their frame, joined one to the next or single.

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
    add_attribute(mesh, FRAME, frames.astype(np.float32))
    return mesh


WINDOW = {"Middle": "Vector", "Right": "Vector", "Up": "Vector"}
"""The window that trails are kept within: the middle of a window of the picture in the world, and one over its half
width and half height, along the directions in which these are."""

FADE_RATIO = 0.15
"""The part of the window's half, from its edge, where what is drawn begins to thin."""


def trail_group() -> bpy.types.NodeTree:
    """Return a tube from `Past` frames ago to `Ahead` frames from now, that thins by `Taper` towards its old end.

    None outside of the `WINDOW`.
    """
    inputs = {"Past": "Float", "Ahead": "Float", "Radius": "Float", "Taper": "Float", "Material": "Material"}
    group = Group("Trail", **inputs, **WINDOW)
    age, points = _within_window(group)
    worn = group.math("MULTIPLY", group.math("DIVIDE", age, group.inputs["Past"], clamp=True), group.inputs["Taper"])
    radius = group.math("MULTIPLY", group.inputs["Radius"], group.math("SUBTRACT", 1.0, worn))
    points, thinned = _within_picture(group, points)
    radius = group.math("MULTIPLY", radius, thinned)
    curve = group.add("GeometryNodeMeshToCurve", points)
    profile = group.add("GeometryNodeCurvePrimitiveCircle", Resolution=4, Radius=1.0)
    tube = _tube(group, curve, profile, radius)
    return group.finish(group.add("GeometryNodeSetMaterial", tube, Material=group.inputs["Material"]))


def cut_group() -> bpy.types.NodeTree:
    """Return what an object has within the `WINDOW`."""
    group = Group("Cut", **WINDOW)
    return group.finish(_within_picture(group, group.inputs["Geometry"])[0])


def marks_group() -> bpy.types.NodeTree:
    """Return a ball at each key from `Past` frames ago to `Ahead` frames from now; it swells while its key is reached.

    None outside of the `WINDOW`.
    """
    group = Group("Key marks", Past="Float", Ahead="Float", Radius="Float", Material="Material", **WINDOW)
    age, points = _within_window(group)
    points, thinned = _within_picture(group, points)
    near = group.math("SUBTRACT", 1.0, group.math("DIVIDE", group.math("ABSOLUTE", age), FLASH_FRAMES), clamp=True)
    radius = group.math("MULTIPLY", group.inputs["Radius"], group.math("MULTIPLY_ADD", near, 0.6, 1.0))
    radius = group.math("MULTIPLY", radius, thinned)
    ball = group.add("GeometryNodeMeshIcoSphere", 1.0, 2)
    ball = group.add("GeometryNodeSetShadeSmooth", ball)
    ball = group.add("GeometryNodeSetMaterial", ball, Material=group.inputs["Material"])
    return group.finish(group.add("GeometryNodeInstanceOnPoints", points, Instance=ball, Scale=radius))


def graph(name: str, frames: np.ndarray, heights: np.ndarray, width: float) -> bpy.types.Mesh:
    """Return the area below a curve, from the origin to the right, whose vertices know their frame.

    Parameters
    ----------
    name : str
    frames : array, shape (n,)
    heights : array, shape (n,)
        Not below zero.
    width : float
        From the first frame to the last.
    """
    count = len(frames)
    right = width * (frames - frames[0]) / max(float(np.ptp(frames)), 1e-9)
    points = np.zeros((2, count, 3))
    points[:, :, 0], points[1, :, 1] = right, heights
    steps = np.arange(count - 1)
    faces = np.stack((steps, steps + 1, steps + 1 + count, steps + count), axis=-1)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], faces.tolist())
    add_attribute(mesh, FRAME, np.tile(frames, 2).astype(np.float32))
    return mesh


def graph_group() -> bpy.types.NodeTree:
    """Return what a graph has up to now."""
    group = Group("Graph", Material="Material")
    future = group.math("GREATER_THAN", group.attribute(FRAME), group.math("ADD", group.frame(), 1e-3))
    kept = group.add("GeometryNodeDeleteGeometry", group.inputs["Geometry"], future, settings={"domain": "POINT"})
    return group.finish(group.add("GeometryNodeSetMaterial", kept, Material=group.inputs["Material"]))


def _within_picture(group: Group, points: Socket) -> tuple[Socket, Socket]:
    """Return the points within the window, and how much is left of what is drawn there: 1, and 0 at its edge."""
    itself = group.add("GeometryNodeSelfObject")
    world = node_of(group.add("GeometryNodeObjectInfo", itself)).outputs["Transform"]
    place = group.add("FunctionNodeTransformPoint", group.add("GeometryNodeInputPosition"), world)
    offset = group.vector("SUBTRACT", place, group.inputs["Middle"])
    shares = [
        group.math("ABSOLUTE", group.vector("DOT_PRODUCT", offset, group.inputs[side])) for side in ("Right", "Up")
    ]
    share = group.math("MAXIMUM", *shares)
    outside = group.math("GREATER_THAN", share, 1.0)
    kept = group.add("GeometryNodeDeleteGeometry", points, outside, settings={"domain": "POINT"})
    return kept, group.math("DIVIDE", group.math("SUBTRACT", 1.0, share), FADE_RATIO, clamp=True)


def _within_window(group: Group) -> tuple[Socket, Socket]:
    """Return how many frames ago each point was passed, and the points within the window."""
    age = group.math("SUBTRACT", group.frame(), group.attribute(FRAME))
    old = group.math("GREATER_THAN", age, group.inputs["Past"])
    # Frames are single precision: the point of this very frame stays.
    future = group.math("LESS_THAN", group.math("ADD", age, group.inputs["Ahead"]), -1e-3)
    outside = group.math("ADD", old, future)
    kept = group.add("GeometryNodeDeleteGeometry", group.inputs["Geometry"], outside, settings={"domain": "POINT"})
    return age, kept


def _tube(group: Group, curve: Socket, profile: Socket, radius: Socket) -> Socket:
    """Return a tube. Blender 5 takes the radius as an input of the tube, Blender 4.5 from the curve."""
    tube = group.add("GeometryNodeCurveToMesh", None, profile)
    inputs = node_of(tube).inputs
    if "Scale" in inputs:
        group.tree.links.new(radius, inputs["Scale"])
    else:
        curve = group.add("GeometryNodeSetCurveRadius", curve, None, radius)
    group.tree.links.new(curve, inputs["Curve"])
    return tube
