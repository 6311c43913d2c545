"""Base of the editing state machines: undo steps, files, switching the extension on and off, and invariants.

Every edit is an operator with undo, as in a window. Blender pushes its undo step before handlers see the edit.
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable, Hashable, Iterable, Sequence
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import ClassVar

import bpy
import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from rigid_motion import animation
from tests.animation.keyed import Carrier, curves_of, key_frames, mode_at, moving_curves, snapshot
from tests.animation.modified import is_term
from tests.animation.oracle import assert_near
from tests.blank import blank
from tests.thoroughness import THOROUGH

LAST = 40
seeds = st.integers(0, 2**16)
shares = st.floats(0.0, 1.0, exclude_max=True)
frames_in = st.integers(-4, 4 * (LAST + 5)).map(lambda quarter: quarter / 4)

SETTINGS = settings(
    max_examples=40 if THOROUGH else 6,
    stateful_step_count=25,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
"""Settings of every machine."""

TURNS = "rigid_motion.turns", 0

Name = Hashable
"""Identifies a carrier of keys in a machine."""


def while_on(**given: st.SearchStrategy) -> Callable:
    """Return a decorator for a rule that applies only while the extension is on."""
    return lambda step: precondition(lambda self: self.on)(rule(**given)(step))


def goes_on(obj: Carrier) -> bool:
    """Whether any of its channels extrapolates linearly."""
    return any(fcurve.extrapolation == "LINEAR" for fcurve in moving_curves(obj))


def assert_keys_kept(name: Name, made: dict, after: dict) -> None:
    """Check that no key changed. Unkeyed channels may be removed, and components that a mode needs may get a first key.

    Fractional turns are merged when the key between them is deleted.
    """
    is_shared = {
        channel for channel, (*_, keys) in made.items() if channel == TURNS and any(key[1] % 1 for key in keys)
    }
    for channel, kept in after.items():
        if channel in is_shared:
            continue
        if made.get(channel, (0, 0, 0, ()))[-1]:
            assert kept == made[channel], f"the keys of {name}, {channel}, are\n{kept}\ninstead of\n{made[channel]}"
        elif kept[-1]:
            assert len(kept[-1]) == 1
            assert any(path in (channel[0], TURNS[0]) and keys[-1] for (path, _), keys in made.items())
    assert not any(made[channel][-1] for channel in made.keys() - after.keys() - is_shared)


class Edit(bpy.types.Operator):
    """Any change, as an operator with undo."""

    bl_idname = "test.edit"
    bl_label = "Edit"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    change: ClassVar[Callable[[], None]]

    def execute(self, context: bpy.types.Context) -> set[str]:
        Edit.change()
        return {"FINISHED"}


class Machine(RuleBasedStateMachine):
    """Base class for edits of carriers. Subclasses define the carriers and the edits."""

    def __init__(self) -> None:
        super().__init__()
        blank()
        bpy.utils.register_class(Edit)
        animation.register()
        self.on = True
        # Handlers log these errors instead of raising them into Blender.
        self.complaints = BufferingHandler(1000)
        self.complaints.setLevel(logging.ERROR)
        logging.getLogger("rigid_motion.animation").addHandler(self.complaints)
        self.folder = tempfile.TemporaryDirectory()
        self.names: list[Name] = []
        self.shift = 0.0
        self.fresh = 0
        self.before_bake: dict[Name, dict] = {}
        self.history: list[tuple[dict, list, dict]] = []
        self.place = -1
        self.steps = 0
        self.playing: dict[Name, np.ndarray] | None = None
        """The poses shown when the extension was switched off, until the next edit."""

    def teardown(self) -> None:
        if self.on:
            animation.unregister()
        bpy.utils.unregister_class(Edit)
        logging.getLogger("rigid_motion.animation").removeHandler(self.complaints)
        self.folder.cleanup()

    # Defined by subclasses for their carriers

    def _found(self, name: Name) -> Carrier:
        raise NotImplementedError

    def _basis(self, carrier: Carrier) -> np.ndarray:
        """Return the matrix displayed now, in its parent's space."""
        raise NotImplementedError

    def _sharing(self, name: Name) -> set[Name]:
        """Return the names of the carriers that share its channels, including itself."""
        raise NotImplementedError

    def _is_held(self, name: Name) -> bool:
        """Whether its keys say that it is held."""
        return False

    def _is_passed_on(self, name: Name) -> bool:
        """Whether it passes to another holder on the current frame."""
        return False

    def _assert_shown(self, names: Sequence[Name], frames: np.ndarray) -> None:
        """Check that these carriers are where they must be on these frames."""
        raise NotImplementedError

    def _named(self, share: float) -> Name:
        return self.names[int(share * len(self.names))]

    def _chosen_names(self, which: set[int]) -> list[Name]:
        return [*dict.fromkeys(self.names[number % len(self.names)] for number in sorted(which))]

    @staticmethod
    def _linked(obj: bpy.types.Object) -> tuple:
        data = obj.animation_data
        return (None, None) if data is None or data.action is None else (data.action, data.action_slot)

    @staticmethod
    def _link(obj: bpy.types.Object, action: bpy.types.Action | None, slot: bpy.types.ActionSlot | None) -> None:
        data = obj.animation_data_create()
        data.action = action
        if action is not None:
            data.action_slot = slot

    def _bases(self, names: Iterable[Name], frames: Sequence[float]) -> dict[Name, np.ndarray]:
        """Return the displayed matrices on frames, (m, 4, 4) each, by name."""
        scene = bpy.context.scene
        before, result = (scene.frame_current, scene.frame_subframe), {name: [] for name in names}
        for frame in frames:
            scene.frame_set(int(frame // 1), subframe=frame % 1)
            for name, bases in result.items():
                bases.append(self._basis(self._found(name)))
        scene.frame_set(before[0], subframe=before[1])
        return {name: np.array(bases) for name, bases in result.items()}

    # What the machine does with an edit

    def _start_history(self) -> None:
        bpy.ops.ed.undo_push(message="Begin")
        self.history = [self._current_state()]
        self.place = 0

    def _current_state(self) -> tuple[dict, list, dict]:
        return self._keyed(), self.names.copy(), self.before_bake.copy()

    def _keyed(self) -> dict[Name, dict]:
        return {name: snapshot(self._found(name)) for name in self.names}

    def _edit(self, change: Callable[[], None], settle: Callable[[dict, dict], None] | None = None) -> None:
        """Make an edit and let handlers see it. They must leave its keys alone, unless `settle` checks them instead."""
        self.playing = None
        made: dict[str, dict] = {}

        def noted() -> None:
            change()
            made.update(self._keyed())

        Edit.change = noted
        bpy.ops.test.edit("EXEC_DEFAULT", True)
        after = self._keyed()
        if settle is None:
            for name in self.names:
                assert_keys_kept(name, made[name], after[name])
        else:
            settle(made, after)
        if self.on:
            self.history[self.place + 1 :] = [self._current_state()]
            self.place += 1

    # Undo, redo, un-bake, files, on and off

    @precondition(lambda self: self.on and len(self.history) > 1)
    @rule(steps=st.integers(-3, 3))
    def undo_or_redo(self, steps):
        place = min(max(self.place + steps, 0), len(self.history) - 1)
        for _ in range(abs(place - self.place)):
            assert (bpy.ops.ed.undo if steps < 0 else bpy.ops.ed.redo)() == {"FINISHED"}
        self.place = place
        self._restore_remembered_names()

    def _restore_remembered_names(self) -> None:
        _, names, before_bake = state = self.history[self.place]
        self.names, self.before_bake = names.copy(), before_bake.copy()
        self._assert_as_in(state)

    def _assert_as_in(self, state: tuple[dict, list, dict]) -> None:
        assert self._keyed() == state[0]

    @precondition(lambda self: self.on and self.before_bake)
    @rule(who=shares)
    def unbake(self, who):
        name = sorted(self.before_bake)[int(who * len(self.before_bake))]
        keyed = self.before_bake.pop(name)
        self._edit(lambda: animation.unbake(self._found(name)))
        assert self._originals(name) == keyed
        assert not animation.is_baked(self._found(name))

    def _originals(self, name: Name) -> dict:
        """Return the keys that Un-Bake restores."""
        return snapshot(self._found(name))

    @rule()
    def save_and_reload(self):
        before = self._current_state()
        path = str(Path(self.folder.name) / "scene.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path, compress=False)
        bpy.ops.wm.open_mainfile(filepath=path)
        self._assert_as_in(before)
        self._start_history()

    @while_on()
    def switch_the_extension_off(self):
        animation.unregister()
        self.on, self.playing = False, self._play()

    def _play(self) -> dict[Name, np.ndarray]:
        """Return the displayed matrices of all carriers on some frames."""
        return self._bases(self.names, np.arange(self.shift, self.shift + LAST, 5.375))

    @precondition(lambda self: not self.on)
    @rule()
    def switch_the_extension_on(self):
        if self.playing is not None:
            # Without the extension everything plays as before.
            played = self._play()
            for name, then in self.playing.items():
                assert_near(played[name], then, name, 1e-6)
        keyed = self._keyed()
        animation.register()
        bpy.context.view_layer.update()
        bpy.context.scene.frame_set(bpy.context.scene.frame_current)
        self.on = True
        for name, after in self._keyed().items():
            assert_keys_kept(name, keyed[name], after)
        self._start_history()

    def _frames_that_are_seen(self, names: Sequence[Name]) -> np.ndarray:
        """Return some eighths of frames and key frames within the range that has in-betweens. For curves with linear
        extrapolation, that range extends before and after the keys, within the scene's frame range.
        """
        objects = list(map(self._found, names))
        first, last, keys = self.shift - 1.0, self.shift + LAST + 5.0, np.concatenate([key_frames(o) for o in objects])
        for obj in filter(goes_on, objects):
            own = key_frames(obj)
            first = max(first, min(bpy.context.scene.frame_start, own[0]))
            last = min(last, max(bpy.context.scene.frame_end, own[-1]))
        self.steps += 1
        random = np.random.default_rng(self.steps)
        eighths = np.round(8.0 * random.uniform(first, last, 14)) / 8.0
        frames = np.concatenate((eighths, np.floor(eighths[:5]), random.permutation(keys)[:5]))
        return np.unique(frames[(frames >= first) & (frames <= last)])

    # Invariants

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def everything_is_where_it_has_to_be(self):
        self._assert_shown(self.names, self._frames_that_are_seen(self.names))

    @invariant()
    def nothing_failed_in_a_handler(self):
        assert list(map(logging.Formatter().format, self.complaints.buffer)) == []

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def nothing_is_wrong_and_nothing_is_left(self):
        for name in self.names:
            carrier = self._found(name)
            assert animation.problem_of(carrier) == ""
            if not self._is_held(name) and {mode_at(carrier, one) for one in key_frames(carrier)} <= {"BLENDER"}:
                terms = [term for fcurve in curves_of(carrier).values() for term in fcurve.modifiers if is_term(term)]
                assert terms == [], f"{name} has terms without a mode"
