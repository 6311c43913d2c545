"""Pictures for print: a white sheet in Blender, as wide as a column, on which things stand and words are written.

A sheet is `WIDTH` pixels wide, 8.5 cm at 300 dots to the inch. Things stand in Blender's world, in metres, z up, and
are seen through parallel rays as on the stage of a comparison; words are placed in units of the sheet's height, 0 in
the middle, and sized in points.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from research.making.rendering import add, tubes
from rigid_motion.motion import Poses
from rigid_motion_batch.scenes import captions, layout
from rigid_motion_batch.scenes.materials import ink
from rigid_motion_batch.scenes.scene import make_camera, make_frame, make_lights, set_up_render
from rigid_motion_batch.scenes.settings import SceneSettings
from rigid_motion_batch.scenes.subject import tinted_slots

WIDTH, DOTS_PER_INCH = 1004, 300.0  # pixels
PAPER, INK, FAINT, RULE = "#FFFFFF", "#1B2026", "#58626E", "#C9CFD6"
MARGIN = 0.016  # in units of the sheet's width


class Sheet:
    """A scene of its own, in a file that is emptied for it.

    Parameters
    ----------
    height : int
        Pixels, even.
    metres : float
        What the height spans in the world.
    frames : int
        Of a film; a picture has one.
    """

    def __init__(self, height: int, metres: float, *, frames: int = 1) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.height, self.metres, self.aspect = height, metres, WIDTH / height
        self.left = -self.aspect * (0.5 - MARGIN)
        """Of the words, in units of the height."""
        self._frame = make_frame(metres)
        self.scene.collection.objects.link(self._frame)
        self._frame.location = layout.AWAY * 4.0 * metres
        make_camera(self.scene, metres, depth=2.0 * metres)
        self.scene.camera.data.clip_end = 20.0 * metres
        make_lights(self.scene)
        settings = SceneSettings(resolution=(WIDTH, height), antialiasing="16" if frames == 1 else "FXAA")
        set_up_render(self.scene, settings, frames, PAPER)
        self._inks: dict[str, bpy.types.Material] = {}

    def size(self, points: float) -> float:
        """Return points in units of the sheet's height."""
        return points * DOTS_PER_INCH / 72.0 / self.height

    def place(self, x: float, y: float) -> np.ndarray:
        """Return where in the world something is that is seen at a place of the sheet, shape (3,)."""
        return layout.unproject(np.array((x, y, 0.0)) * self.metres)

    def ink(self, colour: str) -> bpy.types.Material:
        """Return a flat colour, the same one each time."""
        if colour not in self._inks:
            self._inks[colour] = ink(f"Ink {colour}", colour)
        return self._inks[colour]

    def words(self, text: str, x: float, y: float, points: float = 7.0, colour: str = INK, align: str = "LEFT") -> None:
        """Write a line on the sheet, behind all that stands in the world."""
        self.put(captions.words(text[:40], text, self.size(points), self.ink(colour), align), x, y)

    def put(self, obj: bpy.types.Object, x: float, y: float, lift: int = 2) -> None:
        """Place something on the sheet."""
        captions.put(obj, self._frame, self.scene.collection, x, y, lift)

    def card(self, x: float, y: float, width: float, height: float, colour: str) -> None:
        """Draw a rectangle on the sheet, around its middle."""
        mesh = captions.card("Card", width, height, self.ink(colour), corner=0.0)
        self.put(bpy.data.objects.new("Card", mesh), x, y, lift=0)

    def key(self, entries: Sequence[tuple[str, str]], x: float, y: float, points: float = 7.0) -> None:
        """Write a legend in one line: patches of colour, each with its word."""
        size = self.size(points)
        for colour, text in entries:
            self.card(x + 0.5 * size, y + 0.33 * size, size, 0.7 * size, colour)
            self.words(text, x + 1.35 * size, y, points)
            x += (2.6 + captions.width_of(text)) * size

    def lines(self, name: str, paths: np.ndarray, radius: float, colour: str, *, closed: bool = False) -> None:
        """Draw tubes along polylines, shape (k, m, 3), of a radius in metres."""
        curve = tubes(name, paths, radius, closed=closed)
        curve.bevel_resolution = 2
        add(name, curve, self.ink(colour))

    def faces(self, name: str, polygons: np.ndarray, material: bpy.types.Material) -> None:
        """Draw flat polygons, shape (k, m, 3)."""
        mesh = bpy.data.meshes.new(name)
        corners = np.arange(polygons.shape[0] * polygons.shape[1]).reshape(polygons.shape[:2])
        mesh.from_pydata(polygons.reshape(-1, 3).tolist(), [], corners.tolist())
        add(name, mesh, material)

    def solid(
        self, name: str, mesh: bpy.types.Mesh, pose: Poses, material: bpy.types.Material, *, whole: bool
    ) -> bpy.types.Object:
        """Return an object at a pose, shape (); its tinted parts, or the whole of it, are of a material."""
        obj = add(name, mesh)
        obj.matrix_world = Matrix.LocRotScale(pose.positions.tolist(), Quaternion(pose.quaternions.tolist()), None)
        for slot in range(len(mesh.materials)) if whole else tinted_slots(mesh):
            obj.material_slots[slot].link = "OBJECT"
            obj.material_slots[slot].material = material
        return obj
