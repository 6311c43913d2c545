"""A comparison as a GLB file for any viewer: the recording and every motion beside it, each in a lane of its own.

A lane is a node that stands still, and what moves is below it: an object, or the joints of a body with a box for each
bone. All is in metres and Blender's axes, below a node that turns these to those of glTF; seconds begin at the first
key. The motions are sampled, and then reduced by `rigid_motion.gltf`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigid_motion.gltf import Document, Options, reduced
from rigid_motion.gltf.accessors import GrowingView, in_one_buffer
from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import align_signs
from rigid_motion_batch.analysis.modes import label_of
from rigid_motion_batch.analysis.reconstructions import Reconstruction
from rigid_motion_batch.palette import DARK, colour_of, linear
from rigid_motion_batch.recordings.clips import Clip

from .data import Mesh, drill

TOLERANCE = 1e-4
"""Metres: no point of what moves is off by more."""

RATE = 60.0
"""Samples a second at least, for what a mode does between the samples of the recording."""

RECORDING = "Recording"

APART = 1.3
"""Between lanes, of what a lane takes."""

THICKNESS = 0.12
"""Of the box of a bone, of its length."""

UPRIGHT = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
"""The turn from Blender's axes to those of glTF, x, y, z, w."""

CUBE = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
TRIANGLES = np.array([corners for a, b, c, d in SIDES for corners in ((a, b, c), (a, c, d))])


@dataclass(frozen=True, eq=False)
class Lane:
    """A motion, in metres and Blender's axes."""

    name: str
    colour: str
    poses: Poses
    """Shape (joints, n), each in its parent's space; a rigid body is one joint."""


def comparison_glb(made: Reconstruction, groups: Iterable[tuple[str, ...]]) -> bytes:
    """Return what is in a GLB file of the recording and of these modes, those in one lane that are one motion.

    Raises
    ------
    GltfError
        Where it cannot be reduced.
    """
    times = _dense(made.times)
    clip = made.clip
    lanes = [Lane(RECORDING, DARK.ghost, _shown(clip, interpolate(clip.times, clip.poses, times, "lerp_slerp")))]
    for modes in groups:
        name = " = ".join(label_of(mode).partition(" (")[0] for mode in modes)
        lanes.append(Lane(name, colour_of(modes[0]), _shown(clip, made.filled_in(modes[0], times))))
    document = _document(clip, times - times[0], lanes)
    return reduced(document, Options(TOLERANCE)).document.files("comparison.glb")["comparison.glb"]


def _dense(times: np.ndarray) -> np.ndarray:
    """All of these times (n,), and so many between them that there are `RATE` a second."""
    parts = max(math.ceil(float(np.median(np.diff(times))) * RATE - 1e-6), 1)
    places = np.arange((len(times) - 1) * parts + 1) / parts
    return np.interp(places, np.arange(len(times)), times)


def _shown(clip: Clip, poses: Poses) -> Poses:
    poses = clip.in_blender(poses)
    return poses if clip.rest_body else poses[None]


def _document(clip: Clip, times: np.ndarray, lanes: list[Lane]) -> Document:
    """Return the lanes as they are sampled at times (n,), with a key for every sample."""
    names, parents, meshes = _body(clip, lanes[0].poses)
    writer = _Writer()
    surfaces = [writer.surface(mesh) for mesh in meshes]
    key_times = writer.numbers(times[:, None], bounds=True)
    step = APART * _width(lanes[0], parents, meshes)
    nodes, materials, made_meshes = writer.json["nodes"], writer.json["materials"], writer.json["meshes"]
    top: dict[str, Any] = {"name": clip.name, "rotation": UPRIGHT, "children": []}
    nodes.append(top)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for number, lane in enumerate(lanes):
        factor = [*linear(lane.colour), 1.0]
        surface = {"baseColorFactor": factor, "metallicFactor": 0.0, "roughnessFactor": 0.6}
        materials.append({"name": lane.name, "pbrMetallicRoughness": surface})
        root: dict[str, Any] = {"name": lane.name, "translation": [number * step, 0.0, 0.0], "children": []}
        top["children"].append(len(nodes))
        nodes.append(root)
        first = len(nodes)
        for joint, parent in enumerate(parents):
            (root if parent < 0 else nodes[first + parent]).setdefault("children", []).append(first + joint)
            primitive = {**surfaces[joint], "material": number}
            node = {"name": f"{lane.name}: {names[joint]}", "mesh": len(made_meshes)}
            made_meshes.append({"name": node["name"], "primitives": [primitive]})
            quaternions = align_signs(lane.poses.quaternions[joint])
            for path, values in (
                ("translation", lane.poses.positions[joint]),
                ("rotation", np.clip(quaternions[:, [1, 2, 3, 0]], -1.0, 1.0)),
            ):
                node[path] = values[0].tolist()
                if np.ptp(values, axis=0).any():
                    channels.append({"sampler": len(samplers), "target": {"node": first + joint, "path": path}})
                    samplers.append({"input": key_times, "output": writer.numbers(values)})
            nodes.append(node)
    return writer.document(clip.name, samplers, channels)


def _body(clip: Clip, poses: Poses) -> tuple[tuple[str, ...], np.ndarray, list[Mesh]]:
    """Return the names of what moves, their parents, and their looks in their own space: boxes to their children."""
    rest_body = clip.rest_body
    if rest_body is None:
        return (clip.body or clip.name,), np.array([-1]), [drill()]
    places = poses.positions[:, 0]
    lengths = np.linalg.norm(places[rest_body.parents >= 0], axis=1)
    least = 0.02 * max(float(lengths.max(initial=0.0)), 1e-3)
    ends = [places[rest_body.parents == joint] for joint in range(len(places))]
    return rest_body.joints, rest_body.parents, [_bones(of_joint, least) for of_joint in ends]


def _bones(ends: np.ndarray, least: float) -> Mesh:
    """Boxes from the origin to each of these ends (n, 3) that is so far away, or a cube of that size."""
    ends = ends[np.linalg.norm(ends, axis=1) > least]
    boxes = [_bone(end) for end in ends] or [Mesh(least * CUBE, TRIANGLES)]
    triangles = [box.triangles + number * len(CUBE) for number, box in enumerate(boxes)]
    return Mesh(np.concatenate([box.vertices for box in boxes]), np.concatenate(triangles))


def _bone(end: np.ndarray) -> Mesh:
    """Return a box from the origin to an end."""
    length = float(np.linalg.norm(end))
    along = end / length
    side = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    side /= np.linalg.norm(side)
    axes = np.array((side * THICKNESS, np.cross(along, side) * THICKNESS, along)) * length
    return Mesh((CUBE + np.array((0.0, 0.0, 0.5))) @ axes, TRIANGLES)


def _width(lane: Lane, parents: np.ndarray, meshes: list[Mesh]) -> float:
    """How far what moves in a lane reaches from side to side: the way of its roots, and what hangs on them."""
    roots = lane.poses.positions[parents < 0][..., 0]
    reach = sum(float(np.linalg.norm(lane.poses.positions[joint, 0])) for joint in np.flatnonzero(parents >= 0))
    reach = min(reach, 2.0) if len(parents) > 1 else 2.0 * meshes[0].size
    return float(np.ptp(roots)) + reach


class _Writer:
    """The JSON of a document, and the bytes of its one buffer."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "Rigid Motion"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [],
            "materials": [],
            "meshes": [],
        }
        self.keys = GrowingView(self.json)
        self.vertices = GrowingView(self.json, target=34962, byteStride=12)
        self.triangles = GrowingView(self.json, target=34963)

    def numbers(self, values: np.ndarray, *, bounds: bool = False) -> int:
        """Return the number of an accessor of keys (n, columns)."""
        return self.keys.add(values.astype("<f4"), bounds=bounds)

    def surface(self, mesh: Mesh) -> dict[str, Any]:
        """Add the triangles of a mesh, and return what a primitive says of them."""
        corners = mesh.corners()[:6].T
        places, order = np.unique(corners.astype(np.float32), axis=0, return_inverse=True)
        normals = places[:, 3:].astype(np.float64)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        attributes = {
            "POSITION": self.vertices.add(places[:, :3], bounds=True),
            "NORMAL": self.vertices.add(normals.astype("<f4")),
        }
        return {"attributes": attributes, "indices": self.triangles.add(order.reshape(-1, 1).astype("<u4"))}

    def document(self, name: str, samplers: list[Any], channels: list[Any]) -> Document:
        """All of it, with one animation."""
        animations = [{"name": name, "samplers": samplers, "channels": channels}] if channels else []
        json = self.json | ({"animations": animations} if animations else {})
        data = in_one_buffer((self.keys, self.vertices, self.triangles))
        return Document(json | {"buffers": [{"byteLength": len(data)}]}, (data,), ())
