"""What Blender's dependency graphs tell: which data-blocks were edited, before they are evaluated and after it.

Data-blocks are found by their names, for the original of what was deleted just now is no longer there to be asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from ..actions.slots import actions_of

BlockKey = tuple[str, str | None]
"""The key that a data-block is found by in the file: its name, and the file that it is linked from."""


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
