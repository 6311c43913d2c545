"""The figure "LERP and SLERP of multivectors": a triangle between two extreme poses, interpolated both ways.

LERP of motors is `pga_lerp`, SLERP `pga_slerp`. Twenty in-betweens are evenly spaced, and the maximum distance between
the two ways is measured. Metres; the triangle is about one metre large.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb

from research.drawing import FAINT, INK, column, seen, write_legend
from rigid_motion.motion import MODES, Poses, interpolate, measure
from rigid_motion.motion.quaternions import angle_between, normalise, rotate

IN_BETWEENS = 20

ENGINES = {"lerp": "pga_lerp", "slerp": "pga_slerp"}
"""The paper's names, and the corresponding modes."""

COLOURS = {"lerp": "#FFD60A", "slerp": "#1FA63A"}  # of the paper's figure: yellow and green

TRIANGLE_M = np.array(((-0.30, 0.0, -0.36), (0.40, 0.0, -0.26), (-0.08, 0.0, 0.46)))
"""The corners in the body's own axes, shape (3, 3)."""

TURN, AXIS = np.radians(150.0), normalise(np.array((-0.45, 0.85, 0.20)))  # of the second pose: an extreme rotation

EXTREMES = Poses(
    [(-1.85, 0.0, -0.60), (1.65, 0.0, -0.30)],
    normalise(np.array([(1.0, 0.0, 0.0, 0.0), (np.cos(TURN / 2), *np.sin(TURN / 2) * AXIS)])),
)

WAY_RATIOS = np.arange(1, IN_BETWEENS + 1) / (IN_BETWEENS + 1.0)  # fractions of the way, without the ends


def in_betweens(shares: np.ndarray = WAY_RATIOS) -> dict[str, Poses]:
    """Return the poses of both engines at fractions of the way (n,)."""
    return {name: interpolate([0.0, 1.0], EXTREMES, shares, mode) for name, mode in ENGINES.items()}


def figures() -> dict[str, float]:
    """Return the figure in numbers: degrees per step of LERP and SLERP, and their maximum distance."""
    poses, first = in_betweens(), EXTREMES.quaternions[:1]
    steps = {
        name: np.diff(np.degrees(angle_between(first, np.concatenate((first, of_kind.quaternions)))))
        for name, of_kind in poses.items()
    }
    apart = measure(WAY_RATIOS, poses["lerp"], poses["slerp"])
    return {
        "in_betweens": IN_BETWEENS,
        "slerp_step": steps["slerp"][0],
        "lerp_first_step": steps["lerp"][0],
        "lerp_largest_step": steps["lerp"].max(),
        "apart": apart.position.max(),
        "apart_degrees": np.degrees(apart.rotation.max()),
    }


def draw() -> Axes:
    """Draw the figure."""
    axes = column(620)
    left = axes.get_xlim()[0] + 0.026

    def corners(poses: Poses) -> np.ndarray:
        points = poses.positions[:, None] + rotate(poses.quaternions[:, None], TRIANGLE_M[None])
        return seen(points, (0.0, 0.02), 3.1)

    fine = in_betweens(np.linspace(0.0, 1.0, 200))
    axes.add_collection(PolyCollection(corners(EXTREMES), facecolors="#B9C0C8", edgecolors=INK, linewidths=1.2))
    for name, poses in in_betweens().items():
        faces = {"facecolors": (*to_rgb(COLOURS[name]), 0.06), "edgecolors": COLOURS[name], "linewidths": 0.5}
        axes.add_collection(PolyCollection(corners(poses), **faces))
        axes.add_collection(LineCollection(corners(fine[name]).swapaxes(0, 1), colors=COLOURS[name], linewidths=0.35))
    axes.text(left, 0.405, "LERP and SLERP of multivectors", fontsize=8.5, color=INK)
    entries = [(COLOURS[name], f"{name.upper()}: {MODES[mode].label}") for name, mode in ENGINES.items()]
    write_legend(axes, entries, left, -0.38, 6.5)
    text = f"{IN_BETWEENS} in-betweens at even steps, {np.degrees(TURN):.0f}° from the first to the last"
    axes.text(left, -0.45, text, fontsize=6.5, color=FAINT)
    return axes
