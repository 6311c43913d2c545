"""What Blender tells of edits: which data-blocks and what operators, and when what is between frames is asked for.

Of data-blocks its dependency graphs tell, before they are evaluated and after it. They are found by their names, for
the original of what was deleted just now is no longer there to be asked for. Objects and bones that have nothing to do
with modes are never read.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import bpy

from ..actions.slots import actions_of
from ..transforms import Transform, is_part, transform_of

BlockKey = tuple[str, str | None]
"""The key that a data-block is found by in the file: its name, and the file that it is linked from."""

BLENDING = (
    "TRANSFORM_OT_",
    *(f"POSE_OT_{name}" for name in ("push", "relax", "breakdown", "blend", "user_transforms_clear")),
)
"""The beginnings of names of operators that go on from what properties have, also when adjusted afterwards."""

PATIENCE = 10.0
"""Seconds to wait for the main thread, which may be waiting itself: for a render to be cancelled."""


def key_of(block: bpy.types.ID) -> BlockKey:
    return block.name, block.library and block.library.filepath


def objects_of(keys: Iterable[BlockKey]) -> list[bpy.types.Object]:
    """Return the objects with these keys that are still there."""
    return [obj for obj in map(bpy.data.objects.get, keys) if obj is not None]


def add_actions(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, added: set[tuple[int, int]]) -> None:
    """Have the Actions of an object be in the dependency graph, which otherwise does not report their edits.

    Blender leaves them out that *Make Single User > Object Animation* has made. `added` has the session ids of objects
    and Actions that this was tried for.
    """
    for action in actions_of(obj):
        key = obj.session_uid, action.session_uid
        if key not in added and not action.evaluated_get(depsgraph).is_evaluated:
            added.add(key)
            # No edit, but Blender finds out anew what depends on what.
            obj.instance_type = obj.instance_type


def edited_actions(depsgraph: bpy.types.Depsgraph | None) -> list[bpy.types.Action]:
    """Return the Actions that wait to be evaluated, or just were."""
    if depsgraph is None or not depsgraph.id_type_updated("ACTION"):
        return []
    blocks = [update.id for update in depsgraph.updates if isinstance(update.id, bpy.types.Action)]
    return [action for action in map(bpy.data.actions.get, map(key_of, blocks)) if action is not None]


def actions_to_evaluate(scene: bpy.types.Scene) -> set[bpy.types.Action]:
    """Return the Actions that were edited since any of the scene's graphs was evaluated."""
    return {action for layer in scene.view_layers for action in edited_actions(layer.depsgraph)}


def objects_to_evaluate(
    scene: bpy.types.Scene, evaluated: set[int]
) -> Iterator[tuple[bpy.types.Object, bpy.types.Depsgraph | None]]:
    """Yield the objects that wait to be evaluated: all where nothing has been yet.
    With the graph they were evaluated in.

    `evaluated` has the addresses of the graphs that were evaluated before. Those of the scene are added.
    """
    for layer in scene.view_layers:
        depsgraph = layer.depsgraph
        known = depsgraph is not None and depsgraph.as_pointer() in evaluated
        if depsgraph is not None:
            evaluated.add(depsgraph.as_pointer())
        # What is new in a scene is in no graph yet.
        if not known or depsgraph.id_type_updated("SCENE") or depsgraph.id_type_updated("COLLECTION"):
            yield from ((obj, None) for obj in scene.objects)
        if known and depsgraph.id_type_updated("OBJECT"):
            blocks = [update.id for update in depsgraph.updates if isinstance(update.id, bpy.types.Object)]
            yield from ((obj, depsgraph) for obj in objects_of(map(key_of, blocks)))


def transforms_under(objects: Iterable[bpy.types.Object]) -> list[Transform]:
    """Return these objects, and all bones of rigs with Actions, modes or constraints for any."""
    result: dict[Transform, None] = {}
    for obj in objects:
        result[transform_of(obj)] = None
        if obj.pose is not None and has_bones(obj):
            result |= dict.fromkeys(map(transform_of, obj.pose.bones))
    return list(result)


def uses_modes(obj: bpy.types.Object) -> bool:
    """Return whether an object or its bones have, or had, anything to do with modes."""
    if obj.rigid_motion.has_bones or _has_properties(obj):
        return True
    return any(len(action.rigid_motion.slots) > 0 for action in actions_of(obj))


def has_mode(obj: bpy.types.Object) -> bool:
    """Return whether an object itself has, or had, anything to do with modes."""
    records = (record for action in actions_of(obj) for record in action.rigid_motion.slots)
    return _has_properties(obj) or any(not is_part(record.prefix) for record in records)


def has_bones(obj: bpy.types.Object) -> bool:
    """Return whether bones of a rig have anything to do with modes."""
    return obj.rigid_motion.has_bones or any(
        is_part(record.prefix) for action in actions_of(obj) for record in action.rigid_motion.slots
    )


def _has_properties(obj: bpy.types.Object) -> bool:
    motion = obj.rigid_motion
    return any(motion.filled) or motion.mode != "BLENDER" or motion.awaited != "BLENDER"


@dataclass(frozen=True)
class Operators:
    """The operators that are at work."""

    names: tuple[str, ...] = ()
    """Names of those that run, and of the one that has ended last if it did since edits were last seen."""

    is_script: bool = True
    """True if what is set is set as a script does it: none runs, nor is one adjusted that goes on from what was."""

    def are_any(self, beginnings: tuple[str, ...]) -> bool:
        """Return whether the name of any begins so."""
        return any(name.startswith(beginnings) for name in self.names)


class OperatorWatch:
    """Which operators were at work between two looks."""

    def __init__(self) -> None:
        self._last = (0, "")
        """The operator that had ended last, told from others of its kind, and its name."""

    def look(self) -> Operators:
        """Return those that are at work now, or ended since the last look."""
        manager = bpy.context.window_manager
        ended = manager.operators if manager is not None else ()
        last = (ended[-1].as_pointer(), ended[-1].bl_idname) if len(ended) else (0, "")
        running = [one.bl_idname for window in (manager.windows if manager else ()) for one in window.modal_operators]
        names = (*running, *((last[1],) if last != self._last else ()))
        self._last = last
        return Operators(names, not running and not last[1].startswith(BLENDING))


def shows_between_frames() -> bool:
    """Return whether a scene is shown between frames of its Actions, or one is being rendered."""
    return bpy.app.is_job_running("RENDER") or any(
        scene.frame_subframe or scene.render.frame_map_old != scene.render.frame_map_new for scene in bpy.data.scenes
    )


def on_main_thread(work: Callable[[], object]) -> None:
    """Do something on Blender's main thread, and wait for it.

    A render that is watched begins on a thread of its own, while the main thread evaluates and draws what would be
    changed.
    """
    if threading.current_thread() is threading.main_thread():
        work()
        return
    waiting, done = [work], threading.Event()

    def run() -> None:
        try:
            if waiting:
                waiting.pop()()
        finally:
            done.set()

    bpy.app.timers.register(run)
    if not done.wait(PATIENCE):
        if bpy.app.timers.is_registered(run):
            bpy.app.timers.unregister(run)
        run()
