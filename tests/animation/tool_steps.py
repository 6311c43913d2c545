"""Steps of the editing state machine for tools used on top of modes: breakdowns, modifiers, bakes."""

from __future__ import annotations

from collections.abc import Hashable
from contextlib import suppress

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from rigid_motion import animation
from tests.animation.bones.rigs import pose_mode, select_only
from tests.animation.editing import ORDERS, Editing
from tests.animation.keyed import (
    WIDTHS,
    curve_of,
    curves_of,
    key_frames,
    mode_at,
    moving_curves,
    snapshot,
    transform_paths,
)
from tests.animation.machine import LAST, frames_in, goes_on, seeds, shares, while_on
from tests.animation.oracle import assert_near, world_of
from tests.animation.scenes import editor, random_values


class WithTools(Editing):
    """An animator who also uses breakdowns, modifiers and bakes."""

    @while_on(
        who=shares,
        kind=st.sampled_from(("BREAKDOWN", "BREAKDOWN", "PUSH", "RELAX")),
        factor=st.sampled_from((0.0, 1.0)) | st.floats(-0.2, 1.2),
        cancelled=st.booleans(),
    )
    def key_a_breakdown(self, who, kind, factor, cancelled):
        name, frame = self._named(who), bpy.context.scene.frame_current_final
        obj, done = self._found(name), []
        keys, before = key_frames(obj), snapshot(obj)
        others = keys[np.abs(keys - frame) >= 0.01]
        fits = len(others) > 1 and others[0] < frame < others[-1] and not self._is_passed_on(name)
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
        # Channels without a key on the surrounding keys change there, too. Muted channels get no key.
        frames = [{key.co[0] for key in curve.keyframe_points} for curve in moving_curves(obj)]
        is_whole = not any(curve.mute for curve in curves_of(obj).values())
        is_whole = is_whole and all(of_one.issuperset(ends) for of_one in frames)
        if kind == "BREAKDOWN" and factor in (0.0, 1.0) and is_whole:
            now, then = self._expected(name, [frame, ends[int(factor)]])
            assert_near(now, then, name, 2e-5)

    @while_on(
        who=shares,
        step=st.sampled_from((None, 2.0, 3.0, 7.0)),
        offset=st.sampled_from((0.0, 1.0, 30.0)),
        other=st.none() | st.sampled_from(("NOISE", "LIMITS", "FNGENERATOR")),
        blend=st.sampled_from(("REPLACE", "ADD", "SUBTRACT", "MULTIPLY")),
        seed=seeds,
    )
    def look_at_it_with_modifiers_and_take_them_off(self, who, step, offset, other, blend, seed):
        name = self._named(who)
        if any(map(self._is_held, self._carrying(name))):
            return

        def change() -> None:
            obj, added = self._found(name), []
            for fcurve in (curve for (path, _), curve in curves_of(obj).items() if path in WIDTHS):
                if step is not None:
                    added.append((fcurve, fcurve.modifiers.new("STEPPED")))
                    added[-1][1].frame_step, added[-1][1].frame_offset = step, offset
                if other is not None and fcurve == curve_of(obj, "location", seed % 3):
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
            self._assert_shown([name], self._frames_that_are_seen(self._carrying(name)))
            for fcurve, modifier in added:
                fcurve.modifiers.remove(modifier)

        self._edit(change)

    @while_on(who=shares, mode=st.sampled_from(("REPEAT", "MIRROR")))
    def let_it_repeat_for_a_while(self, who, mode):
        name = self._named(who)
        curves = moving_curves(self._found(name))
        ends = {(curve.keyframe_points[0].co[0], curve.keyframe_points[-1].co[0]) for curve in curves}
        if len(ends) != 1 or self._sharing(name) != {name} or self._is_held(name):
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
            first_time, again = (self._bases([name], some)[name] for some in (frames, again))
            error = np.abs(again - first_time).max(initial=0.0)
            assert error < 1e-4 * max(1.0, np.abs(first_time).max(initial=0.0)), f"{name} is off by {error}"
            for fcurve in curves_of(self._found(name)).values():
                for item in [item for item in fcurve.modifiers if item.type == "CYCLES"]:
                    fcurve.modifiers.remove(item)

        self._edit(change)

    @precondition(lambda self: self.on and self.place >= 0)
    @rule(who=shares, back=st.booleans())
    def turn_keys_to_samples(self, who, back):
        """Blender samples the displayed motion. Samples and keys made from them have no modes, and the motion stays."""
        name = self._named(who)
        curves = moving_curves(self._found(name))
        first, last = int(self.shift) - 1, int(self.shift) + LAST
        if not curves or self._sharing(name) != {name}:
            return
        frames = np.arange(first, last, 7.0)
        before = self._bases([name], frames)[name]

        def change() -> None:
            for fcurve in moving_curves(self._found(name)):
                fcurve.convert_to_samples(first, last)
            bpy.context.view_layer.update()
            if back:
                for fcurve in curves_of(self._found(name)).values():
                    if not fcurve.keyframe_points and fcurve.sampled_points:
                        fcurve.convert_to_keyframes(first, last)

        self._edit(change, lambda made, after: None)
        assert_near(self._bases([name], frames)[name], before, name)
        bpy.ops.ed.undo()
        self.place -= 1
        self._restore_remembered_names()
        self._edit(lambda: None)

    @while_on(
        which=st.sets(st.integers(0, 5), min_size=1),
        step=st.sampled_from((1.0, 0.5, 3.0)),
        interpolation=st.sampled_from(("LINEAR", "CONSTANT")),
    )
    def bake(self, which, step, interpolation):
        names = [name for name in self._chosen_names(which) if self._sharing(name) == {name}]
        live = [name for name in names if self._is_live(name)]
        keyed = {name: self._originals(name) for name in live}
        frames = np.concatenate(
            [(self.shift - 2.0, self.shift + LAST), *(key_frames(self._found(name)) for name in live)]
        )
        every = np.arange(np.floor(frames.min()), frames.max() + 6.0, 0.25)
        before = {name: self._baked(name, every) for name in live}
        keys, baked = {name: key_frames(self._found(name)) for name in live}, []
        refused: list[animation.Refused] = []

        def change() -> None:
            carriers = list(map(self._found, names))
            baked.extend(animation.bake(carriers, step=step, interpolation=interpolation, refused=refused))

        self._edit(change)
        assert len(refused) == len(names) - len(live)
        for name in names:
            assert animation.is_baked(self._found(name)) == (name in live or name in self.before_bake)
        kept = {}
        for name in live:
            self.before_bake.setdefault(name, keyed[name])
            begin, end = baked if len(live) == 1 else keys[name][[0, -1]]
            is_step = (every >= np.ceil(begin)) & (every <= np.floor(end)) & ((every - begin) % step == 0.0)
            # Motion that extrapolates is baked over another range.
            kept[name] = np.isin(every, keys[name]) | (is_step & (len(live) == 1 or not goes_on(self._found(name))))
        # In the world, a holder that is baked too is as before only on its own baked keys.
        of_all = np.all([np.ones(len(every), bool), *kept.values()], axis=0)
        for name in live:
            of_it = self._baked(name, every)
            for (chosen, then), (_, now), on in zip(
                before[name], of_it, (kept[name], of_all)[: len(of_it)], strict=True
            ):
                assert_near(now[on & chosen], then[on & chosen], name, 2e-5)
        self.history[self.place] = self._current_state()

    def _is_live(self, name: Hashable) -> bool:
        keys = key_frames(self._found(name))
        return any(mode_at(self._found(name), frame) != "BLENDER" for frame in keys[:-1])

    def _baked(self, name: Hashable, frames: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return poses that stay the same on baked keys, (m, 4, 4) each, and a mask of the frames concerned, (m,)."""
        return [(np.ones(len(frames), bool), self._expected(name, frames))]

    @while_on(who=shares, how=st.sampled_from(("move", "turn", "snap")), seed=seeds)
    def grab_it_and_key_it(self, who, how, seed):
        """Transform it with Blender's own tools. It stays where it was put."""
        name, frame = self._named(who), bpy.context.scene.frame_current_final
        if self._sharing(name) != {name} or any(curve.mute for curve in curves_of(self._found(name)).values()):
            return
        by, seen = np.random.default_rng(seed).normal(size=3), []
        bpy.context.view_layer.update()
        before = world_of(self._found(name))

        def change() -> None:
            carrier = self._found(name)
            if carrier == carrier.id_data:
                select_only(carrier)
            else:
                pose_mode(carrier.id_data, carrier.name)
            with editor("VIEW_3D"):
                if how == "move":
                    bpy.ops.transform.translate(value=by)
                elif how == "turn":
                    bpy.ops.transform.rotate(value=by[0], orient_axis="Z", orient_type="GLOBAL")
                elif self._snaps_exactly(name):
                    bpy.context.scene.cursor.location = by
                    bpy.ops.view3d.snap_selected_to_cursor(use_offset=False)
            if carrier != carrier.id_data:
                bpy.ops.object.mode_set(mode="OBJECT")
            carrier = self._found(name)
            for path in transform_paths(carrier)[:2]:
                carrier.keyframe_insert(path, frame=frame)
            bpy.context.view_layer.update()
            seen.append(world_of(carrier))

        self._edit(change, self._inserted_keys_check(frame))
        if self._snaps_exactly(name):
            there = {"move": before[:3, 3] + by, "turn": before[:3, 3], "snap": by}[how]
            assert np.abs(seen[0][:3, 3] - there).max() < 1e-4 * max(1.0, np.abs(before).max(), np.abs(there).max())
        bpy.context.scene.frame_set(int(frame // 1) + 3)
        bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)
        assert_near(world_of(self._found(name)), seen[0], name)

    def _snaps_exactly(self, name: Hashable) -> bool:
        """Whether Blender's tools now move it exactly to the requested place."""
        return True

    @while_on(who=shares, order=st.sampled_from(ORDERS), rekeyed=st.booleans(), seed=seeds)
    def turn_in_another_way(self, who, order, rekeyed, seed):
        name = self._named(who)
        if self._sharing(name) != {name} or name in self.before_bake:
            return

        def change() -> None:
            obj = self._found(name)
            keys = key_frames(obj)
            obj.rotation_mode = order
            path = transform_paths(obj)[1]
            for frame, values in zip(keys, random_values(obj, path, len(keys), seed), strict=True) if rekeyed else ():
                setattr(obj, path, values)
                obj.keyframe_insert(path, frame=frame)

        self._edit(change)

    def _carrying(self, name: Hashable) -> list[Hashable]:
        """Return the names of the carriers it moves with, itself first."""
        return [name]

    @while_on(who=shares, which=shares, at=shares, seed=seeds)
    def edit_while_nothing_is_followed(self, who, which, at, seed):
        animation.set_enabled(False)
        try:
            fcurve = self._curve(self._found(self._named(who)), which)
            if fcurve is not None:
                self._set_a_value(fcurve, at, seed)
            bpy.context.view_layer.update()
        finally:
            animation.set_enabled(True)
        self._edit(animation.refresh)

    # Removing, restoring and sharing Actions

    def _animated(self, name: Hashable) -> bpy.types.Object:
        """Return the object whose Action animates the carrier with this name."""
        return self._found(name).id_data

    def _users(self, obj: bpy.types.Object) -> set[bpy.types.Object]:
        """Return the objects that share the slot of this one, including itself."""
        action, slot = self._linked(obj)
        return {obj} | {
            one for one in map(self._animated, self.names) if action and self._linked(one) == (action, slot)
        }

    def _is_free(self, obj: bpy.types.Object) -> bool:
        """Whether its Action may be replaced without losing the keys from before a bake or affecting other users."""
        return self._users(obj) == {obj} and obj not in map(self._animated, self.before_bake)

    def _copy(self, obj: bpy.types.Object, new: str, copied: bool) -> None:
        """Duplicate the object, with the same Action or a copy of it."""
        made = obj.copy()
        made.name, made.data = new, obj.data and obj.data.copy()
        bpy.context.scene.collection.objects.link(made)
        if copied:
            self._make_single_user(made)
        self.names += self._names_in(made)

    def _names_in(self, obj: bpy.types.Object) -> list[Hashable]:
        """Return the names of all carriers in an object."""
        return [obj.name] if obj.pose is None else [(obj.name, bone.name) for bone in obj.pose.bones]

    def _make_single_user(self, obj: bpy.types.Object) -> None:
        action, slot = self._linked(obj)
        if action is not None:
            action = action.copy()
            self._link(obj, action, action.slots[slot.identifier])

    @precondition(lambda self: self.on and len(self.names) < 5)
    @rule(who=shares, copied=st.booleans())
    def copy_an_object(self, who, copied):
        obj = self._animated(self._named(who))
        name, new, self.fresh = obj.name, f"Copy {self.fresh}", self.fresh + 1
        if self._is_free(obj):
            self._edit(lambda: self._copy(bpy.data.objects[name], new, copied))

    @while_on(who=shares)
    def make_it_single_user(self, who):
        name = self._named(who)
        if len(self._users(self._animated(name))) > 1:
            self._edit(lambda: self._make_single_user(self._animated(name)))

    @while_on(who=shares, cleared=st.booleans(), there=frames_in)
    def take_the_animation_away_for_a_while(self, who, cleared, there):
        """The object stays where it is seen without its Action, and moves as before with it."""
        name = self._named(who)
        obj = self._animated(name)
        action, slot = self._linked(obj)
        if action is None or not self._is_free(obj):
            return
        bpy.context.view_layer.update()
        seen, own = {name: self._basis(self._found(name))}, self._found(name).matrix_basis.copy()
        frame = bpy.context.scene.frame_current_final
        if cleared:
            obj.animation_data_clear()
        else:
            self._link(obj, None, None)
        self._assert_in_place(seen)
        bpy.context.scene.frame_set(int(there + self.shift))
        assert self._found(name).matrix_basis == own
        bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)
        self._assert_in_place(seen)
        self._link(obj, action, slot)
        bpy.context.view_layer.update()
