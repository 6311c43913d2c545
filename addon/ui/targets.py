"""Which objects and keys are meant: what a Dope Sheet or Graph Editor shows, else the selected objects."""

from __future__ import annotations

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..animation import Refused, key_frames, modes_of
from ..animation.describing import frame_in_action, segment_at
from ..animation.mode_keys import source_of

KEY_EDITORS = ("DOPESHEET_EDITOR", "GRAPH_EDITOR")

WHOLE, CURRENT, SELECTED = "WHOLE", "CURRENT", "SELECTED"

SCOPES = [
    (WHOLE, "Whole Object", "One mode for all segments. Keys of the mode are removed"),
    (CURRENT, "Current Segment", "The segment that the playhead is in. The others keep their modes"),
    (SELECTED, "Selected Keys", "The segments that the selected keys begin. The others keep their modes"),
]
"""What of an object gets a mode, as the items of an enum property."""


def is_key_editor(context: bpy.types.Context) -> bool:
    return context.area is not None and context.area.type in KEY_EDITORS


def objects_for(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The objects that an operator acts on here."""
    if is_key_editor(context):
        return _shown_in_editor(context)
    return list(context.selected_objects) or [obj for obj in (context.object,) if obj is not None]


def scope_for(context: bpy.types.Context) -> str:
    """What of them gets a mode here, unless asked for otherwise."""
    return SELECTED if is_key_editor(context) else WHOLE


def frames_meant(context: bpy.types.Context, obj: bpy.types.Object, scope: str) -> np.ndarray | None:
    """The keys of an object that begin the segments meant, None for all of it. `Refused` where there are none."""
    if scope == WHOLE:
        return None
    if scope == SELECTED:
        frames = key_frames(obj, selected=True)
        if not len(frames):
            raise Refused(f"{obj.name}: no key of location, rotation or scale is selected")
        return frames
    source = source_of(obj)
    if source is None:
        raise Refused(f"{obj.name} has no Action with keys: key it first, or enter a strip (NLA Editor, Tab)")
    segment = segment_at(source, frame_in_action(obj, context.scene.frame_current_final))
    if segment is None:
        raise Refused(f"{obj.name}: the playhead is not between two keys; move it there, or select keys instead")
    return np.array([segment.key])


def modes_meant(context: bpy.types.Context, obj: bpy.types.Object | None, scope: str) -> set[str]:
    """The modes that what is meant of an object has now."""
    if obj is None:
        return set()
    try:
        frames = frames_meant(context, obj, scope)
    except ValueError:
        return set()
    keys = key_frames(obj)
    if frames is None:
        frames = keys if len(keys) else np.zeros(1)
    # The last key begins no segment. Alone it still has a mode, for keys to come.
    return set(modes_of(obj, frames[~np.isin(frames, keys[-1:])] if len(frames) > 1 else frames))


def _shown_in_editor(context: bpy.types.Context) -> list[bpy.types.Object]:
    shown = {fcurve.as_pointer() for fcurve in context.visible_fcurves or ()}
    return [obj for obj in context.view_layer.objects if any(one.as_pointer() in shown for one in fcurves_of(obj))]


def fcurves_of(obj: bpy.types.Object) -> bpy.types.bpy_prop_collection | tuple:
    """The F-curves of an object's slot. Looks at nothing else in the file, for it is asked of many objects."""
    data = obj.animation_data
    if data is None or data.action is None or data.action_slot is None:
        return ()
    channelbag = action_get_channelbag_for_slot(data.action, data.action_slot)
    return () if channelbag is None else channelbag.fcurves
