"""Make the film of two dancers: one with a key on every frame, one with only the key poses left by reducing keys.

python docs/make_dancer_film.py

prints the number of keys before and after, and writes dancer.png and dancer.mp4 next to this file. With --still it
writes only the picture.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Vector

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from examples import figure
from examples.dancer import dance
from examples.stills import render_still
from rigid_motion import animation
from rigid_motion.animation import write_channel
from rigid_motion_batch import palette
from rigid_motion_batch.scenes import captions
from rigid_motion_batch.scenes.film import render_film
from rigid_motion_batch.scenes.materials import ink, surface
from rigid_motion_batch.scenes.scene import make_lights, set_up_render
from rigid_motion_batch.scenes.settings import SceneSettings

SETTINGS = SceneSettings(resolution=(960, 540), antialiasing="5", fps=dance.FPS)

MODE = "motor_spline"
TOLERANCE, RADIUS = 0.01, 0.03

SKIN, FLOOR = "#93A0B3", "#4A5462"
RECORDED, REDUCED = "#C9CED6", palette.MODE_COLOURS[MODE]
FLASH = "#D9FF9E"

GLOW, AFTERGLOW = 3, 14
"""How long the dancer lights up at a key pose, and how long the pose stays visible, in frames."""

WIDTH = 2.5
"""Width of a lane, in metres."""

MIDDLE, CAMERA = (0.03, 0.0, 0.79), (80.0, 0.0, 0.0)
"""The point that the camera looks at, in the space of a rig, and the camera's rotation in degrees."""

STILL = 98
"""The frame of the picture."""

LEFT, RIGHT, TITLE, STRIP, SAYS = -0.45, 0.45, 0.15, 0.104, 0.03
"""Positions of captions in a lane, in lane widths: x from its middle (the first two), y from its bottom."""


def main() -> None:
    """Render the picture and the film."""
    animation.register()
    scene = build()
    scene.frame_set(STILL)
    image, kind = scene.render.image_settings, scene.render.image_settings.file_format
    render_still(scene, DOCS / "dancer.png")
    if "--still" not in sys.argv:
        if hasattr(image, "media_type"):  # Blender 5 needs the kind of output first.
            image.media_type = "VIDEO"
        image.file_format = kind
        render_film(scene, DOCS / "dancer.mp4")


def build() -> bpy.types.Scene:
    """Return the scene with both dancers side by side."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_up_render(scene, SETTINGS, len(dance.FRAMES))
    video = scene.render.ffmpeg
    video.constant_rate_factor, video.ffmpeg_preset, video.gopsize = "MEDIUM", "BEST", 5 * SETTINGS.fps
    make_lights(scene)
    scene.render.dither_intensity = 0.0  # The grain of dithering would be most of the file.
    camera = _camera(scene)

    recorded, reduced = dance.dancer(), dance.dancer()
    bones = list(reduced.pose.bones)
    animation.reduce_keys_of(bones, MODE, TOLERANCE, RADIUS, shared=True)
    done = animation.reduction_of(bones)
    poses = key_frames(reduced)
    off = math.ceil(1e4 * done.largest_error) / 10.0
    print(
        f"{len(dance.FRAMES)} poses of {done.before} keys, {len(poses)} of {done.after}, off by {off:.1f} mm",
        flush=True,
    )

    skin, lit = surface("Recorded skin", SKIN), surface("Reduced skin", SKIN)
    _flash(lit, SKIN, FLASH, poses)
    bodies = []
    for rig, material, side in ((recorded, skin, -0.5), (reduced, lit, 0.5)):
        rig.hide_render = True
        rig.location.x = side * WIDTH
        bodies.append(figure.clothe(rig, material))
        floor = captions.card("Floor", 2.36, 2.6, surface("Floor", FLOOR), 1.1)
        floor = bpy.data.objects.new("Floor", floor)
        floor.location = (side * WIDTH + MIDDLE[0], 0.55, -0.006)
        scene.collection.objects.link(floor)
    for frame in poses:
        _ghost(scene, bodies[1], int(frame))

    _captions(camera, -0.5, "Recorded", RECORDED, dance.FRAMES, f"{done.before} keys: every bone on every frame")
    says = f"{done.after} keys, no joint off by more than {off:.1f} mm"
    _captions(camera, 0.5, "Key poses", REDUCED, poses, says)
    return scene


def key_frames(rig: bpy.types.Object) -> np.ndarray:
    """Return the frames on which any bone of a dancer has keys, shape (k,)."""
    moved = rig.animation_data
    curves = moved.action.layers[0].strips[0].channelbag(moved.action_slot).fcurves
    return np.unique([key.co.x for curve in curves for key in curve.keyframe_points])


def _camera(scene: bpy.types.Scene) -> bpy.types.Object:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    turn = Euler([math.radians(angle) for angle in CAMERA]).to_matrix()
    camera.rotation_euler = turn.to_euler()
    camera.location = Vector(MIDDLE) + turn @ Vector((0.0, 0.0, 8.0))
    camera.data.type, camera.data.ortho_scale, camera.data.clip_end = "ORTHO", 2.0 * WIDTH, 40.0
    camera.data.sensor_fit = "HORIZONTAL"
    return camera


def _flash(material: bpy.types.Material, colour: str, bright: str, frames: np.ndarray) -> None:
    """Make a material light up on some frames, then fade back to its colour."""
    every = dance.FRAMES
    since = np.array([min((frame - key for key in frames if key <= frame), default=GLOW) for frame in every])
    share = np.clip(1.0 - since / GLOW, 0.0, 1.0)[:, None]
    values = (1.0 - share) * palette.linear(colour) + share * palette.linear(bright)
    write_channel(material, "diffuse_color", every, np.pad(values, ((0, 0), (0, 1)), constant_values=1.0))


def _ghost(scene: bpy.types.Scene, body: bpy.types.Object, frame: int) -> None:
    """Add a copy of the body in the pose of a frame, which stays in place and fades."""
    scene.frame_set(frame)
    seen = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
    material = surface(f"Ghost {frame}", REDUCED, alpha=0.5)
    mesh = bpy.data.meshes.new_from_object(seen)
    mesh.materials.clear()
    mesh.materials.append(material)
    ghost = bpy.data.objects.new(f"Ghost {frame}", mesh)
    ghost.matrix_world = seen.matrix_world.copy()
    # Behind the dancer as the camera sees her; in front, it would dim her.
    ghost.location += 0.25 * (Euler([math.radians(angle) for angle in CAMERA]).to_matrix() @ Vector((0.0, 0.0, -1.0)))
    scene.collection.objects.link(ghost)
    ages = np.arange(AFTERGLOW + 1.0)
    colours = np.tile((*palette.linear(REDUCED), 0.0), (len(ages), 1))
    colours[:, 3] = 0.5 * (1.0 - ages / AFTERGLOW)
    write_channel(material, "diffuse_color", frame + ages, colours)
    _show(ghost, frame, frame + AFTERGLOW)


def _show(obj: bpy.types.Object, first: float, last: float) -> None:
    """Show an object in renders from one frame until another frame."""
    frames = np.array((first - 1.0, first, last))
    write_channel(obj, "hide_render", frames, np.array((1.0, 0.0, 1.0)), interpolation="CONSTANT")


def _captions(camera: bpy.types.Object, side: float, title: str, colour: str, poses: np.ndarray, says: str) -> None:
    """Add captions below a lane: title, number of poses passed, a strip of all poses, and a sentence."""
    bright, faint, dim = ink(f"{title} ink", colour), ink("Faint", palette.DARK.faint), ink("Dim", palette.DARK.track)
    bottom = -WIDTH * SETTINGS.resolution[1] / SETTINGS.resolution[0]
    every, collection = dance.FRAMES, bpy.context.scene.collection

    def put(obj: bpy.types.Object, x: float, y: float, lift: float = 0.0) -> bpy.types.Object:
        obj.parent, obj.location = camera, ((side + x) * WIDTH, bottom + y * WIDTH, -2.0 + lift)
        if obj.name not in collection.objects:
            collection.objects.link(obj)
        return obj

    put(captions.words("Title", title, 0.07 * WIDTH, bright), LEFT, TITLE)
    of = f"of {len(poses)}"
    put(captions.words("Of", of, 0.055 * WIDTH, faint, "RIGHT"), RIGHT, TITLE)
    number = captions.readout_group(f"{title} number", 0, bright)
    passed = np.searchsorted(poses, every, side="right").astype(float)
    put(
        captions.readout("Passed", number, 0.07 * WIDTH, every, passed),
        RIGHT - 0.055 * captions.width_of(of) - 0.02,
        TITLE,
    )
    put(captions.words("Says", says, 0.045 * WIDTH, faint), LEFT, SAYS)

    def x_of(frame: float) -> float:
        return LEFT + (RIGHT - LEFT) * (frame - every[0]) / (every[-1] - every[0])

    tall = 0.032 * WIDTH
    if len(poses) == len(every):
        for name, material, lift in (("Strip", dim, 0.0), ("Strip passed", bright, 0.001)):
            bar = figure.boxes(name, material, ((0.5, 0.0, 0.0), (1.0, tall, 0.0005)))
            put(bar, LEFT, STRIP, lift)
            bar.scale.x = (RIGHT - LEFT) * WIDTH
        shares = np.zeros((len(every), 3)) + 1.0
        shares[:, 0] = np.maximum(1e-4, (every - every[0]) / (every[-1] - every[0])) * (RIGHT - LEFT) * WIDTH
        write_channel(bar, "scale", every, shares)
    else:
        for frame in poses:
            for name, material, lift in (("Tick", dim, 0.0), ("Tick passed", bright, 0.001)):
                tick = figure.boxes(name, material, ((0.0, 0.0, 0.0), (0.0052 * WIDTH, tall, 0.0005)))
                put(tick, x_of(frame), STRIP, lift)
            _show(tick, frame, every[-1] + 1.0)
            pop = np.ones((5, 3))
            pop[:, 1] = 1.0 + 0.9 * np.linspace(1.0, 0.0, 5)
            write_channel(tick, "scale", frame + np.arange(5.0), pop)
    head = figure.boxes(
        "Playhead", ink("Playhead", palette.DARK.ink), ((0.0, 0.0, 0.0), (0.004 * WIDTH, 1.7 * tall, 0.0005))
    )
    put(head, LEFT, STRIP, 0.002)
    ways = np.tile(np.array(head.location), (len(every), 1))
    ways[:, 0] = [(side + x_of(frame)) * WIDTH for frame in every]
    write_channel(head, "location", every, ways)


if __name__ == "__main__":
    main()
