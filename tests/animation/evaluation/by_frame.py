"""Sources to test with, and what their channels are to have on one frame, worked out from 4 x 4 matrices by SciPy.

Every channel is a list of keys, (frame, value), with one interpolation throughout.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

from rigid_motion.animation.evaluation.components import LOCATION, PART_OF, REST, ROTATION, ROWS, SCALE
from rigid_motion.animation.evaluation.differences import channel_differences
from rigid_motion.animation.evaluation.sources import Source
from rigid_motion.animation.evaluation.spans import spans
from rigid_motion.animation.fcurves.keys import CODE, INTERPOLATIONS, Keys

Track = Sequence[tuple[float, float]]

CODES = {name: code for code, name in INTERPOLATIONS.items()}
EASE = {"LINEAR": lambda u: u, "QUAD": lambda u: u * u, "CUBIC": lambda u: u**3}
SCREW = 2
"""The number of the mode "dq_sclerp"."""


def keys_of(track: Track, interpolation: str = "LINEAR", **others: object) -> Keys:
    points = np.array(track, np.float32)[None]
    eased = interpolation not in ("LINEAR", "CONSTANT")
    easing = {"easing": np.zeros(points.shape[:2], CODE), "easing_settings": np.zeros((3, *points.shape[:2]))}
    codes = np.full(points.shape[:2], CODES[interpolation], CODE)
    return Keys(points, codes, **(easing if eased else {}), **others)


def source_of(
    tracks: dict[int, Track], order: str | None = None, interpolation: str = "LINEAR", **others: object
) -> Source:
    """A source with a channel for each row, which goes on in a straight line, or round, if so given."""
    of_keys = {name: others.pop(name) for name in ("linear", "cycles") if name in others}
    channels = tuple(([row], keys_of(track, interpolation, **of_keys)) for row, track in tracks.items())
    keyed = frozenset(PART_OF[row] for row in tracks)
    return Source(order, keyed, channels, **{"rest": {}, "original": REST.copy(), "mode": SCREW, **others})


def tracks_of(part: str, frames: Iterable[float], rows: np.ndarray) -> dict[int, Track]:
    """Tracks of all components of a part, from values (., n)."""
    frames = list(frames)
    return {ROWS[part].start + row: list(zip(frames, values, strict=True)) for row, values in enumerate(rows.tolist())}


def value(track: Track, frame: float, interpolation: str = "LINEAR") -> float:
    """What Blender's own in-between is, straight on outside of the keys."""
    index = segment([at for at, _ in track], frame)
    (first, begin), (last, end) = track[index : index + 2]
    return begin + (end - begin) * EASE[interpolation]((frame - first) / (last - first))


def segment(keys: Sequence[float], frame: float) -> int:
    return min(max(int(np.searchsorted(keys, frame)) - 1, 0), len(keys) - 2)


def turned(rows: Sequence[float], order: str | None) -> Rotation:
    """The rotation that channels (4,) make."""
    if order is None:
        return Rotation.from_quat(np.roll(rows, -1))
    if order == "AXIS_ANGLE":
        length = np.linalg.norm(rows[1:])
        return Rotation.from_rotvec(rows[0] * np.asarray(rows[1:]) / length if length else np.zeros(3))
    return Rotation.from_euler(order.lower(), [rows["XYZ".index(axis)] for axis in order])


def matrix(location: Sequence[float], rotation: Rotation) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation.as_matrix(), location
    return result


def screwed(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """The screw motion from one pose to another."""
    return first @ expm(share * logm(np.linalg.inv(first) @ second).real)


def share(
    tracks: Iterable[Track], order: str | None, rows: Iterable[int], ends: tuple[float, float], now: dict
) -> float:
    """The share of the chord over channels, whose values on this frame are given by their rows."""
    done = whole = 0.0
    for row, track in zip(rows, tracks, strict=True):
        weight = 4.0 if order is None and PART_OF[row] == ROTATION else 1.0
        begin, end = (dict(track)[at] for at in ends)
        done += weight * (end - begin) * (now[row] - begin)
        whole += weight * (end - begin) ** 2
    return done / whole if whole else 0.0


def pose_of(rows: np.ndarray, order: str | None, original: np.ndarray = REST) -> np.ndarray:
    """The matrix of channels (10,) after the object's own delta transforms."""
    own = Rotation.from_quat(np.roll(original[ROWS[ROTATION]], -1))
    return matrix(rows[ROWS[LOCATION]] + original[ROWS[LOCATION]], own * turned(rows[ROWS[ROTATION]], order))


def inside(source: Source, count: int = 23) -> np.ndarray:
    """Frames inside of all spans."""
    steps = np.arange(1, count) / count
    return np.unique(np.concatenate([span.first + (span.last - span.first) * steps for span in spans(source)]))


def channels(source: Source, frames: np.ndarray) -> np.ndarray:
    """The values that channels are to have, (10, m)."""
    ((difference, native),) = channel_differences([source], [frames])
    unfilled = [row for row in range(10) if row not in source.filled_rows]
    assert not difference[unfilled].any()
    assert SCALE in source.keyed or not difference[ROWS[SCALE]].any()
    return difference + native
