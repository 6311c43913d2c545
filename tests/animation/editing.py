"""An animator at work on keys, modes and frames, in whatever order: what machines that edit have in common."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from tests.animation.body_oracle import Own, bodies_of, is_beside_path, may_spin
from tests.animation.bones import rigs
from tests.animation.edit_steps import LAST, frames_in, seeds, shares
from tests.animation.keyed import (
    KEY_FIELDS,
    MARKED_FIELDS,
    WIDTHS,
    Carrier,
    curves_of,
    key_frames,
    mode_at,
    moving_curves,
    snapshot,
    transform_paths,
)
from tests.animation.oracle import expected_bases
from tests.animation.path_oracle import DEPENDS_ON_KEYS
from tests.animation.scenes import random_values
from tests.animation.settings_steps import SAME_FRAME, Settings

__all__ = ["LAST", "Editing", "frames_in", "seeds", "shares"]

ORDERS = (*rigs.ORDERS, "AXIS_ANGLE")


def segment_start(keys: np.ndarray, frame: float) -> float:
    """The key that the segment of a frame begins on: that of the first or the last one outside of all."""
    return float(keys[np.clip(np.searchsorted(keys, frame) - 1, 0, len(keys) - 2)])


def without_turns(keys: dict) -> dict:
    """A snapshot without the channel of turns."""
    return {channel: kept for channel, kept in keys.items() if channel[0] != "rigid_motion.turns"}


def assert_only_completed(made: dict, after: dict, frame: float) -> None:
    """Between these snapshots no key changed but on this frame, where others than the components that were keyed may
    have one by now; and handles, as Blender has them follow a key.

    Those of the keys beside it may be set. Turns are shared out between the parts of a segment.
    """
    made, after = without_turns(made), without_turns(after)
    for channel, (*rest, keys) in after.items():
        if channel not in made:
            assert len(keys) == 1, f"{channel} is new"
            continue
        *rest_made, keys_made = made[channel]
        assert rest == rest_made
        others, others_made = (
            [key for key in of_one if abs(key[0] - frame) >= SAME_FRAME] for of_one in (keys, keys_made)
        )
        assert len(keys) - len(others) <= 1
        assert [(*key[:2], *key[6:10]) for key in others] == [(*key[:2], *key[6:10]) for key in others_made]
        behind = sum(key[0] < frame for key in others)
        for number, (key, key_made) in enumerate(zip(others, others_made, strict=True)):
            # Handles that are free are the animator's; only those beside the new key are shortened with their segment.
            if number not in (behind - 1, behind):
                assert key[10:12] == key_made[10:12]
                assert key == key_made or key[10:12] != ("FREE", "FREE")


def is_timed_together(carrier: Carrier, frame: float) -> bool:
    """Whether all channels go from key to key on the same frames here, with handles on the same frames or none."""
    timings = set()
    for fcurve in moving_curves(carrier):
        points = fcurve.keyframe_points
        number = sum(point.co[0] < frame for point in points)
        if not 0 < number < len(points):
            return False
        before, behind = points[number - 1], points[number]
        handles = before.handle_right[0] - before.co[0], behind.co[0] - behind.handle_left[0]
        eased = before.interpolation, before.easing
        timings.add((before.co[0], behind.co[0], eased, *np.round(np.minimum(handles, behind.co[0] - before.co[0]), 4)))
        if fcurve.extrapolation == "LINEAR" or before.interpolation not in ("BEZIER", "LINEAR"):
            return False
    return len(timings) == 1


def shapes_path(carrier: Carrier, frame: float) -> bool:
    """Whether a key inserted here is no breakdown, and makes another path: so it is where the carrier has spins."""
    return mode_at(carrier, frame) in DEPENDS_ON_KEYS and may_spin(carrier)


def _is(fcurve: bpy.types.FCurve, carrier: Carrier, path: str, index: int) -> bool:
    prefix = "" if isinstance(carrier, bpy.types.Object) else f"{carrier.path_from_id()}."
    return (fcurve.data_path, fcurve.array_index) == (prefix + path, index)


class Editing(Settings):
    """An animator at work on carriers of keys. What they are, machines say that are derived from it."""

    def _completes(self, frame: float) -> Callable[[dict, dict], None]:
        """Keys are as the edit made them, but for what goes with keys that were inserted on this frame."""

        def settle(made: dict, after: dict) -> None:
            for name in self.names:
                assert_only_completed(made[name], after[name], frame)

        return settle

    # Edits

    @precondition(lambda self: self.on)
    @rule(
        who=shares,
        what=st.sampled_from((None, None, (0,), (1,), (2,), (0, 1))),
        index=st.none() | st.integers(0, 2),
        posed=st.booleans(),
        seed=seeds,
    )
    def insert_a_key_at_the_current_frame(self, who, what, index, posed, seed):
        """Of all, or of parts of it or one component, as Auto Key does. It takes what is seen, and nothing jumps."""
        name, frame = self._named(who), bpy.context.scene.frame_current_final
        obj = self._found(name)
        bpy.context.view_layer.update()
        paths = transform_paths(obj) if what is None else [transform_paths(obj)[part] for part in what]
        index = -1 if what is None or index is None else index
        goes_by = self._frames_to_go_by(name) if what is None and not posed and not self._is_posed(obj) else np.empty(0)
        before = expected_bases(obj, goes_by, self.owns.get(name))
        if posed:
            self._pose(obj, seed)
        alone = self._sharing(name) == {name} or not posed
        seen = {other: self._basis(self._found(other)) for other in self.names if other == name or alone}
        values = {path: tuple(getattr(obj, path)) for path in paths}

        def insert() -> None:
            for path in paths:
                self._found(name).keyframe_insert(path, frame=frame, index=index)

        self._edit(insert, self._completes(frame))
        self._assert_in_place(seen)
        obj = self._found(name)
        for path in paths:
            for number in range(WIDTHS[path]) if index < 0 else (index,):
                (value,) = [key.co[1] for curve, key in self._keys_on(obj, frame) if _is(curve, obj, path, number)]
                assert abs(value - values[path][number]) < 1e-5 * max(1.0, abs(value)), f"{path} {number} of {name}"
        if not posed and not self._is_posed(obj):
            bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)
            self._assert_in_place(seen)
        if len(before):
            error = np.abs(expected_bases(obj, goes_by, self.owns.get(name)) - before).max(axis=(1, 2))
            worst = goes_by[error.argmax()]
            assert error.max() < 1e-3 * max(1.0, np.abs(before).max()), f"{name} moves by {error.max()} on {worst}"

    def _assert_in_place(self, seen: dict) -> None:
        """Things are still shown as they were."""
        bpy.context.view_layer.update()
        for name, then in seen.items():
            now = self._basis(self._found(name))
            error = np.abs(now - then).max()
            assert error < 1e-5 * max(1.0, np.abs(then).max()), f"{name} jumped from\n{then}\nto\n{now}"

    def _frames_to_go_by(self, name) -> np.ndarray:
        """Frames on which a key of all that is keyed, inserted now, leaves the motion as it is."""
        obj, frame = self._found(name), bpy.context.scene.frame_current_final
        keys = key_frames(obj)
        kept = (
            *(len(keys) > 1 and keys[0] < frame < keys[-1] and np.abs(keys - frame).min() >= 0.01,),
            *(len(bodies_of(obj, Own())) == 1,),
        )
        if not all(kept) or not is_timed_together(obj, frame):
            return np.empty(0)
        if shapes_path(obj, frame) or mode_at(obj, frame) != mode_at(obj, segment_start(keys, frame)):
            return np.empty(0)
        if len(modes := {mode_at(obj, key) for key in keys}) > 1 and "motor_spline" in modes:
            # A smooth segment beside one of another mode has the new key for its neighbour.
            return np.empty(0)
        goes_by = np.arange(keys[0], keys[-1], 0.5)
        if is_beside_path(obj, frame, self.owns.get(name)):
            # The new key is nearest to another moment of the path: up to the keys around it the motion may change.
            first, last = keys[keys < frame][-1], keys[keys > frame][0]
            goes_by = goes_by[(goes_by <= first) | (goes_by >= last)]
        return goes_by

    def _is_posed(self, obj: Carrier) -> bool:
        """Whether it was posed by hand on this frame."""
        frame = bpy.context.scene.frame_current_final
        return any(
            abs(getattr(obj, path)[index] - fcurve.evaluate(frame)) > 1e-5 * max(1.0, abs(fcurve.evaluate(frame)))
            for (path, index), fcurve in curves_of(obj).items()
            if path in WIDTHS and len(fcurve.keyframe_points) and not fcurve.mute
        )

    @precondition(lambda self: self.on)
    @rule(who=shares, other=shares, by=st.sampled_from((0.0, 4.0, 0.25)))
    def paste_keys_of_another(self, who, other, by):
        """As the Dope Sheet does: each key is inserted with all that it has, its mode among it."""
        name, other = self._named(who), self._named(other)
        if name == other or name in self._sharing(other):
            return
        model = self._found(other)
        if model.rotation_mode != self._found(name).rotation_mode or not curves_of(self._found(name)):
            return
        modes = [mode_at(model, frame) for frame in key_frames(model)]

        def paste() -> None:
            model, curves = self._found(other), curves_of(self._found(name))
            for channel, fcurve in curves_of(model).items():
                copy = curves.get(channel)
                if channel[0] in WIDTHS and copy is not None:
                    copy.keyframe_points.clear()
                    for key in fcurve.keyframe_points:
                        pasted = copy.keyframe_points.insert(key.co[0] + by, key.co[1])
                        for field in (*KEY_FIELDS, *MARKED_FIELDS):
                            setattr(pasted, field, getattr(key, field))
                    copy.update()

        if self._has_same_channels(name, other):
            self._edit(paste)
            obj = self._found(name)
            assert [mode_at(obj, frame) for frame in key_frames(obj)] == modes

    def _has_same_channels(self, *names) -> bool:
        """Whether these have the same channels with keys, none of them muted."""
        keyed = [{channel for channel, kept in snapshot(self._found(name)).items() if kept[-1]} for name in names]
        muted = any(curve.mute for name in names for curve in curves_of(self._found(name)).values())
        return keyed[0] == keyed[1] and not muted and not any(path not in WIDTHS for path, _ in keyed[0])

    @rule(who=shares, frame=frames_in, seed=seeds, partly=st.booleans())
    def insert_keys_of_any_value_anywhere(self, who, frame, seed, partly):
        name, frame = self._named(who), frame + self.shift

        def insert() -> None:
            obj = self._found(name)
            for (path, index), fcurve in curves_of(obj).items():
                if path in WIDTHS and not (partly and (index + seed) % 2):
                    value = random_values(obj, path, 1, seed)[0, index]
                    fcurve.keyframe_points.insert(frame, value)

        self._edit(insert, self._completes(frame))

    @rule(who=shares, which=shares, to=frames_in, one_channel=st.booleans())
    def move_keys(self, who, which, to, one_channel):
        name, to = self._named(who), to + self.shift

        def move() -> None:
            obj = self._found(name)
            frame = self._frame(obj, which)
            if frame is None or any(True for _ in self._keys_on(obj, to)):
                return
            moved = []
            for fcurve, point in list(self._keys_on(obj, frame))[: 1 if one_channel else None]:
                point.co_ui.x = to
                moved.append(fcurve)
            for fcurve in moved:
                fcurve.update()

        self._edit(move)

    @rule(who=shares, which=shares, one_channel=st.booleans())
    def delete_keys(self, who, which, one_channel):
        name = self._named(who)

        def delete() -> None:
            obj = self._found(name)
            frame = self._frame(obj, which)
            if frame is not None:
                for fcurve, point in list(self._keys_on(obj, frame))[: 1 if one_channel else None]:
                    fcurve.keyframe_points.remove(point)

        self._edit(delete)

    @precondition(lambda self: self.on)
    @rule(who=shares, parts=st.sets(st.integers(0, 2), min_size=1))
    def delete_all_keys(self, who, parts):
        """It stays where it is, as in Blender."""
        name = self._named(who)
        if self._sharing(name) != {name}:
            return
        seen = {name: self._basis(self._found(name))}

        def delete() -> None:
            obj = self._found(name)
            for part in sorted(parts):
                for index in range(4):
                    fcurve = curves_of(obj).get((transform_paths(obj)[part], index))
                    if fcurve is not None:
                        fcurve.keyframe_points.clear()

        self._edit(delete)
        if len(parts) == 3:
            self._assert_in_place(seen)
