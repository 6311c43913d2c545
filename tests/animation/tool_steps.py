"""What animators do with tools on top of modes, as steps of a machine that edits: breakdowns, modifiers, samples."""

from __future__ import annotations

from contextlib import suppress

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from rigid_motion import animation
from tests.animation.body_oracle import Own, bodies_of
from tests.animation.edit_steps import LAST
from tests.animation.editing import Editing, seeds, shares
from tests.animation.keyed import WIDTHS, curves_of, key_frames, moving_curves, snapshot
from tests.animation.oracle import assert_shown, expected_bases


class WithTools(Editing):
    """An animator who also has these tools."""

    @precondition(lambda self: self.on)
    @rule(
        who=shares,
        kind=st.sampled_from(("BREAKDOWN", "BREAKDOWN", "PUSH", "RELAX")),
        factor=st.sampled_from((0.0, 1.0)) | st.floats(-0.2, 1.2),
        cancelled=st.booleans(),
    )
    def key_a_breakdown(self, who, kind, factor, cancelled):
        name, frame = self._named(who), bpy.context.scene.frame_current_final
        obj, done = self._found(name), []
        keys, before, is_even = key_frames(obj), snapshot(obj), len(bodies_of(obj, Own())) == 1
        others = keys[np.abs(keys - frame) >= 0.01]
        fits = len(others) > 1 and others[0] < frame < others[-1]
        ends = others[np.searchsorted(others, frame) - 1 :][:2] if fits else None

        def change() -> None:
            with suppress(animation.Refused):
                tries = animation.Breakdowns(self._found(name), kind)
                tries.apply(0.8)
                if cancelled:
                    tries.cancel()
                else:
                    tries.apply(factor)
                done.append(True)

        self._edit(change)
        assert bool(done) == fits
        obj = self._found(name)
        if cancelled or not done:
            assert snapshot(obj) == before
            return
        rest = keys[np.abs(key_frames(obj)[:, None] - keys).min(axis=0) >= 0.01]
        assert not len(rest), "a key went"
        # Parts with keys of their own go from each of these to the next, and what is muted gets no key.
        is_whole = is_even and not any(curve.mute for curve in curves_of(obj).values())
        if kind == "BREAKDOWN" and factor in (0.0, 1.0) and is_whole:
            now, then = expected_bases(obj, [frame, ends[int(factor)]], self.owns.get(name))
            assert np.abs(now - then).max() < 2e-5 * max(1.0, np.abs(then).max()), f"{name}: {now}\nis not\n{then}"

    @precondition(lambda self: self.on)
    @rule(
        who=shares,
        step=st.sampled_from((None, 2.0, 3.0, 7.0)),
        offset=st.sampled_from((0.0, 1.0, 30.0)),
        other=st.none() | st.sampled_from(("NOISE", "LIMITS", "FNGENERATOR")),
        blend=st.sampled_from(("REPLACE", "ADD", "SUBTRACT", "MULTIPLY")),
        seed=seeds,
    )
    def look_at_it_with_modifiers_and_take_them_off(self, who, step, offset, other, blend, seed):
        name = self._named(who)

        def change() -> None:
            obj, added = self._found(name), []
            for fcurve in (curve for (path, _), curve in curves_of(obj).items() if path in WIDTHS):
                if step is not None:
                    added.append((fcurve, fcurve.modifiers.new("STEPPED")))
                    added[-1][1].frame_step, added[-1][1].frame_offset = step, offset
                if other is not None and (fcurve.data_path, fcurve.array_index) == ("location", seed % 3):
                    modifier = fcurve.modifiers.new(other)
                    added.append((fcurve, modifier))
                    if other == "NOISE":
                        modifier.phase, modifier.blend_type = float(seed % 100), blend
                    elif other == "LIMITS":
                        modifier.use_max_y, modifier.max_y = True, 0.1 * (seed % 10) - 0.5
                    else:
                        modifier.use_additive = blend != "REPLACE"
            bpy.context.view_layer.update()
            assert animation.problem_of(obj) == ""
            carried_by = [obj]
            while (parent := carried_by[-1].parent) is not None:
                carried_by.append(parent)
            assert_shown([obj], self._frames_that_are_seen(carried_by), self.owns)
            for fcurve, modifier in added:
                fcurve.modifiers.remove(modifier)

        self._edit(change)

    @precondition(lambda self: self.on)
    @rule(who=shares, mode=st.sampled_from(("REPEAT", "MIRROR")))
    def let_it_repeat_for_a_while(self, who, mode):
        name = self._named(who)
        curves = moving_curves(self._found(name))
        ends = {(curve.keyframe_points[0].co[0], curve.keyframe_points[-1].co[0]) for curve in curves}
        if len(ends) != 1 or self._sharing(name) != {name}:
            return
        ((first, last),) = ends
        if last <= first:
            return

        def change() -> None:
            obj = self._found(name)
            animation.repeat(obj, mode)
            bpy.context.view_layer.update()
            assert animation.problem_of(obj) == ""
            frames = np.round(8.0 * np.random.default_rng(8).uniform(first, last, 8)) / 8.0
            frames = frames[(frames > first) & (frames < last)]
            again = frames + last - first if mode == "REPEAT" else 2.0 * last - frames
            error = np.abs(self._bases(name, again) - self._bases(name, frames)).max(initial=0.0)
            assert error < 1e-4 * max(1.0, np.abs(self._bases(name, frames)).max(initial=0.0)), (
                f"{name} is off by {error}"
            )
            for fcurve in moving_curves(self._found(name)):
                fcurve.modifiers.remove(next(item for item in fcurve.modifiers if item.type == "CYCLES"))

        self._edit(change)

    def _bases(self, name, frames: np.ndarray) -> np.ndarray:
        """How something is shown on frames."""
        scene, result = bpy.context.scene, []
        before = scene.frame_current, scene.frame_subframe
        for frame in frames:
            scene.frame_set(int(frame // 1), subframe=frame % 1)
            result.append(self._basis(self._found(name)))
        scene.frame_set(before[0], subframe=before[1])
        return np.array(result)

    @precondition(lambda self: self.on and self.place >= 0)
    @rule(who=shares, back=st.booleans())
    def turn_keys_to_samples(self, who, back):
        """Blender samples what is shown. There are no modes in samples, nor in keys made of them, and nothing moves."""
        name = self._named(who)
        curves = moving_curves(self._found(name))
        first, last = int(self.shift) - 1, int(self.shift) + LAST
        if not curves or self._sharing(name) != {name}:
            return
        frames = np.arange(first, last, 7.0)
        before = self._bases(name, frames)

        def change() -> None:
            for fcurve in moving_curves(self._found(name)):
                fcurve.convert_to_samples(first, last)
            bpy.context.view_layer.update()
            if back:
                for fcurve in curves_of(self._found(name)).values():
                    if not fcurve.keyframe_points and fcurve.sampled_points:
                        fcurve.convert_to_keyframes(first, last)

        self._edit(change, lambda made, after: None)
        assert np.abs(self._bases(name, frames) - before).max() < 1e-5 * max(1.0, np.abs(before).max())
        bpy.ops.ed.undo()
        self.place -= 1
        self._is_as_remembered()
        self._edit(lambda: None)
