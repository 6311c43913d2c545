"""The sidebar panel of the viewport, the Dope Sheet and the Graph Editor: how the active object or bone moves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_

from .. import animation
from ..animation.actions.records import record_of, recorded_digest
from ..animation.actions.slots import active_fcurves
from ..animation.compute.components import SCALE
from ..animation.compute.sources import Source
from ..animation.queries.keyed import active_binding, active_binding_alone, source_of
from ..animation.queries.polls import with_in_betweens
from ..animation.queries.segments import (
    SegmentFacts,
    frame_in_action,
    has_edited_differences,
    is_blended,
    is_up_to_date,
    parts_with_in_betweens,
    segment_at,
)
from ..animation.transforms import ORIGINALS, OWN_WORDS, Refused, Transform, transform_of
from ..animation.transforms.sizes import metres_per_unit
from . import overlay
from .pose_operators import RIGID_MOTION_OT_switch_parent, draw_parent_switch
from .targets import CURRENT, SELECTED, WHOLE, active_target, is_key_editor, modes_meant, with_keyed_bones
from .wording import (
    BAKED,
    BLENDED,
    DELTA_EDITED,
    KEYED_BONES,
    LABELS,
    NO_BONE,
    NO_KEYS,
    NO_SEGMENT,
    OUT_OF_DATE,
    STRIPS,
    TROUBLES,
    cautions,
    draw_text,
    labelled,
    length,
    reduced_to,
    split,
    turn,
)

Notes = list[tuple[str, str]]
"""Texts, each behind its icon."""

SPACES = ("VIEW_3D", "DOPESHEET_EDITOR", "GRAPH_EDITOR")

PROMISED = 0.0001
"""The largest error between frames of what is to be exact there, in metres."""

WORTH_OFFERING = 0.001
"""From which error on, in metres, an object is offered to be exact."""


def facts_and_notes(
    target: bpy.types.Object | bpy.types.PoseBone | Transform, frame: float
) -> tuple[SegmentFacts | None, Notes]:
    """Return the segment that a frame of the scene is in, and notes on it."""
    target = transform_of(target)
    source, problem = _read(target)
    segment = None
    notes = []
    if problem:
        notes.append(("ERROR", problem))
    elif source is None:
        data = target.animated.animation_data
        in_strips = data is not None and any(track.strips for track in data.nla_tracks)
        of_bones = with_keyed_bones(target) != [target]
        notes.append(("INFO", KEYED_BONES if of_bones else STRIPS if in_strips else NO_KEYS))
    else:
        frame = frame_in_action(target.animated, frame)
        segment = segment_at(source, frame)
        notes += [("ERROR", caution) for caution in cautions(segment)] if segment else [("INFO", NO_SEGMENT)]
        if not animation.is_enabled() and not is_up_to_date(target, source):
            notes.append(("ERROR", OUT_OF_DATE))
        elif target.animated.visible_get() and has_edited_differences(target, frame):
            # What is hidden need not have been evaluated on this frame.
            notes.append(("INFO", DELTA_EDITED))
    if trouble := animation.constraint_trouble(target):
        notes.append(TROUBLES[trouble])
    if is_blended(target):
        notes.append(("INFO", BLENDED))
    if animation.is_baked(target):
        notes.append(("INFO", BAKED))
    return segment, notes


_problem: tuple[tuple, str] = ((), "")
"""The last answer of `problem_of`, which looks through all frames; and before it, all that it depends on."""


def _read(target: Transform) -> tuple[Source | None, str]:
    """Return what is keyed, or why rigid motion cannot act on it."""
    global _problem
    try:
        source = source_of(target)
    except ValueError as problem:
        return None, str(problem)
    if source is None:
        return None, animation.problem_of(target)
    # What the slot was filled in from as well: of several users it is the source of the leading one.
    binding = active_binding_alone(target)
    depends_on = (target.animated.session_uid, target.prefix, source.digest, binding and recorded_digest(binding))
    if _problem[0] != depends_on:
        _problem = depends_on, animation.problem_of(target)
    return (None if _problem[1] else source), _problem[1]


class InSidebar:
    bl_region_type: Any = "UI"
    bl_category = "Animation"  # in the viewport Blender has its own tools for animation there


class Folded(InSidebar):
    bl_options: Any = {"DEFAULT_CLOSED"}  # noqa: RUF012 - Blender reads it


class _Main(InSidebar):
    bl_label = "Rigid Motion"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, target = self.layout, active_target(context)
        if target is None:
            layout.label(text=NO_BONE)
            return
        segment, notes = facts_and_notes(target, context.scene.frame_current_final)
        if is_key_editor(context):
            _draw_mode_menu(
                labelled(layout, iface_("Selected", OWN_WORDS)), SELECTED, modes_meant(context, target, SELECTED)
            )
        label = iface_(target.label, OWN_WORDS)
        mode_path, _ = target.mode_channel
        if any(fcurve.data_path == mode_path for fcurve in active_fcurves(target.animated)):
            _draw_mode_menu(labelled(layout, label), WHOLE, modes_meant(context, target, WHOLE))
        else:
            labelled(layout, label).prop(target.motion, "mode", text="")
        if segment is not None:
            _draw_segment(context, layout, segment)
            if segment.mode != "BLENDER":
                _draw_turns(layout, target)
        _draw_exactness(context, layout, target)
        for icon, text in notes:
            draw_text(context, layout, text, icon)
        if ("ERROR", OUT_OF_DATE) in notes:
            layout.operator("rigid_motion.refresh")
        if any(trouble in notes for trouble in TROUBLES.values()):
            layout.operator("rigid_motion.mend")
        draw_parent_switch(layout, context)
        row = layout.row(align=True)
        row.operator("rigid_motion.bake", text="Bake...")
        row.operator("rigid_motion.unbake")
        _draw_reduction(context, layout, target)


class _Shown(Folded):
    bl_label = "Transform on Screen"
    bl_description = (
        "Where the object or bone is seen on this frame, with the in-betweens. "
        "The Item tab has Blender's own values, without"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        target = active_target(context)
        return target is not None and any(True for _ in with_in_betweens((target,)))

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        with suppress(Refused):  # that is in a note of the panel
            target = active_target(context)
            parts = parts_with_in_betweens(target)
            for name, prop in target.properties.items():
                # A scale without in-betweens is that of the Item tab.
                if name != SCALE or name in parts:
                    column.prop(context.window_manager.rigid_motion_shown, prop)


class RIGID_MOTION_PT_parent_switch(bpy.types.Panel):
    """Where Rigify's own panel is, whose *Switch Parent* takes Blender's in-between."""

    bl_label = "Rigid Motion"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Item"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return RIGID_MOTION_OT_switch_parent.poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        draw_parent_switch(self.layout, context)


class _Path(Folded):
    bl_label = "Path"

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.rigid_motion_overlay, "show_paths", text="")

    def draw(self, context: bpy.types.Context) -> None:
        overlay.draw_settings(self.layout, context)


class _Delta(Folded):
    bl_label = "Delta Transform"
    bl_description = "The delta transforms that the object has of its own, to which the in-betweens are added"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        target = active_target(context)
        return target is not None and not target.has_difference_slot and any(target.motion.filled)

    def draw(self, context: bpy.types.Context) -> None:
        layout, target = split(self.layout), active_target(context)
        is_quaternion = target.carrier.rotation_mode == "QUATERNION"
        rotation = "delta_rotation_quaternion" if is_quaternion else "delta_rotation_euler"
        parts = ("delta_location", iface_("Location")), (rotation, iface_("Rotation")), ("delta_scale", iface_("Scale"))
        for path, label in parts:
            column = layout.column(align=True)
            for index, axis in enumerate("WXYZ" if path.endswith("quaternion") else "XYZ"):
                text = axis if index else f"{label} {axis}"
                # Where in-betweens are in a component, the object's own value is kept elsewhere.
                if target.is_recorded([(path, index)]):
                    column.prop(target.motion, ORIGINALS[path], index=index, text=text, translate=False)
                else:
                    column.prop(target.carrier, path, index=index, text=text, translate=False)


def _draw_segment(context: bpy.types.Context, layout: bpy.types.UILayout, segment: SegmentFacts) -> None:
    _draw_mode_menu(labelled(layout, iface_("Segment", OWN_WORDS)), CURRENT, {segment.mode})
    frames = f"{segment.first:g} \N{EN DASH} {segment.last:g}"
    facts = frames, turn(segment), length(context.scene, segment.distance)
    labelled(layout, iface_("Frames", OWN_WORDS)).label(text=", ".join(facts), translate=False)


def _draw_turns(layout: bpy.types.UILayout, target: Transform) -> None:
    """Draw the turns of the segment, to be set; and what they are about once there are any."""
    row = labelled(layout, iface_("Turns", OWN_WORDS))
    row.prop(target.motion, "turns", text="")
    binding = active_binding(target) if target.motion.turns else None
    if binding is not None and (record := record_of(binding)) is not None:
        row.prop(record, "turns_axis", text="")


def _draw_mode_menu(layout: bpy.types.UILayout, scope: str, modes: set[str]) -> None:
    """Draw a button that shows the mode and sets another."""
    layout.enabled = bool(modes)
    text = iface_(LABELS[next(iter(modes))]) if len(modes) == 1 else iface_("Mixed") if modes else iface_("None")
    layout.operator_menu_enum("rigid_motion.set_mode", "mode", text=text, translate=False).on = scope


def _draw_exactness(context: bpy.types.Context, layout: bpy.types.UILayout, target: Transform) -> None:
    """Draw how far off a target is between frames, where that is more than there should be, and what to do about it."""
    error, is_exact = animation.error_between_frames(target), target.has_difference_slot
    is_off = error > (PROMISED if is_exact else WORTH_OFFERING)
    if not is_off and (target.is_part or not is_exact):
        return
    scene = context.scene
    text = iface_("Exact")
    if is_off:
        text = iface_("{distance} off").format(distance=length(scene, error / metres_per_unit(scene), precision=2))
    row = labelled(layout, iface_("Subframes", OWN_WORDS))
    if target.is_part:
        row.label(text=text, translate=False)
    else:
        row.operator("rigid_motion.exact", text=text, translate=False, depress=is_exact).is_exact = not is_exact


def _draw_reduction(context: bpy.types.Context, layout: bpy.types.UILayout, target: Transform) -> None:
    row = layout.row(align=True)
    row.operator("rigid_motion.reduce_keys", text="Reduce Keys", text_ctxt=OWN_WORDS)
    row.operator("rigid_motion.restore_keys", text="Restore Keys", text_ctxt=OWN_WORDS)
    keyed = with_keyed_bones(target)
    reduction = animation.reduction_of(target) if keyed == [target] else animation.total_reduction(keyed)
    if reduction is not None:
        row.operator("rigid_motion.discard_dense_keys", text="", icon="TRASH")
        text = reduced_to(context.scene, reduction)
        labelled(layout, iface_("Keys", OWN_WORDS)).label(text=text, translate=False)


def _in_space(base: type, space: str, parent: type | None = None) -> type[bpy.types.Panel]:
    name = f"RIGID_MOTION_PT_{base.__name__.strip('_').lower()}_{space.lower()}"
    content: dict[str, object] = {"bl_space_type": space}
    if parent is not None:
        content["bl_parent_id"] = parent.__name__
    return type(name, (base, bpy.types.Panel), content)


def _panels() -> Iterator[type[bpy.types.Panel]]:
    for space in SPACES:
        yield (main := _in_space(_Main, space))
        yield (shown := _in_space(_Shown, space, main))
        yield _in_space(_Delta, space, shown)
        yield _in_space(_Path, space, main)


CLASSES = (*_panels(), RIGID_MOTION_PT_parent_switch)
