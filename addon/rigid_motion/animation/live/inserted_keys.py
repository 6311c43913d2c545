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
  it is.
- A whole pose was put on a bone (*Paste Pose*, a pose asset, *Apply Visual Transform to Pose*, `matrix = M`, and so
  Rigify's switches): whoever did it knows nothing of constraints, and means it as it is. So it is shown, without the
  difference, until it is keyed or the frame changes; and so it is keyed, at once or later.

Where a key gets a pose, so do all keyed channels of the transform. And where it is of the motion as it was, that goes
on as it did: see `kept_timing`.
"""

from __future__ import annotations

from collections import OrderedDict, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np

from ..actions.reading import added_values
from ..actions.slots import Binding
from ..compute.components import PART_OF, rows_left_to
from ..compute.source_cache import cached_source
from ..compute.sources import SAME_FRAME, Source, values_of
from ..compute.turning import needs_turning
from ..queries.segments import frame_in_action
from ..transforms import Transform, visible_components
from ..writers.table import shown_components, writer_of
from .edited import Operators
from .kept_timing import Insertion, keep_timing, mark_breakdown, nearest_key

MOST_INSERTED = 256
"""Insertions that undo and redo can bring back as they were."""

MOST_WHOLE = 4096
"""Poses of single transforms that undo and redo can bring back as they were seen."""

TOLERANCE = 1e-5
"""Differences of single precision, relative to the value or absolute below 1."""


@dataclass(frozen=True)
class _Posed:
    """How a transform was posed, without a key yet."""

    frame: float
    """The frame of the scene."""

    components: np.ndarray
    """Its properties, shape (10,)."""

    on_top: bool
    """True if the pose is that with the difference on top."""

    is_whole: bool = False
    """True if a whole pose was put on it, which is meant as it is, and shown so."""

    is_shown: bool = True
    """True if it has been evaluated so."""


@dataclass(frozen=True)
class _NewKey:
    """A key that was inserted on the frame that is shown."""

    user: Transform
    """The user of which it is, if it can be."""

    posed: _Posed | None
    """The pose that the user had on this frame."""

    old: Source
    """The keys without it."""

    source: Source
    """The keys as they are now."""

    frame: float
    """The frame of the Action."""

    had: np.ndarray
    """Values of the channels there without it, shape (10,)."""

    @cached_property
    def numbers(self) -> dict[int, int]:
        """The numbers of the keys on its frame, by the rows of the channels that have one."""
        nearest = (
            (rows, keys.times, int(np.abs(keys.times - self.frame).argmin())) for rows, keys in self.source.channels
        )
        return {
            row: number
            for rows, times, number in nearest
            if abs(times[number] - self.frame) < SAME_FRAME
            for row in rows
        }

    def has_values(self, shown: np.ndarray) -> bool:
        """Return whether every key on this frame has the value that the property had, of these components (10,)."""
        for rows, keys in self.source.channels:
            if rows[0] in self.numbers:
                had = shown[rows]
                off = np.abs(keys.values[:, self.numbers[rows[0]]] - had)
                if np.any(off > TOLERANCE * np.maximum(1.0, np.abs(had))):
                    return False
        return True


class InsertedKeys:
    """How transforms of a file were posed, for the keys that may be inserted of it."""

    def __init__(self) -> None:
        self._posed: dict[tuple[int, str], _Posed] = {}
        self._whole: OrderedDict[tuple[tuple[int, str], bytes], _Posed] = OrderedDict()
        """The whole poses that undo and redo can bring back, by the transform and the components."""
        self._undone: dict[tuple[int, str], bytes] = {}
        """The components that undo or redo has given transforms, which have not been evaluated since."""
        self._new: defaultdict[Binding, list[_NewKey]] = defaultdict(list)
        """The keys inserted in each binding, as each of its users may have them, while edits are looked at."""
        self._insertions: list[Insertion] = []
        self._inserted: OrderedDict[tuple[str, str], tuple[np.ndarray, bool, bool]] = OrderedDict()
        """Decisions to keep when undo and redo bring keys back: the components that there were, whether they were all
        of the pose, and whether they were the in-between as it was, by the digests before and after."""

    def look_at(self, changes: Iterable[tuple[Binding, str, Source]], frame: float) -> None:
        """Find the keys that were inserted on the frame that is shown, and what the channels of all had there.

        `changes` are bindings, the digests of what they are filled in from, and what is keyed in them now.
        """
        self._new.clear()
        result = []
        for binding, before, source in changes:
            if (old := _before_insertion(before, source)) is not None:
                for user in self._by_precedence(binding):
                    action_frame = frame_in_action(user.animated, frame)
                    if _is_inserted(old, source, action_frame):
                        result.append((binding, user, old, source, action_frame))
        had = values_of(
            [old for _, _, old, *_ in result],
            [old.held(np.array([action_frame])) for _, _, old, _, action_frame in result],
        )
        for (binding, user, old, source, action_frame), values in zip(result, had, strict=True):
            posed = self._posed.get(user.identity)
            posed = posed if posed is not None and posed.frame == frame else None
            self._new[binding].append(_NewKey(user, posed, old, source, action_frame, values[:, 0]))

    def _by_precedence(self, binding: Binding) -> list[Transform]:
        """Return the users of a slot that a key may be of: first what was posed by hand, or else what is active."""
        users = [user for user in binding.users if user.animated.animation_data.action == binding.slot.action]
        if len(users) > 1:
            layer = bpy.context.view_layer
            active = None if layer is None else layer.objects.active
            users.sort(key=lambda user: (user.identity not in self._posed, user.animated != active))
        return users

    def keep_timing(self) -> None:
        """Have the motion go on as it did beside the keys that were given the pose of it."""
        self._new.clear()
        insertions, self._insertions = self._insertions, []
        keep_timing(insertions)

    def _keep(self, transform: Transform, posed: _Posed) -> None:
        identity = transform.identity
        self._posed[identity] = posed
        if posed.is_whole:
            self._whole[identity, posed.components.tobytes()] = posed
            self._whole.move_to_end((identity, posed.components.tobytes()))
            if len(self._whole) > MOST_WHOLE:
                self._whole.popitem(last=False)

    def notice_undo(self, transform: Transform) -> None:
        """Undo or redo gave a transform its properties: they were not set, though others were evaluated."""
        self._undone[transform.identity] = transform.components().tobytes()

    def forget_undo(self) -> None:
        """Forget what undo or redo posed: all has been evaluated since."""
        self._undone.clear()

    def is_whole_again(self, transform: Transform, frame: float) -> bool:
        """Return whether undo or redo brought a whole pose back that was put on a transform on this frame."""
        posed = self._whole.get((transform.identity, transform.components().tobytes()))
        if posed is None or posed.frame != frame:
            return False
        self._posed[transform.identity] = posed
        return True

    def notice_pose(self, transform: Transform, frame: float) -> bool:
        """Keep how a transform was posed on the frame that is shown, and has been evaluated so.

        Returns whether its properties have all of its pose, with no difference on top.
        """
        is_whole = self._is_shown_whole(transform)
        self._keep(transform, _Posed(frame, transform.components(), not is_whole, is_whole))
        return is_whole

    def notice_whole(self, transform: Transform, frame: float) -> None:
        """Keep that the properties of a transform have all of its pose, with no difference on top."""
        self._keep(transform, _Posed(frame, transform.components(), False, True))

    def _is_shown_whole(self, transform: Transform) -> bool:
        """Return whether a whole pose was put on a transform, and it has been shown without the difference since."""
        before = self._posed.get(transform.identity)
        if before is None or not before.is_whole:
            return False
        seen = shown_components(transform)
        return seen is None or np.allclose(seen, transform.components(), rtol=TOLERANCE, atol=TOLERANCE)

    def posed_of(self, animated: bpy.types.ID) -> set[str]:
        """Return the prefixes of what was posed of a data-block, and has no key yet."""
        return {prefix for uid, prefix in self._posed if uid == animated.session_uid}

    def notice_assignment(
        self,
        transform: Transform,
        evaluated: bpy.types.Object | bpy.types.PoseBone,
        changed: int,
        frame: float,
        operators: Operators,
    ) -> bool:
        """Keep what so many properties of a transform were set to since it was evaluated.

        Returns whether they are to be shown without the difference.
        """
        if not changed or self._undone.get(transform.identity) == transform.components().tobytes():
            return False
        is_whole = self._is_shown_whole(transform) or operators.are_any(transform.stored_by)
        if not is_whole and transform.has_difference_slot and operators.is_script:
            is_whole = changed > 1 or transform.is_as_seen(evaluated)
        # From what a matrix is set to, Blender takes delta transforms off.
        on_top = operators.are_any(transform.placed_by) or (not transform.has_difference_slot and changed > 1)
        on_top = on_top and not is_whole
        self._keep(transform, _Posed(frame, transform.components(), on_top, is_whole, is_shown=False))
        return is_whole

    def notice_values(self, transform: Transform, frame: float) -> None:
        """Note that keys of a transform that are set on the frame that is shown are meant as they are."""
        self._keep(transform, _Posed(frame, transform.components(), False, is_shown=False))

    def forget_poses(self, transforms: Iterable[Transform] | None = None) -> None:
        """Forget how these were posed, or all: their Actions have moved them again."""
        if transforms is None:
            self._posed.clear()
        else:
            for transform in transforms:
                self._posed.pop(transform.identity, None)

    def keep_pose(self, binding: Binding, *, again: bool) -> bool:
        """Give a key that was found in a binding the pose of one of the users of the slot, if it can be of any.

        `again` is whether undo or redo brought the key back, and not an edit. Returns whether there was such a key.
        """
        return any(self._keep_pose_of(binding, key, again) for key in self._new.get(binding, ()))

    def _keep_pose_of(self, binding: Binding, key: _NewKey, again: bool) -> bool:
        user, posed, old, source, frame = key.user, key.posed, key.old, key.source, key.frame
        change = old.digest, source.digest
        decided = self._inserted.get(change) if again else None
        added = added_values(binding, user, source, np.array([frame]))[:, 0]
        if decided is None:
            in_between = key.had + added
            # A property that had no keys at all is where it is.
            unkeyed = [part not in old.keyed for part in PART_OF]
            in_between[unkeyed] = user.components()[unkeyed]
            shown = in_between if posed is None else posed.components
            if not key.has_values(shown) or (posed is not None and not (posed.on_top or posed.is_shown)):
                return False
            is_whole = posed is not None and posed.is_whole
            decided = shown, is_whole, not is_whole and _is_same(old, shown, in_between)
            self._inserted[change] = decided
            if len(self._inserted) > MOST_INSERTED:
                self._inserted.popitem(last=False)
        shown, is_whole, is_in_between = decided
        left = rows_left_to(old.driven) if old.driven else ()
        seen = (shown if is_whole else _seen_components(user, binding, old, shown, frame)) - added
        curves = {row: binding.curves[channel] for row, channel in user.channels.items() if channel in binding.curves}
        for row, fcurve in curves.items():
            if row in key.numbers and row not in left:
                fcurve.keyframe_points[key.numbers[row]].co_ui.y = seen[row]
                fcurve.update()
            elif row not in left:
                set_key(fcurve, frame, seen[row])
        if is_in_between and old.keyed_range[0] < frame < old.keyed_range[1]:
            if not needs_turning(old):
                mark_breakdown(curves.values(), old, frame)
            self._insertions.append(Insertion(curves, old, frame))
        return True


def _before_insertion(digest: str, source: Source) -> Source | None:
    """Return the source with this digest if there are more keys than in it."""
    old = cached_source(digest)
    return old if old is not None and source.key_count > old.key_count and old.order == source.order else None


def _is_inserted(old: Source, new: Source, frame: float) -> bool:
    """Return whether key times differ by one more alone, on this frame, where the motion is not Blender's own.

    That is in a segment with a mode, or before or behind all keys where the motion goes on.
    """
    before, after = old.keyed_frames, new.keyed_frames
    if not (before[0] < frame < before[-1] or old.goes_on) or np.abs(before - frame).min() < SAME_FRAME:
        return False
    others = after[np.abs(after - frame) >= SAME_FRAME]
    if len(others) == len(after) or not np.array_equal(others, before):
        return False
    return old.is_live and old.mode_at(frame) != 0


def _is_same(source: Source, components: np.ndarray, others: np.ndarray) -> bool:
    """Return whether these are the same components (10,), as far as they are keyed."""
    rows = [row for keyed_rows, _ in source.channels for row in keyed_rows]
    return bool(np.all(np.abs(components - others)[rows] <= TOLERANCE * np.maximum(1.0, np.abs(others[rows]))))


def _seen_components(user: Transform, binding: Binding, old: Source, shown: np.ndarray, frame: float) -> np.ndarray:
    """Return the components (10,) that, with the original difference alone, look as the screen does."""
    filled, difference = binding.filled, writer_of(binding).difference(binding, user, frame)
    parts = {PART_OF[row] for row, channel in user.differences.items() if channel in filled}
    return visible_components(shown, old.original, difference, old.order, parts)


def set_key(fcurve: bpy.types.FCurve, frame: float, value: float) -> None:
    """Give a key this value, handles along with it; insert one that the channel lacks."""
    keys, (number, points) = fcurve.keyframe_points, nearest_key(fcurve, frame)
    times = points[:, 0]
    if len(times) and abs(times[number] - frame) < SAME_FRAME:
        keys[number].co_ui.y = value
    else:
        before = keys[int(np.where(times < frame, times, -np.inf).argmax())] if (times < frame).any() else None
        # Read first: an insertion moves the other keys elsewhere in memory.
        eased = None if before is None else (before.interpolation, before.easing)
        key = keys.insert(frame, value)
        if eased is not None:
            key.interpolation, key.easing = eased
    fcurve.update()
