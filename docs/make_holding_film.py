"""Make the film of a hammer that goes from hand to hand, by keyed influences of Child Of and, side by side, by holds.

python docs/make_holding_film.py

prints how far the hammer is off the hands, and writes holding.png and holding.mp4 next to this file. With --still it
writes only the picture.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from examples import figure
from examples.dancer.plan import BONES
from examples.stills import render_still
from rigid_motion import animation
from rigid_motion.animation import write_channel
from rigid_motion_batch import palette
from rigid_motion_batch.scenes import captions
from rigid_motion_batch.scenes.film import render_film
from rigid_motion_batch.scenes.materials import ink, surface
from rigid_motion_batch.scenes.scene import make_lights, set_up_render
from rigid_motion_batch.scenes.settings import SceneSettings

SETTINGS = SceneSettings(resolution=(960, 540), antialiasing="8", fps=24)
FRAMES = np.arange(1.0, 193.0)

PICK, OVER, THROWN, CAUGHT, DOWN = 24, 62, 104, 118, 164
"""The frames on which the hammer is picked up, handed over, thrown, caught and put down."""

COLOURS = "#4FA8E8", "#F0A04B", "#C9CED6"
"""Colours of the first and second person, and of a hammer that no hand holds."""

STEEL, WOOD, STAND, FLOOR = "#DDE3EA", "#8A5A33", "#4A5462", "#242932"

WIDTH = 2.4
"""Width of a lane, in metres."""

MIDDLE = Vector((0.0, 0.0, 0.79))
"""The point that the camera looks at, halfway between the two lanes."""

DEPTH = -0.20
"""The Y coordinate of the hammer, in metres: towards the camera, in front of the shoulders of the near arms."""

TABLE, AIR = 2, 3
"""Numbers of the holders that are not people: the two people are 0 and 1."""

HELD = (1, TABLE, 0), (PICK, 0, 0), (OVER, 1, 4), (THROWN, AIR, 1), (CAUGHT, 0, 3), (DOWN, TABLE, 0)
"""First frame of each hold, its holder, and how many frames the hand-over before that frame takes."""

STILL = OVER - 2
"""The frame of the picture."""


@dataclass(frozen=True)
class Person:
    """A person next to the table: X position, turn in degrees about Z, and the side of the hand near the camera."""

    colour: str
    place: float
    turn: float
    side: str
    grip: Matrix
    """Matrix of the hand in the space of the hammer that it holds."""

    idle: Vector
    """Position of the wrist while the hand is idle."""


def _grip(along: float, forward: float) -> Matrix:
    """Return a hand's matrix: `along` metres up the handle, pointing along (1) or against (-1) the hammer's X axis."""
    axes = Matrix(((0.0, forward, 0.0), (-forward, 0.0, 0.0), (0.0, 0.0, 1.0))).to_4x4()
    return Matrix.Translation((-0.075 * forward, 0.0, along)) @ axes


PEOPLE = (
    Person(COLOURS[0], -0.52, 90.0, "R", _grip(0.0, 1.0), Vector((-0.34, DEPTH, 0.94))),
    Person(COLOURS[1], 0.52, -90.0, "L", _grip(0.12, -1.0), Vector((0.34, DEPTH, 0.94))),
)


def _pose(x: float, z: float, degrees: float) -> Matrix:
    """Return the hammer's matrix: its grip at (x, z), its head tilted from upright towards +X by an angle."""
    return Matrix.Translation((x, DEPTH, z)) @ Matrix.Rotation(math.radians(degrees), 4, "Y")


LIES = _pose(-0.21, 0.849, 90.0)
TAKEN = _pose(-0.02, 1.17, 10.0)
TURNS = -10.0, 350.0
LET_GO, CATCH = _pose(0.20, 1.22, TURNS[0]), _pose(-0.20, 1.22, TURNS[1])

CENTRE, HEAD = Vector((0.0, 0.0, 0.18)), Vector((0.0, 0.0, 0.24))
"""Centre of mass and middle of the head, in the space of the hammer."""

HELD_AT = Vector(), Vector((0.0, 0.0, 0.12)), CENTRE, CENTRE
"""The point of the hammer that each holder holds, in the space of the hammer, by number of the holder."""

CARRIED: tuple[dict[int, Matrix], ...] = (
    {
        PICK: LIES,
        PICK + 14: _pose(-0.26, 1.16, -15.0),
        OVER - 6: TAKEN,
        OVER + 1: TAKEN,
        CAUGHT - 3: Matrix.Translation((0.0, 0.0, 0.26)) @ CATCH,
        CAUGHT: CATCH,
        CAUGHT + 8: _pose(-0.22, 1.02, 375.0),
        DOWN: LIES,
    },
    {
        OVER - 6: TAKEN,
        OVER + 1: TAKEN,
        OVER + 18: _pose(0.20, 1.30, 18.0),
        THROWN - 9: _pose(0.26, 0.90, -48.0),
        THROWN: LET_GO,
    },
)
"""Keys of each person's hand by frame, given as the pose of the hammer in that hand."""

FREE: tuple[dict[int, tuple[float, float, float]], ...] = (
    {
        1: (0.0, 0.0, 45.0),
        PICK - 9: (0.18, 0.10, 70.0),
        OVER + 14: (0.10, 0.20, 20.0),
        CAUGHT - 20: (0.06, 0.16, 20.0),
        CAUGHT - 7: (0.08, 0.34, 0.0),
        DOWN + 9: (0.18, 0.10, 70.0),
        192: (0.0, 0.0, 45.0),
    },
    {
        1: (0.0, 0.0, -45.0),
        OVER - 28: (0.0, 0.0, -45.0),
        OVER - 14: (-0.22, 0.26, -10.0),
        THROWN + 7: (-0.20, 0.56, 20.0),
        THROWN + 34: (0.0, 0.0, -45.0),
        192: (0.0, 0.0, -45.0),
    },
)
"""Keys of each person's empty hand by frame: offset of the wrist from its idle place in X and Z, turn in degrees."""

LEANS: tuple[dict[int, float], ...] = (
    {
        1: 2.0,
        PICK: 18.0,
        PICK + 14: -2.0,
        OVER: 8.0,
        OVER + 22: 0.0,
        CAUGHT: 2.0,
        CAUGHT + 9: 6.0,
        DOWN: 18.0,
        192: 2.0,
    },
    {1: 1.0, OVER - 28: 1.0, OVER: 9.0, OVER + 20: -4.0, THROWN - 9: 7.0, THROWN + 6: -4.0, THROWN + 36: 1.0, 192: 1.0},
)
"""Keys of each person's forward bend by frame, in degrees."""

TITLE, SAYS, STRIP, LEFT, RIGHT = 0.150, 0.098, 0.045, -0.45, 0.45
"""Positions of captions in a lane, in lane widths: y from its bottom (the first three), x from its middle."""


def main() -> None:
    """Render the picture and the film."""
    animation.register()
    scene = build()
    scene.frame_set(STILL)
    image, kind = scene.render.image_settings, scene.render.image_settings.file_format
    render_still(scene, DOCS / "holding.png")
    if "--still" not in sys.argv:
        if hasattr(image, "media_type"):  # Blender 5 needs the kind of output first.
            image.media_type = "VIDEO"
        image.file_format = kind
        render_film(scene, DOCS / "holding.mp4")


def build() -> bpy.types.Scene:
    """Return the scene with both ways to hold, side by side."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_up_render(scene, SETTINGS, len(FRAMES))
    video = scene.render.ffmpeg
    video.constant_rate_factor, video.ffmpeg_preset, video.gopsize = "MEDIUM", "BEST", 5 * SETTINGS.fps
    scene.render.dither_intensity = 0.0  # The grain of dithering would be most of the file.
    make_lights(scene)
    camera = _camera(scene)
    for side, title, hold in ((-0.5, "Child Of, influence keyed", by_influence), (0.5, "Hold In", by_holds)):
        lane = Matrix.Translation((side * WIDTH, 0.0, 0.0))
        rigs = [person(who, lane) for who in PEOPLE]
        tool = hammer()
        hold(tool, [rig.pose.bones[f"DEF-hand.{who.side}"] for rig, who in zip(rigs, PEOPLE, strict=True)], lane)
        ways, off = measure(tool, rigs, lane)
        print(f"{title}: off the hands by at most {100.0 * off.max():.4f} cm at quarters of frames", flush=True)
        for obj in (*_furniture(), *_trails(ways)):
            obj.matrix_world = lane
        _captions(camera, side, title, off[::4])
    return scene


# -- people, and the held hammer ---------------------------------------------------------------------------------------


def person(who: Person, lane: Matrix) -> bpy.types.Object:
    """Add a person: the hand control near the camera has keys, and the arm follows it by IK."""
    rig = bpy.data.objects.new("Person", bpy.data.armatures.new("Person"))
    bpy.context.scene.collection.objects.link(rig)
    rig.matrix_world = (
        lane @ Matrix.Translation((who.place, 0.0, 0.0)) @ Matrix.Rotation(math.radians(who.turn), 4, "Z")
    )
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (parent, head, tail) in BONES.items():
        bone = rig.data.edit_bones.new(f"DEF-{name}")
        bone.head, bone.tail = head, tail
        if parent:
            bone.parent = rig.data.edit_bones[f"DEF-{parent}"]
    hand = rig.data.edit_bones[f"DEF-hand.{who.side}"]
    control = rig.data.edit_bones.new("hand")
    control.head, control.tail, control.roll, control.use_deform = hand.head, hand.tail, hand.roll, False
    bpy.ops.object.mode_set(mode="OBJECT")
    bones = rig.pose.bones
    follow = bones[f"DEF-forearm.{who.side}"].constraints.new("IK")
    follow.target, follow.subtarget, follow.chain_count = rig, "hand", 2
    turn = bones[f"DEF-hand.{who.side}"].constraints.new("COPY_ROTATION")
    turn.target, turn.subtarget = rig, "hand"
    far = bones[f"DEF-upper_arm.{'L' if who.side == 'R' else 'R'}"]
    far.matrix = (
        Matrix.Rotation(math.radians(28.0 if who.side == "R" else -28.0), 4, "Y").to_3x3().to_4x4() @ far.matrix
    )

    number = PEOPLE.index(who)
    for frame, pose in CARRIED[number].items():
        _key(bones["hand"], frame, lane @ pose @ who.grip)
    for frame, (x, z, degrees) in FREE[number].items():
        turned = _pose(0.0, 0.0, degrees) @ who.grip
        wrist = Matrix.LocRotScale(who.idle + Vector((x, 0.0, z)), turned.to_quaternion(), None)
        _key(bones["hand"], frame, lane @ wrist)
    for frame, degrees in LEANS[number].items():
        for name, share in (("spine.001", 0.5), ("spine.002", 0.5), ("spine.004", -0.3)):
            bone = bones[f"DEF-{name}"]
            bone.rotation_mode = "XYZ"
            bone.rotation_euler.x = math.radians(share * degrees)
            bone.keyframe_insert("rotation_euler", frame=frame)
    animation.set_mode([bones["hand"]], "motor_spline")
    rig.hide_render = True
    figure.clothe(rig, surface("Skin", who.colour))
    return rig


def _key(bone: bpy.types.PoseBone, frame: float, world: Matrix) -> None:
    bone.matrix_basis = bone.bone.matrix_local.inverted() @ bone.id_data.matrix_basis.inverted() @ world
    for path in ("location", "rotation_quaternion"):
        bone.keyframe_insert(path, frame=frame)


def hammer() -> bpy.types.Object:
    """Add a hammer with its origin at the point where it is first held."""
    head = figure.boxes("Head", surface("Steel", STEEL), ((0.0, 0.0, 0.24), (0.15, 0.06, 0.06)))
    tool = figure.boxes("Hammer", surface("Handle", WOOD), ((0.0, 0.0, 0.08), (0.028, 0.028, 0.36)))
    head.parent, tool.rotation_mode = tool, "QUATERNION"
    return tool


def by_holds(tool: bpy.types.Object, hands: Sequence[bpy.types.PoseBone], lane: Matrix) -> None:
    """Hold the hammer as an animator does: go to a frame, select the hammer, then the hand, and use Hold In."""
    scene = bpy.context.scene
    _key_tool(tool, 1, lane @ LIES)
    for frame, who, frames in HELD[1:]:
        if frame == CAUGHT:
            for between in range(THROWN + 2, CAUGHT + 1, 2):
                _key_tool(tool, between, lane @ flight(between))
            animation.refresh()
        scene.frame_set(frame)
        animation.hold_in(tool, hands[who] if who < TABLE else None, frames=frames)
    animation.refresh()


def by_influence(tool: bpy.types.Object, hands: Sequence[bpy.types.PoseBone], lane: Matrix) -> None:
    """Give the hammer a Child Of for each hand, with inverses set when first taken, and key influences and hammer.

    The hammer is in the right place on each of its keys. Only the in-betweens are left to Blender.
    """
    scene, constraints = bpy.context.scene, []
    for hand, frame in zip(hands, (PICK, OVER), strict=True):
        scene.frame_set(frame)
        held = tool.constraints.new("CHILD_OF")
        held.target, held.subtarget, held.influence = hand.id_data, hand.name, 0.0
        held.set_inverse_pending, held.inverse_matrix = False, _world(hand).inverted()
        constraints.append(held)
    on = ((PICK - 1, PICK), (CAUGHT - 3, CAUGHT)), ((OVER - 4, OVER),)
    off = ((OVER - 4, OVER), (DOWN - 1, DOWN)), ((THROWN - 1, THROWN),)
    for held, *changes in zip(constraints, on, off, strict=True):
        for influence, frames in ((1.0, changes[0]), (0.0, changes[1])):
            for before, frame in frames:
                for held.influence, at in ((1.0 - influence, before), (influence, frame)):
                    held.keyframe_insert("influence", frame=at)

    def held_in(number: int, frame: float, pose: Matrix) -> Matrix:
        scene.frame_set(int(frame))
        return (_world(hands[number]) @ constraints[number].inverse_matrix).inverted() @ lane @ pose

    keys = [(frame, lane @ LIES) for frame in (1, PICK - 1)]
    keys += [(frame, held_in(0, PICK, LIES)) for frame in (PICK, OVER - 4)]
    keys += [(frame, held_in(1, OVER, TAKEN)) for frame in (OVER, THROWN - 1)]
    keys += [(frame, lane @ flight(frame)) for frame in (*range(THROWN, CAUGHT - 3, 2), CAUGHT - 3)]
    keys += [(frame, held_in(0, CAUGHT, CATCH)) for frame in (CAUGHT, DOWN - 1)]
    keys += [(frame, lane @ LIES) for frame in (DOWN, FRAMES[-1])]
    for frame, pose in keys:
        _key_tool(tool, frame, pose)


def _key_tool(tool: bpy.types.Object, frame: float, pose: Matrix) -> None:
    place, rotation, _ = pose.decompose()
    rotation.make_compatible(tool.rotation_quaternion)
    tool.location, tool.rotation_quaternion = place, rotation
    for path in ("location", "rotation_quaternion"):
        tool.keyframe_insert(path, frame=frame)


def flight(frame: float) -> Matrix:
    """Return the matrix of the thrown hammer: centre of mass on a parabola, one full turn at constant speed."""
    seconds, share = (CAUGHT - THROWN) / SETTINGS.fps, (frame - THROWN) / (CAUGHT - THROWN)
    first, last = (pose @ CENTRE for pose in (LET_GO, CATCH))
    rise = 0.5 * 9.81 * seconds**2 * share * (1.0 - share)
    turned = _pose(0.0, 0.0, TURNS[0] + share * (TURNS[1] - TURNS[0])).to_quaternion()
    place = first.lerp(last, share) + Vector((0.0, 0.0, rise))
    return Matrix.LocRotScale(place - turned @ CENTRE, turned, None)


# -- the measured error ------------------------------------------------------------------------------------------------


def measure(tool: bpy.types.Object, rigs: Sequence[bpy.types.Object], lane: Matrix) -> tuple[np.ndarray, np.ndarray]:
    """Return the hammer head's path in its lane, (q, 3), and its distance from its holder, (q,), every quarter frame.

    The distance is in metres, at the point where the hammer is held. During a hand-over, the nearer holder counts.
    """
    scene, back, moments = bpy.context.scene, lane.inverted(), np.arange(FRAMES[0], FRAMES[-1] + 0.1, 0.25)
    ways, off = np.empty((len(moments), 3)), np.empty((4, len(moments)))
    for number, moment in enumerate(moments):
        scene.frame_set(int(moment), subframe=moment % 1.0)
        shown = back @ tool.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world
        ways[number] = shown @ HEAD
        hands = [rig.pose.bones[f"DEF-hand.{who.side}"] for rig, who in zip(rigs, PEOPLE, strict=True)]
        poses = [back @ _world(hand) @ who.grip.inverted() for hand, who in zip(hands, PEOPLE, strict=True)]
        for one, (pose, place) in enumerate(zip((*poses, LIES, flight(moment)), HELD_AT, strict=True)):
            off[one, number] = (shown @ place - pose @ place).length
    result = off[TABLE].copy()
    for (frame, who, _), (until, then, passing) in pairwise((*HELD, (np.inf, TABLE, 0))):
        there = (moments >= frame) & (moments < until)
        result[there] = off[who, there]
        there &= moments > until - passing
        result[there] = np.minimum(off[who], off[then])[there]
    return ways, result


def _world(bone: bpy.types.PoseBone) -> Matrix:
    rig = bone.id_data.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return rig.matrix_world @ rig.pose.bones[bone.name].matrix


# -- the picture -------------------------------------------------------------------------------------------------------


def _trails(ways: np.ndarray) -> list[bpy.types.Object]:
    """Draw the path of the head as it forms, in the colour of the holder."""
    result = []
    for (first, who, _), (last, *_) in pairwise((*HELD, (int(FRAMES[-1]), TABLE, 0))):
        part = ways[4 * (first - 1) : 4 * (last - 1) + 1]
        if np.ptp(part, axis=0).max() > 1e-3:
            trail = figure.trail("Trail", ink("Trail", COLOURS[min(who, 2)]), part, 0.006)
            share = np.linspace(0.0, 1.0, last - first + 1)
            trail.data.bevel_factor_mapping_end = "RESOLUTION"
            write_channel(trail.data, "bevel_factor_end", np.arange(first, last + 1.0), share)
            result.append(trail)
    return result


def _furniture() -> list[bpy.types.Object]:
    table = surface("Table", STAND)
    top = ((0.0, 0.05, 0.80), (0.62, 0.62, 0.03))
    legs = [((x, y, 0.39), (0.04, 0.04, 0.78)) for x in (-0.28, 0.28) for y in (-0.2, 0.3)]
    floor = ((0.0, 0.4, -0.01), (0.98 * WIDTH, 1.6, 0.01))
    return [figure.boxes("Table", table, top, *legs), figure.boxes("Floor", surface("Floor", FLOOR), floor)]


def _camera(scene: bpy.types.Scene) -> bpy.types.Object:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    turn = Euler((math.radians(84.0), 0.0, 0.0)).to_matrix()
    camera.rotation_euler = turn.to_euler()
    camera.location = MIDDLE + turn @ Vector((0.0, 0.0, 8.0))
    camera.data.type, camera.data.ortho_scale, camera.data.clip_end = "ORTHO", 2.0 * WIDTH, 40.0
    camera.data.sensor_fit = "HORIZONTAL"
    return camera


def _captions(camera: bpy.types.Object, side: float, title: str, off: np.ndarray) -> None:
    """Add captions below a lane: title, largest error so far, and a strip in the colours of the holders."""
    bright, faint = ink("Bright", palette.DARK.ink), ink("Faint", palette.DARK.faint)
    bottom = -WIDTH * SETTINGS.resolution[1] / SETTINGS.resolution[0]
    collection = bpy.context.scene.collection

    def put(obj: bpy.types.Object, x: float, y: float, lift: float = 0.0) -> bpy.types.Object:
        obj.parent, obj.location = camera, ((side + x) * WIDTH, bottom + y * WIDTH, -2.0 + lift)
        if obj.name not in collection.objects:
            collection.objects.link(obj)
        return obj

    def x_of(frame: float) -> float:
        return LEFT + (RIGHT - LEFT) * (frame - FRAMES[0]) / (FRAMES[-1] - FRAMES[0])

    put(captions.words("Title", title, 0.062 * WIDTH, bright), LEFT, TITLE)
    number = captions.readout_group(f"{title} number", 1, bright)
    put(
        captions.readout("Off", number, 0.062 * WIDTH, FRAMES, 100.0 * np.maximum.accumulate(off)), RIGHT - 0.085, TITLE
    )
    put(captions.words("Unit", "cm", 0.05 * WIDTH, bright, "RIGHT"), RIGHT, TITLE)
    put(captions.words("Says", "in the hand of", 0.036 * WIDTH, faint), LEFT, SAYS)
    put(captions.words("Says", "off the hands, so far at most", 0.036 * WIDTH, faint, "RIGHT"), RIGHT, SAYS)
    for (first, who, _), (last, *_) in pairwise((*HELD, (int(FRAMES[-1]), TABLE, 0))):
        colour = palette.DARK.track if who >= TABLE else COLOURS[who]
        bar = figure.boxes("Held", ink("Held", colour), ((0.5, 0.0, 0.0), (1.0, 0.028 * WIDTH, 0.0005)))
        put(bar, x_of(first), STRIP)
        bar.scale.x = (x_of(last) - x_of(first)) * WIDTH
    head = figure.boxes("Playhead", bright, ((0.0, 0.0, 0.0), (0.006 * WIDTH, 0.05 * WIDTH, 0.0005)))
    put(head, LEFT, STRIP, 0.002)
    ways = np.tile(np.array(head.location), (len(FRAMES), 1))
    ways[:, 0] = [(side + x_of(frame)) * WIDTH for frame in FRAMES]
    write_channel(head, "location", FRAMES, ways)


if __name__ == "__main__":
    main()
