"""Keeping in-betweens up to date: whatever the animator edits, by hand or by script, shows at once.

Blender's handlers tell that something was edited, before it is evaluated: then what is written is evaluated along with
it. What was added they tell of only afterwards. A frame that is played costs nothing.
"""

from __future__ import annotations

import functools
import logging
import threading
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..actions.marks import has_marks
from ..actions.modifiers import has_terms
from ..actions.reading import is_marked
from ..actions.slots import (
    Binding,
    Slot,
    bindings_in,
    bindings_in_slot,
    bindings_of,
    slots_alone,
    slots_in,
    slots_of,
)
from ..evaluation import source_cache
from ..handlers import append_handlers, remove_handlers
from ..transforms import WIDTHS, Channel, Transform, let_override_be_read, split_path, transform_of
from .changes import Snapshot, add_action, bones_in, edited_actions, edited_objects, graphs_of, object_bits, slots_by
from .refreshing import is_keying_safe, refresh_bindings
from .unkeyed import Poses

log = logging.getLogger(__package__)

DENSE = 1000
"""Keys of an F-curve that are not looked at with every edit of an Action without modes."""

Targets = Iterable[bpy.types.Object | bpy.types.PoseBone | Transform]


class Follower:
    """Follows the edits of the file that is open."""

    def __init__(self) -> None:
        self.enabled = True
        """True if edits are followed at once."""
        self.busy = False
        """True if the edits that Blender tells of are the extension's."""
        self.handlers = {
            "depsgraph_update_pre": self._handler(self.before_update),
            "depsgraph_update_post": self._handler(self.after_update),
            "frame_change_pre": self._handler(self.before_frame),
            "undo_post": self._handler(self.after_undo),
            "redo_post": self._handler(self.after_undo),
            "load_post": self._handler(self.after_load),
            "save_pre": self._handler(self.before_saving),
        }
        self.begin_file()

    def begin_file(self) -> None:
        """Know nothing of the file that is open."""
        self.unseen = True
        """True if the file has yet to be looked through."""
        self.ranges: dict[int, tuple[int, int]] = {}
        """First and last frame of each scene when last seen, by session id."""
        self.followed: set[int] = set()
        """The Actions, by session id, that were followed before Blender evaluated them."""
        self.added: set[tuple[int, int]] = set()
        """The objects and Actions, by session id, that were added to dependency graphs."""
        self.unkeyed: list[Poses] = []
        """Poses without keys that are to be set again."""
        self.forget_snapshots()

    def forget_snapshots(self) -> None:
        self.snapshots: dict[tuple[int, int], Snapshot] = {}
        """The keys of slots with modes, by the Action's session id and the slot's handle."""
        self.plain: dict[tuple[int, int], int] = {}
        """The number of keys of slots without modes, likewise."""
        self.bits: dict[int, tuple[tuple, np.ndarray | None]] = {}
        """What objects and their bones had beside their keys, by session id."""

    def _handler(self, method: Callable) -> Callable:
        """Return a handler that stays quiet while edits are not followed, and never raises into Blender."""

        @persistent
        @functools.wraps(method)
        def follow(*arguments: object) -> None:
            # A render that is watched changes frames on a thread of its own, where nothing may be written.
            if self.enabled and not self.busy and threading.current_thread() is threading.main_thread():
                try:
                    with self.turn():
                        method(*arguments)
                except Exception:
                    log.exception("In-betweens could not be brought up to date")

        return follow

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Have the edits that Blender tells of meanwhile be the extension's."""
        before, self.busy = self.busy, True
        try:
            yield
        finally:
            self.busy = before

    def refresh(self, targets: Targets | None = None) -> int:
        """Bring the in-betweens of these up to date, or of all in the file: see the function of this name."""
        slots = None if targets is None else bindings_of([transform_of(target) for target in targets])
        bindings = self._all() if slots is None else slots
        with self.turn():
            count = refresh_bindings(bindings, may_key=is_keying_safe())
        for slot in dict.fromkeys(binding.slot for binding in bindings):
            self._remember(slot)
        return count

    def _all(self) -> list[Binding]:
        """Return all that is moved in the file, but what is known to have no modes."""
        slots = slots_of(obj for obj in bpy.data.objects if obj.animation_data is not None)
        return [binding for slot in slots if not self._is_plain(slot) for binding in bindings_in_slot(slot)]

    def _is_plain(self, slot: Slot) -> bool:
        """Return whether a slot had no modes when it was looked at last, and has as many keys since."""
        return self.plain.get(_key_of(slot)) == _count_keys(slot)

    def _remember(self, slot: Slot) -> None:
        """Keep what a slot has by now."""
        key = _key_of(slot)
        if any(map(has_modes, bindings_in_slot(slot))):
            self.snapshots[key] = Snapshot(slot)
            self.plain.pop(key, None)
        else:
            self.snapshots.pop(key, None)
            self.plain[key] = _count_keys(slot)

    def follow(self, actions: Collection[bpy.types.Action], frame: float) -> None:
        """Refresh what these Actions, which were edited, move."""
        for slot in slots_in(actions) if actions else ():
            if slot.is_editable and (not self._is_plain(slot) or _says_modes(slot)):
                self._follow_slot(slot, frame)

    def _follow_slot(self, slot: Slot, frame: float) -> None:
        snapshot = self.snapshots.get(_key_of(slot))
        changed = None if snapshot is None else snapshot.look(slot)
        if changed is not None and not changed:
            return
        prefixes = None if changed is None else dict.fromkeys(split_path(path)[0] for path, _ in changed)
        bindings = bindings_in_slot(slot, prefixes)

        def keep_poses(stale: Collection[Binding]) -> None:
            self._keep_poses(slot, changed, stale, frame)

        is_doubtful = changed is not None
        refresh_bindings(bindings, may_key=is_keying_safe(), is_doubtful=is_doubtful, before_writing=keep_poses)
        curves = {channel: fcurve for binding in bindings for channel, fcurve in binding.curves.items()}
        if snapshot is None or not snapshot.note_modifiers(curves):
            self._remember(slot)

    def _keep_poses(
        self, slot: Slot, edited: Collection[Channel] | None, stale: Iterable[Binding], frame: float
    ) -> None:
        """Keep the poses of a slot that have no keys, before what is stale in it is written.

        Where it is not known what was edited, all of that may be.
        """
        written = {channel for binding in stale for channel in binding.curves}
        self.unkeyed.append(Poses(slot, written if edited is None else edited, written, frame))

    def follow_objects(self, objects: Collection[bpy.types.Object], frame: float) -> None:
        """Refresh what moves these objects where it depends on something of theirs that is not as it was."""
        edited: list[Transform] = []
        left: set[bpy.types.Action] = set()
        for obj in objects:
            slots = slots_alone(obj)
            bones = bones_in(obj) if slots and obj.pose is not None else None
            before, now = self.bits.get(obj.session_uid), (object_bits(obj), bones)
            self.bits[obj.session_uid] = now
            if before is not None and before[0] != now[0]:
                left |= {action for action, _ in slots_by(before[0]) - slots_by(now[0])}
            if not slots or all(map(self._is_plain, slots)):
                continue
            if before is None or before[0] != now[0] or (bones is not None and np.shape(before[1]) != bones.shape):
                edited += [transform_of(obj), *(map(transform_of, obj.pose.bones) if obj.pose is not None else ())]
            elif bones is not None:
                numbers = np.flatnonzero((bones != before[1]).any(axis=1)).tolist()
                edited += [transform_of(obj.pose.bones[number]) for number in numbers]
        # What others move by may have been planned for those that move by it no longer.
        of_others = bindings_in(left & set(bpy.data.actions)) if left else []
        if edited or of_others:
            bindings = list(
                {(item.slot.key, item.prefix): item for item in (*of_others, *bindings_of(edited))}.values()
            )

            def keep_poses(stale: Collection[Binding]) -> None:
                for slot in dict.fromkeys(binding.slot for binding in stale):
                    self._keep_poses(slot, (), [binding for binding in stale if binding.slot == slot], frame)

            refresh_bindings(bindings, before_writing=keep_poses)
            for slot in dict.fromkeys(binding.slot for binding in bindings):
                snapshot = self.snapshots.get(_key_of(slot))
                if snapshot is None:
                    self._remember(slot)
                else:
                    of_slot = (binding.curves for binding in bindings if binding.slot == slot)
                    snapshot.note_modifiers(
                        {channel: fcurve for curves in of_slot for channel, fcurve in curves.items()}
                    )

    def look_through(self) -> None:
        """Refresh all there is in the file."""
        self.unseen = False
        self.ranges = {scene.session_uid: (scene.frame_start, scene.frame_end) for scene in bpy.data.scenes}
        self.refresh()

    def before_update(self, scene: bpy.types.Scene, *_: object) -> None:
        actions = set().union(*map(edited_actions, graphs_of(scene)))
        self.followed = {action.session_uid for action in actions}
        self.follow(actions, scene.frame_current_final)
        self.follow_objects(set().union(*map(edited_objects, graphs_of(scene))), scene.frame_current_final)

    def after_update(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        if self.unseen:
            self.look_through()
        actions = {action for action in edited_actions(depsgraph) if action.session_uid not in self.followed}
        self.followed = set()
        self.follow(actions, scene.frame_current_final)
        if depsgraph.id_type_updated("OBJECT"):
            edited, known = edited_objects(depsgraph), self.bits.keys()
            added = {obj for obj in edited if obj.session_uid not in known}
            for obj in edited:
                add_action(obj, depsgraph, self.added)
            self.follow_objects(added, scene.frame_current_final)
        if depsgraph.id_type_updated("SCENE") and self._ranges_changed():
            self.look_through()
        unkeyed, self.unkeyed = self.unkeyed, []
        if sum(poses.set_again() for poses in unkeyed):
            bpy.context.view_layer.update()

    def _ranges_changed(self) -> bool:
        now = {scene.session_uid: (scene.frame_start, scene.frame_end) for scene in bpy.data.scenes}
        return now != self.ranges

    def before_frame(self, scene: bpy.types.Scene, *_: object) -> None:
        if self.unseen:
            self.look_through()
        self.follow(set().union(*map(edited_actions, graphs_of(scene))), scene.frame_current_final)
        self.unkeyed.clear()

    def after_undo(self, *_: object) -> None:
        # What there was is back with its terms; but nothing that was kept of it is to be trusted.
        self.forget_snapshots()
        self.unkeyed.clear()

    def after_load(self, *_: object) -> None:
        source_cache.clear()
        self.begin_file()
        self.look_through()

    def before_saving(self, *_: object) -> None:
        self.look_through()
        for obj in bpy.data.objects:
            if obj.override_library is not None and obj.pose is not None:
                let_override_be_read(obj)


def has_modes(binding: Binding) -> bool:
    """Return whether the keys of a slot say a mode, or it has terms."""
    return is_marked(binding) or any(map(has_terms, binding.moving.values()))


def _key_of(slot: Slot) -> tuple[int, int]:
    return slot.action.session_uid, slot.handle


def _says_modes(slot: Slot) -> bool:
    """Return whether keys of a slot say modes, such as those that were pasted in place of others that did not.

    Recordings with thousands of keys are left out: there it takes longer than the edit.
    """
    curves = (fcurve for fcurve in slot.fcurves if split_path(fcurve.data_path)[1] in WIDTHS)
    return any(len(fcurve.keyframe_points) < DENSE and has_marks(fcurve) for fcurve in curves)


def _count_keys(slot: Slot) -> int:
    return sum(len(fcurve.keyframe_points) for fcurve in slot.fcurves)


follower = Follower()


def set_enabled(enabled: bool) -> None:
    """Follow edits at once, or else only when `refresh` is called."""
    follower.enabled, follower.unseen = enabled, enabled


def is_enabled() -> bool:
    """Return whether edits are followed at once."""
    return follower.enabled


def refresh(targets: Targets | None = None) -> int:
    """Bring the in-betweens of these up to date, or of all in the file.

    Returns
    -------
    int
        How much had to be changed, counted in transforms of slots.
    """
    return follower.refresh(targets)


def first_look() -> None:
    """Look through the file as soon as Blender is idle."""
    follower.look_through()


def register() -> None:
    follower.begin_file()
    append_handlers(follower.handlers)
    if not bpy.app.background:
        # While an extension is switched on, the file is out of its reach.
        bpy.app.timers.register(first_look, first_interval=0.0)


def unregister() -> None:
    if bpy.app.timers.is_registered(first_look):
        bpy.app.timers.unregister(first_look)
    remove_handlers(follower.handlers)
    # What is edited from now on is no edit that is followed later.
    source_cache.clear()
