"""Make the films of docs/modes.md: each mode with the same keys, with Blender's own in-betweens in grey.

python docs/make_mode_loops.py [MODE ...]

A hammer swings about the end of its handle, flies off while growing, and returns to its start, so the film can loop.
This writes MODE.mp4, and MODE.png in the middle of the swing, to docs/modes/.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Quaternion, Vector

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from examples import figure
from examples.stills import render_still
from rigid_motion import animation
from rigid_motion.animation.evaluation.differences import in_betweens
from rigid_motion.animation.queries.keyed import source_of
from rigid_motion.motion import MODES, Poses, interpolate
from rigid_motion.motion.quaternions import align_signs, rotate
from rigid_motion_batch import palette
from rigid_motion_batch.scenes import captions
from rigid_motion_batch.scenes.film import render_film
from rigid_motion_batch.scenes.materials import ink, surface
from rigid_motion_batch.scenes.scene import make_lights, set_up_render
from rigid_motion_batch.scenes.settings import SceneSettings
from tests.world_poses import read_poses

SETTINGS = SceneSettings(resolution=(960, 540), antialiasing="5", fps=24)
THEME = palette.DARK

HANDLE = Vector((0.0, 0.0, -0.8))
"""The end of the handle in the hammer's own space, whose origin is in the head."""

KEYS = (
    # frame, end of the handle (x, z), clockwise degrees, size
    (1, (-0.95, -0.42), -75.0, 1.0),
    (25, (-0.95, -0.42), 65.0, 1.0),
    (49, (1.05, 0.30), 190.0, 1.45),
    (73, (-0.95, -0.42), 285.0, 1.0),
)
"""The last key repeats the first pose; the film ends one frame before it."""

FRAMES = np.arange(KEYS[0][0], KEYS[-1][0])

STILL = 14
"""The frame of the picture: there, the mode and Blender are far apart."""

WIDTH = 5.4
"""Width of the picture, in metres."""

MIDDLE = (-0.1, 0.0, -0.3)

LINE = 0.014
"""Radius of the line along the head's path, in metres; the line of the handle's end is half as thick."""


IN_FRONT = Vector((0.0, -1.0, 0.0))
"""Offset to a place in front of the hammers, as the camera sees them."""


def main(modes: Iterable[str]) -> None:
    """Render the films and pictures of these modes."""
    animation.register()
    for mode in modes:
        scene = build(mode)
        picture = DOCS / "modes" / mode
        render_film(scene, picture.with_suffix(".mp4"))
        scene.frame_set(STILL)
        render_still(scene, picture.with_suffix(".png"))
        print(picture.with_suffix(".mp4"), flush=True)


def build(mode: str) -> bpy.types.Scene:
    """Return the scene of a mode: a hammer moved by the mode, a hammer moved by Blender, and the paths of both."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_up_render(scene, SETTINGS, len(FRAMES), THEME.background)
    video = scene.render.ffmpeg
    video.constant_rate_factor, video.ffmpeg_preset, video.gopsize = "MEDIUM", "BEST", len(FRAMES)
    scene.render.dither_intensity = 0.0  # The grain of dithering would be most of the file.
    make_lights(scene)
    make_camera(scene)
    native = hammer("Blender", surface("Blender", THEME.faint, alpha=0.5))
    key(native)
    shown = read_poses(native, FRAMES)
    native.delta_location.y = 0.6  # Behind the other hammer; its path is behind both.
    moved = hammer(MODES[mode].label, surface(mode, palette.colour_of(mode)))
    poses = by_mode(native, mode)
    animation.bake_poses(moved, FRAMES.astype(float), poses)
    draw_ways(shown, ink("Blender's way", THEME.faint), behind=1.2)
    draw_ways(poses, ink("Way", palette.colour_of(mode)), behind=1.1)
    for (_, (x, z), _, _), head in zip(KEYS[:-1], key_poses().positions, strict=False):
        for place in ((x, 0.0, z), head):
            dot = figure.ball("Key", ink("Key", THEME.ink), 0.034)
            dot.location = Vector(place) + IN_FRONT
    caption(scene.camera, MODES[mode].label, palette.colour_of(mode))
    return scene


def make_camera(scene: bpy.types.Scene) -> None:
    """Add an orthographic camera, perpendicular to the plane of the motion."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.rotation_euler.x = math.pi / 2.0
    camera.location = Vector(MIDDLE) - Vector((0.0, 10.0, 0.0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", WIDTH


def hammer(name: str, material: bpy.types.Material) -> bpy.types.Object:
    """Add a hammer with its origin in the head."""
    parts = (
        ((0.0, 0.0, -0.4), (0.09, 0.09, 0.86)),
        ((0.02, 0.0, 0.04), (0.46, 0.2, 0.2)),
        ((-0.24, 0.0, 0.04), (0.1,) * 3),
    )
    tool = figure.boxes(name, material, *parts)
    tool.rotation_mode = "QUATERNION"
    return tool


def key_poses() -> Poses:
    """Return the hammer's poses on `KEYS`."""
    turns = [Quaternion((0.0, 1.0, 0.0), math.radians(angle)) for _, _, angle, _ in KEYS]
    heads = [
        Vector((x, 0.0, z)) - size * (turn @ HANDLE) for (_, (x, z), _, size), turn in zip(KEYS, turns, strict=True)
    ]
    return Poses(np.array(heads), align_signs(np.array(turns)), np.array([size for *_, size in KEYS]))


def key(obj: bpy.types.Object) -> None:
    """Give an object the keys, with Blender's own easing."""
    poses, frames = key_poses(), np.array([float(frame) for frame, *_ in KEYS])
    scales = np.repeat(poses.scales[:, None], 3, axis=1)
    channels = ("location", poses.positions), ("rotation_quaternion", poses.quaternions), ("scale", scales)
    for channel, values in channels:
        animation.write_channel(obj, channel, frames, values, interpolation="BEZIER")


def by_mode(keyed: bpy.types.Object, mode: str) -> Poses:
    """Return the poses of a mode on all frames, with the easing of an object's keys.

    Blender does not offer the modes for streams, so all modes are evaluated in the same way: the progress in a segment
    is the fraction of the straight line that the mode Straight has covered.
    """
    keys = key_poses()
    straight = in_betweens(source_of(keyed), FRAMES, "lerp_slerp").desired.positions
    key_frames = np.array([frame for frame, *_ in KEYS])
    segment = np.searchsorted(key_frames, FRAMES, side="right") - 1
    way = np.diff(keys.positions, axis=0)[segment]
    gone = straight - keys.positions[segment]
    progress = np.sum(gone * way, axis=1) / np.sum(way * way, axis=1)
    times = key_frames[segment] + progress * np.diff(key_frames)[segment]
    return interpolate(key_frames, keys, times, mode)


def draw_ways(poses: Poses, material: bpy.types.Material, behind: float) -> None:
    """Draw the closed paths of the head and of the end of the handle, behind the hammers."""
    sizes = 1.0 if poses.scales is None else poses.scales[:, None]
    for point, thickness in ((Vector(), LINE), (HANDLE, LINE / 2.0)):
        way = poses.positions * (1.0, 0.0, 1.0) + sizes * rotate(poses.quaternions, np.array(point))
        line = figure.trail("Way", material, [*way, way[0]], thickness)
        line.location.y = behind


def caption(camera: bpy.types.Object, title: str, colour: str) -> None:
    """Name both hammers in the upper corners, in their colours."""
    top = 0.5 * WIDTH * SETTINGS.resolution[1] / SETTINGS.resolution[0]
    for text, material, x, align in (
        (title, ink("Title", colour), -0.47, "LEFT"),
        ("Blender", ink("Faint", THEME.faint), 0.47, "RIGHT"),
    ):
        words = captions.words(text, text, 0.05 * WIDTH, material, align)
        words.parent, words.location = camera, (x * WIDTH, top - 0.065 * WIDTH, -2.0)
        bpy.context.scene.collection.objects.link(words)


if __name__ == "__main__":
    main(sys.argv[1:] or [mode for mode in MODES if not MODES[mode].is_reference])
