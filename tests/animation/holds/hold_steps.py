"""Steps of the editing state machine for holds: hold, let go, pass on, match grips."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import bpy
import numpy as np
from hypothesis import strategies as st

from rigid_motion import animation
from tests.animation.editing import SAME_FRAME
from tests.animation.holds.model import assert_held, poses_in_holders
from tests.animation.keyed import HOLD_BITS, Carrier, curves_of, key_frames, snapshot
from tests.animation.machine import Name, goes_on, shares, while_on
from tests.animation.oracle import shown_worlds, world_of
from tests.animation.path_steps import WithPaths


class WithHolds(WithPaths):
    """An animator who also uses holds."""

    @property
    def holders(self) -> list[Name]:
        """Return the names of the possible holders."""
        return self.names

    def _is_held(self, name: Name) -> bool:
        """Whether its keys say that it is held."""
        source = animation.queries.keyed.source_of(self._found(name))
        return source is not None and source.held is not None

    def _is_passed_on(self, name: Name) -> bool:
        source, frame = animation.queries.keyed.source_of(self._found(name)), bpy.context.scene.frame_current_final
        return source is not None and any(abs(switch.frame - frame) < SAME_FRAME for switch in source.switches)

    def _expected(self, name: Name, frames: Sequence[float]) -> np.ndarray:
        return poses_in_holders(self._found(name), frames) if self._is_held(name) else super()._expected(name, frames)

    def _frames_kept_by_a_key(self, name: Name) -> np.ndarray:
        return np.empty(0) if self._is_held(name) else super()._frames_kept_by_a_key(name)

    def _keyed(self) -> dict[Name, dict]:
        """Return snapshots without influences, which follow from keys, and holders, which other edits may change."""
        result = {}
        for name in self.names:
            channels = snapshot(self._found(name))
            result[name] = {
                channel: (
                    *rest,
                    tuple((*k[:8], int(np.float32(k[8]).view(np.int32)) & ~HOLD_BITS, *k[9:]) for k in keys),
                )
                for channel, (*rest, keys) in channels.items()
                if not channel[0].startswith("constraints")
            }
        return result

    def _originals(self, name: Name) -> dict:
        """Return the original keys without the influences, which follow from them."""
        kept = super()._originals(name)
        return {channel: keys for channel, keys in kept.items() if not channel[0].startswith("constraints")}

    def _is_live(self, name: Name) -> bool:
        """Passing moves a prop between the keys of two holders, also in Blender's own mode, so it counts as live."""
        source = animation.queries.keyed.source_of(self._found(name))
        return super()._is_live(name) or (source is not None and bool(source.switches))

    def _baked(self, name: Name, frames: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return world matrices, too. A pass may be baked in the old holder, so matrices there may differ."""
        ((chosen, poses),) = super()._baked(name, frames)
        if not self._is_held(name):
            return [(chosen, poses)]
        switches = animation.queries.keyed.source_of(self._found(name)).switches
        passing = [(frames > switch.begin) & (frames < switch.frame) for switch in switches]
        return [(chosen & ~np.any(passing, axis=0), poses), (chosen, *shown_worlds([self._found(name)], frames))]

    def _snaps_exactly(self, name: Name) -> bool:
        """Blender moves passing props only partly, and snaps held props as if they were in the world."""
        return not self._is_held(name)

    def _assert_held(self, name: Name, frames: np.ndarray) -> None:
        """Check that it is where its keys say on some frames, in the holders that they say."""
        prop = self._found(name)
        keys = key_frames(prop)
        # Blender's own extrapolation goes on outside the keys.
        inside = frames[(frames >= keys[0]) & (frames <= keys[-1])] if len(keys) and goes_on(prop) else frames
        if len(keys) and len(inside):
            assert_held([prop], inside)

    @while_on(who=shares, by=st.none() | shares, over=st.none() | st.integers(0, 9))
    def hold(self, who, by, over):
        """It stays where it is seen."""
        name = self._named(who)
        prop, holder = self._found(name), None if by is None else self.holders[int(by * len(self.holders))]
        if not self._may_be_held(name) or any(curve.mute for curve in curves_of(prop).values()):
            return
        seen = world_of(prop)

        def act(prop: Carrier) -> None:
            animation.hold_in(prop, holder and self._found(holder), frames=over)

        self._if_possible(name, act)
        self._assert_seen_at(name, seen)
        frame = bpy.context.scene.frame_current_final
        bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)
        self._assert_seen_at(name, seen)

    def _assert_seen_at(self, name: Name, then: np.ndarray) -> None:
        """Check that it is still seen in the same place in the world."""
        bpy.context.view_layer.update()
        now = world_of(self._found(name))
        error = np.abs(now - then).max()
        assert error < 1e-5 * max(1.0, np.abs(then).max()), f"{name} jumped by {error} from\n{then}\nto\n{now}"

    def _may_be_held(self, name: Name) -> bool:
        return True

    @while_on(who=shares, over=st.integers(0, 9))
    def choose_over_how_many_frames_it_passes(self, who, over):
        self._if_possible(self._named(who), lambda prop: animation.pass_frames(prop, over))

    def _object_from_copy(self, name: str, *, link: bool, is_local: bool) -> bpy.types.Object:
        """Return an object from a copy of this file. All its dependencies come with it into the scene.

        A linked object may be made local with its Action; its other dependencies stay linked.
        """
        library = str(Path(self.folder.name) / f"library {self.fresh}.blend")
        self.fresh += 1
        bpy.ops.wm.save_as_mainfile(filepath=library, compress=False, copy=True)
        before = set(bpy.data.objects)
        with bpy.data.libraries.load(library, link=link) as (_, wanted):
            wanted.objects = [name]
        (obj,) = wanted.objects
        for brought in set(bpy.data.objects) - before:
            bpy.context.scene.collection.objects.link(brought)
        if link and is_local:
            obj = obj.make_local()
            if obj.animation_data is not None and obj.animation_data.action is not None:
                obj.animation_data.action.make_local()
        return obj

    @while_on(who=shares, is_local=st.booleans())
    def link_it_for_a_while(self, who, is_local):
        """It moves like the original, also when it is made local with its Action."""
        name = self._named(who)
        frames = self._frames_that_are_seen([name])

        def change() -> None:
            own, objects, libraries = self._found(name), set(bpy.data.objects), set(bpy.data.libraries)
            linked = self._object_from_copy(own.id_data.name, link=True, is_local=is_local)
            bpy.context.view_layer.update()
            both = [own, linked if own == own.id_data else linked.pose.bones[own.name]]
            here, there = shown_worlds(both, frames)
            error = np.abs(here - there).max() / max(1.0, np.abs(here).max())
            assert error < 1e-5, f"{name} is off by {error} where it is linked"
            for obj in set(bpy.data.objects) - objects:
                bpy.data.objects.remove(obj)
            for library in set(bpy.data.libraries) - libraries:
                bpy.data.libraries.remove(library)

        self._edit(change)

    @while_on(who=shares)
    def match_grips(self, who):
        self._if_possible(self._named(who), animation.match_grip)

    def _if_possible(self, name: Name, act: Callable[[Carrier], None]) -> None:
        def change() -> None:
            with suppress(animation.Refused):
                act(self._found(name))

        self._edit(change, lambda made, after: None)
