"""Sidebar panels of viewport, Dope Sheet and Graph Editor: mode, path, speed, holder, layer of the active target."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from .. import animation
from ..animation.baking.layers import is_plain, strips_of
from ..animation.properties import TURN_AXIS_ITEMS
from ..animation.queries.segments import SegmentFacts
from ..animation.transforms import OWN_WORDS, Transform
from ..blender import Panel, existing
from . import deviations, held_in, speed
from .holding import facts_or_none, name_of, shown_prop
from .notes import MANY_MODIFIERS, OUT_OF_DATE, facts_and_notes, most_modifiers
from .operators import axis_of_turns
from .overlay.settings import draw_settings, overlay_settings
from .targets import CURRENT, SELECTED, WHOLE, active_target, is_key_editor, modes_meant, with_keyed_bones
from .wording import LABELS, draw_text, labelled, length, reduced_to, turn_text

SPACES = ("VIEW_3D", "DOPESHEET_EDITOR", "GRAPH_EDITOR")

NO_PATH = n_("Its path is known while its strip is edited, with an influence of 1")
NO_BONE = n_("No Bone Active")


class InSidebar(Panel):
    bl_region_type = "UI"
    bl_category = "Animation"  # also the category of Blender's own animation tools in the viewport


class Folded(InSidebar):
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012 - Blender reads it


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
        segment, notes = facts_and_notes(target, existing(context.scene).frame_current_final)
        if is_key_editor(context):
            _draw_mode_menu(
                labelled(layout, iface_("Selected", OWN_WORDS)), SELECTED, modes_meant(context, target, SELECTED)
            )
        label = iface_(target.label, OWN_WORDS)
        _draw_mode_menu(labelled(layout, label), WHOLE, modes_meant(context, target, WHOLE))
        if segment is not None:
            _draw_segment(context, layout, segment)
            if segment.mode != "BLENDER":
                _draw_turns(layout, target)
        for icon, text in notes:
            draw_text(context, layout, text, icon)
        if ("ERROR", OUT_OF_DATE) in notes:
            layout.operator("rigid_motion.refresh")
        if most_modifiers(target) > MANY_MODIFIERS:
            row = layout.row(align=True)
            row.operator("rigid_motion.clear")
            row.operator("rigid_motion.reduce_keys", text="Reduce Keys", text_ctxt=OWN_WORDS)
        row = layout.row(align=True)
        row.operator("rigid_motion.bake", text="Bake...")
        row.operator("rigid_motion.unbake")
        _draw_reduction(context, layout, target)


class _HeldIn(Folded):
    bl_label = "Held In"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        facts = facts_or_none(shown_prop(context))
        if facts is not None and facts.now is not None:
            self.layout.label(text=name_of(facts.now), translate=False)

    def draw(self, context: bpy.types.Context) -> None:
        held_in.draw(context, self.layout)


class _Path(Folded):
    bl_label = "Path"

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(overlay_settings(context.scene), "show_paths", text="")

    def draw(self, context: bpy.types.Context) -> None:
        draw_settings(self.layout, context)
        deviations.draw_settings(context, self.layout)


class _Speed(Folded):
    bl_label = "Speed"

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(overlay_settings(context.scene), "show_speed", text="")

    def draw(self, context: bpy.types.Context) -> None:
        speed.draw_panel(context, self.layout)


class _Layer(Folded):
    bl_label = "Layer"

    def draw(self, context: bpy.types.Context) -> None:
        layout, target = self.layout, active_target(context)
        strips = strips_of(target.animated) if target is not None and target.motion.base is not None else None
        if target is not None and strips is not None:
            layout.prop(strips[1], "influence")
            if not is_plain(target.animated):
                draw_text(context, layout, NO_PATH, "INFO")
        row = layout.row(align=True)
        row.operator("rigid_motion.add_layer")
        row.operator("rigid_motion.merge_layer")


def _draw_segment(context: bpy.types.Context, layout: bpy.types.UILayout, segment: SegmentFacts) -> None:
    _draw_mode_menu(labelled(layout, iface_("Segment", OWN_WORDS)), CURRENT, {segment.mode})
    frames = f"{segment.first:g} \N{EN DASH} {segment.last:g}"
    facts = frames, turn_text(segment), length(existing(context.scene), segment.distance)
    labelled(layout, iface_("Frames", OWN_WORDS)).label(text=", ".join(facts), translate=False)


def _draw_turns(layout: bpy.types.UILayout, target: Transform) -> None:
    """Draw the number of turns of the segment; and their axis, if there are any."""
    row = labelled(layout, iface_("Turns", OWN_WORDS))
    row.prop(target.motion, "turns", text="")
    if target.motion.turns:
        label = dict(item[:2] for item in TURN_AXIS_ITEMS)[axis_of_turns(target)]
        row.operator_context = "EXEC_REGION_WIN"
        properties: Any = row.operator_menu_enum(
            "rigid_motion.set_turns", "axis", text=iface_(label, OWN_WORDS), translate=False
        )
        properties.turns, properties.on = target.motion.turns, CURRENT


def _draw_mode_menu(layout: bpy.types.UILayout, scope: str, modes: set[str]) -> None:
    """Draw a menu button that shows the mode and sets another one."""
    layout.enabled = bool(modes)
    text = (
        iface_(LABELS[next(iter(modes))], OWN_WORDS)
        if len(modes) == 1
        else iface_("Mixed")
        if modes
        else iface_("None")
    )
    properties: Any = layout.operator_menu_enum("rigid_motion.set_mode", "mode", text=text, translate=False)
    properties.on = scope


def _draw_reduction(context: bpy.types.Context, layout: bpy.types.UILayout, target: Transform) -> None:
    row = layout.row(align=True)
    row.operator("rigid_motion.clean_motion")
    row.operator("rigid_motion.reduce_keys", text="Reduce Keys", text_ctxt=OWN_WORDS)
    row = layout.row(align=True)
    row.operator("rigid_motion.restore_keys", text="Restore Keys", text_ctxt=OWN_WORDS)
    reduction = animation.reduction_of(with_keyed_bones(target))
    if reduction is not None:
        row.operator("rigid_motion.discard_dense_keys", text="", icon="TRASH")
        text = reduced_to(existing(context.scene), reduction)
        labelled(layout, iface_("Keys", OWN_WORDS)).label(text=text, translate=False)


def _in_space(base: type[Panel], space: str, parent: type[Panel] | None = None) -> type[Panel]:
    name = f"RIGID_MOTION_PT_{base.__name__.strip('_').lower()}_{space.lower()}"
    content: dict[str, object] = {"bl_space_type": space}
    if parent is not None:
        content["bl_parent_id"] = parent.__name__
    return type(name, (base,), content)


def _panels() -> Iterator[type[Panel]]:
    for space in SPACES:
        yield (main := _in_space(_Main, space))
        yield _in_space(_Path, space, main)
        yield _in_space(_HeldIn, space, main)
        yield _in_space(_Speed, space, main)
        yield _in_space(_Layer, space, main)


PANELS = tuple(_panels())
