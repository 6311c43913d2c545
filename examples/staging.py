"""Shared helpers for the scenes of the examples: a camera with captions, paths of points, first view, and saving.

Captions are parented to the camera, in units of the picture's width, so the .blend and the picture show the same.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from examples import figure
from examples.stills import render_still
from rigid_motion import animation
from rigid_motion_batch import palette
from rigid_motion_batch.scenes import captions
from rigid_motion_batch.scenes.film import save_blend
from rigid_motion_batch.scenes.materials import ink
from rigid_motion_batch.scenes.scene import make_lights, set_up_render
from rigid_motion_batch.scenes.settings import SceneSettings

RESOLUTION = 960, 540

VIEW = 13.0, (0.08, 0.0)
"""Zoom and offset of the camera view: the camera frame fills the viewport next to the sidebar."""

BLENDER, RIGID = "#C9CED6", "#38B6FF"
"""Colours of objects moved by Blender's own in-betweens, and by a mode of Rigid Motion."""

STEEL, WOOD, STONE, SKIN = "#DDE3EA", "#F0A04B", "#4A5462", "#93A0B3"


def parse(folder: Path, description: str, arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the options that every example has, and make the output folder."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--output", type=Path, default=folder, metavar="FOLDER", help="where to write (its own folder)")
    parser.add_argument("--picture", action="store_true", help="render the picture of the README anew, too")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    return options


def put(folder: Path, name: str, text: str) -> Path:
    """Write a text file below a folder, print its name, and return its path."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
    print(f"written: {name}")
    return path


def run(main: Callable[[], None]) -> None:
    """Run the main function of a script, then exit at once: Blender prints memory warnings at a normal exit."""
    main()
    sys.stdout.flush()
    os._exit(0)


def begin(frames: int, fps: int = 24) -> bpy.types.Scene:
    """Return an empty scene with this number of frames, after registering the extension's properties and handlers."""
    if not hasattr(bpy.types.Object, "rigid_motion"):
        animation.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_up_render(scene, SceneSettings(resolution=RESOLUTION, antialiasing="8", fps=fps), frames)
    scene.render.dither_intensity = 0.0  # The grain of dithering would be most of the file.
    make_lights(scene)
    return scene


def look(middle: Sequence[float], degrees: Sequence[float], width: float) -> bpy.types.Object:
    """Add an orthographic camera that looks at `middle` and shows `width` metres from left to right."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    turn = Euler([math.radians(angle) for angle in degrees]).to_matrix()
    camera.rotation_euler = turn.to_euler()
    camera.location = Vector(middle) + turn @ Vector((0.0, 0.0, 4.0 * width))
    data = camera.data
    data.type, data.sensor_fit, data.ortho_scale, data.clip_end = "ORTHO", "HORIZONTAL", width, 20.0 * width
    return camera


def write(camera: bpy.types.Object, text: str, x: float, y: float, size: float, colour: str) -> None:
    """Add a line of text that starts at (x, y), measured from the middle of the picture in widths of the picture."""
    width = camera.data.ortho_scale
    obj = captions.words("Caption", text, size * width, ink("Caption", colour))
    obj.parent, obj.location, obj.hide_select = camera, (x * width, y * width, -width), True
    bpy.context.scene.collection.objects.link(obj)


def path(name: str, points: np.ndarray, colour: str, radius: float) -> None:
    """Draw the path of a point, shape (n, 3), as a line."""
    figure.trail(name, ink(name, colour), points, radius).hide_select = True


def title(camera: bpy.types.Object, x: float, head: str, says: str, colour: str) -> None:
    """Write the heading of a lane, and a line of text below it."""
    write(camera, head, x, 0.232, 0.034, colour)
    write(camera, says, x, 0.2, 0.022, palette.DARK.faint)


def foot(camera: bpy.types.Object, text: str) -> None:
    """Write the explanation of the picture at its lower edge."""
    write(camera, text, -0.47, -0.262, 0.02, palette.DARK.faint)


def key(obj: bpy.types.Object | bpy.types.PoseBone, frame: float, matrix: Matrix) -> None:
    """Key the location and rotation of an object or bone from a basis matrix, with Blender's own easing."""
    obj.matrix_basis, obj.rotation_mode = matrix, "QUATERNION"
    for path in ("location", "rotation_quaternion"):
        obj.keyframe_insert(path, frame=frame)


def on_frames(frames: Iterable[float], measure: Callable[[], Sequence[float]]) -> np.ndarray:
    """Return the values of `measure` on each frame, shape (frames, n). The scene returns to its current frame."""
    scene = bpy.context.scene
    before, result = scene.frame_current, []
    for frame in frames:
        scene.frame_set(int(frame), subframe=float(frame) % 1.0)
        result.append(tuple(measure()))
    scene.frame_set(before)
    return np.array(result)


def all_frames() -> range:
    """Return all frames of the scene."""
    scene = bpy.context.scene
    return range(scene.frame_start, scene.frame_end + 1)


def evaluated(obj: bpy.types.Object) -> bpy.types.Object:
    """Return the evaluated object on the scene's current frame."""
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get())


def farthest(points: np.ndarray, place: np.ndarray) -> float:
    """Return the largest distance of points (n, 3) from a target place, shape (3,) or (n, 3)."""
    return float(np.linalg.norm(points - place, axis=-1).max())


def length(metres: float) -> str:
    """Return a length in cm or mm, as text for a caption."""
    return f"{100.0 * metres:.1f} cm" if metres >= 5e-4 else f"{1000.0 * metres:.1f} mm"


def finish(
    options: argparse.Namespace,
    name: str,
    active: bpy.types.Object,
    still: int,
    *,
    bone: str | None = None,
    dress: Callable[[], None] | None = None,
) -> None:
    """Save the scene in the state in which it opens, and render its picture if asked to.

    Parameters
    ----------
    options : argparse.Namespace
    name : str
        Name of the example.
    active : bpy.types.Object
        The selected object.
    still : int
        The frame of the picture.
    bone : str, optional
        The bone of a rig selected in Pose Mode.
    dress : callable, optional
        Called before rendering, to add objects for the picture alone.
    """
    scene = bpy.context.scene
    scene.frame_set(scene.frame_start)
    for obj in scene.objects:
        obj.select_set(obj == active)
        obj.hide_set(obj.type == "LIGHT")
    bpy.context.view_layer.objects.active = active
    if bone is not None:
        bpy.ops.object.mode_set(mode="POSE")
        active.data.bones.active = active.data.bones[bone]
    _open_in_camera_view()
    save_blend(options.output / f"{name}.blend")
    print(f"written: {name}.blend")
    if options.picture:
        if dress is not None:
            dress()
        scene.frame_set(still)
        render_still(scene, options.output / f"{name}.png")


def _open_in_camera_view() -> None:
    """Make every 3D viewport show the camera view in material colours, with the sidebar open."""
    for screen in bpy.data.screens:
        for space in (space for area in screen.areas for space in area.spaces if space.type == "VIEW_3D"):
            region = space.region_3d
            region.view_perspective, region.view_camera_zoom, region.view_camera_offset = "CAMERA", *VIEW
            shading = space.shading
            shading.type, shading.light = "SOLID", "STUDIO"
            shading.studio_light, shading.color_type = "paint.sl", "MATERIAL"
            shading.background_type = "WORLD"
            space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
            space.overlay.show_relationship_lines = space.overlay.show_cursor = False
            space.show_region_ui = True
