"""Rigs in Edit Mode: their constraints show nothing there, for Blender's Symmetrize crashes on what they show.

Nothing of it is to be seen, as Blender shows rigs at rest in Edit Mode. Files are saved with everything in its place.
This goes on while edits are not followed: a crash does not ask for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import bpy
from bpy.app.handlers import persistent

from ..actions.renaming import follow_renamed_in
from ..handlers import append_handlers, remove_handlers
from ..writers.bone_constraints import attach_slots, detach_slots


def follow_mode(rig: bpy.types.Object) -> None:
    """Have the constraints of a rig show nothing in Edit Mode, and their slots again outside of it."""
    if rig.mode == "EDIT":
        detach_slots(rig)
        # Most edits find it set, and to set it again would be an edit.
        if not rig.rigid_motion.detached:
            rig.rigid_motion.detached = True
    else:
        _put_back(rig)


def _put_back(rig: bpy.types.Object) -> None:
    if rig.rigid_motion.detached:
        follow_renamed_in(rig)
        attach_slots(rig)
        rig.rigid_motion.detached = False


def _for_rigs(act: Callable[[bpy.types.Object], None], objects: Iterable[bpy.types.Object]) -> None:
    for obj in objects:
        if obj.pose is not None and obj.is_editable:
            act(obj)


def _edited(depsgraph: bpy.types.Depsgraph) -> Iterator[bpy.types.Object]:
    return (update.id.original for update in depsgraph.updates if isinstance(update.id, bpy.types.Object))


@persistent
def _on_update(_: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if depsgraph.id_type_updated("OBJECT"):
        _for_rigs(follow_mode, _edited(depsgraph))


@persistent
def _on_file(*_: object) -> None:
    _for_rigs(follow_mode, bpy.data.objects)


@persistent
def _before_saving(*_: object) -> None:
    _for_rigs(_put_back, bpy.data.objects)


HANDLERS = {
    "depsgraph_update_post": _on_update,
    "undo_post": _on_file,
    "redo_post": _on_file,
    "load_post": _on_file,
    "save_pre": _before_saving,
    "save_post": _on_file,
    "save_post_fail": _on_file,
}


def register() -> None:
    append_handlers(HANDLERS)


def unregister() -> None:
    remove_handlers(HANDLERS)
    _for_rigs(_put_back, bpy.data.objects)
