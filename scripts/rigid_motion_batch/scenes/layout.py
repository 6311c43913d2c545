"""Layout of the lanes in the picture, and what the camera frames. Uses only NumPy.

There are two spaces. The *stage* is Blender's world, in metres, z up; the camera looks along +y and down by
`ELEVATION_RAD`, with parallel rays, so every lane is seen from the same side. The *frame* is the picture: x right,
y up, 0 in the middle, in units of the picture's height. `Layout.metres` converts one to the other.

Deviations are the differences of a shown motion from the recording; small ones are magnified.
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
"""Minimum width and height of a card with letters of full size; on a smaller card all letters shrink."""

# Parts of a card's height taken by its texts:
CARD_HEAD_RATIO = 0.062  # the title
CARD_NAMES_RATIO = 0.052  # names below it, if there are any
CARD_FOOT_RATIO = 0.094  # the error
CARD_FINDING_RATIO = 0.042  # each finding above that

WRAP_GAIN = 0.85
"""A layout with fewer rows is preferred if it shows motion and letters at least this large relative to the best."""

DIRECTION_COUNT = 1024
"""Number of directions spread over the sphere (a spherical Fibonacci lattice, as in a sunflower)."""

SHOWN_RATIO = 2.5
"""An object is enlarged for display if its path is longer than this multiple of its size."""


@dataclass(frozen=True)
class Cell:
    """A lane's part of the frame: its card, with a title at the top, the motion, and the error at the bottom."""

    x: float
    y: float
    width: float
    height: float

    named: bool = False
    """True if there are names below the title."""

    found: int = 0
    """The number of findings above the error."""

    @property
    def unit(self) -> float:
        """The scale of its letters, at most 1."""
        return min(1.0, self.width / FULL_CARD_RATIOS[0], self.height / FULL_CARD_RATIOS[1])

    @property
    def head(self) -> float:
        """The height of the text at the top."""
        return self.unit * (CARD_HEAD_RATIO + CARD_NAMES_RATIO * self.named)

    @property
    def base(self) -> float:
        """The height of the text at the bottom."""
        return self.unit * (CARD_FOOT_RATIO + CARD_FINDING_RATIO * self.found)

    @property
    def view(self) -> np.ndarray:
        """The middle of the view, shape (2,)."""
        return np.array((self.x, self.y + (self.base - self.head) / 2.0))

    @property
    def room(self) -> np.ndarray:
        """The width and height available to the motion."""
        return np.array((self.width - self.unit * PADDING_RATIO, self.height - self.head - self.base))

    @property
    def left(self) -> float:
        return self.x - self.width / 2.0

    @property
    def foot(self) -> float:
        return self.y - self.height / 2.0


@dataclass(frozen=True)
class Layout:
    """The cells of all lanes, and the scale: the picture's height in metres."""

    cells: tuple[Cell, ...]
    metres: float
    aspect: float


def heading(points: np.ndarray) -> float:
    """Return the yaw in radians that aligns the longest horizontal extent of `points`, shape (n, 3), with the frame."""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    axis = np.linalg.eigh(flat.T @ flat)[1][:, 1]
    yaw = -np.arctan2(axis[1], axis[0])
    # The axis has no sign: choose the half turn that keeps the recording's own x pointing mostly right.
    return float(yaw - np.pi * np.round(yaw / np.pi))


def yaw_quaternion(yaw: float) -> np.ndarray:
    return np.array((np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)))


def outermost(points: np.ndarray) -> np.ndarray:
    """Return the few points, shape (m, 3), that reach farthest in any of many directions.

    They span all points up to a thousandth of the size, and are few enough to be transformed for every frame.
    """
    steps = np.arange(DIRECTION_COUNT) + 0.5
    height, turn = 1.0 - 2.0 * steps / DIRECTION_COUNT, np.pi * (1.0 + 5.0**0.5) * steps
    ring = np.sqrt(1.0 - height * height)
    spread = np.stack((ring * np.cos(turn), ring * np.sin(turn), height), axis=-1)
    return points[np.unique(np.concatenate([(points @ part.T).argmax(axis=0) for part in np.split(spread, 8)]))]


def swept_points(poses: Poses, points: np.ndarray) -> np.ndarray:
    """Return the object's points, shape (m, 3), moved by all poses: shape (n m, 3)."""
    arms = points[None] if poses.scales is None else points[None] * poses.scales[:, None, None]
    return (rotate(poses.quaternions[:, None], arms) + poses.positions[:, None]).reshape(-1, 3)


def telling_point(poses: Poses, points: np.ndarray) -> np.ndarray:
    """Return the point whose path is drawn, shape (3,): the tip of the object, if the tip moves.

    The tip is the point farthest from the origin. A tool that pivots about its tip is better shown by the point that
    travels farthest: that point is returned if it travels more than twice as far.
    """
    paths = swept_points(poses, points).reshape(len(poses), len(points), 3)
    travelled = np.linalg.norm(np.diff(paths, axis=0), axis=-1).sum(axis=0)
    tip, farthest = np.argmax(np.linalg.norm(points, axis=-1)), np.argmax(travelled)
    return points[farthest if travelled[farthest] > 2.0 * travelled[tip] else tip]


def display_scale(path: np.ndarray, size: float) -> float:
    """Return the factor that enlarges the object so that it stays visible on a path of shape (n, 3)."""
    extent = float(np.ptp(path, axis=0).max())
    return max(1.0, extent / (SHOWN_RATIO * size))


def project(points: np.ndarray) -> np.ndarray:
    """Return metres right, up and away from the camera, for points on the stage: shape (..., 3)."""
    return points @ np.stack((RIGHT_AXIS, UP_AXIS, AWAY_AXIS), axis=-1)


def unproject(seen: np.ndarray) -> np.ndarray:
    """Return points on the stage: the inverse of `project`."""
    return seen @ np.stack((RIGHT_AXIS, UP_AXIS, AWAY_AXIS))


def arrange(lanes: int, extent: np.ndarray, aspect: float, *, named: bool = False, found: int = 0) -> Layout:
    """Return cells in the fewest rows that show object and text well.

    Parameters
    ----------
    lanes : int
    extent : array, shape (2,)
        The width and height in metres that the motion needs in every cell. Positive.
    aspect : float
        The picture's width over its height.
    named : bool
        Whether there are names below the titles.
    found : int
        The number of findings above the errors.
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
"""Maximum displayed size of a magnified deviation, as a fraction of the object's size."""

MAGNIFICATION_STEPS = (1.0, 2.0, 5.0)
"""Magnifications are these, times a power of ten."""


def largest_deviation(shown: Poses, recording: Poses, outline: np.ndarray) -> float:
    """Return the largest distance of any of the object's points (m, 3) between two motions (n,), in metres."""
    apart = layout.swept_points(shown, outline) - layout.swept_points(recording, outline)
    return float(np.linalg.norm(apart, axis=-1).max())


def magnification(deviation: float, size: float) -> float:
    """Return a round factor by which deviations up to this one are magnified on an object of this size.

    1 if they are visible anyway.
    """
    most = MAX_MAGNIFIED_RATIO * size / deviation if deviation > 1e-6 * size else 1.0
    power = 10.0 ** np.floor(np.log10(max(most, 1.0)))
    return float(max(step * power for step in MAGNIFICATION_STEPS if step * power <= max(most, 1.0)))


def magnified(shown: Poses, recording: Poses, factor: float, middle: np.ndarray) -> Poses:
    """Return poses (n,) with the deviation from the recording magnified: of the object's centre `middle` and rotation.

    Each point of the object is displaced by about `factor` times its deviation (large rotations bend this). No rotation
    is magnified beyond half a turn.
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
