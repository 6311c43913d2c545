"""Keys on paths: moving, turning, retiming, inserting, deleting and selecting keys, each in all channels of a body.

Moves are given in the world and converted to channels through their space on the frame of each key. A transform without
keys of location cannot move: it turns about its origin until its lead point is as near as possible. For targets and
refusals see `apply`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion import Poses
from ...motion.affine import AffineMaps, turned
from ...motion.quaternions import from_matrices, matrices, multiply, normalise
from ..actions.channels import BREAKDOWN_KEY, code_of, key_fields, key_points, set_key_fields
from ..actions.slots import Binding
from ..evaluation.bodies import turn_into_quaternions
from ..evaluation.channel_values import channel_values
from ..evaluation.components import LOCATION, PART_OF, ROTATION, ROWS
from ..evaluation.differences import seen_values
from ..evaluation.marks import SAME_FRAME, near
from ..following.inserted import set_key
from ..queries.keyed import active_binding, frames_in
from ..transforms import Channel, Refused, Transform
from .apply import Readings, Target, TriedEdit, TriedEdits, apply_edit, editable_binding, editable_keys

MIN_KEY_DISTANCE_FRAMES = 1.0
"""The least distance in frames of a retimed key to its neighbours, unless these were nearer before."""

MAX_STILL_CHANGE = 1e-6
"""A smaller change of a value needs no key, and a smaller rotation counts as none."""

POINT_FIELDS = ("co", "handle_left", "handle_right")
SELECTION_FIELDS = ("select_control_point", "select_left_handle", "select_right_handle")

NOT_KEYED = n_("{name} has no keys of location or rotation to move: key it first")


class KeySpaces(NamedTuple):
    """n keys of a transform, and the spaces of their channels."""

    frames: np.ndarray
    """Frames of the Action, rising, shape (n,)."""

    maps: AffineMaps
    """From the space of location channels into the world, shape (n,)."""

    turns: np.ndarray | None
    """The matrices between rotation channels and that space, shape (n, 3, 3); None if there are none."""

    points: np.ndarray
    """The lead points of the body, in the world, shape (n, 3)."""

    weights: np.ndarray
    """The fraction of a movement that each key follows, 0 to 1, shape (n,)."""


class _Keys(TriedEdit):
    """The keys of one transform that are being edited."""

    def __init__(self, transform: Transform, readings: Readings, spaces: KeySpaces) -> None:
        binding, source = editable_keys(transform, readings)
        self.source = source
        self.spaces = spaces
        super().__init__(transform, binding, (*binding.moving, transform.turns_channel))
        is_tied = transform.is_part and transform.pose_bone.bone.use_connect and transform.pose_bone.parent is not None
        parts = {ROTATION} if is_tied else {LOCATION, ROTATION}
        self.rows = [
            row
            for row, channel in transform.channels.items()
            if PART_OF[row] in parts and row not in source.driven and self.keys.get(channel) is not None
        ]
        """The rows of components that can be moved."""
        if not self.rows:
            raise Refused(NOT_KEYED, name=transform.name)
        self.before = source.values_at(spaces.frames)
        for part in ROWS.keys() - source.keyed:
            self.before[ROWS[part]] = self.posed[ROWS[part], None]
        if is_tied:
            self.before[ROWS[LOCATION]] = 0.0
        others = frames_in(binding)
        away = others[~near(others, spaces.frames)] - spaces.frames[:, None]
        back, forth = (np.abs(away[side]).min(initial=np.inf) for side in (away < 0.0, away > 0.0))
        self.room = -max(back - MIN_KEY_DISTANCE_FRAMES, 0.0), max(forth - MIN_KEY_DISTANCE_FRAMES, 0.0)
        """The number of frames that the keys can move back and forth before they reach other keys."""

    def moved(self, delta: AffineMaps) -> np.ndarray:
        """Return the components (10, n) of the keys moved by maps of the world (n,)."""
        _, spaces, turns, points, _ = self.spaces
        rows, original = self.before.copy(), self.source.original[:, None].repeat(len(points), axis=1)
        turn_into_quaternions(rows, self.source.order)
        places = spaces.at((rows[ROWS[LOCATION]] + original[ROWS[LOCATION]]).T)
        axes = delta.axes
        if np.allclose(delta.axes, np.eye(3), atol=MAX_STILL_CHANGE) and self.rows[0] >= ROWS[ROTATION].start:
            axes = swings(points - places, delta.at(points) - places)
        along = spaces.axes if turns is None else spaces.axes @ turns
        # Under uneven scale this is no rotation: use the nearest one.
        first, _, last = np.linalg.svd(np.linalg.solve(along, axes @ along))
        quaternions = multiply(original[ROWS[ROTATION]].T, rows[ROWS[ROTATION]].T)
        poses = Poses(
            turned(np.linalg.inv(spaces.axes), delta.at(places) - spaces.origins),
            multiply(from_matrices(first @ last), quaternions),
        )
        each, ends = np.ones(len(points), dtype=int), np.stack((self.before, self.before))
        return channel_values(poses, each, np.zeros(len(points)), ends, original, self.source.order)

    def move(self, delta: AffineMaps) -> None:
        """Move the keys by maps of the world (n,). Breakdown keys become ordinary keys, which shape the path."""
        frames, values, source = self.spaces.frames, self.moved(delta), self.source
        passed = source.key_frames[source.on_path]
        for row in self.rows:
            channel = self.transform.channels[row]
            kept, fcurve = self.keys[channel], self.binding.curves[channel]
            assert kept is not None
            fields = {name: numbers.copy() for name, numbers in kept.items()}
            times = fields["co"][:, 0]
            at = np.abs(times - frames[:, None]).argmin(axis=1)
            there = np.abs(times[at] - frames) < SAME_FRAME
            by = values[row] - np.where(there, fields["co"][at, 1], self.before[row])
            if PART_OF[row] == ROTATION and not np.abs(by).max() > MAX_STILL_CHANGE:
                continue
            for name in POINT_FIELDS:
                fields[name][at[there], 1] += by[there]
            shapes = at[there & near(frames, passed)]
            types = fields["type"][shapes]
            fields["type"][shapes] = np.where(types == BREAKDOWN_KEY, code_of("type", "KEYFRAME"), types)
            set_key_fields(fcurve, fields)
            for number in np.flatnonzero(~there & (np.abs(by) > MAX_STILL_CHANGE)).tolist():
                set_key(fcurve, float(frames[number]), float(values[row, number]))

    def retime(self, by: float) -> None:
        """Move the keys by a number of frames, together with their handles."""
        for channel, kept in self.keys.items():
            if kept is not None:
                fields = {name: numbers.copy() for name, numbers in kept.items()}
                chosen = near(kept["co"][:, 0], self.spaces.frames)
                for name in POINT_FIELDS:
                    fields[name][chosen, 0] += by
                set_key_fields(self.binding.curves[channel], fields)


class KeyEdits(TriedEdits):
    """Keys of several transforms, for trying places or frames until the user accepts them."""

    def __init__(self, keys: Mapping[Transform, KeySpaces], *, refused: list[Refused] | None = None) -> None:
        def plan(transform: Transform, readings: Readings) -> _Keys:
            return _Keys(transform, readings, keys[transform])

        super().__init__(keys, plan, refused)

    def move(self, delta: Callable[[float], np.ndarray]) -> None:
        """Move all keys from their original places by rigid maps of the world (4, 4), which depend on their weights."""
        with self.edit():
            for one in self.tried:
                maps = np.stack([delta(weight) for weight in one.spaces.weights.tolist()])
                one.move(AffineMaps(maps[:, :3, :3], maps[:, :3, 3]))

    def retime(self, by: float) -> float:
        """Move all keys from their original frames, but not up to other keys; return the actual number of frames."""
        back, forth = (np.array([one.room[side] for one in self.tried]) for side in (0, 1))
        by = float(np.clip(by, back.max(), forth.min()))
        with self.edit():
            for one in self.tried:
                one.retime(by)
        return by


def insert_key(target: Target, frame: float) -> None:
    """Key the visible pose on a frame of the target's Action, in all channels with keys. The motion stays the same."""

    def plan(transform: Transform, readings: Readings) -> tuple[Binding, dict[Channel, float], bool]:
        binding, source = editable_keys(transform, readings)
        run = source.run_at(frame)
        values, channels = seen_values(run.source, run.moments(np.array([frame])))[:, 0].tolist(), transform.channels
        first, last = run.source.keyed_range
        is_native = first < frame < last and not run.source.mode_at(frame)
        return binding, {channels[row]: values[row] for rows, _ in source.channels for row in rows}, is_native

    def act(_: Transform, planned: tuple[Binding, dict[Channel, float], bool]) -> None:
        binding, values, is_native = planned
        for channel, value in values.items():
            fcurve = binding.curves[channel]
            behind = int(np.searchsorted(key_points(fcurve)[:, 0], frame))
            # Blender would recalculate automatic handles next to the key.
            for key in fcurve.keyframe_points[max(behind - 1, 0) : behind + 1] if is_native else ():
                key.handle_left_type = key.handle_right_type = "FREE"
            set_key(fcurve, frame, value)

    apply_edit(target, plan, act, None)


def delete_keys(keys: Mapping[Transform, np.ndarray], *, refused: list[Refused] | None = None) -> None:
    """Delete the keys on given frames (n,) of each transform. A channel without other keys is removed."""

    def plan(transform: Transform, readings: Readings) -> Binding:
        return editable_binding(transform, [binding for binding, _ in readings])

    def act(transform: Transform, binding: Binding) -> None:
        for channel in (*binding.moving, transform.turns_channel):
            if (fcurve := binding.curves.get(channel)) is not None:
                stays = ~near(key_points(fcurve)[:, 0], keys[transform])
                if stays.any():
                    fields = key_fields(fcurve.keyframe_points)
                    set_key_fields(fcurve, {name: numbers[stays] for name, numbers in fields.items()})
                else:
                    binding.remove_curve(channel)

    apply_edit(keys, plan, act, refused)


def select_keys(target: Transform, frames: np.ndarray) -> None:
    """Select a target's keys on these frames (n,), and deselect all its others."""
    if (binding := active_binding(target)) is not None:
        for fcurve in binding.curves.values():
            chosen = near(key_points(fcurve)[:, 0], frames)
            for name in SELECTION_FIELDS:
                fcurve.keyframe_points.foreach_set(name, chosen)


def swings(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the shortest rotations (n, 3, 3) that take the directions of vectors (n, 3) to those of others."""
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    cosines = lengths + np.einsum("ni,ni->n", first, second)
    turns = np.column_stack((np.where(cosines > 0.0, cosines, 1.0), np.cross(first, second)))
    return np.moveaxis(matrices(normalise(turns)), -1, 0)
