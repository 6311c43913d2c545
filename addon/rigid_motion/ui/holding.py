"""Holding objects: finds held objects and holders in the selection, and operators that hold, pass and let go.

Select the objects to hold first and the holder last, as the active one: an object, or in Pose Mode a bone. Selected
objects that are not posed take precedence over bones, as in Blender's Ctrl P. All operators act on the current frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any, ClassVar

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from .. import animation
from ..animation import HoldFacts, Refused, hold_facts
from ..animation.evaluation.runs import MOST_FRAMES
from ..animation.holds.holders import Holder, is_ours
from ..animation.transforms import OWN_WORDS, Transform, transform_of
from ..blender import BoolProperty, IntProperty, Menu, StringProperty, with_properties
from .targets import OnTargets, each_done, is_posing

Node = bpy.types.Object | bpy.types.PoseBone
"""A holder or a held object."""

FIRST_AND_LAST = n_("Select the things to hold, and last their holder: an object, or in Pose Mode a bone")
NOTHING_HELD = n_("Nothing selected is held yet: use Hold In")

HIDDEN_OPTIONS = {"HIDDEN", "SKIP_SAVE"}
"""The options of operator properties that menus set."""

STRIP_COLOUR_NUMBERS = (4, 7, 2, 6, 1, 3)
"""Numbers of the theme's strip colours, for holders in menus and along paths."""


PASS_PROPERTY = "rigid_motion_pass"
"""The name of the scene property by which panels set the number of frames of a pass."""


def hue_of(number: int) -> int:
    """Return the number of the theme's strip colour for a holder other than the world."""
    return STRIP_COLOUR_NUMBERS[(number - 1) % len(STRIP_COLOUR_NUMBERS)]


def icon_of(holder: Holder | None) -> str:
    """Return the icon of a holder, in the colour of its part of a path."""
    return "WORLD" if holder is None else f"STRIP_COLOR_{hue_of(holder.number):02d}"


def name_of(holder: Holder | None) -> str:
    """Return the name of a holder in menus, in the user's language."""
    if holder is None:
        return iface_("World", OWN_WORDS)
    return title_of(holder.target, holder.bone)


def title_of(target: bpy.types.Object | None, bone: str) -> str:
    """Return the name of an object in menus, or of a bone with its rig."""
    if target is None:
        return iface_("None")
    return f"{bone} ({target.name})" if bone else target.name


def has_been_held(transform: Transform) -> bool:
    """Return whether a transform has any constraint that holds it."""
    return any(is_ours(constraint) for constraint in transform.carrier.constraints)


def active_holder(context: bpy.types.Context, *, use_bone: bool = True) -> Node | None:
    """Return the holder: the active bone in Pose Mode or of the active rig, or else the active object."""
    if is_posing(context):
        return context.active_pose_bone
    return _active_bone(context.object) or context.object if use_bone else context.object


def _active_bone(obj: bpy.types.Object | None) -> bpy.types.PoseBone | None:
    data: Any = None if obj is None else obj.data
    if obj is None or obj.type != "ARMATURE" or obj.pose is None or data.bones.active is None:
        return None
    return obj.pose.bones.get(data.bones.active.name)


def chosen(context: bpy.types.Context) -> list[Transform]:
    """Return all selected transforms, objects that are not posed first."""
    objects = [obj for obj in context.selected_objects or () if obj.mode != "POSE"]
    bones = (context.selected_pose_bones or ()) if is_posing(context) else ()
    return [transform_of(item) for item in (*objects, *bones)]


def props_for(context: bpy.types.Context, holder: Node | None) -> list[Transform]:
    """Return the selected transforms for a holder: objects that are not posed, or else bones; never the holder."""
    if holder is None:
        return []
    objects = [item for item in chosen(context) if not item.is_part and item.carrier not in (holder, holder.id_data)]
    return objects or [item for item in chosen(context) if item.is_part and item.carrier != holder]


def held(context: bpy.types.Context) -> list[Transform]:
    """Return the selected transforms that have been held, except the active one if it holds another of them."""
    result = [item for item in chosen(context) if has_been_held(item)]
    active = active_holder(context)
    if active is not None and len(result) > 1 and (own := transform_of(active)) in result:
        is_holder = any(_is_held_in(item, active) for item in result if item != own)
        result = [item for item in result if not (is_holder and item == own)]
    return result


def _is_held_in(item: Transform, node: Node) -> bool:
    """Return whether a transform has been held in this object or bone."""
    ours: list[Any] = [one for one in item.carrier.constraints if is_ours(one) and one.type == "CHILD_OF"]
    return any((one.target, one.subtarget) == _target_and_bone(node) for one in ours)


def shown_prop(context: bpy.types.Context) -> Transform | None:
    """Return the transform that panels on holding show: a held one, or else one that could be held."""
    active = active_holder(context, use_bone=False)
    if held_already := held(context):
        own = None if active is None else transform_of(active)
        return own if own in held_already else held_already[0]
    props = props_for(context, active_holder(context))
    return props[0] if props else None if active is None else transform_of(active)


def candidates(context: bpy.types.Context, prop: Transform) -> Iterator[Node]:
    """Yield possible holders: the active object or bone, and the active bones of selected rigs."""
    rigs = (_active_bone(obj) for obj in (context.object, *(context.selected_objects or ())))
    nodes = dict.fromkeys(node for node in (active_holder(context), *rigs, context.object) if node is not None)
    yield from (node for node in nodes if node not in (prop.carrier, prop.animated))


def _frames_property(description: str, **more: Any) -> Any:
    """Return a property for the number of frames of a pass."""
    return IntProperty(description=description, min=0, max=MOST_FRAMES, soft_max=12, **more)


@with_properties
class _Hold(OnTargets):
    """Operators that key what is selected in the space of something."""

    frames: int = _frames_property(
        "Frames before this one in which it passes from its previous holder: 0 at once, to pick up and put down; 1 to "
        "throw; 3 to catch; 4 from hand to hand",
        name="Pass",
        options={"SKIP_SAVE"},
        translation_context=OWN_WORDS,
    )
    summary: ClassVar[str]

    def holder(self, _context: bpy.types.Context) -> tuple[bpy.types.Object | None, str]:
        """Return the holding object, None for the world, and the name of its bone, "" for none."""
        return None, ""

    def do(self, context: Any, targets: list[Transform], refused: list[Refused]) -> str:
        frames = self.frames if self.properties.is_property_set("frames") else None
        target, bone = self.holder(context)
        done = each_done(targets, refused, lambda item: animation.hold_in(item, target, bone, frames=frames))
        facts = facts_or_none(next(iter(done), None))
        if frames is None and facts is not None:
            # The redo panel then shows the number that was used.
            self.frames = facts.frames
        text = rpt_(self.summary).format(holder=title_of(target, bone), frame=context.scene.frame_current_final)
        if facts is None or facts.until is None:
            return text
        return rpt_("{done}, up to its key on frame {until:g}").format(done=text, until=facts.until)


@with_properties
class RIGID_MOTION_OT_hold_in(_Hold):
    bl_idname = "rigid_motion.hold_in"
    bl_label = "Hold In"
    bl_description = (
        "Let the active object hold the other selected ones from this frame on; in Pose Mode the active bone, and "
        "of an active rig its active bone. They stay where they are, and follow all later edits of it"
    )
    summary = n_("held in {holder} from frame {frame:g}")
    nothing_meant = FIRST_AND_LAST

    use_bone: bool = BoolProperty(
        name="Active Bone",
        description="Hold them in the active bone of the rig, and not in the rig as a whole",
        default=True,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        return iter(props_for(context, active_holder(context)))

    def holder(self, context: bpy.types.Context) -> tuple[bpy.types.Object | None, str]:
        node = active_holder(context, use_bone=self.use_bone)
        return _target_and_bone(node) if node is not None else (None, "")

    def draw(self, context: bpy.types.Context) -> None:
        layout: Any = self.layout
        layout.use_property_split = True
        layout.prop(self, "frames")
        if not is_posing(context) and _active_bone(context.object) is not None:
            layout.prop(self, "use_bone")


@with_properties
class RIGID_MOTION_OT_hold_in_known(_Hold):
    bl_idname = "rigid_motion.hold_in_known"
    bl_label = "Hold In"
    bl_description = "Hold it in this from this frame on. It stays where it is"
    summary = RIGID_MOTION_OT_hold_in.summary

    target: str = StringProperty(
        name="Target", description="Name of the object that holds, with that of its library", options=HIDDEN_OPTIONS
    )
    bone: str = StringProperty(
        name="Bone", description="Name of its bone that holds; empty for none", options=HIDDEN_OPTIONS
    )

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        return iter(known_props(context))

    def holder(self, _context: bpy.types.Context) -> tuple[bpy.types.Object | None, str]:
        found = next((obj for obj in bpy.data.objects if obj.name_full == self.target), None)
        if found is None:
            raise Refused(n_("The object {name} no longer exists: choose another holder"), name=self.target)
        return found, self.bone


def known_props(context: bpy.types.Context) -> list[Transform]:
    """Return the transforms to hold in a holder chosen by name."""
    prop = shown_prop(context)
    return held(context) or props_for(context, active_holder(context)) or ([prop] if prop is not None else [])


class _OfHeld(OnTargets):
    """Operators on what has been held."""

    nothing_meant = NOTHING_HELD

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        return iter(held(context))


@with_properties
class RIGID_MOTION_OT_let_go(_OfHeld, _Hold):
    bl_idname = "rigid_motion.let_go"
    bl_label = "Let Go"
    bl_description = (
        "Release the selection from this frame on: it is in the world, or follows its parent. It stays where it is"
    )
    summary = n_("let go on frame {frame:g}")


class RIGID_MOTION_OT_match_grip(_OfHeld):
    bl_idname = "rigid_motion.match_grip"
    bl_label = "Match Grip"
    bl_description = (
        "Give the key on this frame the grip that the same hand had the last time, so that it is held as before"
    )

    def do(self, context: Any, targets: list[Transform], refused: list[Refused]) -> str:
        each_done(targets, refused, animation.match_grip)
        return rpt_("the grip as before on frame {frame:g}").format(frame=context.scene.frame_current_final)


@with_properties
class RIGID_MOTION_OT_pass_frames(_OfHeld):
    bl_idname = "rigid_motion.pass_frames"
    bl_label = "Pass"
    bl_description = (
        "Choose the number of frames in which the selection passes to its next holder: before the key on this "
        "frame, or before the next one with another holder"
    )

    frames: int = _frames_property(
        "0: at once, to pick up and put down. 1: to throw. 3: to catch. 4: from hand to hand",
        name="Frames",
        default=4,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: Any, _event: bpy.types.Event) -> Any:
        facts = facts_or_none(next(iter(held(context)), None))
        if facts is not None and facts.switch is not None and not self.properties.is_property_set("frames"):
            self.frames = facts.frames
        return context.window_manager.invoke_props_dialog(self, confirm_text="Pass Over")

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        each_done(targets, refused, lambda item: animation.pass_frames(item, self.frames))
        return rpt_("passed over {frames} frames").format(frames=self.frames)


def _target_and_bone(node: Node) -> tuple[Any, str]:
    """Return the object of a holder, and the name of its bone, "" for none."""
    return node.id_data, node.name if isinstance(node, bpy.types.PoseBone) else ""


def facts_or_none(prop: Transform | None) -> HoldFacts | None:
    """Return the facts on how a transform is held; None if its keys are refused, or for None."""
    try:
        return None if prop is None else hold_facts(prop)
    except ValueError:
        return None


class RIGID_MOTION_MT_holders(Menu):
    bl_label = "Hold In"
    bl_description = "The holder from this frame on: the world, a previous holder, or the active one"

    def draw(self, context: Any) -> None:
        layout: Any = self.layout
        prop = shown_prop(context)
        layout.operator_context = "EXEC_REGION_WIN"
        layout.operator("rigid_motion.let_go", text=name_of(None), icon=icon_of(None), translate=False)
        facts = facts_or_none(prop)
        known = [] if facts is None else [holder for holder in facts.holders if holder.target is not None]
        for holder in known:
            _draw_holder(layout, holder.target, holder.bone, icon_of(holder))
        if prop is None:
            return
        new = [node for node in candidates(context, prop) if not any(_is_holder(holder, node) for holder in known)]
        if new:
            layout.separator()
        for node in new:
            _draw_holder(
                layout, *_target_and_bone(node), "BONE_DATA" if isinstance(node, bpy.types.PoseBone) else "OBJECT_DATA"
            )


def _is_holder(holder: Holder, node: Node) -> bool:
    return (holder.target, holder.bone) == _target_and_bone(node)


def _draw_holder(layout: Any, target: Any, bone: str, icon: str) -> None:
    text = title_of(target, bone)
    properties = layout.operator("rigid_motion.hold_in_known", text=text, icon=icon, translate=False)
    properties.target, properties.bone = target.name_full, bone


class RIGID_MOTION_MT_hold(Menu):
    bl_label = "Hold"
    bl_translation_context = OWN_WORDS
    bl_description = "The holder of the selection: pick up, hand over, throw, catch and put down"

    def draw(self, _context: Any) -> None:
        layout: Any = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        layout.operator("rigid_motion.hold_in")
        layout.menu(RIGID_MOTION_MT_holders.__name__, text="Hold In...")
        layout.operator("rigid_motion.let_go")
        layout.separator()
        layout.operator("rigid_motion.match_grip")
        layout.operator("rigid_motion.pass_frames", text="Pass...")


def _get_frames(_scene: bpy.types.Scene) -> int:
    facts = facts_or_none(shown_prop(bpy.context))
    return 0 if facts is None else facts.frames


def _set_frames(_scene: bpy.types.Scene, frames: int) -> None:
    prop = shown_prop(bpy.context)
    # The panel shows the reason of a refusal.
    with suppress(Refused):
        if prop is not None and frames != _get_frames(_scene):
            animation.pass_frames(prop, frames)


def register() -> None:
    # The property stores nothing: it reads and writes the number at the key of the shown transform.
    described: Any = {"name": "Pass", "translation_context": OWN_WORDS, "options": set()}
    description = RIGID_MOTION_OT_pass_frames.bl_description
    frames = _frames_property(description, get=_get_frames, set=_set_frames, **described)
    setattr(bpy.types.Scene, PASS_PROPERTY, frames)


def unregister() -> None:
    delattr(bpy.types.Scene, PASS_PROPERTY)
