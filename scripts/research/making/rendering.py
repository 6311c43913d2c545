"""How the pictures of the extension's page are rendered: on the processor, the same pixels every time, and no more."""

from __future__ import annotations

import struct
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import ArrayLike

SIGNATURE = 8
"""The bytes that every PNG file begins with; chunks follow, each with its length, its kind and a checksum."""

NOTES = {b"tEXt", b"zTXt", b"iTXt", b"tIME", b"eXIf"}


def empty_scene() -> bpy.types.Scene:
    """Return the scene, with nothing in it."""
    bpy.data.batch_remove(list(bpy.data.objects))
    return bpy.context.scene


def add(name: str, data: bpy.types.ID | None, *materials: bpy.types.Material) -> bpy.types.Object:
    """Return a new object in the scene, of these materials."""
    for material in materials:
        data.materials.append(material)
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def tubes(name: str, paths: ArrayLike, radius: float, *, closed: bool = False) -> bpy.types.Curve:
    """Return a new curve along polylines (k, m, 3), as thick as twice the radius."""
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", radius
    for path in np.asarray(paths):
        spline = curve.splines.new("POLY")
        spline.points.add(len(path) - 1)
        spline.points.foreach_set("co", np.pad(path, ((0, 0), (0, 1)), constant_values=1.0).ravel())
        spline.use_cyclic_u = closed
    return curve


def look_from(place: tuple[float, float, float], turn: tuple[float, float, float], width: float) -> None:
    """Have a camera at a place, turned from looking down, that sees so much of the scene without perspective."""
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", width
    obj = bpy.context.scene.camera = add("Camera", camera)
    obj.location, obj.rotation_euler = place, turn


def render(
    path: Path, size: tuple[int, int], samples: int, *, transparent: bool = False, denoise: bool = False
) -> None:
    """Render the scene into a PNG file, without the date and the other notes that Blender leaves in one."""
    scene = bpy.context.scene
    settings, cycles, image = scene.render, scene.cycles, scene.render.image_settings
    settings.engine, settings.film_transparent, settings.filepath = "CYCLES", transparent, str(path)
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, 0
    cycles.use_denoising, cycles.max_bounces = denoise, 4
    scene.view_settings.view_transform = "Standard"
    settings.resolution_x, settings.resolution_y, settings.resolution_percentage = *size, 100
    image.file_format, image.color_mode, image.compression = "PNG", "RGBA" if transparent else "RGB", 100
    bpy.ops.render.render(write_still=True)
    path.write_bytes(without_notes(path.read_bytes()))


def without_notes(png: bytes) -> bytes:
    """Return a PNG file with what makes the picture, without dates, times and names."""
    kept, place = [png[:SIGNATURE]], SIGNATURE
    while place < len(png):
        length, kind = struct.unpack_from(">I4s", png, place)
        if kind not in NOTES:
            kept.append(png[place : place + length + 12])
        place += length + 12
    return b"".join(kept)
