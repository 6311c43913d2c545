"""Meshes of figures: their skin if they have one, or else a solid for each bone.

A mesh shows the figure at rest, in the space of its armature; each vertex has the indices and weights of the bones
that carry it, and each face has the bone that determines its colour.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import bpy
import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.recordings.clips import Clip

from .armature import RestFigure, Rig
from .nodes import add_attribute

BONE = "bone"
"""The attribute of a face or point with the index of its bone."""

RADIUS_PER_LENGTH = 0.13
"""The radius of a solid, relative to its length."""

THICKNESS_RANGE = 0.008, 0.034
"""Minimum and maximum radius, relative to the figure's size."""

LINK_THICKNESS_RATIO = 0.5
"""The thickness of a link from a bone to a child that is not at its tail, relative to a solid."""

AT_END = 0.02
"""A bone leads to a child if its tail is at most this far from it, relative to the figure's size."""

STUB_LENGTH_RATIO = 0.04
"""The length of a solid at a joint without children, relative to the figure, if bones do not lead to children: their
tails were then made up by some program, and mean nothing."""

N_SIDES = 8
WAIST_RATIO = 0.22
"""Where a solid is thickest, as a fraction of its length."""


@dataclass(frozen=True, eq=False)
class Physique:
    """The surface of a figure at rest."""

    vertices: np.ndarray
    """Shape (v, 3), metres."""

    faces: list[tuple[int, ...]]
    carriers: np.ndarray
    """Shape (v, k): the bones that carry each vertex."""

    weights: np.ndarray
    """Shape (v, k)."""

    smooth: bool

    @property
    def foremost(self) -> np.ndarray:
        """The bone with the largest weight for each vertex, shape (v,)."""
        return np.take_along_axis(self.carriers, self.weights.argmax(axis=1)[:, None], axis=1)[:, 0]

    @property
    def bones(self) -> np.ndarray:
        """The bone of each face: its first vertex's."""
        return self.foremost[[face[0] for face in self.faces]]

    @property
    def outermost(self) -> np.ndarray:
        """The indices of each bone's outermost vertices along the axes, shape (k,)."""
        parts = (np.flatnonzero(self.foremost == bone) for bone in np.unique(self.foremost))
        ends = [own[edge(self.vertices[own], axis=0)] for own in parts for edge in (np.argmin, np.argmax)]
        return np.unique(np.concatenate(ends))

    @classmethod
    def of(cls, clip: Clip, rest: RestFigure) -> Physique:
        """Return the figure's skin, or solids if it has none."""
        skin = clip.whole_body.skin
        if skin is None:
            return cls._of_solids(rest)
        unturned = np.tile((1.0, 0.0, 0.0, 0.0), (len(skin.vertices), 1))
        vertices = clip.in_blender(Poses(skin.vertices, unturned)).positions - rest.origin
        faces = [*map(tuple, skin.triangles.tolist())]
        return cls(vertices, faces, skin.joints, skin.weights, smooth=True)

    @classmethod
    def _of_solids(cls, rest: RestFigure) -> Physique:
        size = body_size(rest)
        vertices: list[np.ndarray] = []
        faces: list[tuple[int, ...]] = []
        carriers: list[np.ndarray] = []
        for bone, head, tail, share in _parts(rest, size):
            corners, own = _solid(head, tail, share, size)
            faces += [tuple(len(vertices) * len(corners) + corner for corner in face) for face in own]
            vertices.append(corners)
            carriers.append(np.full(len(corners), bone))
        joints = np.concatenate(carriers)[:, None]
        return cls(np.concatenate(vertices), faces, joints, np.ones(joints.shape), smooth=False)


def _parts(rest: RestFigure, size: float) -> Iterator[tuple[int, np.ndarray, np.ndarray, float]]:
    """Yield the bone of each solid, its head and tail, and its relative thickness."""
    heads, tails, seen = rest.joints.positions, rest.tails, seen_bones(rest)
    children = {joint: np.flatnonzero(rest.parents == joint) for joint in seen}
    gaps = {joint: np.linalg.norm(heads[own] - tails[joint], axis=1) for joint, own in children.items() if len(own)}
    lead = not gaps or np.mean([gap.min() < AT_END * size for gap in gaps.values()]) > 0.5
    for joint in seen:
        own = children[joint]
        if not len(own):
            along = tails[joint] - heads[joint]
            length = float(np.linalg.norm(along))
            yield (
                joint,
                heads[joint],
                heads[joint] + along * min(1.0, 1.0 if lead else STUB_LENGTH_RATIO * size / length),
                1.0,
            )
            continue
        straight = lead and gaps[joint].min() < AT_END * size
        if lead and not straight:
            yield joint, heads[joint], tails[joint], 1.0
        for child in own.tolist():
            is_next = straight and child == own[gaps[joint].argmin()]
            alone = not lead and len(own) == 1
            if np.linalg.norm(heads[child] - heads[joint]) > 1e-3 * size:
                yield joint, heads[joint], heads[child], 1.0 if is_next or alone else LINK_THICKNESS_RATIO


def body_size(rest: RestFigure) -> float:
    """Return the largest extent of the joints of a figure at rest, without joints that only carry it.

    The tails of bones are used only for a single joint: importers often make them up.
    """
    seen = seen_bones(rest)
    heads = rest.joints.positions[seen]
    extent = float(np.ptp(heads, axis=0).max())
    return max(extent or float(np.ptp(np.concatenate((heads, rest.tails[seen])), axis=0).max()), 1e-6)


def seen_bones(rest: RestFigure) -> list[int]:
    """Return all bones except those that only carry: these may reach anywhere."""
    return np.flatnonzero(~rest.aside if not rest.aside.all() else rest.aside).tolist()


def _solid(head: np.ndarray, tail: np.ndarray, share: float, size: float) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Return corners and faces of a spindle from head to tail, thickest near its head."""
    along = tail - head
    length = float(np.linalg.norm(along))
    radius = share * float(np.clip(RADIUS_PER_LENGTH * length, THICKNESS_RANGE[0] * size, THICKNESS_RANGE[1] * size))
    along = along / max(length, 1e-9)
    side = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    side /= np.linalg.norm(side)
    other = np.cross(along, side)
    angles = 2.0 * np.pi * np.arange(N_SIDES) / N_SIDES
    ring = np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * other
    rings = ((0.0, 0.45), (WAIST_RATIO, 1.0), (1.0, 0.35))
    corners = np.concatenate([head + place * length * along + radius * width * ring for place, width in rings])
    steps = np.arange(N_SIDES)
    faces = [
        (first + step, first + (step + 1) % N_SIDES, first + N_SIDES + (step + 1) % N_SIDES, first + N_SIDES + step)
        for first in (0, N_SIDES)
        for step in steps.tolist()
    ]
    return corners, [*faces, tuple(steps[::-1].tolist()), tuple((2 * N_SIDES + steps).tolist())]


@dataclass(frozen=True, eq=False)
class CarriedMesh:
    """A mesh of the figure at rest, shared by objects that follow different rigs."""

    mesh: bpy.types.Mesh
    carriers: np.ndarray
    """Shape (v, k): the bones that carry each vertex."""

    weights: np.ndarray
    """Shape (v, k)."""

    @classmethod
    def rest_body(cls, name: str, physique: Physique) -> CarriedMesh:
        """Return the mesh of a physique. Its faces have the attribute `BONE`."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(physique.vertices.tolist(), [], physique.faces)
        add_attribute(mesh, BONE, physique.bones.astype(np.int32), "FACE")
        mesh.polygons.foreach_set("use_smooth", np.full(len(mesh.polygons), physique.smooth))
        mesh.update()
        return cls(mesh, physique.carriers, physique.weights)

    @classmethod
    def joints(cls, name: str, rest: RestFigure) -> CarriedMesh:
        """Return a mesh with a vertex at each joint. The vertices have the attribute `BONE`."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(rest.joints.positions.tolist(), [], [])
        numbers = np.arange(len(rest.parents))[:, None]
        add_attribute(mesh, BONE, numbers[:, 0].astype(np.int32))
        return cls(mesh, numbers, np.ones(numbers.shape))

    def hang_on(self, rig: Rig, obj: bpy.types.Object) -> None:
        """Make an object with this mesh follow a rig."""
        if not obj.vertex_groups:  # They belong to the mesh: the first object adds them for all.
            vertices = np.arange(len(self.carriers))
            for bone, name in enumerate(rig.bones):
                group = obj.vertex_groups.new(name=name)
                for column, shares in zip(self.carriers.T, self.weights.T, strict=True):
                    own = (column == bone) & (shares > 0.0)
                    for share in np.unique(shares[own]).tolist():
                        group.add(vertices[own & (shares == share)].tolist(), share, "ADD")
        cast(bpy.types.ArmatureModifier, obj.modifiers.new("Armature", "ARMATURE")).object = rig.obj
