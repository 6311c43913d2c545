"""Pictures for the extension's page: its icon, and the featured picture of a hammer swinging between the same two keys.

The left side of the featured picture uses Blender's own in-betweens, the right side the screw. Both hammers are keyed
objects, drawn where Blender shows them on each frame. They move in the plane of x and z.
"""

from __future__ import annotations

import math
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike

from research.drawing import picture, save
from rigid_motion import animation
from rigid_motion_batch.scenes.body_scene import registered

NATIVE, RIGID, KEY = "#F08A3C", "#38B6FF", "#FFB52E"
GROUND, WORDS, FAINT = "#303030", "#E6E6E6", "#9A9A9A"

HANDLE_LENGTH = 4.3  # from the hammer's origin, in its head, to the hand
GRIP = Vector((0.0, 0.0, -HANDLE_LENGTH))  # the hand, in the hammer's space
SWING_RAD = math.radians(62.0)  # the tilt of a key to its side
FIRST_FRAME, LAST_FRAME, GHOSTS_BETWEEN = 1, 61, 3  # the frames of the keys, and the number of ghosts between them

HANDLE = ((0.0, 0.0, -HANDLE_LENGTH - 0.3), (0.0, 0.0, 0.0), 0.16, "#B98A54")
HEAD_BOXES = ((0.27, 0.57, 0.25), (0.51, 0.81, 0.38), (-0.57, -0.27, 0.25), (-0.81, -0.51, 0.38), (-0.35, 0.35, 0.34))
CYLINDERS = (HANDLE, *(((begin, 0.0, 0.0), (end, 0.0, 0.0), radius, "#C9CED6") for begin, end, radius in HEAD_BOXES))
"""Both ends, radius and colour, from back to front."""

CYLINDER_SHADES = np.linspace(-1.0, 1.0, 25)  # across a cylinder


# -- the icon ----------------------------------------------------------------------------------------------------------


def icon(path: Path) -> None:
    """Draw a body that moves along an arc from key to key and turns with it; outlined, to suit any background."""
    axes = picture(256, 256)
    axes.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0))

    def towards(degrees: ArrayLike, radius: float = 0.66) -> np.ndarray:
        return radius * np.stack((np.cos(np.radians(degrees)), np.sin(np.radians(degrees))))

    def line(points: np.ndarray, width: float, colour: str) -> None:
        axes.plot(*points, color=colour, linewidth=92.16 * width, solid_capstyle="round", solid_joinstyle="round")

    centre, arc = np.array(((0.0,), (-0.22,))), np.arange(-24, 205, 3)
    for width, colour in ((0.24, "#1B1F24"), (0.12, "#F2F2F2")):
        line(centre + towards(arc), width, colour)
    for at, size, turn, colour in ((-24, 0.2, 24, KEY), (204, 0.2, -204, KEY), (72, 0.4, 45, RIGID)):
        corners = centre + towards([at]) + towards(at + turn + np.arange(0, 360, 90), size)
        for width, outline in ((0.21, "#1B1F24"), (0.1, colour)):
            line(np.concatenate((corners, corners[:, :2]), axis=1), width, outline)
            axes.fill(*corners, color=outline, zorder=2)  # Like lines: later ones cover earlier ones.
    save(axes, path)


# -- the featured picture ----------------------------------------------------------------------------------------------


def featured(path: Path) -> None:
    """Draw both hammers at their keys and in between, the paths of head and grip, and the hand."""
    axes = picture(1920, 1080, GROUND)
    axes.set(xlim=(-9.6, 9.6), ylim=(-5.4, 5.4))
    with registered():
        _swinging(axes, -4.75, None, (NATIVE, "#A05F33"), "Blender", "each channel for itself")
        _swinging(axes, 4.75, "dq_sclerp", (RIGID, "#2A7CAD"), "Rigid Motion", "one body, one motion")
    for text, x, z, size, colour in (
        ("the grip leaves the hand", -1.55, -3.5, 23, NATIVE),
        ("the grip stays in the hand", 4.75, -2.95, 23, RIGID),
        ("The same two keys", 0.0, -4.72, 23, FAINT),
    ):
        axes.text(x, z, text, color=colour, fontsize=size, ha="center", va="center")
    save(axes, path)


def _swinging(axes: Axes, x: float, mode: str | None, colours: tuple[str, str], title: str, subtitle: str) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    hammer = bpy.data.objects.new("Hammer", None)
    bpy.context.collection.objects.link(hammer)
    hand = Vector((x, 0.0, -1.85))
    poses = swing(hammer, hand, mode)
    step = (LAST_FRAME - FIRST_FRAME) // (GHOSTS_BETWEEN + 1)
    for pose in poses[step:-1:step]:
        _draw_hammer(axes, pose, colours[1])
    for pose in (poses[0], poses[-1]):
        _draw_hammer(axes, pose)
    heads, grips = (np.array([pose @ point for pose in poses])[:, ::2].T for point in (Vector(), GRIP))
    axes.plot(*heads, color=colours[0], linewidth=6.5, solid_capstyle="round")
    if np.ptp(grips, axis=1).max() > 0.1:
        axes.plot(*grips, color=colours[0], linewidth=4.5)
    axes.plot(*heads[:, [0, -1]], "o", color=KEY, markersize=22)
    axes.plot(hand.x, hand.z, "o", markersize=60, markerfacecolor="none", markeredgecolor=WORDS, markeredgewidth=7)
    axes.text(x, 4.22, title, color=colours[0], fontsize=56, ha="center", va="center")
    axes.text(x, 3.5, subtitle, color=WORDS, fontsize=24, ha="center", va="center")


def swing(hammer: bpy.types.Object, hand: Vector, mode: str | None) -> list[Matrix]:
    """Key a hammer so that the hand holds it at both ends of the swing, with a mode or (None) Blender's in-betweens.

    Returns
    -------
    list of Matrix
        The evaluated world matrix on each frame.
    """
    hammer.rotation_mode = "QUATERNION"
    for frame, angle in ((FIRST_FRAME, -SWING_RAD), (LAST_FRAME, SWING_RAD)):
        turn = Quaternion((0.0, 1.0, 0.0), angle)
        hammer.rotation_quaternion = turn
        hammer.location = hand - turn @ GRIP
        hammer.keyframe_insert("location", frame=frame)
        hammer.keyframe_insert("rotation_quaternion", frame=frame)
    for fcurve in animation.channelbag_of(hammer).fcurves:
        for key in fcurve.keyframe_points:
            key.interpolation = "LINEAR"
    if mode is not None:
        animation.set_mode(hammer, mode)
    shown = []
    for frame in range(FIRST_FRAME, LAST_FRAME + 1):
        bpy.context.scene.frame_set(frame)
        shown.append(hammer.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.copy())
    return shown


def _draw_hammer(axes: Axes, pose: Matrix, colour: str | None = None) -> None:
    """Draw a hammer as lit cylinders; in one colour, or in those of wood and steel."""
    for *ends, radius, material in CYLINDERS:
        begin, end = (np.array(pose @ Vector(end))[::2] for end in ends)
        along = (end - begin) / np.linalg.norm(end - begin)
        out = np.array((-along[1], along[0]))
        # Strips face outwards in proportion to their offset; the light comes from the left, above and in front.
        bright = np.clip(CYLINDER_SHADES * (out @ (-0.45, 0.55)) + np.sqrt(1.0 - CYLINDER_SHADES**2) * 0.7, 0.0, 1.0)
        edges = radius * CYLINDER_SHADES[:, None] * out
        strips = np.stack((begin + edges[:-1], end + edges[:-1], end + edges[1:], begin + edges[1:]), axis=1)
        shades = (0.4 + 0.65 * 0.5 * (bright[:-1] + bright[1:]))[:, None] * to_rgb(colour or material)
        axes.add_collection(PolyCollection(strips, facecolors=shades.clip(0.0, 1.0), edgecolors="face", linewidths=0.5))
