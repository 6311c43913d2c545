"""State machine for held objects: after any edits in any order, they are where their keys say, in that holder."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import initialize, precondition, rule

from rigid_motion import animation
from tests.animation.bones.rigs import select_only
from tests.animation.editing import ORDERS
from tests.animation.holds.hold_steps import WithHolds
from tests.animation.holds.staging import HANDS, PROPS, found, set_up
from tests.animation.keyed import MODE_IDS, Carrier, curves_of, key_frames
from tests.animation.machine import LAST, SETTINGS, seeds, shares, while_on
from tests.animation.oracle import world_of
from tests.animation.scenes import FRAMES, key, push_down, tweak


class Holding(WithHolds):
    """An animator at work on props (an object, one with a moving parent, and a bone) and on their holders."""

    @initialize(
        orders=st.lists(st.sampled_from(ORDERS), min_size=3, max_size=3),
        mode=st.sampled_from(MODE_IDS),
        seed=seeds,
        held=st.lists(st.none() | st.sampled_from(HANDS), min_size=3, max_size=3),
    )
    def begin(self, orders, mode, seed, held=()):
        bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, LAST
        set_up(FRAMES, seed)
        for name, order in zip(PROPS, orders, strict=True):
            prop = found(name)
            prop.rotation_mode = order
            key(prop, (1.0, 13.0, 26.0, 37.0), seed=seed + 5)
            animation.set_mode(prop, mode)
        self.names = [*PROPS]
        bpy.context.scene.frame_set(20)
        for name, by in zip(self.names, held, strict=False):
            if by is not None:
                animation.hold_in(self._found(name), self._found(by))
        bpy.context.scene.frame_set(1)
        self._start_history()

    _found = staticmethod(found)

    def _basis(self, carrier: Carrier) -> np.ndarray:
        return world_of(carrier)

    def _sharing(self, name: str) -> set[str]:
        users, (_, *bone) = self._users(self._animated(name)), name.split("/")
        return {other for other in self.names if self._animated(other) in users and other.split("/")[1:] == bone}

    def _names_in(self, obj: bpy.types.Object) -> list[str]:
        return [obj.name if obj.pose is None else f"{obj.name}/Bone"]

    holders = HANDS

    def _assert_shown(self, names: Sequence[str], frames: np.ndarray) -> None:
        for name in names:
            self._assert_held(name, frames)

    mute_a_channel = look_at_it_with_modifiers_and_take_them_off = let_it_repeat_for_a_while = None
    """A rotation with a muted channel is left to Blender, and so cannot be held. Cycles cannot, either."""

    @while_on(who=shares, which=shares, what=st.sampled_from(("delete keys", "remove", "move", "value")))
    def tamper_with_influences(self, who, which, what):
        name = self._named(who)

        def change() -> None:
            curves = [c for (path, _), c in curves_of(self._found(name)).items() if path.startswith("constraints")]
            if curves:
                fcurve = curves[int(which * len(curves))]
                if what == "remove":
                    animation.channelbag_of(self._found(name).id_data).fcurves.remove(fcurve)
                elif what == "delete keys":
                    fcurve.keyframe_points.clear()
                elif fcurve.keyframe_points:
                    setattr(fcurve.keyframe_points[-1].co_ui, "x" if what == "move" else "y", 17.3)
                self._found(name).id_data.animation_data.action.update_tag()

        self._edit(change)

    @while_on(who=shares, which=shares, by=st.sampled_from((-3.0, 0.5, 2.0, 60.0)))
    def retime(self, who, which, by):
        """As the Dope Sheet does with all channels: keys of influences move along."""
        name = self._named(who)
        frames = key_frames(self._found(name))
        if not len(frames):
            return
        first = frames[int(which * len(frames))]

        def change() -> None:
            for fcurve in curves_of(self._found(name)).values():
                for point in fcurve.keyframe_points:
                    if point.co.x >= first - 0.005:
                        point.co_ui.x += by
                fcurve.update()

        if by > 0.0 or not len(frames[(frames < first) & (frames > first + by - 0.1)]):
            self._edit(change)

    @while_on(which=st.sampled_from(HANDS), seed=seeds)
    def move_a_hand(self, which, seed):
        def change() -> None:
            for fcurve in curves_of(self._found(which)).values():
                fcurve.keyframe_points[seed % len(fcurve.keyframe_points)].co_ui.y += 0.1
                fcurve.update()

        self._edit(change)

    @while_on(which=st.sampled_from(("Parent", "Other")), parented=st.booleans(), by_command=st.booleans())
    def parent_the_tool(self, which, parented, by_command):
        """A held tool stays in its holder and does not move."""
        tool, is_held = self._found("Tool"), animation.hold_facts(self._found("Tool")).now is not None
        if is_held and not self._is_passing("Tool"):
            bpy.context.view_layer.update()
            seen = world_of(tool)

        def change() -> None:
            tool, parent = bpy.data.objects["Tool"], bpy.data.objects[which]
            if not by_command:
                tool.parent = parent if parented else None
                return
            select_only(parent, tool)
            if parented:
                bpy.ops.object.parent_set(type="OBJECT", keep_transform=True)
            else:
                bpy.ops.object.parent_clear(type="CLEAR_KEEP_TRANSFORM")

        self._edit(change)
        if is_held and not self._is_passing("Tool"):
            self._assert_seen_at("Tool", seen)

    def _is_passing(self, name: str) -> bool:
        frame = bpy.context.scene.frame_current_final
        source = animation.queries.keyed.source_of(self._found(name))
        return any(switch.begin < frame < switch.frame for switch in source.switches)

    @while_on(which=st.sampled_from(HANDS))
    def rename_a_hand_for_a_while(self, which):
        """While the hand has another name, it still holds everything."""
        found, before = self._found(which), which.split("/")[-1]

        def change() -> None:
            hand = found if found == found.id_data else found.id_data.data.bones[before]
            hand.name = "Someone's"
            bpy.context.view_layer.update()
            self._assert_shown(self.names, self._frames_that_are_seen(self.names))
            hand.name = before

        self._edit(change)

    @precondition(lambda self: self.on and len(self.names) < 5)
    @rule(who=shares, link=st.booleans())
    def append(self, who, link):
        """Append from a copy of this file, with holders that equal the existing ones in nothing but their names.

        The prop may also be linked and made local, with linked holders.
        """
        name = self._named(who).split("/")[0]

        def change() -> None:
            brought = self._object_from_copy(name, link=link, is_local=True)
            self.names += self._names_in(brought)
            self._may_be_unbaked(name, brought.name)

        self._edit(change)

    @while_on(who=shares, order=st.sampled_from(ORDERS))
    def name_constraints_anew(self, who, order):
        name = self._named(who)

        def change() -> None:
            for number, constraint in enumerate(self._found(name).constraints):
                constraint.name = f'Name "{number}" {order}'

        self._edit(change)

    @while_on(who=shares)
    def make_it_single_user(self, who):
        name = self._named(who)
        if self._animated(name) not in map(self._animated, self.before_bake):
            self._edit(lambda: self._make_single_user(self._animated(name)))

    @precondition(lambda self: self.on and len(self.names) < 5)
    @rule(who=shares, with_hand=st.booleans())
    def duplicate(self, who, with_hand):
        name = self._named(who).split("/")[0]
        if name == "Rig":
            return

        def change() -> None:
            for obj in bpy.data.objects:
                obj.select_set(obj.name == name or (with_hand and obj.name == "Hand"))
            bpy.context.view_layer.objects.active = bpy.data.objects[name]
            before = set(bpy.data.objects)
            bpy.ops.object.duplicate()
            new = [obj.name for obj in set(bpy.data.objects) - before if not obj.name.startswith("Hand")]
            self.names += new
            self._may_be_unbaked(name, *new)

        self._edit(change)

    def _may_be_unbaked(self, name: str, *new: str) -> None:
        """Objects made from one with an Action of its own can also be un-baked."""
        self.before_bake |= {
            one.replace(name, other, 1): kept
            for one, kept in self.before_bake.items()
            if one.split("/")[0] == name
            for other in new
        }

    @while_on(who=shares, start=st.integers(1, 30), scale=st.sampled_from((1.0, 2.0)), by=st.sampled_from(HANDS))
    def hold_in_a_strip(self, who, start, scale, by):
        """In tweak mode as anywhere else. The displayed pose stays when the strip is removed."""
        prop = self._found(self._named(who))
        name, obj = self._named(who), prop.id_data
        if obj.animation_data.action is None or not len(key_frames(prop)) or not self._is_free(obj):
            return
        action, slot = obj.animation_data.action, obj.animation_data.action_slot
        strip = push_down(obj, start)
        strip.scale = scale
        tweak(obj, strip)
        inside = strip.frame_start < bpy.context.scene.frame_current_final < strip.frame_end
        bpy.context.view_layer.update()
        before = world_of(self._found(name))
        with suppress(animation.Refused):
            animation.hold_in(self._found(name), self._found(by))
        bpy.context.view_layer.update()
        if inside:
            assert np.abs(world_of(self._found(name)) - before).max() < 1e-5 * max(1.0, np.abs(before).max())
        obj.animation_data.use_tweak_mode = False
        obj.animation_data.nla_tracks.remove(obj.animation_data.nla_tracks[0])
        self._link(obj, action, slot)
        bpy.context.view_layer.update()
        self._edit(lambda: None, lambda made, after: None)


Holding.TestCase.settings = SETTINGS
TestHolds = Holding.TestCase
