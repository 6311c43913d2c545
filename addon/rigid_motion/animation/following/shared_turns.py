"""Turns of segments, and their distribution when keys divide a segment or when its parts are joined."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ...motion.quaternions import conjugate, rotate
from ...motion.spins import FULL_TURN
from ..actions.channels import ensure_group, key_points, replace_keys, selected_keys
from ..actions.marks import read_marks, write_marks
from ..actions.slots import Binding
from ..evaluation.components import LOCATION, MODE_NAMES, ROWS
from ..evaluation.differences import in_betweens
from ..evaluation.marks import WHOLE_TURN, near
from ..evaluation.sources import SAME_FRAME, TURN_AXES, KeyedTransform
from ..evaluation.turning import Turning, needs_turning, shortest_turns, turning_in
from ..queries.keyed import frames_in, turns_in
from ..transforms import GROUP_NAME, bone_name


def set_turns_in(
    binding: Binding, turns: float | Sequence[float], frames: Sequence[float] | np.ndarray, axis: str | None = None
) -> None:
    """Key the Turns channel of a slot on the frames of keys that begin segments: one number for all, or one for each in
    rising order. Other turns continue after them. If given, `axis`, one of `TURN_AXES`, applies to the whole channel.

    If no segment has turns, the channel is removed.
    """
    keyed, channel = frames_in(binding), binding.users[0].turns_channel
    is_chosen, numbers = near(keyed, np.asarray(frames)), turns_in(binding, keyed)
    numbers[is_chosen] = turns
    if not numbers.any():
        binding.remove_curve(channel)
        return
    fcurve = binding.ensure_curve(channel)
    if fcurve.group is None:
        fcurve.group = ensure_group(binding.channelbag, bone_name(binding.prefix) or GROUP_NAME)
    mark = max(read_marks(fcurve)[:1], default=0) if axis is None else TURN_AXES.index(axis) + 1
    # A muted channel has no effect. It is unmuted now, and all other segments turn as they did while it was muted.
    old, selected = (
        (np.empty(0), np.empty(0, bool)) if fcurve.mute else (key_points(fcurve)[:, 0], selected_keys(fcurve))
    )
    fcurve.mute = False
    kept = is_chosen | near(keyed, old) | ~(np.abs(np.diff(numbers, prepend=np.nan)) <= WHOLE_TURN)
    # Select keys as the keys of the pose are selected, so that both move together.
    selected = is_chosen | near(keyed, old[selected])
    replace_keys(fcurve, keyed[kept], numbers[kept], interpolation="CONSTANT", selected=selected[kept])
    write_marks(fcurve, np.full(np.count_nonzero(kept), mark))


STRAIGHT_MODES = ("lerp_slerp",)
"""Modes in which the path of the origin does not depend on the rotation of the body."""

ONE_AXIS = 1e-5
"""Rotations within this angle, in radians, of an axis differ from it only by rounding."""

SAMPLES_PER_TURN = 16
"""Samples for each part of a segment, and for each turn in it, to measure how far a motion turns."""


def share_out_turns(
    binding: Binding, source: KeyedTransform, old: KeyedTransform, progress: float | None = None
) -> bool:
    """Distribute the turns of segments among the parts that keys divide them into, keeping the motion unchanged.

    If keys between such parts are removed, the joined segment gets whole turns again. Returns whether anything changed.

    Parameters
    ----------
    binding : Binding
    source : Source
        The present keys.
    old : Source
        The keys before the edit.
    progress : float, optional
        Progress of the pose of the one new key along its segment, instead of the body's progress on its frame.
    """
    if old.order != source.order or source.cyclic is not None or not needs_turning(old):
        return False
    if source.key_count == old.key_count:
        return False
    shared = _divided(old, source, progress) if source.key_count > old.key_count else _joined(old, source)
    chosen = np.array(list(shared))
    if not shared or np.array_equal(turns_in(binding, chosen), list(shared.values())):
        return False
    set_turns_in(binding, list(shared.values()), chosen)
    return True


def _divided(old: KeyedTransform, source: KeyedTransform, progress: float | None) -> dict[float, float]:
    """Return the turns of the parts that keys divide segments into, by the first frame of each part."""
    shared: dict[float, float] = {}
    for segment in np.flatnonzero(old.modes).tolist():
        parts = _segments_within(source.key_frames, *old.key_frames[segment : segment + 2])
        are_as_before = source.segment_turns[parts] == old.segment_turns[segment]
        if len(parts) > 1 and np.all(are_as_before & (source.modes[parts] != 0)):
            turned = turning_in(old, segment)
            if turned.spins.turns[0]:
                along = None if progress is None else (0.0, progress, 1.0)
                shares, axes = _shares(old, turned, source.key_frames[[*parts, parts[-1] + 1]], along)
                whole = _is_enough_in_whole_turns(old, segment, turned)
                for part, share, axis in zip(parts.tolist(), shares, axes, strict=True):
                    shared[float(source.key_frames[part])] = _turns_of(source, part, turned, share, axis, whole=whole)
    return shared


def _joined(old: KeyedTransform, source: KeyedTransform) -> dict[float, float]:
    """Return the whole turns of segments that were joined from several parts, at least one with fractional turns."""
    shared: dict[float, float] = {}
    for segment in np.flatnonzero(source.segment_turns != np.rint(source.segment_turns)).tolist():
        ends = source.key_frames[segment : segment + 2]
        parts = _segments_within(old.key_frames, *ends)
        if len(parts) > 1 and source.segment_turns[segment] == old.segment_turns[parts[0]]:
            turned = turning_in(old, int(parts[0]))
            shares, axes = _shares(old, turned, ends)
            shared[float(ends[0])] = _turns_of(source, segment, turned, shares[0], axes[0], whole=True)
    return shared


def _segments_within(frames: np.ndarray, first: float, last: float) -> np.ndarray:
    """Return the segments between these key frames that begin at `first` or later, and before `last`."""
    return np.flatnonzero((frames[:-1] > first - SAME_FRAME) & (frames[:-1] < last - SAME_FRAME))


def _is_enough_in_whole_turns(source: KeyedTransform, segment: int, turned: Turning) -> bool:
    """Return whether the motion is the same no matter which part of a turn is spin.

    This is so if the whole turn is about one axis, and the path of the origin does not depend on it.
    """
    ends = source.values_at(source.key_frames[segment : segment + 2])[ROWS[LOCATION]]
    is_straight = MODE_NAMES[source.modes[segment]] in STRAIGHT_MODES or not np.ptp(ends, axis=1).any()
    return is_straight and float(np.abs(np.cross(turned.turn[:, 0], turned.axes_in_body[:, 0])).max()) < ONE_AXIS


def _shares(
    source: KeyedTransform, turned: Turning, frames: np.ndarray, along: Sequence[float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the fraction of a segment's turn made from each of the frames (p + 1,) in it to the next, (p,), and
    the axis of its spins in the body on each of them, (p, 3). `along` is the progress (p + 1,) on the frames, if it is
    not that of the motion.
    """
    most = max(abs(float(turned.spins.turns[0])), float(np.abs(source.segment_turns).sum()))
    steps = SAMPLES_PER_TURN * (1 + int(most))

    def sampled(ends: Sequence[float] | np.ndarray) -> np.ndarray:
        inner = [np.linspace(*pair, steps, endpoint=False) for pair in itertools.pairwise(ends)]
        return np.append(np.concatenate(inner), ends[-1])

    progress = None if along is None else sampled(along)
    quaternions = in_betweens(source, sampled(frames), progress=progress).desired.quaternions
    axes = np.tile(turned.spins.axes[:, 0], (len(quaternions), 1))
    if turned.spins.in_space[0]:
        axes = rotate(conjugate(quaternions), axes)
    angles = np.einsum("sk,sk->s", shortest_turns(quaternions[:-1], quaternions[1:]).T, axes[:-1])
    return angles.reshape(-1, steps).sum(axis=1) / turned.about[0], axes[:-1:steps]


def _turns_of(
    source: KeyedTransform, segment: int, of: Turning, share: float, axis: np.ndarray, *, whole: bool
) -> float:
    """Return the turns that a segment needs for this fraction of a turning, whose axis in the body there is (3,).

    They are whole if that is sufficient: if the path of the origin does not depend on which part of a turn is spin.
    """

    def about(result: Turning) -> float:
        return float(axis @ result.twists[:, 0, 0]) / FULL_TURN

    none, one = (turning_in(source, segment, turns=turns) for turns in (0.0, 1.0))
    sense = np.copysign(1.0, about(one) - about(none))
    if whole:
        return float(sense * np.rint((share * of.about[0] - float(axis @ none.turn[:, 0])) / FULL_TURN - about(none)))
    turns = share * float(of.spins.turns[0])
    part = turns - np.rint(turns)
    return float(sense * (part + np.rint(turns - about(turning_in(source, segment, turns=sense * part)))))
