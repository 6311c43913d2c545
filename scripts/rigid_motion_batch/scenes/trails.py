"""Trails, key marks and graphs: past and future motion, drawn around the current frame.

A trail is a tube along the path of one point of the object, a mark a small ball at a vertex, a graph an area that
grows from left to right. Each vertex has its moment as the attribute `frame`; the node groups keep vertices within a
window of frames around the current one, and for trails, within a window of the picture.
"""

from __future__ import annotations

import bpy
import numpy as np

from .nodes import Group, Socket, add_attribute, node_of

FRAME = "frame"
FLASH_FRAMES = 6.0
"""Frames that a mark takes to swell before its key, and to shrink after it."""


def polyline(name: str, frames: np.ndarray, points: np.ndarray, *, joined: bool = True) -> bpy.types.Mesh:
    """Return a mesh of vertices with their frames, joined into a line or separate.

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
"""The visible window of the picture, in the world: its centre, and the directions right and up, divided by its half
width and half height."""

FADE_RATIO = 0.15
"""The fraction of the window's half size, from its edge inwards, over which trails fade out."""


def trail_group() -> bpy.types.NodeTree:
    """Return a node group for a tube from `Past` frames ago to `Ahead` frames ahead, thinned by `Taper` at its old end.

    Nothing outside the `WINDOW`.
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
    """Return a node group that keeps the part of an object within the `WINDOW`."""
    group = Group("Cut", **WINDOW)
    return group.finish(_within_picture(group, group.inputs["Geometry"])[0])


def marks_group() -> bpy.types.NodeTree:
    """Return a node group for balls at keys from `Past` frames ago to `Ahead` frames ahead; balls swell at their keys.

    Nothing outside the `WINDOW`.
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
    """Return the area below a curve, from the origin to the right, with vertices that have their frames.

    Parameters
    ----------
    name : str
    frames : array, shape (n,)
    heights : array, shape (n,)
        Not negative.
    width : float
        The distance from the first frame to the last.
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
    """Return a node group that keeps a graph up to the current frame."""
    group = Group("Graph", Material="Material")
    future = group.math("GREATER_THAN", group.attribute(FRAME), group.math("ADD", group.frame(), 1e-3))
    kept = group.add("GeometryNodeDeleteGeometry", group.inputs["Geometry"], future, settings={"domain": "POINT"})
    return group.finish(group.add("GeometryNodeSetMaterial", kept, Material=group.inputs["Material"]))


def _within_picture(group: Group, points: Socket) -> tuple[Socket, Socket]:
    """Return the points within the `WINDOW`, and how much they are faded: 1 inside, falling to 0 at the edge."""
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
    """Return the age of each point in frames, and the points within the window of frames."""
    age = group.math("SUBTRACT", group.frame(), group.attribute(FRAME))
    old = group.math("GREATER_THAN", age, group.inputs["Past"])
    # Frames are single precision: keep the point of the current frame.
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
