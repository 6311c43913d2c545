"""Paths that were worked out already, and which of them an edit may have made wrong.

Blender's handlers name the objects and Actions that were edited. Their paths are looked at again when next drawn, and
worked out anew where the digest of the source, or something else that they depend on, is another one. So a frame
that is merely played, or looked at from elsewhere, costs no more than looking paths up.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass

import bpy
from bpy.app.handlers import persistent

from ...animation import key_frames
from ...animation.inbetweens.mode_keys import source_of
from ...animation.transforms import Transform, transform_of
from .points import Path, axis_length_of, trace

SPARE = 64
"""How many paths are kept that are not drawn any more."""


@dataclass
class _Entry:
    path: Path | None
    digest: tuple
    """Of all that the path depends on."""

    settings: tuple
    """The part of it that is the scene's."""

    action: int
    """Session id of the Action that the path was read from, 0 for none."""

    selected: bytes = b""
    """The frames of the keys that were selected."""

    stale: bool = False


_entries: OrderedDict[tuple[int, str], _Entry] = OrderedDict()
"""By the identity of what is moved; those drawn last come last."""


def path_of(target: bpy.types.Object | Transform, scene: bpy.types.Scene) -> Path | None:
    """The path of a target, as the overlay of the scene is set.

    None where it has none: without keys in its Action, with a single one, and where rigid motion is refused.
    """
    target = transform_of(target)
    overlay = scene.rigid_motion_overlay
    settings = (overlay.mode, overlay.tick_step, overlay.axes_size, scene.frame_start, scene.frame_end)
    identity = _identity(target)
    entry = _entries.get(identity)
    if entry is None or entry.stale or entry.settings != settings:
        entry = _entries[identity] = _read(target, settings, entry)
    _entries.move_to_end(identity)
    return entry.path


def keep_only(drawn: int) -> None:
    """Drop paths that were not drawn for long, where this many were drawn just now."""
    while len(_entries) > drawn + SPARE:
        _entries.popitem(last=False)


def notice_selection(targets: Iterable[bpy.types.Object | Transform]) -> bool:
    """Whether keys of these are selected otherwise than in their paths; those are looked at again then.

    Selecting is no edit, so Blender's handlers are silent about it.
    """
    targets = map(transform_of, targets)
    entries = [(entry, target) for target in targets if (entry := _entries.get(_identity(target))) is not None]
    changed = [
        entry
        for entry, target in entries
        if entry.path and entry.selected != key_frames(target, selected=True).tobytes()
    ]
    for entry in changed:
        entry.stale = True
    return bool(changed)


def _identity(target: Transform) -> tuple[int, str]:
    return target.animated.session_uid, target.prefix


def _read(target: Transform, settings: tuple, before: _Entry | None) -> _Entry:
    data = target.animated.animation_data
    action = data.action if data else None
    entry = _Entry(None, (), settings, action.session_uid if action else 0)
    try:
        source = source_of(target)
        if source is not None:
            mode, tick_step, axes_size, *_ = settings
            selected = key_frames(target, selected=True)
            axis_length = axes_size * axis_length_of(target.carrier, source)
            entry.selected = selected.tobytes()
            # What is not keyed moves the path and not its in-betweens, so it is no part of their digest.
            entry.digest = (source.digest, tuple(source.rest.items()), entry.selected, axis_length, settings)
            if before is not None and before.digest == entry.digest:
                entry.path = before.path
            else:
                entry.path = trace(source, None if mode == "CHOSEN" else mode, tick_step, axis_length, selected)
    except ValueError:
        # Refused. The panel says why.
        pass
    return entry


@persistent
def _on_update(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if _entries:
        edited = {update.id.original.session_uid for update in depsgraph.updates}
        for (uid, _), entry in _entries.items():
            entry.stale |= uid in edited or entry.action in edited


@persistent
def _on_frame(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    # To Blender, whatever is animated was updated on every frame. Unless it plays, a script may really have edited it.
    windows = bpy.context.window_manager.windows
    if not any(window.screen.is_animation_playing or window.screen.is_scrubbing for window in windows):
        _on_update(scene, depsgraph)


@persistent
def _on_file(*_: object) -> None:
    _entries.clear()


HANDLERS = {
    "depsgraph_update_post": _on_update,
    "frame_change_post": _on_frame,
    "undo_post": _on_file,
    "redo_post": _on_file,
    "load_post": _on_file,
}


def register() -> None:
    for name, handler in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    for name, handler in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(handler)
    _entries.clear()
