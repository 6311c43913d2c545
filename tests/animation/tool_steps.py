"""What animators do with tools on top of modes, as steps of a machine that edits: breakdowns, holds, noise."""

from __future__ import annotations

from contextlib import suppress

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from rigid_motion import animation
from tests.animation.editing import Editing, seeds, shares
from tests.animation.keyed import curves_of, key_frames, rotation_path, snapshot
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
        keys, before, settable = key_frames(obj), snapshot(obj), self._has_keys_for_any_pose(obj)
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
        if settable and kind == "BREAKDOWN" and factor in (0.0, 1.0):
            now, then = expected_bases(obj, [frame, ends[int(factor)]], self.owns.get(name))
            assert np.abs(now - then).max() < 2e-5 * max(1.0, np.abs(then).max()), f"{name}: {now}\nis not\n{then}"

    @precondition(lambda self: self.on)
    @rule(who=shares, step=st.sampled_from((None, 2.0, 3.0, 7.0)), offset=st.sampled_from((0.0, 1.0, 30.0)), seed=seeds)
    def look_at_it_held_or_shaken_and_take_that_off(self, who, step, offset, seed):
        name = self._named(who)

        def change() -> None:
            obj, added = self._found(name), []
            for channel, fcurve in animators(obj).items():
                if step is not None:
                    added.append((fcurve, fcurve.modifiers.new("STEPPED")))
                    added[-1][1].frame_step, added[-1][1].frame_offset = step, offset
                if channel == ("location", seed % 3) and seed % 2:
                    added.append((fcurve, fcurve.modifiers.new("NOISE")))
                    added[-1][1].phase = float(seed % 100)
            bpy.context.view_layer.update()
            assert animation.problem_of(obj) == ""
            self._assert_shown(obj)
            for fcurve, modifier in added:
                fcurve.modifiers.remove(modifier)

        self._edit(change)

    def _assert_shown(self, obj: bpy.types.Object) -> None:
        """An object is shown where it has to be, on frames on which its parents are, too."""
        carried_by = [obj]
        while (parent := carried_by[-1].parent) is not None:
            carried_by.append(parent)
        assert_shown([obj], self._frames_that_are_seen(carried_by), self.owns)


def animators(obj: bpy.types.Object) -> dict[tuple[str, int], bpy.types.FCurve]:
    """The F-curves of location, rotation and scale that have keys."""
    path = rotation_path(obj)
    return {
        channel: fcurve
        for channel, fcurve in curves_of(obj).items()
        if channel[0] in ("location", path, "scale") and len(fcurve.keyframe_points)
    }
