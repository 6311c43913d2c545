"""The figure "interpolation algorithms": the drill at the same moments with the paper's three engines, in strips.

The tool rotates about its resting tip, as an instrument in an incision; the receiver has only the first and the last
pose. Metres.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from research.drawing import FAINT, INK, RULE, Model, column
from research.making.motions import BIT_TIP_M, about, chain, held_by
from rigid_motion.motion import MODES, Poses, interpolate
from rigid_motion.motion.quaternions import angle_between, normalise, rotate
from rigid_motion_batch.palette import DARK, colour_of

ENGINES = {"lerp_slerp": "State of the art", "dq_sclerp": "Dual quaternions", "pga_lerp": "Multivectors"}
"""Mode id to the paper's name."""

SHOWN_MOMENTS = np.linspace(0.0, 1.0, 7)  # fractions of the motion

SWING, AXIS = np.radians(110.0), normalise(np.array((0.0, 0.97, 0.24)))
"""The rotation from the first pose to the last: about the line of sight, tilted a little towards it."""

UPRIGHT = normalise(np.array((1.0, -1.0, 0.0, 0.0)))  # the bit points down, and the grip away from the viewer
SIDEWAYS = normalise(np.array((1.0, 0.0, 0.0, 1.0)))  # the grip points left

HEIGHT_M = 1.56  # metres spanned by the picture's height


def shown() -> dict[str, Poses]:
    """Return the poses at `SHOWN_MOMENTS` by mode; in the first and last pose the tip is at the origin."""
    keys = held_by(BIT_TIP_M, np.zeros((2, 3)), chain(about(AXIS, np.array((-0.5, 0.5)) * SWING), SIDEWAYS, UPRIGHT))
    return {mode: interpolate([0.0, 1.0], keys, SHOWN_MOMENTS, mode) for mode in ENGINES}


def figures() -> dict[str, float]:
    """Return the tip's maximum distance from its resting point, by mode."""
    return {mode: np.linalg.norm(tips(poses), axis=1).max() for mode, poses in shown().items()}


def tips(poses: Poses) -> np.ndarray:
    """Return the tip's displacement from its resting point, shape (7, 3)."""
    return poses.positions + rotate(poses.quaternions, BIT_TIP_M)


def draw() -> Axes:
    """Draw the figure."""
    axes, drill, result = column(1000), Model.of("drill"), shown()
    left, columns = axes.get_xlim()[0] + 0.016, np.linspace(-0.378, 0.345, len(SHOWN_MOMENTS))
    axes.text(left, 0.442, "Interpolation algorithms", fontsize=8.5, color=INK)
    for row, (mode, title) in enumerate(ENGINES.items()):
        foot, poses = 0.2 - row * 0.286, result[mode]
        axes.axhline(foot + 0.222, 0.016, 0.984, color=RULE, linewidth=0.5)
        axes.text(left, foot + 0.190, f"{title}: {MODES[mode].label}", fontsize=6.5, color=INK)
        turned = np.degrees(angle_between(poses.quaternions[:1], poses.quaternions))
        for moment, (x, tip, angle) in enumerate(zip(columns, tips(poses), turned, strict=True)):
            place, off = (x, foot + 0.028), np.linalg.norm(tip)
            if off > 1e-4:
                drill.draw(axes, result["dq_sclerp"][moment], place, HEIGHT_M, DARK.ghost, whole=True)
            drill.draw(axes, poses[moment], place, HEIGHT_M, colour_of(mode), whole=False)
            axes.plot(*place, "+", color="#C1121F", markersize=4, markeredgewidth=0.7)
            axes.text(x, foot - 0.027, f"{1e3 * off:.0f} mm", fontsize=6, color=INK, ha="center")
            axes.text(x, foot - 0.053, f"{angle:.1f}°", fontsize=6, color=FAINT, ha="center")
    for x, moment in zip(columns, SHOWN_MOMENTS, strict=True):
        axes.text(x, -0.453, f"{moment:.0%}", fontsize=6, color=FAINT, ha="center")
    legend = "of the way. Cross: the tip's place; mm: how far it is off; pale: turned about it"
    axes.text(left, -0.486, legend, fontsize=6, color=FAINT)
    return axes
