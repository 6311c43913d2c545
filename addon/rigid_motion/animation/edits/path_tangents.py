"""Tangents of paths at keys: the speed at which a body leaves or reaches a key, set by the handles of all channels.

In a segment with a mode, handles decide the progress along the path, but not the path. So the handles of all channels
get the same slope of progress, which is 1 at an even speed. The handle at the other end of the segment stays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...blender import existing
from ..actions.channels import code_of, key_points, set_key_fields
from ..actions.reading import read
from ..evaluation.components import SMOOTH_MODES
from ..evaluation.differences import progress_at
from ..evaluation.ends import SLOPE_MOMENTS, SLOPE_WEIGHTS
from ..evaluation.marks import SAME_FRAME
from ..evaluation.sources import KeyedTransform
from ..fcurves.keys import BEZIER, LINEAR
from ..transforms import Channel, Refused, Transform
from .apply import Readings, TriedEdit, TriedEdits, editable_keys

SIDE_BEFORE, SIDE_AFTER = range(2)
"""The sides of a key."""

HANDLE_RATIO = 1.0 / 3.0
"""The length of a handle in time, as a fraction of its segment, unless the handle is too steep."""

EVEN_END = (HANDLE_RATIO, HANDLE_RATIO)
"""Time and progress of the handle at the other end of a previously linear segment, as fractions of the segment."""

FREE = code_of("handle_left_type", "FREE")

END_RATIO = 1e-6
"""The fraction of a segment skipped when measuring progress at its ends, as these belong to other segments too."""

MIN_GAIN = 0.5
"""The least fraction of the handles' slope that a smooth mode takes over; less means that its path turns back."""

MAX_HANDLE_SHIFT = 1e-5
"""The largest change, in frames and units, that Blender may make to other handles."""

NO_SEGMENT = n_("{name} has no motion of a mode on this side of frame {frame:g}: choose a mode, or drag another handle")
NO_HANDLES = n_(
    "{name} is eased, held or at rest on this side of frame {frame:g}: make its keys Bezier (T) or move them"
)


class _Tangent(TriedEdit):
    """A key of a transform whose handles on one side are being edited."""

    def __init__(self, transform: Transform, readings: Readings, frame: float, side: int) -> None:
        binding, whole = editable_keys(transform, readings)
        super().__init__(transform, binding, (*binding.moving, transform.turns_channel))
        source = whole.run_at(frame).source
        number, other = (int(np.argmin(np.abs(source.key_frames - frame))) + by for by in (0, 2 * side - 1))
        segment = min(number, other)
        if not (0 <= segment < len(source.key_frames) - 1 and source.modes[segment]):
            raise Refused(NO_SEGMENT, name=transform.name, frame=frame)
        self.side, self.ends = side, source.key_frames[[number, other]]
        """The frames of the key, and of the key at the other end of the segment."""
        self.handles = dict(filter(None, (self._handles(transform.channels[row]) for row in source.filled_rows)))
        """For channels with keys on both frames: the numbers of these keys, and their difference in frame and value."""
        self.held = {
            transform.channels[row]: (keys.times, existing(keys.left)[place], existing(keys.right)[place])
            for rows, keys in (source.channels if whole.switches else ())
            for place, row in enumerate(rows if keys.left is not None else ())
        }
        """The frames and handles of the keys in the same holder, as if there were no others."""
        codes = {
            int(existing(self.keys[channel])["interpolation"][min(at), 0]) for channel, (at, _) in self.handles.items()
        }
        if not any(change[1] for _, change in self.handles.values()) or not codes <= {BEZIER, LINEAR}:
            raise Refused(NO_HANDLES, name=transform.name, frame=frame)
        self.shares = self._shares(source)
        """The progress at one, two and three eighths of the segment away from the key, as fractions, shape (3,)."""
        self.slopes = (0.0, 1.0) if source.modes[segment] not in SMOOTH_MODES else None
        """The slopes that result from handles of slope 0 and 1; None until these were tried."""

    def _shares(self, whole: KeyedTransform) -> np.ndarray:
        source = whole.run_at(self.ends[0]).source
        moments = self.ends[0] + np.diff(self.ends) * (END_RATIO, *SLOPE_MOMENTS[:3], 1.0 - END_RATIO)
        forth = 1 if self.side == SIDE_AFTER else -1
        along = progress_at([source], [moments[::forth]])[0][::forth]
        return np.asarray((along[1:4] - along[0]) / (along[4] - along[0]))

    def _handles(self, channel: Channel) -> tuple[Channel, tuple[tuple[int, int], np.ndarray]] | None:
        if (fields := self.keys.get(channel)) is None:
            return None
        off = np.abs(fields["co"][:, 0] - self.ends[:, None])
        at = off.argmin(axis=1)
        first, other = at.tolist()
        if off.min(axis=1).max() > SAME_FRAME or abs(first - other) != 1:
            return None
        return channel, ((first, other), np.diff(fields["co"][at].astype(np.float64), axis=0)[0])

    def key(self, slope: float | None) -> None:
        """Give the progress of the segment this slope at the key, on its side; None for linear F-curves."""
        if slope is None:
            for channel, (at, _) in self.handles.items():
                self.binding.curves[channel].keyframe_points[min(at)].interpolation = "LINEAR"
            return
        if self.slopes is None:
            # At keys of a smooth mode the slope is that of Blender's own in-betweens in the direction of the tangent.
            self.slopes = self._slope_with(0.0), self._slope_with(1.0)
            self.put_back()
        low, high = self.slopes
        is_steady = MIN_GAIN < high - low < 1.0 / MIN_GAIN
        self._set_handles(max((slope - low) / (high - low) if is_steady else slope, 0.0))

    def _slope_with(self, slope: float) -> float:
        self._set_handles(slope)
        return float(self._shares(read(self.binding)) @ SLOPE_WEIGHTS)

    def _set_handles(self, slope: float) -> None:
        time = min(HANDLE_RATIO, 1.0 / max(slope, 1.0))
        names = ("handle_right", "handle_left")[:: 1 if self.side == SIDE_AFTER else -1]
        for channel, ((first, other), change) in self.handles.items():
            fields = {name: numbers.copy() for name, numbers in existing(self.keys[channel]).items()}
            keys: Any = slice(None)
            if channel in self.held:
                times, *handles = self.held[channel]
                keys = np.abs(fields["co"][:, 0] - times[:, None]).argmin(axis=1)
                for side, points in zip(("left", "right"), handles, strict=True):
                    fields[f"handle_{side}"][keys], fields[f"handle_{side}_type"][keys] = points, FREE
            begins = fields["interpolation"][min(first, other)]
            for at, name, share in ((first, names[0], (time, slope * time)), (other, names[1], EVEN_END)):
                if at == first or begins == LINEAR:
                    away = 1.0 if at == first else -1.0
                    fields[name][at] = fields["co"][at] + away * change * share
                    for side in ("left", "right"):
                        fields[f"handle_{side}_type"][at] = FREE
            begins[:] = BEZIER
            set_key_fields(fcurve := self.binding.curves[channel], fields)
            # Handles of other keys that Blender has recalculated are set back.
            now = {name: key_points(fcurve, name) for name in names}
            shifts = np.max([np.abs(now[name] - fields[name]).max(axis=1) for name in names], axis=0)
            moved = np.arange(len(shifts))[keys][shifts[keys] > MAX_HANDLE_SHIFT]
            if len(moved):
                for side in ("left", "right"):
                    fields[f"handle_{side}_type"][moved] = FREE
                set_key_fields(fcurve, fields)


class TangentEdit(TriedEdits):
    """The tangent of a key on one side, for trying slopes until the user accepts one. Empty if it was refused."""

    def __init__(self, transform: Transform, frame: float, side: int, *, refused: list[Refused] | None = None) -> None:
        def plan(one: Transform, readings: Readings) -> _Tangent:
            return _Tangent(one, readings, frame, side)

        super().__init__(transform, plan, refused)

    @property
    def ends(self) -> np.ndarray:
        """The frames of the key, and of the key at the other end of the segment, shape (2,)."""
        return np.asarray(self.tried[0].ends)

    @property
    def first_share(self) -> float:
        """The progress an eighth of the segment away from the key, as a fraction."""
        return float(self.tried[0].shares[0])

    @property
    def slope(self) -> float:
        """The slope of progress at the key: 1 at an even speed, 0 at rest."""
        return float(self.tried[0].shares @ SLOPE_WEIGHTS)

    def apply(self, slope: float | None) -> None:
        """Give progress this slope at the key; None for an even speed throughout the segment, without handles."""
        with self.edit():
            for one in self.tried:
                one.key(slope)
