"""State machine for offset layers: after any edits in any order, the offset is seen on top of the motion below."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule

from rigid_motion.animation import Refused, add_layer, merge_layer, radius_of, set_mode
from tests.animation.held import in_holder, worlds
from tests.animation.keyed import MODE_IDS, Carrier, curves_of, rotation_path
from tests.animation.layered import key_base, new, offsets, seen
from tests.animation.machine import SETTINGS, Machine, Name, seeds, shares, while_on
from tests.animation.oracle import assert_near
from tests.balls import displaced
from tests.thoroughness import THOROUGH

FRAMES = np.arange(-3.0, 46.0, 1.625)
WHOLE = np.arange(1.0, 41.0)
PRECISION = 2e-5
TOLERANCE = 0.01


def while_layered(**given: st.SearchStrategy) -> Callable:
    """Return a decorator for a rule that applies only to a layer, while the extension is on."""
    return lambda step: precondition(lambda self: self.base is not None)(while_on(**given)(step))


class Layering(Machine):
    """An animator at work on an object or a bone, on the offset of its layer, and on the Empty below."""

    @initialize(kind=st.sampled_from(("child", "root", "bone")), mode=st.sampled_from(MODE_IDS))
    def begin(self, kind, mode):
        self.kind = kind
        bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 40
        key_base(new(kind, "XYZ"), mode)
        self._start_history()

    @property
    def tool(self) -> Carrier:
        if self.kind == "child":
            return bpy.data.objects["Tool"]
        return bpy.data.objects["Rig"].pose.bones["Body" if self.kind == "root" else "Hand"]

    @property
    def base(self) -> bpy.types.Object | None:
        return self.tool.rigid_motion.base

    def _below(self) -> np.ndarray:
        """Return the Empty's matrices, relative to the same parent as those of `seen`."""
        if self.kind == "child":
            return worlds(self.base, FRAMES)
        return in_holder(self.base, self.tool.parent or self.tool.id_data, FRAMES)

    def _current_state(self) -> tuple[dict, list, dict]:
        return {"Tool": seen(self.tool, FRAMES)}, [], {}

    def _assert_as_in(self, state: tuple[dict, list, dict]) -> None:
        self._assert_seen_as(state[0]["Tool"])

    def _assert_seen_as(self, expected: np.ndarray) -> None:
        assert_near(seen(self.tool, FRAMES), expected, tolerance=PRECISION)

    def _play(self) -> dict[Name, np.ndarray]:
        return {"Tool": seen(self.tool, FRAMES)}

    @precondition(lambda self: self.on and self.history and self.base is not None)
    @invariant()
    def everything_is_where_it_has_to_be(self):
        """It is where the motion below and the offset say.

        Outside its strip, a layer keeps its values at the ends of the strip.
        """
        strip = self.tool.id_data.animation_data.nla_tracks["Rigid Motion Layer"].strips[0]
        frames = np.clip(FRAMES, strip.frame_start, strip.frame_end)
        self._assert_seen_as(self._below() @ offsets(self.tool, frames))

    @precondition(lambda self: self.on and self.base is None)
    @rule(frame=st.integers(-5, 45))
    def add(self, frame):
        before = seen(self.tool, FRAMES)
        bpy.context.scene.frame_set(frame)
        self._edit(lambda: add_layer(self.tool))
        self._assert_seen_as(before)

    @while_layered()
    def merge(self):
        before = seen(self.tool, WHOLE)
        refused: list[Refused] = []
        self._edit(lambda: merge_layer(self.tool, TOLERANCE, refused=refused))
        if refused:
            assert self.base is not None
            return
        assert self.base is None
        assert not len(self.tool.id_data.animation_data.nla_tracks)
        # Before the first key and after the last, it stays where it was on those keys.
        frames = sorted({key.co.x for curve in curves_of(self.tool).values() for key in curve.keyframe_points})
        inside = (frames[0] <= WHOLE) & (frames[-1] >= WHOLE)
        off = displaced(seen(self.tool, WHOLE), before, radius_of(self.tool))[inside].max(initial=0.0)
        assert off < TOLERANCE + 1e-4, f"merged it is off by {off}"

    @while_layered(frame=st.integers(-3, 44), seed=seeds, below=st.booleans())
    def pose_and_key(self, frame, seed, below):
        def change() -> None:
            random, carrier = np.random.default_rng(seed), self.base if below else self.tool
            bpy.context.scene.frame_set(frame)
            carrier.location = 0.3 * random.normal(size=3)
            carrier.rotation_euler = 0.3 * random.normal(size=3)
            for path in ("location", rotation_path(carrier)):
                carrier.keyframe_insert(path, frame=frame)

        self._edit(change)

    @while_layered(
        which=shares, below=st.booleans(), by=st.sampled_from((-3.0, 0.5, 2.0)), how=st.sampled_from(("move", "set"))
    )
    def edit_a_key(self, which, below, by, how):
        curves = [*curves_of(self.base if below else self.tool).values()]
        curves = [curve for curve in curves if curve.keyframe_points]
        if not curves:
            return

        def change() -> None:
            curve = curves[int(which * len(curves))]
            point = curve.keyframe_points[int(which * len(curve.keyframe_points))]
            setattr(point.co_ui, "x" if how == "move" else "y", (point.co.x if how == "move" else 0.0) + 0.3 * by)
            curve.update()
            curve.id_data.update_tag()

        self._edit(change)

    @while_layered(mode=st.sampled_from(MODE_IDS), below=st.booleans())
    def choose_a_mode(self, mode, below):
        self._edit(lambda: set_mode(self.base if below else self.tool, mode))

    @while_layered(frame=st.integers(1, 40), influence=st.floats(0.0, 1.0))
    def key_the_influence(self, frame, influence):
        def change() -> None:
            strip = self.tool.id_data.animation_data.nla_tracks["Rigid Motion Layer"].strips[0]
            strip.fcurves.find("influence").keyframe_points.insert(frame, influence)
            bpy.context.view_layer.update()

        self._edit(change)

    @while_layered(seed=seeds)
    def rename_the_empty(self, seed):
        self._edit(lambda: setattr(self.base, "name", f"Below {seed}"))

    @while_layered()
    def leave_the_strip_and_enter_it_again(self):
        data, before = self.tool.id_data.animation_data, seen(self.tool, FRAMES)

        def change() -> None:
            data.use_tweak_mode = False
            bpy.context.view_layer.update()
            self._assert_seen_as(before)
            data.use_tweak_mode = True

        self._edit(change)


Layering.TestCase.settings = settings(SETTINGS, max_examples=12 if THOROUGH else 3, stateful_step_count=20)
TestLayering = Layering.TestCase
