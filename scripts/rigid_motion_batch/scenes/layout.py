"""Layout: where the lanes stand and what the camera frames, in NumPy alone.

Two spaces. The *stage* is Blender's world, in metres, z up; the camera looks along +y and down by `ELEVATION_RAD`,
through parallel rays, so every lane is seen from the same side. The *frame* is what it sees: x right, y up, 0 in the
middle, in units of the picture's height. `Layout.metres` leads from one to the other.

Deviations are by how much what is shown is off from the recording, and are drawn larger where they are small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply, rotate
from rigid_motion.motion.twists import between, exponential

from . import layout

ELEVATION_RAD = np.radians(20.0)
RIGHT_AXIS = np.array((1.0, 0.0, 0.0))
UP_AXIS = np.array((0.0, np.sin(ELEVATION_RAD), np.cos(ELEVATION_RAD)))
AWAY_AXIS = np.array((0.0, np.cos(ELEVATION_RAD), -np.sin(ELEVATION_RAD)))

MARGIN_RATIO = 0.022
HEADER_RATIO = 0.066
FOOTER_RATIO = 0.045
GAP_RATIO = 0.014
PADDING_RATIO = 0.028
FULL_CARD_RATIOS = (0.42, 0.3)
"""The width and height of a card on which letters have their full size; on a smaller one all of them are smaller."""

# The parts of a card's height that are taken by what is written on it:
CARD_HEAD_RATIO = 0.062  # the title
CARD_NAMES_RATIO = 0.052  # names below it, if there are any
CARD_FOOT_RATIO = 0.094  # the error
CARD_FINDING_RATIO = 0.042  # each finding above that

WRAP_GAIN = 0.85
"""A layout of fewer rows is kept while it shows motion and letters so large relative to the best."""

DIRECTION_COUNT = 1024
"""Spread over the sphere as on a sunflower (a spherical Fibonacci lattice)."""

SHOWN_RATIO = 2.5
"""A path longer than so many times the object makes the object grow for display."""


@dataclass(frozen=True)
class Cell:
    """One lane's part of the frame: its card, with a title at the top, the motion, and the error at the foot."""

    x: float
    y: float
    width: float
    height: float

    named: bool = False
    """True if there are names below the title."""

    found: int = 0
    """How many findings there are above the error."""

    @property
    def unit(self) -> float:
        """The size of its letters, 1 at most."""
        return min(1.0, self.width / FULL_CARD_RATIOS[0], self.height / FULL_CARD_RATIOS[1])

    @property
    def head(self) -> float:
        """The height of what is written at the top."""
        return self.unit * (CARD_HEAD_RATIO + CARD_NAMES_RATIO * self.named)

    @property
    def base(self) -> float:
        """The height of what is written at the foot."""
        return self.unit * (CARD_FOOT_RATIO + CARD_FINDING_RATIO * self.found)

    @property
    def view(self) -> np.ndarray:
        """The middle of the view, shape (2,)."""
        return np.array((self.x, self.y + (self.base - self.head) / 2.0))

    @property
    def room(self) -> np.ndarray:
        """The width and height that the motion may fill."""
        return np.array((self.width - self.unit * PADDING_RATIO, self.height - self.head - self.base))

    @property
    def left(self) -> float:
        return self.x - self.width / 2.0

    @property
    def foot(self) -> float:
        return self.y - self.height / 2.0


@dataclass(frozen=True)
class Layout:
    """The cells of all lanes, and the scale: how many metres the picture's height spans."""

    cells: tuple[Cell, ...]
    metres: float
    aspect: float


def heading(points: np.ndarray) -> float:
    """Return the yaw in radians that brings the longest horizontal extent of `points`, shape (n, 3),
    across the frame.
    """
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    axis = np.linalg.eigh(flat.T @ flat)[1][:, 1]
    yaw = -np.arctan2(axis[1], axis[0])
    # The axis has no sign. The half turn that keeps most of the recording's own x pointing right is taken.
    return float(yaw - np.pi * np.round(yaw / np.pi))


def yaw_quaternion(yaw: float) -> np.ndarray:
    return np.array((np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)))


def outermost(points: np.ndarray) -> np.ndarray:
    """Return the few points, shape (m, 3), that reach furthest in any of many directions.

    They span what all points span, but for a thousandth of their size, and are few enough to be followed through
    every frame.
    """
    steps = np.arange(DIRECTION_COUNT) + 0.5
    height, turn = 1.0 - 2.0 * steps / DIRECTION_COUNT, np.pi * (1.0 + 5.0**0.5) * steps
    ring = np.sqrt(1.0 - height * height)
    spread = np.stack((ring * np.cos(turn), ring * np.sin(turn), height), axis=-1)
    return points[np.unique(np.concatenate([(points @ part.T).argmax(axis=0) for part in np.split(spread, 8)]))]


def swept_points(poses: Poses, points: np.ndarray) -> np.ndarray:
    """Return where the object's points, shape (m, 3), come to be: shape (n m, 3)."""
    arms = points[None] if poses.scales is None else points[None] * poses.scales[:, None, None]
    return (rotate(poses.quaternions[:, None], arms) + poses.positions[:, None]).reshape(-1, 3)


def telling_point(poses: Poses, points: np.ndarray) -> np.ndarray:
    """Return the point whose path is drawn, shape (3,): the tip of the object, where that moves.

    The tip is the point furthest from the origin. A tool that pivots about it is better shown by another point: the
    one that travels furthest, if that is more than twice as far.
    """
    paths = swept_points(poses, points).reshape(len(poses), len(points), 3)
    travelled = np.linalg.norm(np.diff(paths, axis=0), axis=-1).sum(axis=0)
    tip, farthest = np.argmax(np.linalg.norm(points, axis=-1)), np.argmax(travelled)
    return points[farthest if travelled[farthest] > 2.0 * travelled[tip] else tip]


def display_scale(path: np.ndarray, size: float) -> float:
    """Return how much larger than it is the object is shown, so that it stays visible on a path of shape (n, 3)."""
    extent = float(np.ptp(path, axis=0).max())
    return max(1.0, extent / (SHOWN_RATIO * size))


def project(points: np.ndarray) -> np.ndarray:
    """Return metres right and up in the frame, and away from the camera, of points on the stage: shape (..., 3)."""
    return points @ np.stack((RIGHT_AXIS, UP_AXIS, AWAY_AXIS), axis=-1)


def unproject(seen: np.ndarray) -> np.ndarray:
    """Return the points on the stage that `project` takes to these."""
    return seen @ np.stack((RIGHT_AXIS, UP_AXIS, AWAY_AXIS))


def arrange(lanes: int, extent: np.ndarray, aspect: float, *, named: bool = False, found: int = 0) -> Layout:
    """Return cells in as few rows as show the object, and what is written, well.

    Parameters
    ----------
    lanes : int
    extent : array, shape (2,)
        The width and height in metres that the motion needs in every cell. Above zero.
    aspect : float
        The picture's width over its height.
    named : bool
        Whether there are names below the titles.
    found : int
        How many findings there are above the errors.
    """
    candidates = [_arranged(lanes, rows, extent, aspect, named, found) for rows in range(1, lanes + 1)]
    sizes = [candidate.cells[0].unit / candidate.metres for candidate in candidates]
    return next(candidate for candidate, size in zip(candidates, sizes, strict=True) if size >= WRAP_GAIN * max(sizes))


def _arranged(lanes: int, rows: int, extent: np.ndarray, aspect: float, named: bool, found: int) -> Layout:
    columns = -(-lanes // rows)
    width = (aspect - 2.0 * MARGIN_RATIO - (columns - 1) * GAP_RATIO) / columns
    height = (1.0 - HEADER_RATIO - FOOTER_RATIO - 2.0 * MARGIN_RATIO - (rows - 1) * GAP_RATIO) / rows
    left, top = -aspect / 2.0 + MARGIN_RATIO, 0.5 - MARGIN_RATIO - HEADER_RATIO
    cells = tuple(
        Cell(
            left + width / 2.0 + (lane % columns) * (width + GAP_RATIO),
            top - height / 2.0 - (lane // columns) * (height + GAP_RATIO),
            width,
            height,
            named,
            found,
        )
        for lane in range(lanes)
    )
    return Layout(cells, float((extent / cells[0].room).max()), aspect)


MAX_MAGNIFIED_RATIO = 0.25
"""The most of the object's size that the largest deviation is shown at, where it is magnified."""

MAGNIFICATION_STEPS = (1.0, 2.0, 5.0)
"""Magnifications are these, times a power of ten."""


def largest_deviation(shown: Poses, recording: Poses, outline: np.ndarray) -> float:
    """Return the farthest that any of the points (m, 3) of the object is off between poses (n,), in metres."""
    apart = layout.swept_points(shown, outline) - layout.swept_points(recording, outline)
    return float(np.linalg.norm(apart, axis=-1).max())


def magnification(deviation: float, size: float) -> float:
    """Return how many times larger deviations up to this are shown on an object of this size;
    1 where they are seen anyway.

    A round number.
    """
    most = MAX_MAGNIFIED_RATIO * size / deviation if deviation > 1e-6 * size else 1.0
    power = 10.0 ** np.floor(np.log10(max(most, 1.0)))
    return float(max(step * power for step in MAGNIFICATION_STEPS if step * power <= max(most, 1.0)))


def magnified(shown: Poses, recording: Poses, factor: float, middle: np.ndarray) -> Poses:
    """Return poses (n,) so many times as far off from the recording: the middle, shape (3,), of the object,
    and the turn.

    A point of the object is displaced by the factor times what it is, but for what large turns bend; no turn is
    magnified beyond half a turn.
    """
    if factor == 1.0:
        return shown
    places, truth = (layout.swept_points(poses, middle[None]) for poses in (shown, recording))
    still = np.zeros_like(places)
    turns = between(still, recording.quaternions, still, shown.quaternions)
    angles = np.maximum(np.linalg.norm(turns, axis=0), 1e-12)
    turns *= np.minimum(factor, np.maximum(angles, np.pi) / angles)
    quaternions = multiply(recording.quaternions, exponential(turns)[0].T)
    places = truth + factor * (places - truth)
    arms = np.tile(middle, (len(places), 1)) * (1.0 if shown.scales is None else shown.scales[:, None])
    return Poses(places - rotate(quaternions, arms), quaternions, shown.scales)
