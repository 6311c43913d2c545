"""From the context to targets: the transforms and keys that an editor means, here and nowhere else.

In a Dope Sheet or Graph Editor these are the transforms whose channels are shown. Elsewhere they are the selected
objects; while bones are posed, the selected bones of all rigs in Pose Mode.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy
import numpy as np
from bpy.app.translations import pgettext_rpt as rpt_
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..animation import Refused, key_frames, modes_of
from ..animation.queries.keyed import source_of
from ..animation.queries.polls import with_more_keys_than
from ..animation.queries.segments import frame_in_action, segment_at
from ..animation.transforms import SEGMENT_PROPERTIES, WIDTHS, Transform, bone_name, split_path, transform_of

KEY_EDITORS = ("DOPESHEET_EDITOR", "GRAPH_EDITOR")

WHOLE, CURRENT, SELECTED = "WHOLE", "CURRENT", "SELECTED"

SCOPES = [
    (WHOLE, "All Segments", "One mode for all segments. Keys of the mode are removed"),
    (CURRENT, "Current Segment", "The segment that the playhead is in. The others keep their modes"),
    (SELECTED, "Selected Keys", "The segments that the selected keys begin. The others keep their modes"),
]
"""The parts of a target that get a mode, as the items of an enum property."""

Frames = tuple[float, ...] | None
"""Frames of keys, None for all of a target."""


def is_key_editor(context: bpy.types.Context) -> bool:
    return context.area is not None and context.area.type in KEY_EDITORS


def is_posing(context: bpy.types.Context) -> bool:
    """Return whether bones are selected here, and not objects: in Pose Mode,
    and while weights are painted for a posed rig.
    """
    return context.mode == "POSE" or (context.mode == "PAINT_WEIGHT" and context.pose_object is not None)


def active_target(context: bpy.types.Context) -> Transform | None:
    """Return what panels and ticks in menus are about."""
    active = context.active_pose_bone if is_posing(context) else context.object
    return None if active is None else transform_of(active)


def each_target(context: bpy.types.Context) -> Iterator[Transform]:
    """Return what an operator acts on here, one after the other: polls need no more than the first that fits."""
    return _shown_in_editor(context) if is_key_editor(context) else map(transform_of, selected(context))


def targets_of(context: bpy.types.Context) -> list[Transform]:
    """Return what an operator acts on here."""
    return list(each_target(context))


def with_bones_of_rigs(context: bpy.types.Context, targets: Iterable[Transform]) -> Iterator[Transform]:
    """Yield the targets, and outside of Pose Mode in place of rigs all that has keys of them and of their bones.

    In a key editor these are the selected rigs too: it shows channels of bones only where the bones are selected.
    """
    if is_posing(context):
        yield from targets
        return
    if is_key_editor(context):
        rigs = (obj for obj in selected(context) if obj.type == "ARMATURE")
        targets = (*map(transform_of, rigs), *targets)
    seen: set[Transform] = set()
    for target in targets:
        keyed = [bone for bone in with_keyed_bones(target) if bone not in seen]
        yield from keyed
        seen.update(keyed)


def with_keyed_bones(target: Transform) -> list[Transform]:
    """Return what has keys of a rig and its bones, where any of its bones has; otherwise the target alone."""
    if target.is_part or target.carrier.type != "ARMATURE":
        return [target]
    keyed = list(with_more_keys_than((target, *map(transform_of, target.carrier.pose.bones)), 0))
    return keyed if any(item.is_part for item in keyed) else [target]


def selected(context: bpy.types.Context) -> list[bpy.types.Object] | list[bpy.types.PoseBone]:
    """Return the selected objects, without any the active one; or the selected bones alone,
    as Blender's operators have it.
    """
    result = selected_in_view(context)
    return result if result or is_posing(context) or context.object is None else [context.object]


def selected_in_view(context: bpy.types.Context) -> list[bpy.types.Object] | list[bpy.types.PoseBone]:
    """Return the selected bones of all rigs in Pose Mode while these are posed, else the selected objects."""
    return list((context.selected_pose_bones if is_posing(context) else context.selected_objects) or ())


def scope_for(context: bpy.types.Context) -> str:
    """Return what of the targets gets a mode here, unless asked for otherwise."""
    return SELECTED if is_key_editor(context) else WHOLE


def frames_meant(context: bpy.types.Context, target: Transform, scope: str) -> Frames:
    """Return the keys of a target that begin the segments meant, None for all of it. `Refused` where there are none."""
    if scope == WHOLE:
        return None
    if scope == SELECTED:
        frames = key_frames(target, selected=True)
        if not len(frames):
            raise Refused(rpt_("{name}: no key of location, rotation or scale is selected").format(name=target.name))
        return tuple(frames.tolist())
    source = source_of(target)
    if source is None:
        raise Refused(
            rpt_("{name} has no Action with keys: key it first, or enter a strip (NLA Editor, Tab)").format(
                name=target.name
            )
        )
    segment = segment_at(source, frame_in_action(target.animated, context.scene.frame_current_final))
    if segment is None:
        raise Refused(
            rpt_("{name}: the playhead is not between two keys; move it there, or select keys instead").format(
                name=target.name
            )
        )
    return (segment.key,)


def grouped_by_frames(
    context: bpy.types.Context, targets: Iterable[Transform], scope: str, refused: list[Refused]
) -> dict[Frames, list[Transform]]:
    """Return the targets whose segments meant begin on the same keys, together.
    `refused` takes why others have none.
    """
    groups: dict[Frames, list[Transform]] = {}
    for target in targets:
        try:
            groups.setdefault(frames_meant(context, target, scope), []).append(target)
        except Refused as refusal:
            refused.append(refusal)
    return groups


def modes_meant(context: bpy.types.Context, target: Transform | None, scope: str) -> set[str]:
    """Return the modes that what is meant of a target has now."""
    if target is None:
        return set()
    try:
        meant = frames_meant(context, target, scope)
    except ValueError:
        return set()
    keys = key_frames(target)
    frames = keys if meant is None else np.array(meant)
    if not len(frames):
        frames = np.zeros(1)
    # The last key begins no segment. Alone it still has a mode, for keys to come.
    return set(modes_of(target, frames[~np.isin(frames, keys[-1:])] if len(frames) > 1 else frames))


def _shown_in_editor(context: bpy.types.Context) -> Iterator[Transform]:
    """Yield the objects and the bones of which location, rotation, scale or the mode is shown in a key editor."""
    shown = {fcurve.as_pointer() for fcurve in context.visible_fcurves or ()}
    for obj in _animated_in_editor(context) if shown else ():
        result = set()
        for fcurve in fcurves_of(obj):
            prefix, prop = split_path(fcurve.data_path)
            if prefix not in result and (prop in WIDTHS or prop in SEGMENT_PROPERTIES) and fcurve.as_pointer() in shown:
                result.add(prefix)
                if (carrier := _carrier(obj, prefix)) is not None:
                    yield transform_of(carrier)


def _animated_in_editor(context: bpy.types.Context) -> Iterable[bpy.types.Object]:
    """Return the objects that a key editor may show."""
    if not context.space_data.dopesheet.show_only_selected:
        return context.view_layer.objects
    active = (context.object,) if context.object is not None else ()
    return dict.fromkeys((*context.selected_objects, *active, *(context.objects_in_mode or ())))


def _carrier(obj: bpy.types.Object, prefix: str) -> bpy.types.Object | bpy.types.PoseBone | None:
    """Return what a prefix of data paths stands for in an object; None where that has no such bone."""
    if not prefix:
        return obj
    return None if obj.pose is None else obj.pose.bones.get(bone_name(prefix))


def fcurves_of(animated: bpy.types.Object) -> bpy.types.bpy_prop_collection | tuple:
    """Return the F-curves of an object's slot. Looks at nothing else in the file, for it is asked of many objects."""
    data = animated.animation_data
    if data is None or data.action is None or data.action_slot is None:
        return ()
    channelbag = action_get_channelbag_for_slot(data.action, data.action_slot)
    return () if channelbag is None else channelbag.fcurves
