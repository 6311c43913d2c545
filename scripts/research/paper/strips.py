"""The figure "interpolation algorithms": the drill at the same moments under the paper's three engines, in strips.

The tool turns about its tip, which rests where it is, as an instrument does in an opening; the receiver has the first
pose and the last. Metres.
"""

from __future__ import annotations

import bpy
import numpy as np

from research.making.motions import TIP, about, chain, held_by
from rigid_motion.motion import MODES, Poses, interpolate
from rigid_motion.motion.quaternions import angle_between, normalise, rotate
from rigid_motion_batch.palette import DARK, colour_of
from rigid_motion_batch.scenes.materials import surface
from rigid_motion_batch.scenes.subject import load_subject

from .picture import FAINT, INK, RULE, Sheet

ENGINES = {"lerp_slerp": "State of the art", "dq_sclerp": "Dual quaternions", "pga_lerp": "Multivectors"}
"""Mode id to what the paper calls it."""

MOMENTS = np.linspace(0.0, 1.0, 7)  # shares of the way

SWING, AXIS = np.radians(110.0), normalise(np.array((0.0, 0.97, 0.24)))
"""From the first pose to the last, about the line of sight and a little towards it."""

UPRIGHT = normalise(np.array((1.0, -1.0, 0.0, 0.0)))  # the bit points down, and the grip away from who looks
SIDEWAYS = normalise(np.array((1.0, 0.0, 0.0, 1.0)))  # the grip to the left


def shown() -> dict[str, Poses]:
    """Return the poses at `MOMENTS` by mode; the tip is at the origin in the first and the last."""
    keys = held_by(TIP, np.zeros((2, 3)), chain(about(AXIS, np.array((-0.5, 0.5)) * SWING), SIDEWAYS, UPRIGHT))
    return {mode: interpolate([0.0, 1.0], keys, MOMENTS, mode) for mode in ENGINES}


def figures() -> dict[str, float]:
    """Return how far the tip gets from where it rests, at most, by mode."""
    return {mode: _off(poses).max() for mode, poses in shown().items()}


def _off(poses: Poses) -> np.ndarray:
    """Return how far the tip has left the point that it rests on, shape (7,)."""
    return np.linalg.norm(poses.positions + rotate(poses.quaternions, TIP), axis=-1)


def build() -> bpy.types.Scene:
    """Return the figure as a scene."""
    sheet = Sheet(1000, 1.56)
    mesh, ghost = load_subject("drill"), surface("Pivoting about the tip", DARK.ghost, alpha=0.35)
    columns = np.linspace(-0.378, 0.345, len(MOMENTS)) * sheet.aspect
    sheet.words("Interpolation algorithms", sheet.left, 0.5 - 0.058, 9.0)
    result = shown()
    for row, (mode, title) in enumerate(ENGINES.items()):
        foot, poses = 0.5 - 0.300 - row * 0.286, result[mode]
        paint = surface(f"Mode {mode}", colour_of(mode))
        sheet.card(0.0, foot + 0.222, 2.0 * -sheet.left, 0.0016, RULE)
        sheet.words(f"{title}: {MODES[mode].label}", sheet.left, foot + 0.193, 7.0)
        turned = np.degrees(angle_between(poses.quaternions[:1], poses.quaternions))
        for column, (x, off, angle) in enumerate(zip(columns, _off(poses), turned, strict=True)):
            place = sheet.place(x, foot + 0.028)
            sheet.solid(f"{mode} {column}", mesh, _moved(poses[column], place), paint, whole=False)
            if off > 1e-4:
                rest = _moved(result["dq_sclerp"][column], place)
                sheet.solid(f"{mode} {column} truth", mesh, rest, ghost, whole=True)
            _mark(sheet, place)
            sheet.words(f"{1e3 * off:.0f} mm", x, foot - 0.025, 6.0, INK, "CENTER")
            sheet.words(f"{angle:.1f}°", x, foot - 0.051, 6.0, FAINT, "CENTER")
    for x, moment in zip(columns, MOMENTS, strict=True):
        sheet.words(f"{moment:.0%}", x, -0.5 + 0.052, 6.0, FAINT, "CENTER")
    legend = "of the way. Cross: where the tip rests; mm: how far off it is; pale: a turn about it"
    sheet.words(legend, sheet.left, -0.5 + 0.018, 6.0, FAINT)
    return sheet.scene


def _moved(pose: Poses, place: np.ndarray) -> Poses:
    return Poses(pose.positions + place, pose.quaternions)


def _mark(sheet: Sheet, place: np.ndarray) -> None:
    """Draw a cross at a place, in front of what stands there."""
    bars = 0.010 * np.array((((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), ((0.0, 0.0, -1.0), (0.0, 0.0, 1.0))))
    sheet.lines("Rest", bars + place + (0.0, -0.3, 0.1), 0.0016, "#C1121F")
