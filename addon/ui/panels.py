"""The sidebar panel of the viewport, the Dope Sheet and the Graph Editor: what the active object does, and why."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from .. import animation
from ..animation.describing import SegmentFacts, frame_in_action, is_up_to_date, segment_at
from ..animation.mode_keys import source_of
from ..animation.sources import Source
from ..animation.transforms import MODE_PROPERTY
from . import overlay
from .rows import draw_text, labelled
from .targets import CURRENT, SELECTED, WHOLE, fcurves_of, is_key_editor, modes_meant
from .wording import BAKED, LABELS, NO_KEYS, NO_SEGMENT, OUT_OF_DATE, STRIPS, cautions, degrees, length

CATEGORY = "Animation"
"""The tab of the sidebar: in the viewport Blender has its own tools for animation there."""

SPACES = ("VIEW_3D", "DOPESHEET_EDITOR", "GRAPH_EDITOR")


class _Main:
    bl_label = "Rigid Motion"
    bl_region_type = "UI"
    bl_category = CATEGORY

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        segment, notes = facts_and_notes(obj, context.scene.frame_current_final)
        if is_key_editor(context):
            _draw_mode_menu(labelled(layout, "Selected"), SELECTED, modes_meant(context, obj, SELECTED))
        if any(fcurve.data_path == MODE_PROPERTY for fcurve in fcurves_of(obj)):
            _draw_mode_menu(labelled(layout, "Object"), WHOLE, modes_meant(context, obj, WHOLE))
        else:
            labelled(layout, "Object").prop(obj.rigid_motion, "mode", text="")
        if segment is not None:
            _draw_segment(context, layout, segment)
        for icon, text in notes:
            draw_text(context, layout, text, icon)
        if ("ERROR", OUT_OF_DATE) in notes:
            layout.operator("rigid_motion.refresh")
        row = layout.row(align=True)
        row.operator("rigid_motion.bake", text="Bake...")
        row.operator("rigid_motion.unbake")
        _draw_reduction(context, layout, obj)


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


def facts_and_notes(obj: bpy.types.Object, frame: float) -> tuple[SegmentFacts | None, list[tuple[str, str]]]:
    """What the panel tells of an object: the segment that a frame of the scene is in, and texts, each with its icon."""
    source, problem = _read(obj)
    segment = None
    notes = []
    if problem:
        notes.append(("ERROR", problem))
    elif source is None:
        strips = obj.animation_data is not None and any(track.strips for track in obj.animation_data.nla_tracks)
        notes.append(("INFO", STRIPS if strips else NO_KEYS))
    else:
        segment = segment_at(source, frame_in_action(obj, frame))
        notes += [("ERROR", caution) for caution in cautions(segment)] if segment else [("INFO", NO_SEGMENT)]
        if not is_up_to_date(obj, source):
            notes.append(("ERROR", OUT_OF_DATE))
    if animation.is_baked(obj):
        notes.append(("INFO", BAKED))
    return segment, notes


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


def _draw_segment(context: bpy.types.Context, layout: bpy.types.UILayout, segment: SegmentFacts) -> None:
    _draw_mode_menu(labelled(layout, "Segment"), CURRENT, {segment.mode})
    column = layout.column(align=True)
    labelled(column, "Frames").label(text=f"{segment.first:g} \N{EN DASH} {segment.last:g}")
    labelled(column, "Turn").label(text=degrees(segment.turn))
    labelled(column, "Distance").label(text=length(context.scene, segment.distance))


def _draw_mode_menu(layout: bpy.types.UILayout, scope: str, modes: set[str]) -> None:
    """A button that shows the mode and sets another."""
    layout.enabled = bool(modes)
    text = LABELS[next(iter(modes))] if len(modes) == 1 else "Mixed" if modes else "None"
    layout.operator_menu_enum("rigid_motion.set_mode", "mode", text=text).on = scope


def _draw_reduction(context: bpy.types.Context, layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    row = layout.row(align=True)
    row.operator("rigid_motion.reduce_keys", text="Reduce Keys")
    row.operator("rigid_motion.restore_keys")
    reduction = animation.reduction_of(obj)
    if reduction is not None:
        row.operator("rigid_motion.let_keys_go", text="", icon="TRASH")
        column = layout.column(align=True)
        labelled(column, "Keys").label(text=f"{reduction.before} \N{RIGHTWARDS ARROW} {reduction.after}")
        labelled(column, "Off By").label(text=f"{length(context.scene, reduction.largest_error, 3)} at most")


def _draw_own(layout: bpy.types.UILayout, obj: bpy.types.Object, is_filled: bool, own: str, delta: str) -> None:
    if is_filled:
        layout.prop(obj.rigid_motion, own)
    else:
        layout.prop(obj, delta)


def _in_space(base: type, space: str, parent: type | None = None) -> type[bpy.types.Panel]:
    name = f"RIGID_MOTION_PT_{base.__name__.strip('_').lower()}_{space.lower()}"
    content = {"bl_space_type": space} | ({"bl_parent_id": parent.__name__} if parent else {})
    return type(name, (base, bpy.types.Panel), content)


def _panels() -> Iterator[type[bpy.types.Panel]]:
    for space in SPACES:
        yield (main := _in_space(_Main, space))
        yield from (_in_space(base, space, main) for base in (_Path, _Delta))


CLASSES = tuple(_panels())
