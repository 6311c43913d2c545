"""Base of the state machines that edit: an animator at work on keys, modes and frames, in any order."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import rule

from rigid_motion import animation
from tests.animation.body_oracle import DEPENDS_ON_KEYS, Body
from tests.animation.bones import rigs
from tests.animation.keyed import (
    KEY_FIELDS,
    MARKED_FIELDS,
    MODE_IDS,
    WIDTHS,
    Carrier,
    curve_of,
    curves_of,
    key_frames,
    mode_at,
    moving_curves,
    snapshot,
    transform_paths,
)
from tests.animation.machine import LAST, Machine, Name, frames_in, seeds, shares, while_on
from tests.animation.modified import copy_modifier, is_term
from tests.animation.oracle import assert_near, expected_bases
from tests.animation.scenes import random_values

ORDERS = (*rigs.ORDERS, "AXIS_ANGLE")
INTERPOLATIONS, EASINGS, HANDLES = (
    [item.identifier for item in bpy.types.Keyframe.bl_rna.properties[name].enum_items]
    for name in ("interpolation", "easing", "handle_left_type")
)
SAME_FRAME = 0.005

periods = st.just(0.0) | st.floats(0.1, 10.0)
"""Period of ELASTIC, in frames. Thousands of swings in a segment are noise in single precision, also in Blender."""


def without_turns(keys: dict) -> dict:
    """Return a snapshot without the channel of turns."""
    return {channel: kept for channel, kept in keys.items() if channel[0] != "rigid_motion.turns"}


def assert_only_completed(made: dict, after: dict, frame: float) -> None:
    """Check that only keys on this frame changed: more components may be keyed there, and on the keys before and after.

    Handles may change as Blender adapts them to a key, and handles of the adjacent keys may be set. Turns are split
    between the parts of a segment.
    """
    made, after = without_turns(made), without_turns(after)
    frames = {key[0] for *_, keys in made.values() for key in keys}
    for channel, (*rest, keys) in after.items():
        if channel not in made:
            assert len(keys) == 1, f"{channel} is new"
            continue
        *rest_made, keys_made = made[channel]
        assert rest == rest_made
        kept = {key[0]: key for key in keys_made if abs(key[0] - frame) >= SAME_FRAME}
        added = {key[0] for key in keys} - kept.keys()
        others = [near for near in added if abs(near - frame) >= SAME_FRAME]
        assert frames.issuperset(others)
        assert max((sum(near < frame for near in others), sum(near > frame for near in others))) <= 1
        assert len(added) <= len(others) + 1
        beside = {near for pair in itertools.pairwise(key[0] for key in keys) if added & {*pair} for near in pair}
        now = {key[0]: key for key in keys}
        for near, key in kept.items():
            assert (*now[near][:2], *now[near][6:10]) == (*key[:2], *key[6:10])
            # Free handles are the animator's. Only those next to new keys are shortened with their segment.
            if near not in beside:
                assert now[near][10:12] == key[10:12]
                assert now[near] == key or key[10:12] != ("FREE", "FREE")


def is_timed_together(carrier: Carrier, frame: float) -> bool:
    """Whether all channels have keys and handles (or no handles) on the same frames in the segment at this frame."""
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


class Editing(Machine):
    """An animator at work on carriers of keys. Subclasses define the carriers."""

    def _expected(self, name: Name, frames: Sequence[float]) -> np.ndarray:
        """Return the matrices that its channels must produce on frames, (m, 4, 4)."""
        return expected_bases(self._found(name), frames)

    def _curve(self, obj: Carrier, share: float) -> bpy.types.FCurve | None:
        curves = [curve for (path, _), curve in curves_of(obj).items() if path in WIDTHS and curve.keyframe_points]
        return curves[int(share * len(curves))] if curves else None

    def _keys_on(self, obj: Carrier, frame: float) -> Iterator[tuple[bpy.types.FCurve, bpy.types.Keyframe]]:
        for (path, _), fcurve in curves_of(obj).items():
            if path in WIDTHS:
                for point in fcurve.keyframe_points:
                    if abs(point.co[0] - frame) < SAME_FRAME:
                        yield fcurve, point

    def _pose(self, obj: Carrier, seed: int) -> None:
        for path in transform_paths(obj)[:2]:
            setattr(obj, path, random_values(obj, path, 1, seed)[0])
        bpy.context.view_layer.update()

    def _edit_curve(self, name: Name, share: float, change: Callable[[bpy.types.FCurve], None]) -> None:
        """Change one of the channels with keys, if there are any."""

        def change_it() -> None:
            fcurve = self._curve(self._found(name), share)
            if fcurve is not None:
                change(fcurve)
                fcurve.update()

        self._edit(change_it)

    def _edit_keys(
        self,
        name: Name,
        share: float,
        change: Callable[[bpy.types.FCurve, bpy.types.Keyframe], None],
        *,
        one_channel: bool = False,
    ) -> None:
        """Change the keys of all channels, or of one channel, on one of the frames with keys."""

        def change_them() -> None:
            obj = self._found(name)
            frames = key_frames(obj)
            keys = list(self._keys_on(obj, frames[int(share * len(frames))])) if len(frames) else []
            for fcurve, point in keys[: 1 if one_channel else None]:
                change(fcurve, point)
                fcurve.update()

        self._edit(change_them)

    def _chosen(self, name: Name, which: set[int]) -> list[float]:
        """Return some of the frames with keys."""
        keys = key_frames(self._found(name))
        return sorted({float(keys[number % len(keys)]) for number in which}) if len(keys) else []

    def _inserted_keys_check(self, frame: float) -> Callable[[dict, dict], None]:
        """Return a check that keys are as edited, except for changes caused by keys inserted on this frame."""

        def settle(made: dict, after: dict) -> None:
            for name in self.names:
                assert_only_completed(made[name], after[name], frame)

        return settle

    # Edits

    @while_on(
        who=shares,
        what=st.sampled_from((None, None, (0,), (1,), (2,), (0, 1))),
        index=st.none() | st.integers(0, 2),
        posed=st.booleans(),
        seed=seeds,
    )
    def insert_a_key_at_the_current_frame(self, who, what, index, posed, seed):
        """Key all channels, some parts or one component, as Auto Key does, at the displayed pose. Nothing jumps."""
        name, frame = self._named(who), bpy.context.scene.frame_current_final
        obj = self._found(name)
        bpy.context.view_layer.update()
        paths = transform_paths(obj) if what is None else [transform_paths(obj)[part] for part in what]
        index = -1 if what is None or index is None else index
        goes_by = (
            self._frames_kept_by_a_key(name) if what is None and not posed and not self._is_posed(obj) else np.empty(0)
        )
        before = self._expected(name, goes_by)
        if posed:
            self._pose(obj, seed)
        alone = self._sharing(name) == {name} or not posed
        seen = {other: self._basis(self._found(other)) for other in self.names if other == name or alone}
        values = {path: tuple(getattr(obj, path)) for path in paths}

        def insert() -> None:
            for path in paths:
                self._found(name).keyframe_insert(path, frame=frame, index=index)

        self._edit(insert, self._inserted_keys_check(frame))
        self._assert_in_place(seen)
        obj = self._found(name)
        for path in paths:
            for number in range(WIDTHS[path]) if index < 0 else (index,):
                (value,) = (
                    key.co[1] for curve, key in self._keys_on(obj, frame) if curve == curve_of(obj, path, number)
                )
                assert abs(value - values[path][number]) < 1e-5 * max(1.0, abs(value)), f"{path} {number} of {name}"
        if not posed and not self._is_posed(obj):
            bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)
            self._assert_in_place(seen)
        assert_near(self._expected(name, goes_by), before, name, 1e-3)

    def _assert_in_place(self, seen: dict) -> None:
        """Check that carriers are still displayed in the same place."""
        bpy.context.view_layer.update()
        for name, then in seen.items():
            assert_near(self._basis(self._found(name)), then, name)

    def _frames_kept_by_a_key(self, name) -> np.ndarray:
        """Return the frames on which the motion must stay if all keyed channels get a key now."""
        obj, frame = self._found(name), bpy.context.scene.frame_current_final
        keys, mode, body = key_frames(obj), mode_at(obj, frame), Body(obj)
        is_between = len(keys) > 1 and keys[0] < frame < keys[-1] and np.abs(keys - frame).min() >= 0.01
        if not is_between or not is_timed_together(obj, frame) or (mode in DEPENDS_ON_KEYS and body.may_spin()):
            return np.empty(0)
        # In Blender's own segments, as in those of an uneven scale, handles do not always keep the curve.
        # A smooth segment next to one of another mode gets the new key as its neighbour.
        modes = {mode_at(obj, key) for key in keys}
        if mode == "BLENDER" or body.is_uneven or (len(modes) > 1 and "motor_spline" in modes):
            return np.empty(0)
        goes_by = np.arange(keys[0], keys[-1], 0.5)
        if body.is_beside_path(frame):
            # The new key is nearest to another point of the path: up to the surrounding keys, the motion may change.
            first, last = keys[keys < frame][-1], keys[keys > frame][0]
            goes_by = goes_by[(goes_by <= first) | (goes_by >= last)]
        return goes_by

    def _is_posed(self, obj: Carrier) -> bool:
        """Whether it has an unkeyed pose on this frame."""
        frame = bpy.context.scene.frame_current_final
        return any(
            abs(getattr(obj, path)[index] - fcurve.evaluate(frame)) > 1e-5 * max(1.0, abs(fcurve.evaluate(frame)))
            for (path, index), fcurve in curves_of(obj).items()
            if path in WIDTHS and len(fcurve.keyframe_points) and not fcurve.mute
        )

    @while_on(who=shares, other=shares, by=st.sampled_from((0.0, 4.0, 0.25)))
    def paste_keys_of_another(self, who, other, by):
        """Like the Dope Sheet: each key is inserted with all its settings, including its mode."""
        name, other = self._named(who), self._named(other)
        model, both = self._found(other), [snapshot(self._found(one)) for one in (name, other)]
        keyed = [{channel for channel, (*_, keys) in channels.items() if keys} for channels in both]
        if name in self._sharing(other) or model.rotation_mode != self._found(name).rotation_mode:
            return
        if keyed[0] != keyed[1] or any(path not in WIDTHS for path, _ in keyed[0]):
            return
        if any(is_muted for channels in both for _, is_muted, *_ in channels.values()):
            return
        modes = [mode_at(model, frame) for frame in key_frames(model)]

        def paste() -> None:
            model, curves = self._found(other), curves_of(self._found(name))
            for channel in keyed[0]:
                keys = curves[channel].keyframe_points
                keys.clear()
                for key in curves_of(model)[channel].keyframe_points:
                    pasted = keys.insert(key.co[0] + by, key.co[1])
                    for field in (*KEY_FIELDS, *MARKED_FIELDS):
                        setattr(pasted, field, getattr(key, field))
                curves[channel].update()

        self._edit(paste)
        assert [mode_at(self._found(name), frame) for frame in key_frames(self._found(name))] == modes

    @rule(who=shares, frame=frames_in, seed=seeds, partly=st.booleans())
    def insert_keys_of_any_value_anywhere(self, who, frame, seed, partly):
        name, frame = self._named(who), frame + self.shift

        def insert() -> None:
            obj = self._found(name)
            for (path, index), fcurve in curves_of(obj).items():
                if path in WIDTHS and not (partly and (index + seed) % 2):
                    value = random_values(obj, path, 1, seed)[0, index]
                    fcurve.keyframe_points.insert(frame, value)

        self._edit(insert, self._inserted_keys_check(frame))

    @rule(who=shares, which=shares, to=frames_in, one_channel=st.booleans())
    def move_keys(self, who, which, to, one_channel):
        name, to = self._named(who), to + self.shift
        if not any(True for _ in self._keys_on(self._found(name), to)):
            self._edit_keys(name, which, lambda _, point: setattr(point.co_ui, "x", to), one_channel=one_channel)

    @rule(who=shares, which=shares, one_channel=st.booleans())
    def delete_keys(self, who, which, one_channel):
        name = self._named(who)
        self._edit_keys(name, which, lambda curve, key: curve.keyframe_points.remove(key), one_channel=one_channel)

    @while_on(who=shares, parts=st.sets(st.integers(0, 2), min_size=1))
    def delete_all_keys(self, who, parts):
        """It stays where it is, as in Blender."""
        name = self._named(who)
        if self._sharing(name) != {name}:
            return
        seen = {name: self._basis(self._found(name))}

        def delete() -> None:
            obj = self._found(name)
            for part in sorted(parts):
                for (path, _), fcurve in curves_of(obj).items():
                    if path == transform_paths(obj)[part]:
                        fcurve.keyframe_points.clear()
            self._unmute_if_all_muted(name)

        self._edit(delete)
        if len(parts) == 3:
            self._assert_in_place(seen)

    # Settings

    @rule(who=shares, which=shares, kind=st.sampled_from(("KEYFRAME", "BREAKDOWN")))
    def set_the_type_of_keys(self, who, which, kind):
        self._edit_keys(self._named(who), which, lambda _, point: setattr(point, "type", kind))

    @rule(who=shares, seed=seeds, frame=frames_in)
    def pose_it_without_a_key_and_go_elsewhere(self, who, seed, frame):
        back = bpy.context.scene.frame_current
        self._pose(self._found(self._named(who)), seed)
        bpy.context.scene.frame_set(int(frame + self.shift))
        bpy.context.scene.frame_set(back)

    @rule(who=shares, which=shares, at=shares, seed=seeds)
    def change_a_value(self, who, which, at, seed):
        self._edit_curve(self._named(who), which, lambda fcurve: self._set_a_value(fcurve, at, seed))

    @staticmethod
    def _set_a_value(fcurve: bpy.types.FCurve, at: float, seed: int) -> None:
        point = fcurve.keyframe_points[int(at * len(fcurve.keyframe_points))]
        point.co_ui.y = np.exp(np.random.default_rng(seed).normal())
        fcurve.update()

    @rule(
        who=shares,
        which=shares,
        interpolation=st.sampled_from(INTERPOLATIONS),
        easing=st.sampled_from(EASINGS),
        one_channel=st.booleans(),
        shape=st.tuples(st.floats(0.0, 3.0), st.floats(0.0, 2.0), periods),
    )
    def ease(self, who, which, interpolation, easing, one_channel, shape):
        def change(_: bpy.types.FCurve, point: bpy.types.Keyframe) -> None:
            point.interpolation, point.easing = interpolation, easing
            if not self._is_held(self._named(who)):
                # Keys store their holders in settings that only some interpolations have.
                point.back, point.amplitude, point.period = shape

        self._edit_keys(self._named(who), which, change, one_channel=one_channel)

    @rule(who=shares, which=shares, at=shares, kind=st.sampled_from(HANDLES), seed=seeds)
    def shape_handles(self, who, which, at, kind, seed):
        def change(fcurve: bpy.types.FCurve) -> None:
            point = fcurve.keyframe_points[int(at * len(fcurve.keyframe_points))]
            point.interpolation = "BEZIER"
            point.handle_left_type = point.handle_right_type = kind
            by = np.random.default_rng(seed).normal(size=4) * (5.0, 1.0, 5.0, 1.0)
            point.handle_left = point.co[0] - abs(by[0]), point.co[1] + by[1]
            point.handle_right = point.co[0] + abs(by[2]), point.co[1] + by[3]

        self._edit_curve(self._named(who), which, change)

    @rule(who=shares, which=shares, way=st.sampled_from(("CONSTANT", "LINEAR")))
    def extrapolate(self, who, which, way):
        self._edit_curve(self._named(who), which, lambda fcurve: setattr(fcurve, "extrapolation", way))

    @rule(who=shares, which=shares)
    def mute_a_channel(self, who, which):
        name = self._named(who)
        if self._sharing(name) == {name} and not self._is_held(name):

            def change(fcurve: bpy.types.FCurve) -> None:
                fcurve.mute = not fcurve.mute
                self._unmute_if_all_muted(name)

            self._edit_curve(name, which, change)

    def _unmute_if_all_muted(self, name: Name) -> None:
        """Unmute all channels if all keyed ones are muted: modes rightly report that they cannot act on these."""
        obj = self._found(name)
        for fcurve in curves_of(obj).values() if not moving_curves(obj) else ():
            fcurve.mute = False

    @while_on(who=shares, which=shares, how=st.sampled_from(("delete", "double", "paste")))
    def tamper_with_terms(self, who, which, how):
        name = self._named(who)

        def change(fcurve: bpy.types.FCurve) -> None:
            terms = [item for item in fcurve.modifiers if is_term(item)]
            if how == "delete":
                for term in terms[::2]:
                    fcurve.modifiers.remove(term)
                return
            for fellow in moving_curves(self._found(name))[:2] if how == "paste" else [fcurve]:
                for term in terms[:4]:
                    copy_modifier(term, fellow)

        self._edit_curve(name, which, change)

    @while_on(who=shares, which=st.sets(st.integers(0, 5), min_size=1), mode=st.sampled_from(MODE_IDS))
    def set_the_mode_of_keys(self, who, which, mode):
        name = self._named(who)
        obj, chosen = self._found(name), self._chosen(name, which)
        keys = key_frames(obj)
        expected = [mode if frame in chosen else mode_at(obj, frame) for frame in keys]
        if chosen:
            self._edit(lambda: animation.set_mode(self._found(name), mode, chosen))
        obj = self._found(name)
        assert [mode_at(obj, frame) for frame in keys] == expected == animation.modes_of(obj, keys)

    @while_on(who=shares, which=st.sets(st.integers(0, 5), min_size=1), turns=st.integers(-3, 3))
    def set_the_turns_of_keys(self, who, which, turns):
        name = self._named(who)
        if chosen := self._chosen(name, which):
            self._edit(lambda: animation.set_turns(self._found(name), turns, chosen, refused=[]))

    @while_on(which=st.sets(st.integers(0, 5), min_size=1), mode=st.sampled_from(MODE_IDS), by_property=st.booleans())
    def set_the_mode_of_all_segments(self, which, mode, by_property):
        names = self._chosen_names(which)

        def change() -> None:
            carriers = [self._found(name) for name in names]
            if not by_property:
                animation.set_mode(carriers, mode)
            for carrier in carriers if by_property else ():
                carrier.rigid_motion.mode = mode

        self._edit(change)
        for carrier in map(self._found, names):
            assert {mode_at(carrier, frame) for frame in key_frames(carrier)} <= {mode}
            assert carrier.rigid_motion.mode == mode

    @rule(frame=frames_in)
    def go_to_a_frame(self, frame):
        frame += self.shift
        bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)

    @while_on(end=st.integers(5, LAST + 20))
    def change_the_frame_range(self, end):
        self._edit(lambda: setattr(bpy.context.scene, "frame_end", end))
