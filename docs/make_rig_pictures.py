"""Make the pictures and the film of the chapter on rigs: Rigify's human with Blender's in-betweens and with Screw.

python docs/make_rig_pictures.py

prints the measured errors of each scene, and writes rigs-SHOT.png and rigs.mp4 next to this file. With --still it
writes only the pictures.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from examples import figure
from examples.stills import render_still
from rigid_motion import animation
from rigid_motion_batch import palette
from rigid_motion_batch.scenes import captions
from rigid_motion_batch.scenes.film import render_film
from rigid_motion_batch.scenes.materials import ink, surface
from rigid_motion_batch.scenes.scene import make_lights, set_up_render
from rigid_motion_batch.scenes.settings import SceneSettings
from tests.rigs import scenes
from tests.rigs.human import human

SETTINGS = SceneSettings(resolution=(960, 540), antialiasing="8", fps=24)

SKIN, STEEL, WOOD, FLOOR = "#93A0B3", "#DDE3EA", "#C98B4A", "#2B313B"

LANES = (("Blender", "#C9CED6", None), ("Screw", "#38B6FF", "dq_sclerp"))
"""Title, colour and mode of each lane."""

FRAMES = range(scenes.FRAMES[0], scenes.FRAMES[-1] + 1)

Build = Callable[[bpy.types.Object], scenes.Scene]


@dataclass(frozen=True)
class Shot:
    """A scene of the film, in two lanes.

    Attributes
    ----------
    says
        What the displayed number measures.
    build
        Function that keys a rig.
    traced
        Pairs of a bone and a point in its space, whose path is drawn.
    camera
        Rotation of the camera in degrees.
    middle
        The point that the camera looks at, in the space of a rig.
    width
        Width of one lane, in metres.
    still
        The frame of the picture.
    """

    name: str
    says: str
    build: Build
    traced: Sequence[tuple[str, Vector]]
    camera: tuple[float, float, float]
    middle: tuple[float, float, float]
    width: float
    still: int


def lever(rig: bpy.types.Object) -> scenes.Scene:
    """Build the lever scene: a lever on a stand, with a grip where the fist has to stay."""
    wood, steel = surface("Wood", WOOD), surface("Steel", STEEL)
    rod = figure.boxes("Lever", steel, ((0.0, 0.0, 0.27), (0.026, 0.026, 0.66)))
    knob = figure.ball("Knob", wood, 0.036)
    knob.parent, knob.location = rod, (0.0, 0.0, 0.62)
    grip = figure.boxes("Grip", wood, ((0.0, 0.0, scenes.LEVER), (0.034, 0.034, 0.15)))
    grip.parent = rod
    stand = figure.boxes("Stand", surface("Stand", palette.DARK.track), ((0.0, 0.0, -0.4), (0.10, 0.16, 0.8)))
    stand.parent, stand.location = rig, scenes.PIVOT
    return scenes.pull_a_lever(rig, rod)


def sword(rig: bpy.types.Object) -> scenes.Scene:
    """Build the sword scene: a sword in the fist, its blade in the direction of the thumb."""
    steel, wood = surface("Steel", STEEL), surface("Wood", WOOD)
    blade = figure.boxes(
        "Sword", steel, ((0.0, 0.0, 0.45), (0.008, 0.045, 0.70)), ((0.0, 0.0, 0.09), (0.02, 0.17, 0.02))
    )
    hilt = figure.boxes("Hilt", wood, ((0.0, 0.0, 0.0), (0.028, 0.028, 0.17)))
    for part in (blade, hilt):
        figure.hold(part, rig, "DEF-hand.L", Matrix.Translation(scenes.GRIP))
    return scenes.cut(rig)


def twist(rig: bpy.types.Object) -> scenes.Scene:
    """Build the twist scene: crosses, visible through the feet, mark where the balls of the feet have to stay."""
    wood = ink("Mark", WOOD)
    for side in "LR":
        mark = figure.boxes("Mark", wood, ((0, 0, 0), (0.14, 0.006, 0.002)), ((0, 0, 0), (0.006, 0.14, 0.002)))
        mark.parent, mark.location = rig, rig.pose.bones[f"DEF-toe.{side}"].head
        mark.show_in_front = True
    return scenes.twist(rig)


TIP = scenes.GRIP + Vector((0.0, 0.0, 0.80))

SHOTS = (
    Shot(
        "lever",
        "fist off the handle",
        lever,
        (("DEF-hand.L", scenes.GRIP),),
        (78, 0, 62),
        (0.2, -0.2, 1.2),
        1.75,
        13,
    ),
    Shot(
        "sword",
        "wrist off its circle",
        sword,
        (("DEF-hand.L", TIP), ("DEF-hand.L", Vector())),
        (84, 0, 72),
        (0.16, -0.25, 1.40),
        2.75,
        14,
    ),
    Shot(
        "feet",
        "balls of the feet off their marks",
        twist,
        (("DEF-toe.L", Vector()), ("DEF-toe.R", Vector())),
        (52, 0, 66),
        (0.0, -0.03, 0.03),
        0.62,
        16,
    ),
)


def main() -> None:
    """Render the pictures and the film."""
    animation.register()
    with tempfile.TemporaryDirectory() as folder:
        for shot in SHOTS:
            scene = build(shot)
            take(scene, shot, Path(folder) / shot.name)
        if "--still" not in sys.argv:
            render_film(cut_together([Path(folder) / shot.name for shot in SHOTS]), DOCS / "rigs.mp4")


def build(shot: Shot) -> bpy.types.Scene:
    """Return the scene of a shot, with both lanes side by side."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_up_render(scene, SETTINGS, len(FRAMES))
    make_lights(scene)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    turn = Euler([math.radians(angle) for angle in shot.camera]).to_matrix()
    camera.rotation_euler = turn.to_euler()
    camera.location = Vector(shot.middle) + turn @ Vector((0.0, 0.0, 8.0))
    camera.data.type, camera.data.ortho_scale, camera.data.clip_end = "ORTHO", 2.0 * shot.width, 40.0
    camera.data.sensor_fit = "HORIZONTAL"
    right = turn @ Vector((1.0, 0.0, 0.0))
    for side, (title, colour, mode) in zip((-0.5, 0.5), LANES, strict=True):
        rig = human()
        rig.hide_render = True
        figure.clothe(rig, surface("Skin", SKIN))
        played = shot.build(rig)
        if mode:
            animation.set_mode(played.controls, mode)
        strays = 100.0 * np.array([played.strays(frame) for frame in FRAMES])
        print(f"{shot.name}, {title}: {shot.says}, at most {strays.max():.2f} cm", flush=True)
        for bone, point in shot.traced:
            way = [scenes.shown(rig, frame)[bone].matrix @ point for frame in FRAMES]
            line = figure.trail("Trail", ink(f"{title} trail", colour), way, 0.003 * shot.width)
            line.parent, line.show_in_front = rig, True
        rig.location = side * shot.width * right
        caption(camera, shot, side, title, colour, strays)
    return scene


def caption(camera: bpy.types.Object, shot: Shot, side: float, title: str, colour: str, strays: np.ndarray) -> None:
    """Add captions below a lane: title, number, and what the number measures."""
    bright, faint = ink(f"{title} ink", colour), ink("Faint", palette.DARK.faint)
    unit = shot.width
    bottom = -unit * SETTINGS.resolution[1] / SETTINGS.resolution[0]
    collection = bpy.context.scene.collection

    def put(obj: bpy.types.Object, x: float, y: float) -> None:
        obj.parent, obj.location = camera, ((side + x) * unit, bottom + y * unit, -2.0)
        collection.objects.link(obj)

    put(captions.words("Title", title, 0.075 * unit, bright), -0.46, 0.125)
    number = captions.readout_group(f"{title} number", 1, bright)
    put(captions.readout("Stray", number, 0.075 * unit, np.array(FRAMES, dtype=float), strays), 0.34, 0.125)
    put(captions.words("Unit", "cm", 0.055 * unit, bright), 0.355, 0.125)
    put(captions.words("Says", shot.says, 0.042 * unit, faint, "RIGHT"), 0.44, 0.055)


def take(scene: bpy.types.Scene, shot: Shot, folder: Path) -> None:
    """Render the frames of a shot, and its still."""
    image = scene.render.image_settings
    scene.frame_set(shot.still)
    render_still(scene, DOCS / f"rigs-{shot.name}.png")
    if "--still" not in sys.argv:
        image.compression = 15
        scene.render.filepath = str(folder / "####")
        bpy.ops.render.render(animation=True)


def cut_together(folders: Sequence[Path]) -> bpy.types.Scene:
    """Return a scene whose sequencer shows the rendered frames of all shots, one after another."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, frame = bpy.context.scene, 1
    strips = scene.sequence_editor_create().strips
    for folder in folders:
        first, *others = sorted(folder.glob("*.png"))
        strip = strips.new_image(folder.name, str(first), 1, frame)
        for other in others:
            strip.elements.append(other.name)
        frame += 1 + len(others)
    set_up_render(scene, SETTINGS, frame - 1)
    scene.render.use_sequencer = True
    video = scene.render.ffmpeg
    video.constant_rate_factor, video.ffmpeg_preset, video.gopsize = "MEDIUM", "BEST", len(FRAMES)
    return scene


if __name__ == "__main__":
    main()
