"""Recorded places of objects and bones that follow constraints or drivers, which are known on shown frames only.

Playing all frames once completes a record. After an edit, each frame is recorded again when it is next shown. Frames
are those of the scene.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ...animation.transforms import Transform
from ...motion.affine import AffineMaps
from .blends import blended

MAX_MATRIX_ROUNDING = 1e-6
"""Matrices whose elements differ by less are the same."""


class PlaceRecord:
    """The recorded places of an object or a bone in the world."""

    def __init__(self, transform: Transform) -> None:
        self.transform: Transform | None = transform
        """None after an undo, until `record_of` is called again."""
        self.places: dict[float, np.ndarray] = {}
        """Matrices (4, 4) by the frames on which they were recorded."""
        self.version = 0

    def note(self, frame: float, depsgraph: bpy.types.Depsgraph) -> None:
        """Record the place on the frame that is shown."""
        if self.transform is None:
            return
        evaluated: Any = self.transform.animated.evaluated_get(depsgraph)
        place = np.array(evaluated.matrix_world)
        if self.transform.is_part:
            place = place @ np.array(evaluated.pose.bones[self.transform.carrier.name].matrix)
        before = self.places.get(frame)
        if before is None or np.abs(before - place).max() > MAX_MATRIX_ROUNDING:
            self.places[frame] = place
            self.version += 1

    def maps(self, frames: np.ndarray) -> AffineMaps:
        """Return the maps on frames (n,): blended between recorded frames, and those of the nearest one outside."""
        known = np.array(sorted(self.places))
        places = np.stack([self.places[frame] for frame in known.tolist()])
        seen = AffineMaps(places[:, :3, :3], places[:, :3, 3])
        at = np.clip(frames, known[0], known[-1])
        first = np.clip(np.searchsorted(known, at, side="right") - 1, 0, max(len(known) - 2, 0))
        second = np.minimum(first + 1, len(known) - 1)
        return blended(seen[first], seen[second], (at - known[first]) / np.maximum(known[second] - known[first], 1e-9))


_records: dict[tuple[int, str], PlaceRecord] = {}
"""Records by the identity of their transform."""


def record_of(transform: Transform, frame: float, depsgraph: bpy.types.Depsgraph) -> PlaceRecord:
    """Return the record of a transform; from now on `note` keeps it up to date."""
    record = _records.setdefault(transform.identity, PlaceRecord(transform))
    record.transform = transform
    record.note(frame, depsgraph)
    return record


def note(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Record the places of all transforms that have a record, on the frame that is shown."""
    for identity, record in list(_records.items()):
        try:
            record.note(scene.frame_current_final, depsgraph)
        except (ReferenceError, KeyError):  # the object or bone was
            del _records[identity]


def suspend() -> None:
    """Drop references to data that Blender replaces on undo. Recorded places stay."""
    for record in _records.values():
        record.transform = None


def clear() -> None:
    """Drop all records."""
    _records.clear()
