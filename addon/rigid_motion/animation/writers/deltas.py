"""Objects: differences are the delta transforms, animated in the slot that has the keys."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence

import bpy
import numpy as np

from ..actions.records import recorded_digest
from ..actions.slots import Binding, Slot, bindings_of, is_filled_in, strips_of, with_inner_strips
from ..compute.components import PART_OF
from ..transforms import ORIGINALS, Channel, ObjectTransform, Transform, default_of
from .sampled import Layout, Pieces, hold_constants, replace_samples


class DeltaWriter:
    """What a writer does, here by delta transforms. It keeps nothing itself: all there is to it is in the file."""

    def write(self, binding: Binding, points: dict[Channel, np.ndarray], layout: Layout | None, pieces: Pieces) -> None:
        """Replace the in-betweens of a transform by these samples and pieces.

        Points are frame and value of each sample alternately. Channels that have none are taken out; without any, its
        users are to be released.
        """
        for user in binding.users:
            user.note_original(points)
        gone = replace_samples(binding, points, layout, pieces)
        for channel in gone:
            binding.curves.pop(channel, None)
        binding.curves.update(binding.filled)
        if gone and points:
            self.release(binding.users)

    def is_shown(self, binding: Binding, layout: Layout, channels: Collection[Channel]) -> bool:
        """Return whether what is written in these channels, lying so, is to be seen on all users."""
        return all(user.is_recorded(channels) for user in binding.users)

    def prepare(self, binding: Binding) -> None:
        """Get users ready that were edited, before Blender evaluates them with what is written."""
        filled = binding.filled
        for user in binding.users:
            user.note_original(filled)

    def show(self, binding: Binding) -> None:
        """Have users see what is written that came to the slot after it was."""
        filled = binding.filled
        for user in binding.users if filled else ():
            if not user.animated.is_editable:
                continue
            if not user.is_recorded(filled):
                user.note_original(filled, overwritten=_is_overwritten(user, filled))
            if user.is_more_noted(filled):  # An Action that it had before may have moved more of it.
                self.release([user])

    def difference(self, binding: Binding, user: Transform, frame: float) -> np.ndarray:
        """Return what is on top of a user on a frame of the Action.

        As components (10,): the rotation as the properties have it.
        """
        difference, filled = np.zeros(10), binding.filled
        for row, channel in user.differences.items():
            path, index = channel
            fcurve = filled.get(channel)
            difference[row] = user.animated.path_resolve(path)[index] if fcurve is None else fcurve.evaluate(frame)
        return difference

    def shown_differences(self, user: Transform) -> list[tuple[np.ndarray, set[str]]]:
        """Return what is on top of a user as it is shown now, even where nothing moves it any more, one by one.

        Each as components (10,), and which of location, rotation and scale it is in.
        """
        parts = self.shown_parts(user)
        if not parts:
            return []
        difference = np.zeros(10)
        for row, (path, index) in user.differences.items():
            difference[row] = getattr(user.carrier, path)[index]
        return [(difference, parts)]

    def shown_parts(self, user: Transform) -> set[str]:
        """Return which of location, rotation and scale they are in."""
        return {PART_OF[row] for row, channel in user.differences.items() if user.is_recorded([channel])}

    def hide(self, binding: Binding, user: Transform) -> None:
        """Show a user as its properties have it, until Blender evaluates its animation again."""
        user.show_original()

    def hold(self, binding: Binding, beside: Sequence[Binding]) -> bool:
        """Have a slot hold what the NLA needs of it beside others that are filled in. Whether that was new to it.

        `beside` is what moves the same users in the NLA, the binding itself among it. Original differences are held
        while a strip plays whose Action lacks a channel that another strip's has: Blender puts that to its default, or
        leaves what is below.
        """
        if recorded_digest(binding):
            return False
        held, before = _held(binding, beside), binding.filled
        for user in binding.users:
            user.note_original(held)
        is_new = hold_constants(binding, held)
        if is_new and before.keys() - held.keys():
            self.release(binding.users)
        return is_new

    def release(self, transforms: Iterable[Transform]) -> None:
        """Take off these what was put on them for slots that do not move them any more."""
        noted = [transform for transform in transforms if any(transform.motion.filled)]
        if not noted:
            return
        bindings = bindings_of(noted)
        for transform in noted:
            filled = [channel for binding in bindings if transform in binding.users for channel in binding.curves]
            transform.restore_original(filled)


def _is_overwritten(user: ObjectTransform, filled: dict[Channel, bpy.types.FCurve]) -> bool:
    """Return whether what a user has for a difference is what in-betweens are on the frame that is shown."""
    frame = bpy.context.scene.frame_current_final
    return all(
        abs(user.animated.path_resolve(path)[index] - fcurve.evaluate(frame)) < 1e-6
        for (path, index), fcurve in filled.items()
    )


def _held(binding: Binding, beside: Sequence[Binding]) -> dict[Channel, float]:
    """Return the channels that a slot which is not filled in has to have, and what they hold."""
    in_nla = [user for user in binding.users if len(user.animated.animation_data.nla_tracks)]
    first, *others = [_held_for(user, binding, beside) for user in in_nla] or [{}]
    if any(held != first for held in others) or any(
        user.original_values(path)[index] != value
        for user in binding.users
        if user not in in_nla
        for (path, index), value in first.items()
    ):
        return {}
    # What it does not key may be another strip's to move, below it, and then so are the differences of that.
    animated = {path for (path, _), fcurve in binding.curves.items() if not is_filled_in(fcurve)}
    return {
        (path, index): value
        for (path, index), value in first.items()
        if path not in animated and path.removeprefix("delta_") in animated
    }


def _held_for(user: ObjectTransform, binding: Binding, beside: Sequence[Binding]) -> dict[Channel, float]:
    originals = {path: getattr(user.motion, original)[:] for path, original in ORIGINALS.items()}
    originals = {path: values for path, values in originals.items() if all(map(math.isfinite, values))}
    if not _is_replacing(user.animated, binding.slot):
        return {}
    others = [other for other in beside if user in other.users and recorded_digest(other)]
    filled = {path for other in others for path, _ in other.filled}
    below = {path for other in others if _is_above(user.animated, binding.slot, other.slot) for path, _ in other.filled}
    return {
        (path, index): value
        for path, values in originals.items()
        if path in below or (path in filled and values != default_of(path))
        for index, value in enumerate(values)
    }


def _is_replacing(obj: bpy.types.Object, slot: Slot) -> bool:
    """Return whether a slot takes the place of what is below it wherever it moves an object in the NLA."""
    data = obj.animation_data
    if data.action == slot.action and data.action_blend_type != "REPLACE":
        return False
    # Without an Action it is a strip of strips, and these may be in it.
    return all(strip.blend_type == "REPLACE" for strip in strips_of(obj) if strip.action in (None, slot.action))


def _is_above(obj: bpy.types.Object, slot: Slot, other: Slot) -> bool:
    """Return whether a slot plays above another one in the NLA of an object, on some frame."""
    return any(
        level > below and start < end_below and start_below < end
        for level, start, end in _spans(obj, slot)
        for below, start_below, end_below in _spans(obj, other)
    )


def _spans(obj: bpy.types.Object, slot: Slot) -> list[tuple[int, float, float]]:
    """Return where a slot plays in the NLA of an object: track, that of its Action being last, and scene frames."""
    data = obj.animation_data
    spans = [
        (level, strip.frame_start, strip.frame_end)
        for level, track in enumerate(data.nla_tracks)
        for strip in with_inner_strips(track.strips)
        if (strip.action, strip.action_slot_handle) == slot.key
    ]
    if not data.use_tweak_mode and slot.plays_in(obj):
        spans.append((len(data.nla_tracks), -math.inf, math.inf))
    return spans
