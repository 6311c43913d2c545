"""Keeping in-betweens up to date: whatever the animator edits, by hand or by script, shows at once.

Blender's handlers tell that something was edited. Whether it matters, the digest of the source tells: the Action keeps
that of what it was filled in from. It travels with the file through undo, redo, saving and loading, so nothing has to
be remembered here for the in-betweens to be right. A frame that is merely played costs nothing.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import ClassVar

import bpy
from bpy.app.handlers import persistent

from . import insertion
from .filling import clear, fill_in, give_back, hold_own, is_complete, recorded
from .inbetweens import deltas
from .reading import keyed_in, read
from .refusals import refuse_numbers
from .slots import Curves, Refused, Slot, curves_in, slots_in, slots_of
from .sources import Source

log = logging.getLogger(__package__)


class _State:
    """What the handlers share."""

    enabled = True
    """Whether edits are followed at once."""

    busy = False
    """Whether the edits that Blender tells of are our own."""

    unseen = True
    """Whether the file has yet to be looked through since the extension was switched on."""

    again = False
    """Whether what is there was brought back by undo or redo."""

    frame = 0.0
    """The frame that was last shown."""

    edited = False
    """Whether an Action was edited before the frame changed. Afterwards all that are played look so."""

    ranges: ClassVar[dict[int, tuple[int, int]]] = {}
    """First and last frame of each scene when last seen, by session id."""


def set_enabled(enabled: bool) -> None:
    """Follow edits at once, or else only when `refresh` is called."""
    _State.enabled, _State.unseen = enabled, enabled


def refresh(objects: Iterable[bpy.types.Object] | None = None) -> int:
    """Bring the in-betweens of these objects up to date, or of all in the file.

    Returns
    -------
    int
        How many slots had to be filled in anew.
    """
    objects = list(bpy.data.objects) if objects is None else list(objects)
    with _turn() as ours:
        if not ours:
            return 0
        slots = slots_of(objects)
        moved = {obj for slot in slots for obj in slot.users}
        for obj in objects:
            if obj not in moved:
                give_back(obj)
        return _refresh(slots)


def problem_of(obj: bpy.types.Object) -> str:
    """Why an object keeps Blender's own in-betweens whatever its mode, and the way out; "" where nothing is amiss."""
    try:
        for slot in slots_of([obj]):
            source = read(slot, curves_in(slot.channelbag))
            if source.is_live:
                deltas([source])
    except Refused as problem:
        return str(problem)
    except ValueError as problem:
        return f"{obj.name} has keys too large to compute with ({problem}): delete them (Dope Sheet, X)"
    return ""


def _refresh(slots: Sequence[Slot]) -> int:
    # What is linked has the in-betweens that its own file was saved with.
    readings = [(slot, curves_in(slot.channelbag)) for slot in slots if slot.action.is_editable]
    stale, idle = [], []
    for (slot, curves), source in zip(readings, keyed_in(readings), strict=True):
        before = recorded(slot)
        if not _is_wanted(slot, source, before):
            if before:
                clear(slot, curves)
            idle.append((slot, curves))
            for obj in slot.users:
                give_back(obj)
        elif source.digest != before or not is_complete(curves, source):
            if insertion.keep_pose(slot, curves, before, source, _State.frame, again=_State.again):
                curves = curves_in(slot.channelbag)
                (source,) = keyed_in([(slot, curves)])
                if not _is_wanted(slot, source, before):
                    continue
            stale.append((slot, curves, source))
    try:
        fill_in(stale)
    except ValueError:
        # One of them has numbers that make no motion: it keeps Blender's own, and the others get theirs.
        for one in stale:
            try:
                fill_in([one])
            except ValueError:
                clear(*one[:2])
                idle.append(one[:2])
    for slot, curves in (*idle, *_beside(slots)):
        hold_own(slot, curves)
    return len(stale)


def _beside(slots: Sequence[Slot]) -> list[tuple[Slot, Curves]]:
    """What else than these slots moves their objects in the NLA, and is not filled in."""
    tracked = {obj for slot in slots for obj in slot.users if len(obj.animation_data.nla_tracks)}
    known = {(slot.action, slot.handle) for slot in slots}
    return [
        (slot, curves_in(slot.channelbag))
        for slot in (slots_of(tracked) if tracked else ())
        if (slot.action, slot.handle) not in known and slot.action.is_editable and not recorded(slot)
    ]


def _is_wanted(slot: Slot, source: Source | Refused, before: str) -> bool:
    """Whether there is more to a source than Blender's own in-betweens, and it can be had.

    `before` is the digest of what the slot is filled in from: that needs no second examination.
    """
    if isinstance(source, Refused):
        return False
    if source.digest != before:
        try:
            refuse_numbers(slot.users[0].name, source)
        except Refused:
            return False
        if not source.is_live:
            return False
    insertion.remember(source)
    return True


@contextmanager
def paused() -> Iterator[None]:
    """Do several things, and refresh after them."""
    with _turn():
        yield


@contextmanager
def _turn() -> Iterator[bool]:
    """Whether it is our turn: not while we are at it, for what we write is no edit to follow."""
    ours = not _State.busy
    _State.busy = True
    try:
        yield ours
    finally:
        if ours:
            _State.busy = False


def _follow(depsgraph: bpy.types.Depsgraph, *, edited: bool) -> set[bpy.types.Object]:
    """Refresh after an update in which Actions were edited or not, and say which objects those move."""
    if _State.unseen:
        _look_through()
    if not edited:
        return set()
    slots = slots_in(update.id.original for update in depsgraph.updates if isinstance(update.id, bpy.types.Action))
    with _turn() as ours:
        if ours:
            _refresh(slots)
    return {obj for slot in slots for obj in slot.users}


def _follow_objects(depsgraph: bpy.types.Depsgraph, frame: float, seen: set[bpy.types.Object]) -> None:
    """Refresh after an edit of scenes, or of other objects than these, and notice how one was posed by hand."""
    for update in depsgraph.updates:
        block = update.id
        if isinstance(block, bpy.types.Object):
            motion = block.rigid_motion
            if (motion.mode != "BLENDER" or any(motion.filled)) and block.original not in seen:
                insertion.notice_pose(block.original, frame)
                refresh([block.original])
        elif isinstance(block, bpy.types.Scene):
            # Only the original has an identity: that of the evaluated scene is 0.
            scene, frames = block.original, (block.frame_start, block.frame_end)
            if _State.ranges.get(scene.session_uid, frames) != frames:
                refresh(scene.objects)
            _State.ranges[scene.session_uid] = frames


def _look_through(*_: object) -> None:
    """Refresh all there is in the file."""
    _State.unseen = False
    _State.ranges = {scene.session_uid: (scene.frame_start, scene.frame_end) for scene in bpy.data.scenes}
    refresh()


def _careful(handler: Callable) -> Callable:
    """A handler that stays quiet while edits are not followed, and never raises into Blender."""

    @persistent
    @functools.wraps(handler)
    def follow(*arguments: object) -> None:
        if _State.enabled:
            try:
                handler(*arguments)
            except Exception:
                log.exception("In-betweens could not be brought up to date")

    return follow


@_careful
def _on_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    _State.frame = scene.frame_current_final
    seen = _follow(depsgraph, edited=depsgraph.id_type_updated("ACTION"))
    insertion.forget_poses(seen)
    if depsgraph.id_type_updated("OBJECT") or depsgraph.id_type_updated("SCENE"):
        _follow_objects(depsgraph, _State.frame, seen)


@_careful
def _before_frame(scene: bpy.types.Scene, *_: object) -> None:
    graphs = [layer.depsgraph for layer in scene.view_layers if layer.depsgraph is not None]
    _State.edited = any(graph.id_type_updated("ACTION") for graph in graphs)
    # A script that edits an object and goes on to another frame leaves no trace of which object it was.
    _State.unseen |= any(graph.id_type_updated("OBJECT") for graph in graphs)


@_careful
def _on_frame(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    # Edits that nobody has seen yet were made on the frame before this one.
    _follow(depsgraph, edited=_State.edited)
    insertion.forget_poses()
    _State.frame = scene.frame_current_final


@_careful
def _on_file(*_: object) -> None:
    _State.frame = bpy.context.scene.frame_current_final if bpy.context.scene else 0.0
    _look_through()


@_careful
def _on_undo(*arguments: object) -> None:
    _State.again = True
    try:
        _on_file(*arguments)
    finally:
        _State.again = False


HANDLERS = {
    "depsgraph_update_post": _on_update,
    "frame_change_pre": _before_frame,
    "frame_change_post": _on_frame,
    "undo_post": _on_undo,
    "redo_post": _on_undo,
    "load_post": _on_file,
    "save_pre": _on_file,
    "render_init": _on_file,
}


def register() -> None:
    _State.unseen = True
    for name, handler in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)
    if not bpy.app.background:
        # While an extension is switched on, the file is out of its reach.
        bpy.app.timers.register(_look_through, first_interval=0.0)


def unregister() -> None:
    for name, handler in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(handler)
