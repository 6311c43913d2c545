"""The sidebar panel of the viewport, the Dope Sheet and the Graph Editor: what the active object does, and why."""

from __future__ import annotations

from collections.abc import Iterator

import blf
import bpy

from .. import animation
from ..animation.describing import SegmentFacts, frame_in_action, is_up_to_date, segment_at
from ..animation.mode_keys import source_of
from ..animation.reading import MODE_PATH
from ..animation.sources import Source
from . import overlay
from .targets import CURRENT, SELECTED, WHOLE, fcurves_of, is_key_editor, modes_meant
from .wording import LABELS, cautions, degrees, wrapped

CATEGORY = "Animation"
"""The tab of the sidebar: in the viewport Blender has its own tools for animation there."""

SPACES = ("VIEW_3D", "DOPESHEET_EDITOR", "GRAPH_EDITOR")

MARGIN = 84
"""Pixels of a sidebar that text cannot have, at a resolution scale of 1: tabs, an icon, and the panel's edges."""


class _Main:
    bl_label = "Rigid Motion"
    bl_region_type = "UI"
    bl_category = CATEGORY

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        layout.use_property_split = True
        source, problem = _read(obj)
        if is_key_editor(context):
            _draw_mode_menu(_labelled(layout, "Selected"), SELECTED, modes_meant(context, obj, SELECTED))
        if any(fcurve.data_path == MODE_PATH for fcurve in fcurves_of(obj)):
            _draw_mode_menu(_labelled(layout, "Object"), WHOLE, modes_meant(context, obj, WHOLE))
        else:
            layout.prop(obj.rigid_motion, "mode", text="Object")
        segment = None
        if source is not None:
            segment = segment_at(source, frame_in_action(obj, context.scene.frame_current_final))
            _draw_segment(context, layout, segment)
        for icon, text in _notes(obj, source, segment, problem):
            _draw_text(context, layout, text, icon)
        if source is not None and not is_up_to_date(obj, source):
            _draw_text(context, layout, "The in-betweens are those of older keys", "ERROR")
            layout.operator("rigid_motion.refresh")
        row = layout.row(align=True)
        row.operator("rigid_motion.bake", text="Bake...")
        row.operator("rigid_motion.unbake")


class _Path:
    bl_label = "Path"
    bl_region_type = "UI"
    bl_category = CATEGORY

    def draw(self, context: bpy.types.Context) -> None:
        overlay.draw_settings(self.layout, context)


class _Delta:
    bl_label = "Delta Transform"
    bl_description = "The delta transforms that the object has of its own, to which the in-betweens are added"
    bl_region_type = "UI"
    bl_category = CATEGORY
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012 - Blender reads it

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return any(context.object.rigid_motion.filled)

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        motion = obj.rigid_motion
        layout.use_property_split = True
        layout.use_property_decorate = False
        location, quaternion, euler, scale = motion.filled
        _draw_own(layout, obj, location, "own_location", "delta_location")
        if obj.rotation_mode == "QUATERNION":
            _draw_own(layout, obj, quaternion, "own_quaternion", "delta_rotation_quaternion")
        else:
            _draw_own(layout, obj, euler, "own_euler", "delta_rotation_euler")
        _draw_own(layout, obj, scale, "own_scale", "delta_scale")


_problem: tuple[tuple[int, str], str] = ((0, ""), "")
"""The last answer of `problem_of`, which looks through all frames; and before it, the object and source asked about."""


def _read(obj: bpy.types.Object) -> tuple[Source | None, str]:
    """What is keyed, or why rigid motion cannot act on it."""
    global _problem
    try:
        source = source_of(obj)
    except ValueError as problem:
        return None, str(problem)
    asked = (obj.session_uid, source.digest if source else "")
    if source is None or _problem[0] != asked:
        _problem = asked, animation.problem_of(obj)
    return (None if _problem[1] else source), _problem[1]


def _notes(
    obj: bpy.types.Object, source: Source | None, segment: SegmentFacts | None, problem: str
) -> Iterator[tuple[str, str]]:
    """What there is to know, each with its icon."""
    if problem:
        yield "ERROR", problem
    elif source is None:
        strips = obj.animation_data is not None and any(track.strips for track in obj.animation_data.nla_tracks)
        yield (
            "INFO",
            (
                "Moved by strips: enter one to see its segments (NLA Editor, Tab)"
                if strips
                else "No keys of location, rotation or scale yet"
            ),
        )
    elif segment is not None:
        for caution in cautions(segment):
            yield "ERROR", caution
    if animation.is_baked(obj):
        yield "INFO", "Baked. Un-bake it to go back to its own keys"


def _draw_segment(context: bpy.types.Context, layout: bpy.types.UILayout, segment: SegmentFacts | None) -> None:
    if segment is None:
        _labelled(layout, "Segment").label(text="None at this frame")
        return
    _draw_mode_menu(_labelled(layout, "Segment"), CURRENT, {segment.mode})
    column = layout.column(align=True)
    _labelled(column, "Frames").label(text=f"{segment.first:g} \N{EN DASH} {segment.last:g}")
    _labelled(column, "Turn").label(text=degrees(segment.turn))
    _labelled(column, "Distance").label(text=_length(context.scene, segment.distance))


def _draw_mode_menu(layout: bpy.types.UILayout, scope: str, modes: set[str]) -> None:
    """A button that shows the mode and sets another."""
    layout.enabled = bool(modes)
    text = LABELS[next(iter(modes))] if len(modes) == 1 else "Mixed" if modes else "None"
    layout.operator_menu_enum("rigid_motion.set_mode", "mode", text=text).on = scope


def _draw_own(layout: bpy.types.UILayout, obj: bpy.types.Object, is_filled: bool, own: str, delta: str) -> None:
    if is_filled:
        layout.prop(obj.rigid_motion, own)
    else:
        layout.prop(obj, delta)


def _labelled(layout: bpy.types.UILayout, label: str) -> bpy.types.UILayout:
    """The right-hand part of a line, as wide as those of properties, with a label on the left."""
    row = layout.row(align=True)
    split = row.split(factor=0.4, align=True)
    left = split.row()
    left.alignment = "RIGHT"
    left.label(text=label)
    right = split.row()
    row.label(icon="BLANK1")
    return right


def _draw_text(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str) -> None:
    """A text that is broken into as many lines as the region's width asks for."""
    system = context.preferences.system
    width = context.region.width - MARGIN * system.ui_scale
    blf.size(0, context.preferences.ui_styles[0].widget.points * system.ui_scale)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in wrapped(text, lambda line: blf.dimensions(0, line)[0] <= width):
        column.label(text=line, icon=icon)
        icon = "BLANK1"


def _length(scene: bpy.types.Scene, length: float) -> str:
    unit = scene.unit_settings
    if unit.system == "NONE":
        return f"{length:.4g}"
    return bpy.utils.units.to_string(unit.system, "LENGTH", length * unit.scale_length, precision=4)


def _in_space(base: type, space: str, parent: type | None = None) -> type[bpy.types.Panel]:
    name = f"RIGID_MOTION_PT_{base.__name__.strip('_').lower()}_{space.lower()}"
    content = {"bl_space_type": space} | ({"bl_parent_id": parent.__name__} if parent else {})
    return type(name, (base, bpy.types.Panel), content)


def _panels() -> Iterator[type[bpy.types.Panel]]:
    for space in SPACES:
        yield (main := _in_space(_Main, space))
        yield from (_in_space(base, space, main) for base in (_Path, _Delta))


CLASSES = tuple(_panels())
