"""Compact clip data for the viewer: quantized integers, stored as differences over time, gzipped, in base64.

An array of shape (rows, n) is described by `[offset, rows, n, step, width]`: where its bytes begin in the block, the
value of one unit, and the bytes per number. Each row holds the first number and then differences, modulo the width;
the lowest bytes of all numbers come first, then the next ones, which compresses better. `viewer/data.js` reads it.

Units: metres from the centre of the recording, radians, seconds from the clip's first sample; z is up. For a single
body, a mode's deviation from the recording is a difference of positions and a rotation vector in the world; for a
whole body, the differences of all joint positions. For a long clip, the view has fewer samples than the chart, and
the chart shows the largest error of every few samples: the worst sample of each mode is in both.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise
from math import floor, log10
from typing import Any

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import conjugate, multiply
from rigid_motion_batch.analysis.metrics import MAX_ROUNDING_M
from rigid_motion_batch.analysis.results import ChoiceResult, ClipResult, MotionResult
from rigid_motion_batch.palette import full_colour
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.rest_bodies import carrying, short_names

MOST_SEEN = {True: 4_000_000, False: 12_000_000}
"""Maximum bytes of the poses of all modes, for a whole body (True) or a single one; above it, the view is thinned."""

FEWEST_SEEN = 300
"""Minimum number of samples in the view."""

MOST_CHARTED = 50_000
"""Maximum number of samples of an error over time; longer ones keep the largest of every few."""

MAGNIFICATION_FACTORS = (1000, 500, 200, 100, 50, 30, 20, 10, 5, 3, 2, 1)
"""The factors that deviations may be magnified by."""

SEEN_AS = {True: 0.15, False: 0.34}
"""Maximum size of the largest deviation on screen, as a fraction of the whole body's size (True) or the object's."""

Description = list[float]


class PackedNumbers:
    """A block of arrays of numbers, packed one after the other."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def put(self, values: np.ndarray, width: int = 2, step: float = 0.0) -> Description:
        """Add an array of shape (rows, n) or (n,), rounded to `step`, or coarser if the width has no room for that."""
        values = np.atleast_2d(np.asarray(values, dtype=float))
        step = max(step, float(np.abs(values).max(initial=0.0)) / (2 ** (8 * width - 1) - 1)) or 1.0
        whole = np.rint(values / step).astype(np.int64)
        differences = np.diff(whole, axis=1, prepend=0).astype(f"<i{width}" if width > 1 else "i1")
        packed = np.ascontiguousarray(differences.reshape(-1, 1).view(np.uint8).T).tobytes()
        self._parts.append(packed)
        self._size += len(packed)
        return [self._size - len(packed), *values.shape, step, width]

    def text(self) -> str:
        """Return the whole block as base64 text; the same numbers give the same text."""
        return base64.b64encode(gzip.compress(b"".join(self._parts), mtime=0)).decode("ascii")


def clip_data(clip: ClipResult, label: Callable[[str], str], mesh: Mesh) -> dict[str, Any]:
    """Return the page's data about a clip: names, warnings, and numbers of the recording and of each choice.

    `label` returns the name of a mode; `mesh` is the object that a single rigid body moves.
    """
    block, body = PackedNumbers(), clip.parents is not None
    begin = float(clip.times[0])
    seen = _view_samples(clip)
    truth = _joints(clip.truth)[:, seen]
    # Relative to the centre: coordinates far from the world's origin would waste digits.
    carries = carrying(clip.parents, truth) if clip.parents is not None else np.zeros(1, dtype=bool)
    drawn = np.flatnonzero(~carries)
    low, high = truth[drawn].min(axis=(0, 1)), truth[drawn].max(axis=(0, 1))
    truth = truth - (low + high) / 2.0
    size = (_extent(truth[drawn]) if body else mesh.size) or 1.0
    cell = nice(0.3 * size)
    recording = {
        "times": block.put(clip.times - begin, 4, 1e-6),
        "seen": block.put(seen, 4, 1.0),
        "places": block.put(truth.transpose(0, 2, 1).reshape(-1, len(seen)), 4, 1e-5),
    }
    if not body:
        recording["turns"] = block.put(clip.truth.quaternions[seen].T)
        if clip.truth.scales is not None:
            recording["scales"] = block.put(clip.truth.scales[seen])
    return {
        "name": clip.facts.name,
        "joints": short_names(clip.facts.joint_names) if body else [],
        "parents": [] if clip.parents is None else _line_parents(clip.parents, carries),
        "drawn": drawn.tolist(),
        "size": size,
        "cell": cell,
        "grid": size_as_text(cell),
        "box": [((low - high) / 2.0).tolist(), ((high - low) / 2.0).tolist()],
        "warnings": [
            {
                "from": None if warning.start_s is None else warning.start_s - begin,
                "to": None if warning.end_s is None else warning.end_s - begin,
            }
            for warning in clip.facts.warnings
        ],
        "recording": recording | {"block": block.text()},
        "choices": [_choice_data(clip, result, seen, label, size) for result in clip.choices],
    }


def _choice_data(
    clip: ClipResult, result: ChoiceResult, seen: np.ndarray, label: Callable[[str], str], size: float
) -> dict[str, Any]:
    block, first = PackedNumbers(), result.first
    count = result.motions[0].errors.shape[1]
    every = -(-count // MOST_CHARTED)
    within = seen[(seen >= first) & (seen < first + count)]
    rows = [motion.metrics[0] for motion in result.motions]
    body = clip.parents is not None
    largest = max(float(motion.errors[0].max()) for motion in result.motions)
    of_joints = [motion.joint_errors for motion in result.motions if motion.joint_errors is not None]
    by_joint = np.max([errors.max(axis=1) for errors in of_joints], axis=0) if of_joints else np.zeros(1)
    keyed = len({row.keys for row in rows if row.keys}) > 1 or rows[0].decimation != "uniform"
    return {
        "name": result.choice.name,
        "title": result.choice.title,
        "about": _summary_text(result, keyed, every, thinned=len(within) < count),
        "first": first,
        "count": count,
        "every": every,
        "seen": [int(np.searchsorted(seen, first)), len(within)],
        "keyed": keyed,
        "worst": largest,
        "factor": _magnification(largest, SEEN_AS[body] * size),
        "joint": int(np.argmax(by_joint)),
        "top": full_colour(of_joints) if of_joints else 0.0,
        "motions": [
            {
                "modes": list(motion.modes),
                "name": label(motion.modes[0]),
                "also": [label(mode) for mode in motion.modes[1:]],
                "rms": [1e3 * row.rms_shell_m, 1e3 * row.rms_position_m, row.rms_rotation_deg],
                "errors": [block.put(row) for row in peaks(motion.errors, every) * [[1e3], [1e3], [1.0]]],
                "keys": block.put(motion.keys - first, 4, 1.0),
                **_deviations(block, clip, motion, within, first),
            }
            for motion, row in zip(result.motions, rows, strict=True)
        ],
        "block": block.text(),
    }


def _deviations(
    block: PackedNumbers, clip: ClipResult, motion: MotionResult, within: np.ndarray, first: int
) -> dict[str, Description]:
    """Return a mode's deviations from the recording at these samples of the clip."""
    at = within - first
    away = _joints(motion.poses)[:, at] - _joints(clip.truth)[:, within]
    result = {"away": block.put(away.transpose(0, 2, 1).reshape(-1, len(at)))}
    if clip.parents is not None:
        return result | ({} if motion.joint_errors is None else {"by_joint": block.put(motion.joint_errors[:, at], 1)})
    turn = multiply(motion.poses.quaternions[at], conjugate(clip.truth.quaternions[within]))
    turn *= np.where(turn[:, :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, turn[:, :1])
    result["turn"] = block.put((turn[:, 1:] * angle / np.maximum(sine, 1e-30)).T)
    if motion.poses.scales is not None and clip.truth.scales is not None:
        result["grown"] = block.put(np.log(motion.poses.scales[at] / clip.truth.scales[within]))
    return result


@lru_cache(maxsize=4)
def mesh_data(mesh: Mesh) -> dict[str, Any]:
    """Return a mesh in the form that the viewer draws."""
    block = PackedNumbers()
    edges = mesh.edges()
    none = np.zeros((1, edges.shape[1]))
    return {
        "corners": block.put(mesh.corners().T.ravel()),
        "edges": block.put(np.concatenate((edges[:3], none, edges[3:], none)).T.ravel()),
        "size": mesh.size,
        "middle": mesh.middle.tolist(),
        "block": block.text(),
    }


def json_in_page(content: Any) -> str:
    """Return JSON that is safe inside a script element, for any strings in it."""
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _joints(poses: Poses) -> np.ndarray:
    """Return positions with the joints first, shape (joints, n, 3)."""
    return poses.positions if poses.positions.ndim == 3 else poses.positions[None]


def _view_samples(clip: ClipResult) -> np.ndarray:
    """Return the indices of the clip's samples that go into the view."""
    count, motions = len(clip.times), [motion for result in clip.choices for motion in result.motions]
    body = clip.parents is not None
    a_sample = (7 if body else 12) * len(_joints(clip.truth)) * max(len(motions), 1)
    every = -(-count // max(MOST_SEEN[body] // a_sample, FEWEST_SEEN))
    if every == 1:
        return np.arange(count)
    kept = [np.arange(0, count, every)]
    for result in clip.choices:
        shell = [motion.errors[0] for motion in result.motions]
        kept.append(result.first + np.array([0, len(shell[0]) - 1, *(int(errors.argmax()) for errors in shell)]))
    return np.unique(np.concatenate(kept))


def peaks(errors: np.ndarray, every: int) -> np.ndarray:
    """Return the largest of every `every` samples, shape (3, about n / every)."""
    return np.maximum.reduceat(errors, np.arange(0, errors.shape[1], every), axis=1) if every > 1 else errors


def _line_parents(parents: np.ndarray, carries: np.ndarray) -> list[int]:
    """Return the parent that each joint's line starts at: -1 for none, also if that is a root that only carries."""
    return np.where((parents >= 0) & carries[parents], -1, parents).tolist()


def _magnification(largest: float, seen_as: float) -> int:
    """Return the magnification that makes the largest deviation visible, but at most `seen_as` large."""
    return (
        next(factor for factor in MAGNIFICATION_FACTORS if factor * largest <= seen_as or factor == 1)
        if largest > MAX_ROUNDING_M
        else 1
    )


def nice(length: float) -> float:
    """Return the smallest 1, 2 or 5 times a power of ten that is at least `length`."""
    power = 10.0 ** floor(log10(length))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= length)


def size_as_text(metres: float) -> str:
    """Return a length as text, in the unit that needs few digits."""
    return f"{1e3 * metres:g} mm" if metres < 0.01 else f"{100 * metres:g} cm" if metres < 1.0 else f"{metres:g} m"


def _extent(places: np.ndarray) -> float:
    """Return the size of a body from its joints (joints, n, 3): the median over time of its bounding box's diagonal."""
    return float(np.median(np.linalg.norm(np.ptp(places, axis=0), axis=1)))


def _summary_text(result: ChoiceResult, keyed: bool, every: int, *, thinned: bool) -> str:
    row = result.motions[0].metrics[0]
    if keyed:
        counts = sorted({count for motion in result.motions if (count := motion.metrics[0].keys) is not None})
        keys = f"{counts[0]} to {counts[-1]} keys" if len(counts) > 1 else f"{counts[0]} keys"
        keys += ", where each mode needs them"
    else:
        keys = f"{row.key_frames} key poses" if row.joints else f"{row.keys} keys"
    sent = "" if keyed else f", {row.bytes_per_s:.0f} bytes/s"
    peaks = f"; in the chart the largest of every {every}" if every > 1 else ""
    fewer = "; fewer in the view" if thinned else ""
    return f"{keys} in {row.duration_s:.2f} s{sent}, {row.samples} samples{fewer}{peaks}"


CREASE_COSINE = np.cos(np.radians(35.0))
"""Faces that meet at a sharper angle (over 35 degrees) have an edge between them, in shading and wireframe."""

MOST_TRIANGLES = 6000
"""Maximum number of triangles: more would make the page slow and large."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of at most `MOST_TRIANGLES` triangles.

    Raises
    ------
    ValueError
        If it has more, or none.
    """

    vertices: np.ndarray
    """Shape (v, 3), in metres."""

    triangles: np.ndarray
    """Shape (t, 3), vertex indices, counter-clockwise from outside."""

    tints: np.ndarray | None = None
    """Shape (t,), 0 to 1: how much of a triangle's colour is its mode's rather than grey. 1 for all by default."""

    def __post_init__(self) -> None:
        if not 0 < len(self.triangles) <= MOST_TRIANGLES:
            raise ValueError(f"{len(self.triangles)} triangles; give the viewer 1 to {MOST_TRIANGLES}")

    @property
    def size(self) -> float:
        """The diagonal of the bounding box, in metres."""
        return float(np.linalg.norm(np.ptp(self.vertices[np.unique(self.triangles)], axis=0)))

    @property
    def middle(self) -> np.ndarray:
        """The centre of the bounding box, shape (3,)."""
        used = self.vertices[np.unique(self.triangles)]
        return (used.min(axis=0) + used.max(axis=0)) / 2.0

    def corners(self) -> np.ndarray:
        """Return position, normal and tint of every corner of every triangle, shape (7, 3 t)."""
        places, faces, owners = self._faces()
        normals = np.zeros((len(owners), 3))
        order = np.argsort(owners, kind="stable")
        starts = np.searchsorted(owners[order], np.arange(owners.max() + 2))
        for first, last in pairwise(starts.tolist()):
            around = order[first:last]
            own = faces[around // 3]
            unit = own / np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-30)
            normals[around] = (unit @ unit.T > CREASE_COSINE) @ own
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        tints = np.ones(len(faces)) if self.tints is None else np.asarray(self.tints, dtype=float)
        return np.concatenate((places.T, normals.T, np.repeat(tints, 3)[None]))

    def edges(self) -> np.ndarray:
        """Return both ends of every sharp edge, shape (6, e)."""
        places, faces, owners = self._faces()
        pairs = owners.reshape(-1, 3)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        ordered, kinds = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
        unit = faces / np.maximum(np.linalg.norm(faces, axis=1, keepdims=True), 1e-30)
        sums = np.zeros((len(ordered), 3))
        counts = np.bincount(kinds.ravel(), minlength=len(ordered))
        np.add.at(sums, kinds.ravel(), np.repeat(unit, 3, axis=0))
        # The smaller the angle between two unit vectors, the longer is their sum.
        flat = (counts == 2) & ((sums * sums).sum(axis=1) > 2.0 + 2.0 * CREASE_COSINE)
        _, firsts = np.unique(owners, return_index=True)
        ends = places[firsts][ordered[~flat]]
        return ends.reshape(-1, 6).T

    def _faces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return corner positions (3 t, 3), area-scaled normals of faces (t, 3), and each corner's merged vertex."""
        places = np.asarray(self.vertices, dtype=float)[self.triangles].reshape(-1, 3)
        _, owners = np.unique(np.round(places, 6), axis=0, return_inverse=True)
        a, b, c = places.reshape(-1, 3, 3).transpose(1, 0, 2)
        return places, np.cross(b - a, c - a), owners.ravel()


@cache
def drill() -> Mesh:
    """Return the low-poly version of the drill shown in films."""
    return Mesh(**np.load(ASSETS / "drill.npz"))
