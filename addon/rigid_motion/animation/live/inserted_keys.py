"""The one place where a key of the animator's is changed: a key set where a mode acts keeps the pose that it is of.

That is between two keys, and before and behind all of them where cycles or an extrapolation go on.

The screen shows Blender's own in-between with the difference on top; a key has no difference. What was keyed tells
which of the two its value is:

- It differs from what the property had: it was written to the F-curve (pasted keys, the Graph Editor, a script), and
  stays as it is.
- The property had it when it was last evaluated. Then the animator saw it with the difference on top, be it the
  in-between as it was or a pose made by hand, and the key gets the pose that was to be seen.
- The property was set and keyed in one go. If one of the operators did it that go by what is on the screen (*Snap*,
  *Align*, *Move*), or more than one of location, rotation and scale of an object have changed, then a pose was computed
  for the world, and Blender has taken the difference off: `matrix_world = M` sets all three of them. The key gets that
  pose. A single property (`location = v`, a value typed with Auto Key) is the value that somebody wanted, and stays as
  it is; so does a pose that is set on a bone (`matrix = M`), which knows nothing of constraints.
- A pose from elsewhere was put on a bone (*Paste Pose*, a pose asset): it is meant as it is, and so keyed later, too.

Where a key gets a pose, so do all keyed channels of the transform. And where it is of the motion as it was, that goes
on as it did: see `kept_timing`.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from ..actions.slots import SlotTransform
from ..compute.components import PART_OF
from ..compute.source_cache import cached_source
from ..compute.sources import SAME_FRAME, Source, rows_left_to
from ..queries.visible_pose import visible_components
from ..transforms import Channel, Transform
from ..writers.table import writer_of
from .kept_timing import Insertion, keep_timing, mark_breakdown

MOST_INSERTED = 256
"""Insertions that undo and redo can bring back as they were."""

TOLERANCE = 1e-5
"""Differences of single precision, relative to the value or absolute below 1."""


@dataclass(frozen=True)
class _Posed:
    """How a transform was posed, without a key yet."""

    frame: float
    """Of the scene."""

    components: np.ndarray
    """Its properties, shape (10,)."""

    on_top: bool
    """Whether the pose is that with the difference on top."""

    is_stored: bool = False
    """Whether a pose from elsewhere was put on it, which is meant as it is, whatever the difference makes of it."""


class InsertedKeys:
    """How transforms of a file were posed, for the keys that may be inserted of it."""

    def __init__(self) -> None:
        self._posed: dict[tuple[int, str], _Posed] = {}
        self._insertions: list[Insertion] = []
        self._inserted: OrderedDict[tuple[str, str], tuple[np.ndarray, bool]] = OrderedDict()
        """What undo and redo bring back is decided as it was: the components on the screen, and whether they were the
        in-between as it was, by the digests before and after."""

    def keep_timing(self) -> None:
        """Have the motion go on as it did beside the keys that were given the pose of it."""
        insertions, self._insertions = self._insertions, []
        keep_timing(insertions)

    def notice_pose(self, transform: Transform, frame: float) -> None:
        """Keep how a transform was posed on the frame that is shown, and has been evaluated so."""
        components, before = transform.components(), self._posed.get(_identity(transform))
        if before is not None and before.is_stored and np.array_equal(before.components, components):
            return
        self._posed[_identity(transform)] = _Posed(frame, components, True)

    def posed_of(self, animated: bpy.types.ID) -> set[str]:
        """The prefixes of what was posed of a data-block, and has no key yet."""
        return {prefix for uid, prefix in self._posed if uid == animated.session_uid}

    def notice_assignment(
        self, transform: Transform, depsgraph: bpy.types.Depsgraph, frame: float, *, operator: str = ""
    ) -> None:
        """Keep what the properties of a transform were set to, where they have not been evaluated so yet.

        `operator` is the name of the one that did it, if any did.
        """
        carrier, evaluated = transform.carrier, transform.evaluated(depsgraph)
        changed = sum(
            evaluated is not None and tuple(getattr(carrier, prop)) != tuple(getattr(evaluated, prop))
            for prop in ("location", transform.rotation, "scale")
        )
        if changed:
            on_top = operator.startswith(transform.placed_by) or (transform.matrix_lacks_difference and changed > 1)
            is_stored = operator.startswith(transform.stored_by)
            self._posed[_identity(transform)] = _Posed(frame, transform.components(), on_top, is_stored)

    def forget_poses(self, transforms: Iterable[Transform] | None = None) -> None:
        """Forget how these were posed, or all: their Actions have moved them again."""
        if transforms is None:
            self._posed.clear()
        else:
            for transform in transforms:
                self._posed.pop(_identity(transform), None)

    def keep_pose(self, place: SlotTransform, before: str, source: Source, frame: float, *, again: bool) -> bool:
        """Give a key that was inserted in between the pose that it is of.

        Parameters
        ----------
        place, source
            As they are now, with the new key.
        before : str
            The digest of the source that the slot is filled in from.
        frame : float
            The frame that is shown, of the scene.
        again : bool
            Whether undo or redo brought the key back, and not an edit.

        Returns
        -------
        bool
            Whether there was such a key.
        """
        old = cached_source(before)
        if old is None or source.key_count <= old.key_count or old.order != source.order:
            return False
        users = [user for user in place.users if user.animated.animation_data.action == place.slot.action]
        users.sort(key=self._precedence)
        return any(self._keep_pose_of(user, place, old, source, frame, again) for user in users)

    def _precedence(self, user: Transform) -> tuple[bool, bool]:
        """Which of the users of a slot a key is of that comes first: what was posed by hand, or else what is active."""
        layer = bpy.context.view_layer
        active = None if layer is None else layer.objects.active
        return _identity(user) not in self._posed, user.animated != active

    def _keep_pose_of(
        self, user: Transform, place: SlotTransform, old: Source, source: Source, frame: float, again: bool
    ) -> bool:
        """Give it the pose of one of the users of the slot, if it can be of that one."""
        posed = self._posed.get(_identity(user))
        posed = posed if posed is not None and posed.frame == frame else None
        data = user.animated.animation_data
        if data.use_tweak_mode:
            frame = data.nla_tweak_strip_time_to_scene(frame, invert=True)
        if not _is_inserted(old, source, frame):
            return False
        change = old.digest, source.digest
        shown, is_in_between = self._inserted.get(change, (None, False)) if again else (None, False)
        if shown is None:
            in_between = old.values_at(np.array([frame]))[:, 0]
            shown = in_between if posed is None else posed.components
            if not _has_values(source, frame, shown) or (posed is not None and not posed.on_top):
                return False
            is_in_between = _is_same(old, shown, in_between)
            self._inserted[change] = shown, is_in_between
            if len(self._inserted) > MOST_INSERTED:
                self._inserted.popitem(last=False)
        for channel, value in _visible_values(user, place, old, shown, frame).items():
            if (fcurve := place.curves.get(channel)) is not None:
                _set_key(fcurve, frame, value)
        if is_in_between and old.keyed_range[0] < frame < old.keyed_range[1]:
            curves = {row: place.curves[channel] for row, channel in user.channels.items() if channel in place.curves}
            mark_breakdown(curves.values(), old, frame)
            self._insertions.append(Insertion(curves, old, frame))
        return True


def _identity(transform: Transform) -> tuple[int, str]:
    return transform.animated.session_uid, transform.prefix


def _is_inserted(old: Source, new: Source, frame: float) -> bool:
    """Return whether key times differ by one more alone, on this frame, where the motion is not Blender's own.

    That is in a segment with a mode, or before or behind all keys where the motion goes on.
    """
    before, after = old.keyed_frames, new.keyed_frames
    if not (before[0] < frame < before[-1] or old.goes_on) or np.abs(before - frame).min() < SAME_FRAME:
        return False
    others = after[np.abs(after - frame) >= SAME_FRAME]
    return len(others) < len(after) and np.array_equal(others, before) and bool(old.mode_at(frame))


def _has_values(source: Source, frame: float, shown: np.ndarray) -> bool:
    """Whether every key on this frame has the value that the property had."""
    for rows, keys in source.channels:
        place = int(np.argmin(np.abs(keys.times - frame)))
        if abs(keys.times[place] - frame) < SAME_FRAME:
            had = shown[rows]
            if np.any(np.abs(keys.values[:, place] - had) > TOLERANCE * np.maximum(1.0, np.abs(had))):
                return False
    return True


def _is_same(source: Source, components: np.ndarray, others: np.ndarray) -> bool:
    """Whether these are the same components (10,), as far as they are keyed."""
    rows = [row for own, _ in source.channels for row in own]
    return bool(np.all(np.abs(components - others)[rows] <= TOLERANCE * np.maximum(1.0, np.abs(others[rows]))))


def _visible_values(
    user: Transform, place: SlotTransform, old: Source, shown: np.ndarray, frame: float
) -> dict[Channel, float]:
    """The values of the channels that, with the original difference alone, look as the screen does."""
    left = rows_left_to(old.driven)
    filled, difference = place.filled, writer_of(place).difference(place, user, frame)
    parts = {PART_OF[row] for row, channel in user.differences.items() if channel in filled}
    seen = visible_components(shown, old.original, difference, old.order, parts)
    return {channel: seen[row] for row, channel in user.channels.items() if row not in left}


def _set_key(fcurve: bpy.types.FCurve, frame: float, value: float) -> None:
    """Give a key this value, handles along with it; insert one that the channel lacks."""
    keys = fcurve.keyframe_points
    for key in keys:
        if abs(key.co.x - frame) < SAME_FRAME:
            key.co_ui.y = value
            break
    else:
        before = max((key for key in keys if key.co.x < frame), key=lambda key: key.co.x, default=None)
        # Read first: an insertion moves the other keys elsewhere in memory.
        eased = None if before is None else (before.interpolation, before.easing)
        key = keys.insert(frame, value)
        if eased is not None:
            key.interpolation, key.easing = eased
    fcurve.update()
