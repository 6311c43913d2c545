"""The figure "interpolation algorithms": the drill at the same moments under the paper's three engines, in strips.

The tool turns about its tip, which rests where it is, as an instrument does in an opening; the receiver has the first
pose and the last. Metres.
"""

from __future__ import annotations

import bpy
import numpy as np

from research.making.motions import TIP
from rigid_motion.motion import MODES, Poses, interpolate
from rigid_motion.motion.quaternions import angle_between, multiply, normalise, rotate
from rigid_motion_batch.palette import DARK, colour_of
from rigid_motion_batch.scenes.materials import surface
from rigid_motion_batch.scenes.subject import load_subject

from .picture import FAINT, INK, RULE, Sheet

ENGINES = {
    "lerp_slerp": "State of the art",
    "dq_sclerp": "Dual quaternions",
    "pga_lerp": "Multivectors",
}
"""Mode id to what the paper calls it."""

MOMENTS = np.linspace(0.0, 1.0, 7)
"""Shares of the way."""

SWING = np.radians(110.0)
"""From the first pose to the last, about the line of sight and a little towards it."""

AXIS = np.array((0.0, 0.97, 0.24))

UPRIGHT = normalise(np.array((1.0, -1.0, 0.0, 0.0)))
"""The bit points down, and the grip away from who looks."""

SIDEWAYS = normalise(np.array((1.0, 0.0, 0.0, 1.0)))
"""The grip to the left."""


def keys() -> Poses:
    """The first pose and the last: the tip is at the origin in both."""
    swings = np.array((-0.5, 0.5)) * SWING
    axis = AXIS / np.linalg.norm(AXIS)
    turns = np.stack((np.cos(swings / 2.0), *(np.sin(swings / 2.0) * axis[:, None])), axis=-1)
    quaternions = multiply(turns, np.broadcast_to(multiply(SIDEWAYS, UPRIGHT), turns.shape))
    return Poses(-rotate(quaternions, np.broadcast_to(TIP, (2, 3))), quaternions)


def shown() -> dict[str, Poses]:
    """Mode id to the poses at `MOMENTS`."""
    return {mode: interpolate([0.0, 1.0], keys(), MOMENTS, mode) for mode in ENGINES}


def instants() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return by mode, at `MOMENTS`, degrees turned and how far the tip has left the point that it rests on, (7,)."""
    start, result = keys().quaternions[:1], {}
    for mode, poses in shown().items():
        turned = np.degrees(angle_between(np.broadcast_to(start, poses.quaternions.shape), poses.quaternions))
        tips = poses.positions + rotate(poses.quaternions, np.broadcast_to(TIP, (len(poses), 3)))
        result[mode] = turned, np.linalg.norm(tips, axis=-1)
    return result


def figures() -> dict[str, float]:
    """Return how far the tip gets from where it rests, at most, by mode."""
    return {mode: off.max() for mode, (_, off) in instants().items()}


def build() -> bpy.types.Scene:
    """The figure as a scene."""
    sheet = Sheet(1000, 1.56)
    mesh = load_subject("drill")
    ghost = surface("Pivoting about the tip", DARK.ghost, alpha=0.35)
    rest = interpolate([0.0, 1.0], keys(), MOMENTS, "dq_sclerp")
    numbers = instants()
    columns = np.linspace(-0.378, 0.345, len(MOMENTS)) * sheet.aspect
    pitch = 0.286
    sheet.words("Interpolation algorithms", sheet.left, 0.5 - 0.058, 9.0)
    for row, (mode, title) in enumerate(ENGINES.items()):
        foot = 0.5 - 0.300 - row * pitch
        paint = surface(f"Mode {mode}", colour_of(mode))
        sheet.card(0.0, foot + 0.222, 2.0 * -sheet.left, 0.0016, RULE)
        sheet.words(f"{title}: {MODES[mode].label}", sheet.left, foot + 0.193, 7.0)
        for column, x in enumerate(columns):
            place = sheet.place(x, foot + 0.028)
            pose, (turned, off) = shown()[mode][column], (of_moments[column] for of_moments in numbers[mode])
            sheet.solid(f"{mode} {column}", mesh, place, pose, paint, whole=False)
            if off > 1e-4:
                sheet.solid(f"{mode} {column} truth", mesh, place, rest[column], ghost, whole=True)
            _mark(sheet, place)
            sheet.words(f"{1e3 * off:.0f} mm", x, foot - 0.025, 6.0, INK, "CENTER")
            sheet.words(f"{turned:.1f}°", x, foot - 0.051, 6.0, FAINT, "CENTER")
    for x, moment in zip(columns, MOMENTS, strict=True):
        sheet.words(f"{moment:.0%}", x, -0.5 + 0.052, 6.0, FAINT, "CENTER")
    sheet.words(
        "of the way. Cross: where the tip rests; mm: how far off it is; pale: a turn about it",
        sheet.left,
        -0.5 + 0.018,
        6.0,
        FAINT,
    )
    return sheet.scene


def _mark(sheet: Sheet, place: np.ndarray) -> None:
    """A cross at a place, in front of what stands there."""
    arm = 0.010
    towards = np.array((0.0, -0.3, 0.1))
    bars = np.array((((-arm, 0.0, 0.0), (arm, 0.0, 0.0)), ((0.0, 0.0, -arm), (0.0, 0.0, arm)))) + place + towards
    sheet.lines("Rest", bars, 0.0016, "#C1121F")
