"""What is set of keys, channels and frames, as steps of a machine that edits."""

from __future__ import annotations

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from rigid_motion import animation
from tests.animation.edit_steps import LAST, frames_in, seeds, shares
from tests.animation.keyed import (
    MODE_IDS,
    WIDTHS,
    Carrier,
    curves_of,
    key_frames,
    mode_at,
    moving_curves,
    transform_paths,
)
from tests.animation.machine import Machine
from tests.animation.modified import copy_modifier, is_term
from tests.animation.scenes import random_values

INTERPOLATIONS = [item.identifier for item in bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items]
EASINGS = [item.identifier for item in bpy.types.Keyframe.bl_rna.properties["easing"].enum_items]
HANDLES = [item.identifier for item in bpy.types.Keyframe.bl_rna.properties["handle_left_type"].enum_items]

SAME_FRAME = 0.005

periods = st.just(0.0) | st.floats(0.1, 10.0)
"""Of ELASTIC, in frames. Of many thousand swings in a segment, single precision makes noise, also in Blender itself."""


class Settings(Machine):
    """An animator who changes what keys have."""

    def _curve(self, obj: Carrier, share: float) -> bpy.types.FCurve | None:
        curves = [curve for (path, _), curve in curves_of(obj).items() if path in WIDTHS and curve.keyframe_points]
        return curves[int(share * len(curves))] if curves else None

    def _frame(self, obj: Carrier, share: float) -> float | None:
        keys = key_frames(obj)
        return float(keys[int(share * len(keys))]) if len(keys) else None

    def _keys_on(self, obj: Carrier, frame: float):
        for (path, _), fcurve in curves_of(obj).items():
            if path in WIDTHS:
                for point in fcurve.keyframe_points:
                    if abs(point.co[0] - frame) < SAME_FRAME:
                        yield fcurve, point

    def _pose(self, obj: Carrier, seed: int) -> None:
        for path in transform_paths(obj)[:2]:
            setattr(obj, path, random_values(obj, path, 1, seed)[0])
        bpy.context.view_layer.update()

    @rule(who=shares, which=shares, kind=st.sampled_from(("KEYFRAME", "BREAKDOWN")))
    def set_the_type_of_keys(self, who, which, kind):
        name = self._named(who)

        def change() -> None:
            obj = self._found(name)
            frame = self._frame(obj, which)
            if frame is not None:
                for fcurve, point in self._keys_on(obj, frame):
                    point.type = kind
                    fcurve.update()

        self._edit(change)

    @rule(who=shares, seed=seeds, frame=frames_in)
    def pose_it_without_a_key_and_go_elsewhere(self, who, seed, frame):
        back = bpy.context.scene.frame_current
        self._pose(self._found(self._named(who)), seed)
        bpy.context.scene.frame_set(int(frame + self.shift))
        bpy.context.scene.frame_set(back)

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
                for fcurve, point in list(self._keys_on(obj, frame))[: 1 if one_channel else None]:
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

    @precondition(lambda self: self.on)
    @rule(who=shares, which=shares, how=st.sampled_from(("delete", "double", "paste")))
    def tamper_with_terms(self, who, which, how):
        name = self._named(who)

        def change() -> None:
            fcurve = self._curve(self._found(name), which)
            terms = [] if fcurve is None else [item for item in fcurve.modifiers if is_term(item)]
            if how == "delete":
                for term in terms[::2]:
                    fcurve.modifiers.remove(term)
            for fellow in moving_curves(self._found(name))[:2] if how == "paste" else [fcurve] if terms else []:
                for term in [term for term in terms[:4] if how != "delete"]:
                    copy_modifier(term, fellow)

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

        def change() -> None:
            animation.set_mode(self._found(name), mode, chosen)

        self._edit(change)
        obj = self._found(name)
        assert [mode_at(obj, frame) for frame in keys] == expected == animation.modes_of(obj, keys)

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
        obj = self._found(name)
        assert {mode_at(obj, frame) for frame in key_frames(obj)} <= {mode}
        assert obj.rigid_motion.mode == mode

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
