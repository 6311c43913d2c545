"""Make the models of assets/models.blend: a table of parts for each model, all lofted through rings.

Millimetres. Axes as in `motions`: a tool points along +y, z is up, the origin is in the middle of the grip. Parts may
intersect; each is a closed surface. The drill is an orthopaedic surgeon's; its bit lies in the plane x = 0. The hand
controller is for the right hand: thumb pad on the left of its face, buttons on the right.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bmesh
import bpy
import numpy as np
from numpy.typing import ArrayLike

from rigid_motion_batch.scenes.materials import surface

from .motions import BIT_TIP_M

X_AXIS, Y_AXIS, Z_AXIS = np.eye(3)

MATERIALS = {"Mode": ("#CED4DA", 0.0, 0.32), "Metal": ("#CBCED2", 0.7, 0.30), "Rubber": ("#35373C", 0.0, 0.60)}
"""Colour, metallic, roughness."""

Place = tuple[ArrayLike, np.ndarray, np.ndarray]
"""The start, the direction of the axis, and the up direction."""


@dataclass(frozen=True, eq=False)
class Part:
    """A closed surface through rings (k, m, 3), in one of `MATERIALS`; an endless one ends in its first ring."""

    material: str
    rings: np.ndarray
    endless: bool

    def faces(self) -> list[list[int]]:
        """Return quads between the rings, and a face at each end, as point indices."""
        index = np.arange(self.rings.size // 3).reshape(self.rings.shape[:2])
        corners = (index, np.roll(index, -1, 1), np.roll(index, -1, (0, 1)), np.roll(index, -1, 0))
        quads = np.stack(corners, axis=-1).reshape(-1, 4).tolist()
        return quads if self.endless else [*quads[: -index.shape[1]], index[0].tolist(), index[-1].tolist()]


def loft(
    material: str,
    place: Place,
    rows: ArrayLike,
    *,
    exponent: float = 2.0,
    points: int = 24,
    count: int = 0,
    twist: float = 0.0,
    endless: bool = False,
) -> Part:
    """Return a part through superellipses along an axis.

    Parameters
    ----------
    rows : array-like, shape (k, 2), (k, 3) or (k, 4)
        For each ring its position along the axis, half its width, half its height (its width by default), and the
        height of its centre.
    exponent : float
        2 is an ellipse, more is squarer.
    count : int
        The number of rings, on smooth curves through the rows; 0 uses the rows as rings.
    twist : float
        Rotation of rings in radians, per millimetre along the axis.
    """
    (centre, axis, up), rows = place, np.asarray(rows, dtype=np.float64)
    if count:
        slopes, places = np.gradient(rows, axis=0), np.linspace(0.0, len(rows) - 1.0, count)
        i = np.minimum(places.astype(int), len(rows) - 2)
        u = (places - i)[:, None]
        begins = (1.0 - u) ** 2 * ((1.0 + 2.0 * u) * rows[i] + u * slopes[i])
        rows = begins + u**2 * ((3.0 - 2.0 * u) * rows[i + 1] - (1.0 - u) * slopes[i + 1])
    along, width, height = (rows[:, min(column, rows.shape[1] - 1), None] for column in range(3))
    rise = rows[:, 3:] if rows.shape[1] > 3 else 0.0
    angles = 2.0 * np.pi * (np.arange(points) + 0.5) / points
    c, s = np.cos(angles), np.sin(angles)
    stretch = (np.abs(c) ** exponent + np.abs(s) ** exponent) ** (-1.0 / exponent)
    turned = (width * c + 1j * height * s) * stretch * np.exp(1j * twist * along)
    seen = np.stack(np.broadcast_arrays(turned.real, turned.imag + rise, along), axis=-1)
    return Part(material, centre + seen @ (np.cross(axis, up), up, axis), endless)


def box(material: str, place: Place, half: tuple[float, float, float], edge: float) -> Part:
    """Return a box centred on its place; `half` is half its width, height and length; both ends have cut edges."""
    width, height, length = half
    ends = ((-length, edge), (edge - length, 0.0), (length - edge, 0.0), (length, edge))
    return loft(material, place, [(d, width - inset, height - inset) for d, inset in ends], exponent=6.0, points=32)


def pad(rows: ArrayLike, side: float, depth: float) -> np.ndarray:
    """Return the rows of a pad that stands out a little on the upper (1) or lower side (-1); depth is a fraction."""
    along, width, height, rise = np.transpose(rows)
    return np.stack((along, 0.94 * width, depth * height, rise + side * (1.06 - depth) * height), axis=1)


# -- the drill ---------------------------------------------------------------------------------------------------------

BORE_MM = (0.0, 0.0, 1e3 * BIT_TIP_M[2])
ON_AXIS, ASLANT_AXES = (BORE_MM, Y_AXIS, Z_AXIS), (BORE_MM, Y_AXIS, np.array((0.64, 0.0, 0.768)))

BARREL_MM = ((-38, 20.6, 21.6), (-10, 22, 23.2), (12, 21.6, 22.8), (32, 19.6, 20.6), (60, 15.6, 15.6))
BACK_MM = ((-54, 12, 13), (-51, 17, 18), (-46, 20, 21), (-40, 20.6, 21.6))
COLLAR_MM = ((57, 15.4), (62.4, 15.4), (63.4, 14.4), (63.4, 12.6), (65.4, 12.6), (65.4, 14.6), (70.4, 14.6), (70.4, 10))
SLEEVE_MM = ((71.4, 13), (72.6, 14.4), (87.4, 14.4), (88.6, 13))
NOSE_MM = ((88, 12.6), (90.5, 12.6), (91.5, 11.8), (102.5, 7.2), (109.5, 4.2))
FLUTES_MM = (
    (100, 2.8, 2.8),
    (115, 2.8, 2.8),
    *((y, 2.8, 1.5) for y in np.linspace(117, 158, 16)),
    (1e3 * BIT_TIP_M[1], 0.1, 0.1),
)
GRIP_MM = ((52, 16, 27, 4), (30, 14.4, 19.6, 5), (14, 15, 19.4, 2.8), (-4, 15.6, 19.8, -1), (-40, 14.4, 19, -8))
DIAL_MM = ((-2, 11), (2.2, 11), (2.2, 8.8), (1.2, 8.4), (3.8, 7.8), (4.6, 7))
HOSE_MM = ((-30, 1.8, 1.8, 24.1), (14, 1.8, 1.8, 25.4), (58, 1.8, 1.8, 21.3), (80, 1.8, 1.8, 20.2), (115, 1.8, 1.8, 7))


def drill() -> list[Part]:
    """Return the parts of the drill."""

    def at(x: float, y: float, z: float, axis: np.ndarray = Z_AXIS, up: np.ndarray = Y_AXIS) -> Place:
        return np.array((x, y, z)), axis, up

    grip, height = [*GRIP_MM, (-53, 16.5, 22, -8.4)], BORE_MM[2]
    return [
        loft("Mode", ON_AXIS, BARREL_MM, exponent=2.5, points=28, count=12),
        loft("Metal", ON_AXIS, ((-41, 18.6, 19.6), (-36, 18.6, 19.6)), exponent=2.7),
        loft("Rubber", ON_AXIS, BACK_MM, exponent=2.7, count=8),
        box("Rubber", at(0, -8, height + 19), (9, 24, 5.6), 1.2),
        loft("Metal", ON_AXIS, COLLAR_MM),
        loft("Metal", ON_AXIS, SLEEVE_MM, points=12),
        loft("Metal", ON_AXIS, NOSE_MM),
        loft("Metal", ON_AXIS, FLUTES_MM, points=10, twist=-0.26),
        loft("Mode", at(0, 0, 0), grip, exponent=2.35, points=28, count=18),
        loft("Rubber", at(0, 0, 0), pad(grip[1:], -1, 0.6), exponent=2.35, count=14),
        loft("Rubber", at(0, 0, 0), pad(grip[2:], 1, 0.4), exponent=2.35, count=14),
        box("Metal", at(0, 22, 31), (6.6, 11, 8.5), 1.6),
        box("Rubber", at(0, 19, 14), (5.8, 9, 6), 1.6),
        box("Mode", at(0, 0, -55), (20, 35, 5.5), 3),
        box("Metal", at(0, 0, -61.5), (18.4, 33.4, 2.5), 0.4),
        box("Rubber", at(0, 0, -72), (20, 35, 9.5), 4),
        box("Metal", at(0, 35, -70, Y_AXIS, Z_AXIS), (8, 3.6, 1.8), 0.8),
        loft("Metal", at(-20.5, 2, height, -X_AXIS, Z_AXIS), DIAL_MM),
        box("Rubber", at(-25.1, 2, height, X_AXIS, Z_AXIS), (6.2, 1.6, 1.2), 0.4),
        box("Rubber", at(-20.6, -24, height, X_AXIS, Z_AXIS), (7, 3.4, 1.6), 0.4),
        *(box("Rubber", at(20.8, -18, height + rise, X_AXIS, Z_AXIS), (12, 1.5, 1.4), 0.4) for rise in (-8, -2, 4)),
        loft("Metal", ASLANT_AXES, HOSE_MM, points=8, count=15),
    ]


# -- the controller ----------------------------------------------------------------------------------------------------

HANDLE_MM = ((0.0, 40.0, 6.5), np.array((0.0, -0.919, -0.394)), np.array((0.0, -0.394, 0.919)))
HEAD_MM = (np.array((0.0, 40.0, 18.0)), np.array((0.0, -0.17, 0.985)), np.array((0.0, 0.985, 0.17)))
PULL_MM = ((0.0, 38.0, 8.0), np.array((0.0, 0.593, -0.805)), np.array((0.0, 0.805, 0.593)))
RING_MM = (np.array((3.0, 44.0, 23.0)), np.array((0.0, 0.37, 0.929)), np.array((0.0, 0.929, -0.37)))

SHAFT_MM = ((0, 20, 7, 0), (27, 15.6, 12.4, 5), (42, 14.8, 14.6, 7.8), (59, 14.8, 15.2, 9), (92, 13.2, 13.2, 10.3))
CAP_MM = ((88, 14.2, 14.2, 10.3), (97, 13.2, 13.2, 10.3), (101, 8, 8, 10.3))
BODY_MM = ((-17, 21, 22), (-15, 24, 25), (-13, 25, 26), (-4, 25, 26), (-2, 24, 25), (0, 21, 22))
TRIGGER_MM = ((0, 10, 9, 0), (12.4, 9.6, 7.6, 3.3), (21.5, 9, 5.4, 2.2), (28.6, 8.4, 4, 0), (35.4, 6.8, 2, 0))
RIM_MM = ((-1, 13), (1.4, 13), (2, 12.4), (2, 11.2), (0.9, 10.8))
THUMB_MM = ((-1, 10.6), (1.9, 10.6), (2.5, 9.8), (1.7, 4), (1.6, 0.6))
BUTTON_MM = ((-1, 4.2), (1.9, 4.2), (2.5, 3.4))
NECK_MM = ((12, 15, 6, -6), (26, 14, 5, -3.5), (40, 17, 5, -0.5))


def controller() -> list[Part]:
    """Return the parts of the hand controller."""
    (middle, axis, ahead), around = RING_MM, np.radians(np.arange(0, 360, 30))
    band = np.stack((7.2 * np.sin(around), 42 + 2.6 * np.cos(around)), axis=1)

    def on_face(x: float, forward: float) -> Place:
        return HEAD_MM[0] + x * X_AXIS + forward * HEAD_MM[2], *HEAD_MM[1:]

    def light(angle: float) -> Part:
        out = np.cos(angle) * X_AXIS + np.sin(angle) * ahead
        return loft("Metal", (middle + 44.4 * out, out, axis), ((-1, 1.6), (0.5, 1.6), (0.8, 1.2)), points=8)

    return [
        loft("Mode", HANDLE_MM, SHAFT_MM, exponent=2.3, points=28, count=17),
        loft("Rubber", HANDLE_MM, CAP_MM, exponent=2.3, points=28, count=7),
        loft("Rubber", HANDLE_MM, pad(SHAFT_MM[1:], -1, 0.6), exponent=2.3, count=12),
        box("Metal", ((-14.6, 3.1, -3.9), X_AXIS, HANDLE_MM[1]), (5, 11, 2.4), 1),
        loft("Mode", HEAD_MM, BODY_MM, exponent=2.2, points=28),
        loft("Rubber", HEAD_MM, ((-1, 20.6, 21.6), (0.6, 20.6, 21.6)), exponent=2.2, points=28),
        loft("Metal", on_face(-6.5, 2.0), RIM_MM),
        loft("Rubber", on_face(-6.5, 2.0), THUMB_MM),
        loft("Metal", on_face(13.0, 7.5), BUTTON_MM, points=14),
        loft("Metal", on_face(14.0, -5.0), BUTTON_MM, points=14),
        loft("Metal", on_face(5.5, -16.0), ((-1, 2.4), (1.4, 2.4), (1.8, 1.8)), points=10),
        loft("Rubber", PULL_MM, TRIGGER_MM, exponent=3.0, count=11),
        loft("Mode", RING_MM, band, points=48, endless=True),
        loft("Mode", (middle, ahead, axis), NECK_MM, exponent=4.0),
        *map(light, np.radians(np.arange(-48, 229, 23))),
    ]


MODELS = {"Drill": drill, "Controller": controller}


# -- in Blender --------------------------------------------------------------------------------------------------------


def build_material(name: str) -> bpy.types.Material:
    """Return a new material of `MATERIALS` that looks the same in Workbench (viewport), EEVEE and Cycles (nodes)."""
    colour, metallic, roughness = MATERIALS[name]
    material = surface(name, colour, roughness=roughness)
    shader = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    material.metallic = shader.inputs["Metallic"].default_value = metallic
    return material


def build_mesh(name: str, parts: list[Part], materials: dict[str, bpy.types.Material]) -> bpy.types.Mesh:
    """Return a new mesh of all parts, in metres, smooth except at creases, with outward faces."""
    mesh, used = bpy.data.meshes.new(name), list(dict.fromkeys(part.material for part in parts))
    vertices, faces, numbers = [], [], []
    for part in parts:
        quads = part.faces()
        faces += [[len(vertices) + corner for corner in face] for face in quads]
        numbers += [used.index(part.material)] * len(quads)
        vertices += (1e-3 * part.rings).reshape(-1, 3).tolist()
    mesh.from_pydata(vertices, [], faces)
    for material in used:
        mesh.materials.append(materials[material])
    mesh.polygons.foreach_set("material_index", numbers)
    outward = bmesh.new()
    outward.from_mesh(mesh)
    bmesh.ops.recalc_face_normals(outward, faces=outward.faces)
    outward.to_mesh(mesh)
    outward.free()
    mesh.shade_smooth()
    mesh.set_sharp_from_angle(angle=np.radians(38.0))
    return mesh


def build_models() -> list[bpy.types.Object]:
    """Return new objects of all models at the origin, not in any scene."""
    materials = {name: build_material(name) for name in MATERIALS}
    return [bpy.data.objects.new(name, build_mesh(name, model(), materials)) for name, model in MODELS.items()]


def write_models(path: Path) -> None:
    """Write a .blend file with a scene for each model, without changing the open file.

    The scenes are written as a library, so the file contains neither a window layout nor its own path.
    """
    models = build_models()
    scenes = [bpy.data.scenes.new(model.name) for model in models]
    for scene, model in zip(scenes, models, strict=True):
        scene.collection.objects.link(model)
    try:
        bpy.data.libraries.write(str(path), set(scenes), compress=True)
    finally:
        meshes = {model.data for model in models}
        materials = {material for mesh in meshes for material in mesh.materials}
        bpy.data.batch_remove([*scenes, *models, *meshes, *materials])
