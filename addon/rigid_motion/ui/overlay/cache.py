"""Cache of computed paths, and which of them an edit may have invalidated.

Blender's handlers name the objects and Actions that were edited. Their paths are checked when they are next drawn, and
computed again if the digest of the source or of another dependency has changed. So playing a frame, or looking from
another angle, costs no more than looking up paths.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ...animation.actions.channels import selected_keys
from ...animation.actions.slots import Binding
from ...animation.baking.layers import is_plain
from ...animation.evaluation.sources import KeyedTransform
from ...animation.queries.keyed import active_bindings, frames_in
from ...animation.transforms import Transform, transform_of
from ...blender import existing, original_uid, persistent
from ...handlers import append_handlers, remove_handlers
from ..targets import selected_in_view
from . import records
from .held import motion_of
from .kinds import Space, axis_length_of, space_of
from .parents import CarriedTargets
from .points import DrawnPath

MAX_SPARE_PATHS = 64
"""The number of paths kept that are no longer drawn."""


@dataclass
class _Entry:
    path: DrawnPath | None
    digest: tuple
    """The digest of everything that the path depends on."""

    settings: tuple
    """The scene's settings of the overlay, and the bytes of `Space.turn` if the parents are not followed."""

    action: int
    """Session id of the Action that the path was read from, 0 for none."""

    selected: bytes = b""
    """Which keys of its channels are selected."""

    above: frozenset[int] = frozenset()
    """Session ids of the data-blocks that its parents move by, if it follows them."""

    records: tuple[tuple[records.PlaceRecord, int], ...] = ()
    """Place records that it depends on, with their versions at that time."""

    stale: bool = False

    @property
    def is_outdated(self) -> bool:
        """Return whether a place record has changed since, or lost its transform in an undo."""
        return any(record.version != version or record.transform is None for record, version in self.records)


OVERLAY = "rigid_motion_overlay"
"""The property of scenes with the overlay's settings, see `settings`."""

_entries: OrderedDict[tuple[int, str], _Entry] = OrderedDict()
"""Entries by the identity of the transform, in the order of drawing: the last drawn come last."""


def path_of(target: bpy.types.Object | bpy.types.PoseBone | Transform, context: Any) -> DrawnPath | None:
    """Return the path of a target, with the scene's settings of the overlay.

    None if it has no path: without keys in its Action, with a single one, or if rigid motion is refused.
    """
    (path,) = drawn_paths([transform_of(target)], context)
    return path and path[1]


def drawn_paths(targets: Sequence[Transform], context: Any) -> list[tuple[Matrix, DrawnPath] | None]:
    """Return the paths of several targets, with the maps from their spaces into the world; None for no path."""
    scene, is_playing = context.scene, _is_playing()
    overlay: Any = getattr(scene, OVERLAY)
    ghost_step = overlay.frames_between_ghosts if overlay.show_ghosts else 0
    settings = (
        *(overlay.mode, overlay.tick_step, overlay.axes_size, ghost_step),
        *(scene.frame_start, scene.frame_end),
    )
    spaces = {target: space_of(target, context.view_layer.depsgraph) for target in targets}
    stale = []
    for target, space in spaces.items():
        entry = _entries.get(target.identity)
        if (
            entry is None
            or entry.stale
            or (entry.is_outdated and not is_playing)
            or entry.settings != (*settings, b"" if entry.above else _turn_bytes(space.turn))
        ):
            stale.append(target)
    if stale:
        carried = CarriedTargets()
        for target, (binding, source) in carried.read(stale).items():
            before = _entries.get(target.identity)
            entry = _read(target, binding, source, settings, spaces[target], before, carried)
            _entries[target.identity] = entry
    for target in targets:
        _entries.move_to_end(target.identity)
    paths = [_entries[target.identity].path for target in targets]
    return [
        None if path is None else (Matrix() if path.in_world else spaces[target].matrix, path)
        for target, path in zip(targets, paths, strict=True)
    ]


def shown_paths(context: Any) -> list[tuple[Transform, Matrix, DrawnPath]]:
    """Return the selected objects or bones that have paths, each with the map from its path's space into the world."""
    targets = list(map(transform_of, selected_in_view(context)))
    paths = drawn_paths(targets, context)
    keep_only(len(targets))
    return [(target, *path) for target, path in zip(targets, paths, strict=True) if path is not None]


def _turn_bytes(turn: np.ndarray | None) -> bytes:
    return b"" if turn is None else turn.astype(np.float32).tobytes()


def keep_only(drawn: int) -> None:
    """Drop the paths drawn longest ago, given how many were drawn just now."""
    while len(_entries) > drawn + MAX_SPARE_PATHS:
        _entries.popitem(last=False)


def know_from_seeing(targets: Iterable[Transform]) -> bool:
    """Return whether the path of any target depends on places recorded while frames were shown."""
    entries = (_entries.get(target.identity) for target in targets)
    return any(entry is not None and entry.records for entry in entries)


def notice_selection(targets: Iterable[bpy.types.Object | bpy.types.PoseBone | Transform]) -> bool:
    """Return whether the key selection of any target has changed; mark the paths of these targets as stale.

    Selecting is no edit, so Blender's handlers do not report it.
    """
    entries = {target: entry for target in map(transform_of, targets) if (entry := _entries.get(target.identity))}
    drawn = [target for target, entry in entries.items() if entry.path]
    bindings = active_bindings(drawn) if drawn else {}
    changed = [entries[target] for target in drawn if entries[target].selected != _selection(bindings.get(target))]
    for entry in changed:
        entry.stale = True
    return bool(changed)


def _selection(binding: Binding | None) -> bytes:
    """Return which keys are selected, channel by channel: quicker to get than their frames."""
    curves = () if binding is None else binding.curves.values()
    return b"".join(selected_keys(fcurve).tobytes() for fcurve in curves)


def _read(
    target: Transform,
    binding: Binding | None,
    source: KeyedTransform | None,
    settings: tuple,
    space: Space,
    before: _Entry | None,
    carried: CarriedTargets,
) -> _Entry:
    data = target.animated.animation_data
    action = data.action if data else None
    entry = _Entry(None, (), (*settings, _turn_bytes(space.turn)), action.session_uid if action else 0)
    if binding is None or source is None:
        # If it was refused, the panel says why.
        return entry
    if target.motion.base is not None and not is_plain(target.animated):
        return entry  # the keys are not where the bone or object is seen
    motion = motion_of(target, source, carried, space)
    entry.above = motion.ids
    if entry.above:
        entry.settings = (*settings, b"")
    if not motion.has_path:
        return entry
    entry.selected, entry.records = _selection(binding), motion.records
    selected = frames_in(binding, selected=True)
    # Unkeyed values move the path but not its in-betweens, so the source's digest leaves them out.
    unkeyed = [getattr(target.carrier, prop)[:] for name, prop in target.properties.items() if name not in source.keyed]
    entry.digest = (
        *(source.digest, source.original.tobytes(), tuple(source.rest.items()), tuple(unkeyed), motion.digest),
        *(motion.point.tobytes(), axis_length_of(target), selected.tobytes(), entry.settings),
    )
    if before is not None and before.digest == entry.digest:
        entry.path = before.path
        return entry
    mode, tick_step, axes_size, ghost_step, *_ = settings
    chosen = None if mode == "CHOSEN" else mode
    with suppress(ValueError):  # numbers that make no motion
        entry.path = motion.trace(chosen, tick_step, axes_size, selected)
        if ghost_step and entry.path is not None:
            entry.path = replace(entry.path, ghosts=motion.ghosts(ghost_step, chosen))
    return entry


@persistent
def _on_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _entries:
        records.note(scene, depsgraph)
        edited = set(map(original_uid, depsgraph.updates))
        for (uid, _), entry in _entries.items():
            entry.stale |= uid in edited or entry.action in edited or not edited.isdisjoint(entry.above)


@persistent
def _on_frame(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if not _entries:
        return
    # For Blender every frame updates all animated objects. Unless it plays, a script may have edited them.
    if _is_playing():
        records.note(scene, depsgraph)
    else:
        _on_update(scene, depsgraph)


def _is_playing() -> bool:
    """Return whether any window plays or scrubs."""
    windows = existing(bpy.context.window_manager).windows
    return any(window.screen.is_animation_playing or window.screen.is_scrubbing for window in windows)


@persistent
def _on_undo(*_: object) -> None:
    _entries.clear()
    records.suspend()


@persistent
def _on_file(*_: object) -> None:
    _entries.clear()
    records.clear()


HANDLERS: dict[str, Callable] = {
    "depsgraph_update_post": _on_update,
    "frame_change_post": _on_frame,
    "undo_post": _on_undo,
    "redo_post": _on_undo,
    "load_post": _on_file,
}


def register() -> None:
    append_handlers(HANDLERS)


def unregister() -> None:
    remove_handlers(HANDLERS)
    _entries.clear()
    records.clear()
