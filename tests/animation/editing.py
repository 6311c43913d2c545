"""An animator at work on keys, modes and frames, in whatever order: what machines that edit have in common."""

from __future__ import annotations

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from rigid_motion import animation
from tests.animation.edit_steps import LAST, frames_in, shares
from tests.animation.keyed import MODE_IDS, WIDTHS, Carrier, curves_of, key_frames, mode_at, snapshot, transform_paths
from tests.animation.machine import Machine, goes_on
from tests.animation.oracle import expected_bases, is_beside_path, may_spin
from tests.animation.path_oracle import DEPENDS_ON_KEYS
from tests.animation.scenes import random_values

INTERPOLATIONS = [item.identifier for item in bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items]
EASINGS = [item.identifier for item in bpy.types.Keyframe.bl_rna.properties["easing"].enum_items]
HANDLES = [item.identifier for item in bpy.types.Keyframe.bl_rna.properties["handle_left_type"].enum_items]

seeds = st.integers(0, 2**16)
SAME_FRAME = 0.005

periods = st.just(0.0) | st.floats(0.1, 10.0)
"""Of ELASTIC, in frames. Of many thousand swings in a segment, single precision makes noise, also in Blender itself."""


def segment_start(keys: np.ndarray, frame: float) -> float:
    """The key that the segment of a frame begins on: that of the first or the last one outside of all."""
    return float(keys[np.clip(np.searchsorted(keys, frame) - 1, 0, len(keys) - 2)])


def mode_channel(carrier: Carrier) -> bpy.types.FCurve | None:
    """The mode channel where it has keys, muted or not."""
    fcurve = curves_of(carrier).get(("rigid_motion.mode", 0))
    return fcurve if fcurve is not None and len(fcurve.keyframe_points) else None


def without_turns(keys: dict) -> dict:
    """A snapshot without the channel of turns."""
    return {channel: kept for channel, kept in keys.items() if channel[0] != "rigid_motion.turns"}


def assert_only_a_key_more(made: dict, after: dict, frame: float) -> None:
    """Between these snapshots no key changed but on this frame; and handles, as Blender has them follow a key.

    Those of the keys beside it may be set. Turns are shared out between the parts of a segment.
    """
    made, after = without_turns(made), without_turns(after)
    assert set(made) == set(after)
    for channel, (*rest, points) in after.items():
        *rest_made, points_made = made[channel]
        assert rest == rest_made
        others, others_made = (
            [point for point in keys if abs(point[0] - frame) >= SAME_FRAME] for keys in (points, points_made)
        )
        assert len(points) - len(others) <= 1
        assert [(*point[:2], *point[6:-2]) for point in others] == [(*point[:2], *point[6:-2]) for point in others_made]
        behind = sum(point[0] < frame for point in others)
        for number, (point, point_made) in enumerate(zip(others, others_made, strict=True)):
            # Handles that are free are the animator's; only those beside the new key are shortened with their segment.
            if number not in (behind - 1, behind):
                assert point[-2:] == point_made[-2:]
                assert point == point_made or point[-2:] != ("FREE", "FREE")


def is_timed_together(carrier: Carrier, frame: float) -> bool:
    """Whether all channels go from key to key on the same frames here, with handles on the same frames or none."""
    timings = set()
    for (path, _), fcurve in curves_of(carrier).items():
        points = fcurve.keyframe_points
        if path in WIDTHS and len(points) and not fcurve.mute:
            number = sum(point.co[0] < frame for point in points)
            if not 0 < number < len(points):
                return False
            before, behind = points[number - 1], points[number]
            handles = before.handle_right[0] - before.co[0], behind.co[0] - behind.handle_left[0]
            eased = before.interpolation, before.easing
            timings.add(
                (before.co[0], behind.co[0], eased, *np.round(np.minimum(handles, behind.co[0] - before.co[0]), 4))
            )
            if fcurve.extrapolation == "LINEAR" or before.interpolation not in ("BEZIER", "LINEAR"):
                return False
    return len(timings) == 1


def shapes_path(carrier: Carrier, frame: float) -> bool:
    """Whether a key inserted here is no breakdown, and makes another path: so it is where the carrier has spins."""
    return mode_at(carrier, frame) in DEPENDS_ON_KEYS and may_spin(carrier)


def is_seen_exactly(carrier: Carrier, frame: float) -> bool:
    """Whether it is seen where it has to be on this frame: objects are between frames only where that is asked for."""
    return frame % 1.0 == 0.0 or isinstance(carrier, bpy.types.PoseBone) or carrier.rigid_motion.is_exact


class Editing(Machine):
    """An animator at work on carriers of keys. What they are, machines say that are derived from it."""

    def _has_keys_for_any_pose(self, carrier: Carrier) -> bool:
        """What is not keyed, or muted, beside other channels of the same property has no key to get a value."""
        keyed = {name for name, fcurve in curves_of(carrier).items() if len(fcurve.keyframe_points) and not fcurve.mute}
        return all(
            {(path, index) in keyed for index in range(WIDTHS[path])} in ({True}, {False})
            for path in transform_paths(carrier)
        )

    def _only_share_out_turns(self, made: dict, after: dict) -> None:
        """Keys are as the edit made them, but for turns, which new keys share out."""
        for name in self.names:
            assert without_turns(after[name]) == without_turns(made[name]), f"the keys of {name} were changed"

    def _curve(self, obj: Carrier, share: float) -> bpy.types.FCurve | None:
        curves = [c for (path, _), c in curves_of(obj).items() if path in WIDTHS and len(c.keyframe_points)]
        return curves[int(share * len(curves))] if curves else None

    def _frame(self, obj: Carrier, share: float) -> float | None:
        keys = key_frames(obj)
        return float(keys[int(share * len(keys))]) if len(keys) else None

    def _keys_on(self, obj: Carrier, frame: float, with_mode: bool = True):
        for (path, _), fcurve in curves_of(obj).items():
            if path in WIDTHS or (with_mode and path == "rigid_motion.mode"):
                for point in fcurve.keyframe_points:
                    if abs(point.co[0] - frame) < SAME_FRAME:
                        yield fcurve, point

    # Edits

    @precondition(lambda self: self.on)
    @rule(who=shares, what=st.sampled_from(("location", "rotation", "scale", "all")), posed=st.booleans(), seed=seeds)
    def insert_a_key_at_the_current_frame(self, who, what, posed, seed):
        name, frame = self._named(who), bpy.context.scene.frame_current_final
        obj = self._found(name)
        keys = key_frames(obj)
        held, settable = self._holds_pose(obj, frame), self._has_keys_for_any_pose(obj)
        goes_on_as_before = held and not posed and is_timed_together(obj, frame) and not shapes_path(obj, frame)
        goes_on_as_before = goes_on_as_before and mode_at(obj, frame) == mode_at(obj, segment_start(keys, frame))
        goes_by = np.arange(keys[0], keys[-1], 0.5) if goes_on_as_before and is_seen_exactly(obj, frame) else ()
        if len(goes_by):
            first, last = keys[keys < frame][-1], keys[keys > frame][0]
            if is_beside_path(obj, first, last, self.owns.get(name)):
                # The new key is nearest to another moment of the path: up to the keys around it the motion may change.
                goes_by = goes_by[(goes_by <= first) | (goes_by >= last)]
        before = expected_bases(obj, goes_by, self.owns.get(name))
        moved = self._is_posed(obj)
        if posed:
            self._pose(obj, seed)
        seen = self._basis(obj)
        places = {"location": 0, "rotation": 1, "scale": 2}
        everything = transform_paths(obj)
        paths = everything if what == "all" else (everything[places[what]],)

        def insert() -> None:
            for path in paths:
                self._found(name).keyframe_insert(path, frame=frame)

        def settle(made: dict, after: dict) -> None:
            obj = self._found(name)
            sharing = self._sharing(name) if held else set()
            for other in self.names:
                if other not in sharing:
                    assert after[other] == made[other], f"the keys of {other} were changed"
            if held:
                assert_only_a_key_more(made[name], after[name], frame)
                # Off whole frames a key shows as the samples beside it have it, but it has the pose all the same.
                now = expected_bases(obj, [frame], self.owns.get(name))[0]
                size = max(1.0, np.abs(seen).max())
                error = np.abs(now - seen).max() if settable else 0.0
                assert error < 2e-5 * size, f"{name} jumped from\n{seen}\nto\n{now}\nkeys {keys}"
                if len(before) and settable and not moved:
                    error = np.abs(expected_bases(obj, goes_by, self.owns.get(name)) - before).max(axis=(1, 2))
                    size = max(1.0, np.abs(before).max())
                    worst = goes_by[error.argmax()]
                    assert error.max() < 1e-3 * size, f"{name} moves by {error.max():.3g} on {worst}, keys {keys}"

        self._edit(insert, settle)

    def _holds_pose(self, obj: Carrier, frame: float) -> bool:
        """Whether a key inserted now falls where a mode acts: into a segment, or where the outermost ones go on."""
        keys = key_frames(obj)
        if len(keys) < 2 or np.abs(keys - frame).min() < 0.01:
            return False
        return (keys[0] < frame < keys[-1] or goes_on(obj)) and mode_at(obj, segment_start(keys, frame)) != "BLENDER"

    def _pose(self, obj: Carrier, seed: int) -> None:
        for path in transform_paths(obj)[:2]:
            setattr(obj, path, random_values(obj, path, 1, seed)[0])
        bpy.context.view_layer.update()

    def _is_posed(self, obj: Carrier) -> bool:
        """Whether it was posed by hand on this frame."""
        frame = bpy.context.scene.frame_current_final
        return any(
            abs(getattr(obj, path)[index] - fcurve.evaluate(frame)) > 1e-5 * max(1.0, abs(fcurve.evaluate(frame)))
            for (path, index), fcurve in curves_of(obj).items()
            if path in WIDTHS and len(fcurve.keyframe_points) and not fcurve.mute
        )

    @rule(who=shares, which=shares, kind=st.sampled_from(("KEYFRAME", "BREAKDOWN")))
    def set_the_type_of_keys(self, who, which, kind):
        name = self._named(who)

        def change() -> None:
            obj = self._found(name)
            frame = self._frame(obj, which)
            if frame is not None:
                for fcurve, point in self._keys_on(obj, frame, False):
                    point.type = kind
                    fcurve.update()

        self._edit(change)

    @rule(who=shares, seed=seeds, frame=frames_in)
    def pose_it_without_a_key_and_go_elsewhere(self, who, seed, frame):
        back = bpy.context.scene.frame_current
        self._pose(self._found(self._named(who)), seed)
        bpy.context.scene.frame_set(int(frame + self.shift))
        bpy.context.scene.frame_set(back)

    @rule(who=shares, frame=frames_in, seed=seeds, partly=st.booleans())
    def insert_keys_of_any_value_anywhere(self, who, frame, seed, partly):
        name, frame = self._named(who), frame + self.shift

        def insert() -> None:
            obj = self._found(name)
            for (path, index), fcurve in curves_of(obj).items():
                if path in WIDTHS and not (partly and (index + seed) % 2):
                    value = random_values(obj, path, 1, seed)[0, index]
                    fcurve.keyframe_points.insert(frame, value)

        self._edit(insert, self._only_share_out_turns)

    @rule(who=shares, which=shares, to=frames_in, one_channel=st.booleans(), with_mode=st.booleans())
    def move_keys(self, who, which, to, one_channel, with_mode):
        name, to = self._named(who), to + self.shift

        def move() -> None:
            obj = self._found(name)
            frame = self._frame(obj, which)
            if frame is None or any(True for _ in self._keys_on(obj, to)):
                return
            moved = []
            for fcurve, point in list(self._keys_on(obj, frame, with_mode))[: 1 if one_channel else None]:
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

    @rule(who=shares, which=shares, at=shares, seed=seeds)
    def change_a_value(self, who, which, at, seed):
        name = self._named(who)

        def change() -> None:
            fcurve = self._curve(self._found(name), which)
            if fcurve is not None:
                point = fcurve.keyframe_points[int(at * len(fcurve.keyframe_points))]
                point.co_ui.y = np.exp(np.random.default_rng(seed).normal())
                fcurve.update()

        self._edit(change)

    @rule(
        who=shares,
        which=shares,
        interpolation=st.sampled_from(INTERPOLATIONS),
        easing=st.sampled_from(EASINGS),
        one_channel=st.booleans(),
        shape=st.tuples(st.floats(0.0, 3.0), st.floats(0.0, 2.0), periods),
    )
    def ease(self, who, which, interpolation, easing, one_channel, shape):
        name = self._named(who)

        def change() -> None:
            obj = self._found(name)
            frame = self._frame(obj, which)
            if frame is not None:
                for fcurve, point in list(self._keys_on(obj, frame, False))[: 1 if one_channel else None]:
                    point.interpolation, point.easing = interpolation, easing
                    point.back, point.amplitude, point.period = shape
                    fcurve.update()

        self._edit(change)

    @rule(who=shares, which=shares, at=shares, kind=st.sampled_from(HANDLES), seed=seeds)
    def shape_handles(self, who, which, at, kind, seed):
        name = self._named(who)

        def change() -> None:
            fcurve = self._curve(self._found(name), which)
            if fcurve is not None:
                point = fcurve.keyframe_points[int(at * len(fcurve.keyframe_points))]
                point.interpolation = "BEZIER"
                point.handle_left_type = point.handle_right_type = kind
                by = np.random.default_rng(seed).normal(size=4) * (5.0, 1.0, 5.0, 1.0)
                point.handle_left = point.co[0] - abs(by[0]), point.co[1] + by[1]
                point.handle_right = point.co[0] + abs(by[2]), point.co[1] + by[3]
                fcurve.update()

        self._edit(change)

    @rule(who=shares, which=shares, linear=st.booleans())
    def extrapolate(self, who, which, linear):
        name = self._named(who)

        def change() -> None:
            fcurve = self._curve(self._found(name), which)
            if fcurve is not None:
                fcurve.extrapolation = "LINEAR" if linear else "CONSTANT"
                fcurve.update()

        self._edit(change)

    @rule(who=shares, which=shares)
    def mute_a_channel(self, who, which):
        name = self._named(who)
        if len(self._sharing(name)) > 1:
            return

        def change() -> None:
            fcurve = self._curve(self._found(name), which)
            if fcurve is not None:
                fcurve.mute = not fcurve.mute

        self._edit(change)

    @rule(who=shares, at=shares, mode=st.none() | st.sampled_from(MODE_IDS))
    def mute_the_mode_channel_or_change_a_key_of_it(self, who, at, mode):
        name = self._named(who)

        def change() -> None:
            fcurve = mode_channel(self._found(name))
            if fcurve is None:
                return
            if mode is None:
                fcurve.mute = not fcurve.mute
            else:
                fcurve.keyframe_points[int(at * len(fcurve.keyframe_points))].co_ui.y = MODE_IDS.index(mode)
                fcurve.update()

        self._edit(change)

    @precondition(lambda self: self.on)
    @rule(who=shares, which=st.sets(st.integers(0, 5), min_size=1), mode=st.sampled_from(MODE_IDS))
    def set_the_mode_of_keys(self, who, which, mode):
        name = self._named(who)
        obj = self._found(name)
        keys = key_frames(obj)
        if not len(keys):
            return
        chosen = sorted({float(keys[number % len(keys)]) for number in which})
        expected = [mode if frame in chosen else mode_at(obj, frame) for frame in keys]
        transforms = {channel: kept for channel, kept in snapshot(obj).items() if channel[0] in WIDTHS}

        def change() -> None:
            animation.set_mode(self._found(name), mode, chosen)

        self._edit(change)
        obj = self._found(name)
        assert [mode_at(obj, frame) for frame in keys] == expected == animation.modes_of(obj, keys)
        assert {channel: kept for channel, kept in snapshot(obj).items() if channel[0] in WIDTHS} == transforms

    @precondition(lambda self: self.on)
    @rule(who=shares, which=st.sets(st.integers(0, 5), min_size=1), turns=st.integers(-3, 3))
    def set_the_turns_of_keys(self, who, which, turns):
        name = self._named(who)
        keys = key_frames(self._found(name))
        if not len(keys):
            return
        chosen = sorted({float(keys[number % len(keys)]) for number in which})

        def change() -> None:
            animation.set_turns(self._found(name), turns, chosen, refused=[])

        self._edit(change)

    @precondition(lambda self: self.on)
    @rule(who=shares, mode=st.sampled_from(MODE_IDS))
    def set_the_mode_of_all_segments(self, who, mode):
        name = self._named(who)

        def change() -> None:
            animation.set_mode(self._found(name), mode)

        self._edit(change)
        assert {mode_at(self._found(name), frame) for frame in (1.0, 20.0)} == {mode}
        assert self._found(name).rigid_motion.mode == mode

    @rule(frame=frames_in)
    def go_to_a_frame(self, frame):
        frame += self.shift
        bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)

    @precondition(lambda self: self.on)
    @rule(end=st.integers(5, LAST + 20))
    def change_the_frame_range(self, end):
        def change() -> None:
            bpy.context.scene.frame_end = end

        self._edit(change)
