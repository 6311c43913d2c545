"""Drawing with Matplotlib: pictures for the paper, as wide as its column, and for the extension's page."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.scenes.layout import project
from rigid_motion_batch.scenes.subject import load_subject, tinted_slots, vertices_of

WIDTH_PX, DOTS_PER_INCH = 1004, 300  # pixels of a column of 8.5 cm
INK, FAINT, RULE = "#1B2026", "#58626E", "#C9CFD6"

LIGHT_DIRECTION, AMBIENT_RATIO = np.array((-0.42, 0.60, -0.68)), 0.5
"""The direction towards the light: right, up, and away from the viewer; and the ambient fraction of light."""

MODEL_PIXELS_PER_PIXEL, POINT_SPACING_PX = (
    2,
    0.6,
)  # pixels of a model per pixel of the picture, each way, and the spacing of the model's points


def picture(width: int, height: int, ground: str = "none", dots_per_inch: int = 100) -> Axes:
    """Return the axes of a picture of this size in pixels; the units are its height, with 0 in the middle."""
    figure = Figure((width / dots_per_inch, height / dots_per_inch), dpi=dots_per_inch, facecolor=ground)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-0.5 * width / height, 0.5 * width / height), ylim=(-0.5, 0.5))
    axes.set_axis_off()
    return axes


def column(height: int) -> Axes:
    """Return a white picture as wide as a column."""
    return picture(WIDTH_PX, height, "#FFFFFF", DOTS_PER_INCH)


def save(axes: Axes, path: Path) -> None:
    """Write a picture, without metadata about the software."""
    axes.figure.savefig(path, dpi="figure", facecolor=axes.figure.get_facecolor(), metadata={"Software": None})


def seen(points: np.ndarray, place: ArrayLike, metres: float) -> np.ndarray:
    """Return where points (..., 3) in metres appear in a picture whose height spans `metres`: shape (..., 2)."""
    return project(points)[..., :2] / metres + place


@dataclass(frozen=True, eq=False)
class Model:
    """The surface of a model: triangles (t, 3, 3) in metres, colours (t, 3), and whether each has the mode's colour."""

    triangles: np.ndarray
    colours: np.ndarray
    tinted: np.ndarray

    @classmethod
    def of(cls, subject: str) -> Model:
        """Return the model of a subject, named as in `load_subject`."""
        mesh = load_subject(subject)
        mesh.calc_loop_triangles()
        slots = np.array([triangle.material_index for triangle in mesh.loop_triangles])
        colours = np.array([material.diffuse_color[:3] for material in mesh.materials]) ** (1.0 / 2.2)
        corners = vertices_of(mesh)[[triangle.vertices[:] for triangle in mesh.loop_triangles]]
        return cls(corners, colours[slots], np.isin(slots, tinted_slots(mesh)))

    def draw(self, axes: Axes, pose: Poses, place: ArrayLike, metres: float, colour: str, *, whole: bool) -> None:
        """Draw the model at a pose, shape (), with its tinted parts or the whole of it in `colour`."""
        corners = project(rotate(pose.quaternions, self.triangles) + pose.positions) / metres
        # Right, up, away is a left-handed system.
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 0])
        facing = normals[:, 2] < 0.0
        corners, normals = corners[facing], normals[facing] / np.linalg.norm(normals[facing], axis=1, keepdims=True)
        bright = AMBIENT_RATIO + (1.0 - AMBIENT_RATIO) * np.clip(normals @ LIGHT_DIRECTION, 0.0, 1.0)
        colours = np.where((self.tinted | whole)[:, None], to_rgb(colour), self.colours)[facing] * bright[:, None]
        pixel = 1.0 / (MODEL_PIXELS_PER_PIXEL * axes.bbox.height)
        sizes = np.ptp(corners[..., :2], axis=1).max(axis=1)
        halvings = np.ceil(np.log2(sizes / (POINT_SPACING_PX * pixel))).clip(0.0).astype(int)
        parts = [(centroids(times) @ corners[halvings == times], halvings == times) for times in set(halvings.tolist())]
        points = np.concatenate([pieces.reshape(-1, 3) for pieces, _ in parts])
        colours = np.concatenate([np.repeat(colours[cut], pieces.shape[1], axis=0) for pieces, cut in parts])
        # In each pixel, the nearest part of a triangle is visible.
        order = np.argsort(-points[:, 2])
        cells = np.rint(points[order, :2] / pixel).astype(int)
        low, high = cells.min(axis=0), cells.max(axis=0) + 1
        image = np.zeros((*(high - low)[::-1], 4))
        image[tuple((cells - low).T[::-1])] = np.pad(colours[order], ((0, 0), (0, 1)), constant_values=1.0)
        left, foot, right, top = pixel * np.concatenate((low, high)) + np.tile(place, 2)
        axes.imshow(image, extent=(left, right, foot, top), origin="lower", aspect="auto")


@cache
def centroids(halvings: int) -> np.ndarray:
    """Return the centroids of a triangle's parts after halving its sides repeatedly, as weights of its corners."""
    parts = np.eye(3)[None]
    for _ in range(halvings):
        middles = 0.5 * (parts + np.roll(parts, -1, axis=1))
        parts = np.concatenate(
            [middles, *(np.stack((parts[:, i], middles[:, i], middles[:, i - 1]), 1) for i in range(3))]
        )
    return parts.mean(axis=1)


def write_legend(axes: Axes, entries: list[tuple[str, str]], x: float, y: float, points: float) -> None:
    """Write colour patches with labels in one line."""
    handles = [axes.fill([], [], color=colour, label=label)[0] for colour, label in entries]
    place = {"loc": "lower left", "bbox_to_anchor": (x, y), "bbox_transform": axes.transData, "borderaxespad": 0.0}
    axes.legend(
        handles=handles, ncols=len(entries), fontsize=points, frameon=False, handlelength=1.0, borderpad=0.0, **place
    )
