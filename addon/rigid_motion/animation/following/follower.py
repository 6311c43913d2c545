"""The follower: handlers that keep in-betweens up to date after every edit, by hand or by script.

Blender's handlers report edits before they are evaluated, so that new terms are evaluated along with them. Additions
are reported only afterwards. Playing back a frame costs nothing.
"""

from __future__ import annotations

import functools
import logging
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

from ...blender import existing, persistent, pose_bones, view_layer
from ...handlers import append_handlers, remove_handlers
from ..actions.marks import has_marks
from ..actions.modifiers import has_terms
from ..actions.slots import (
    Binding,
    Curves,
    Slot,
    bindings_in,
    bindings_in_slot,
    bindings_of,
    slots_alone,
    slots_in,
    slots_of,
)
from ..evaluation import source_cache
from ..holds.apply import channels_of
from ..transforms import WIDTHS, Channel, Transform, let_override_be_read, split_path, transform_of
from .assigned import Assigned, Settled, assigned, set_keys, set_values, settled
from .changes import Snapshot, add_action, bones_in, edited_actions, edited_objects, graphs_of, settings_of
from .refreshing import is_keying_safe, refresh_bindings
from .unkeyed import UnkeyedPoses

log = logging.getLogger(__package__)

Targets = Iterable[bpy.types.Object | bpy.types.PoseBone | Transform]


class Follower:
    """Follows the edits of the open file."""

    def __init__(self) -> None:
        self.enabled = True
        """True if edits are followed immediately."""
        self.busy = False
        """True while reported edits are the extension's own."""
        self.handlers = {
            "depsgraph_update_pre": self._handler(self.before_update),
            "depsgraph_update_post": self._handler(self.after_update),
            "frame_change_pre": self._handler(self.before_frame),
            "undo_pre": self._handler(self.before_undo),
            "redo_pre": self._handler(self.before_undo),
            "undo_post": self._handler(self.after_undo),
            "redo_post": self._handler(self.after_undo),
            "load_post": self._handler(self.after_load),
            "save_pre": self._handler(self.before_saving),
        }
        self.begin_file()

    def begin_file(self) -> None:
        """Reset everything that is known of the open file."""
        self.ranges: dict[int, tuple[int, int]] | None = None
        """First and last frame of each scene, by session id, when the file was last refreshed; None before."""
        self.followed: set[int] = set()
        """The Actions, by session id, that were followed before Blender evaluated them."""
        self.added: set[tuple[int, int]] = set()
        """The objects and Actions, by session id, that were added to dependency graphs."""
        self.unkeyed: list[UnkeyedPoses] = []
        """Poses without keys that must be restored."""
        self.undoes = False
        """True while objects come from an undo step, and their matrices do not match any evaluation yet."""
        self.assigned: list[Assigned] = []
        """World poses that held objects must get once they are evaluated."""
        self.settled: dict[tuple[tuple[int, str], bytes], Settled] = {}
        """Results for such poses, by transform and components, as Blender's undo steps contain these components."""
        self.forget_snapshots()

    def forget_snapshots(self) -> None:
        self.snapshots: dict[tuple[int, int], Snapshot | int] = {}
        """The keys of slots, or just their number if there are no modes, by the Action's session id and slot handle.
        """
        self.bits: dict[int, tuple[tuple, list[Slot], np.ndarray | None]] = {}
        """The other settings of objects and their bones, and the slots that moved them, by session id."""

    def _handler(self, method: Callable) -> Callable:
        """Return a handler that does nothing while edits are not followed, and never raises into Blender."""

        @persistent
        @functools.wraps(method)
        def follow(*arguments: object) -> None:
            # A render with a visible window changes frames on a thread of its own, where nothing may be written.
            if self.enabled and not self.busy and threading.current_thread() is threading.main_thread():
                try:
                    with self.own_edits():
                        method(*arguments)
                except Exception:
                    log.exception("In-betweens could not be brought up to date")

        return follow

    @contextmanager
    def own_edits(self) -> Iterator[None]:
        """Treat edits reported during this context as the extension's own."""
        before, self.busy = self.busy, True
        try:
            yield
        finally:
            self.busy = before

    def refresh(self, targets: Targets | None = None) -> int:
        """Update the in-betweens of these targets, or of everything in the file.

        Returns how many transforms of slots had to be changed.
        """
        if targets is not None:
            bindings = bindings_of(map(transform_of, targets))
        else:
            slots = slots_of(obj for obj in bpy.data.objects if obj.animation_data is not None)
            bindings = [binding for slot in slots if not self._is_plain(slot) for binding in bindings_in_slot(slot)]
        with self.own_edits():
            count = refresh_bindings(bindings, may_key=is_keying_safe())
        self._remember(bindings)
        return count

    def _is_plain(self, slot: Slot) -> bool:
        """Return whether a slot had no modes when it was last examined, and still has the same number of keys."""
        number = self.snapshots.get(_key_of(slot))
        return isinstance(number, int) and number == _count_keys(slot)

    def _remember(self, bindings: Iterable[Binding]) -> None:
        """Store the present state of these bindings."""
        by_slot: dict[Slot, list[Binding]] = {}
        for binding in bindings:
            by_slot.setdefault(binding.slot, []).append(binding)
        for slot, of_slot in by_slot.items():
            snapshot = self.snapshots.get(_key_of(slot))
            if not has_modes(slot):
                self.snapshots[_key_of(slot)] = _count_keys(slot)
            elif isinstance(snapshot, Snapshot):
                snapshot.note({channel: curve for item in of_slot for channel, curve in item.curves.items()})
            else:
                self.snapshots[_key_of(slot)] = Snapshot(slot)

    def follow(self, actions: Collection[bpy.types.Action], frame: float) -> None:
        """Refresh everything moved by these edited Actions."""
        for slot in slots_in(actions):
            if slot.is_editable and (not self._is_plain(slot) or has_modes(slot)):
                snapshot = self.snapshots.get(_key_of(slot))
                changed = snapshot.look(slot) if isinstance(snapshot, Snapshot) else None
                prefixes = None if changed is None else dict.fromkeys(split_path(path)[0] for path, _ in changed)
                bindings = bindings_in_slot(slot, prefixes)
                self._refresh(bindings, changed, frame, may_key=is_keying_safe(), is_doubtful=changed is not None)

    def _refresh(
        self, bindings: Sequence[Binding], edited: Collection[Channel] | None, frame: float, **options: bool
    ) -> None:
        """Refresh these bindings, and keep poses that have no keys.

        If `edited` is None, any channel that is written may have been edited.
        """

        def keep_poses(stale: Iterable[Binding]) -> None:
            written: dict[Slot, Curves] = {}
            follows: set[Channel] = set()
            for binding in stale:
                written.setdefault(binding.slot, {}).update(binding.curves)
                follows |= channels_of(binding)
            for slot, curves in written.items():
                self.unkeyed.append(
                    UnkeyedPoses(slot, {*(curves if edited is None else edited), *follows}, curves, frame)
                )

        if bindings:
            refresh_bindings(bindings, before_writing=keep_poses, **options)
            self._remember(bindings)

    def follow_objects(self, objects: Collection[bpy.types.Object], frame: float) -> None:
        """Refresh the motion of these objects if settings that it depends on have changed."""
        edited: list[Transform] = []
        left: set[bpy.types.Action] = set()
        for obj in objects:
            slots, pose = slots_alone(obj), obj.pose
            settings, bones = settings_of(obj, slots), bones_in(obj) if slots and pose is not None else None
            settings_before, slots_before, bones_before = self.bits.get(obj.session_uid, (None, [], None))
            self.bits[obj.session_uid] = settings, slots, bones
            left |= {slot.action for slot in slots_before if slot.key not in {now.key for now in slots}}
            if not slots or all(map(self._is_plain, slots)):
                continue
            if settings != settings_before or np.shape(bones) != np.shape(bones_before):
                edited += map(transform_of, (obj, *(() if pose is None else pose.bones)))
            elif bones is not None:
                numbers = np.flatnonzero((bones != bones_before).any(axis=1)).tolist()
                edited += [transform_of(pose_bones(obj)[number]) for number in numbers]
        # Slots that these objects no longer use may have been planned for them, and still move others.
        bindings = (*bindings_in(left & set(bpy.data.actions)), *bindings_of(edited))
        self._refresh([*{(item.slot.key, item.prefix): item for item in bindings}.values()], (), frame)

    def refresh_file(self) -> None:
        """Refresh everything in the file."""
        self.ranges = _scene_ranges()
        self.refresh()

    def settle(self, items: Iterable[Settled], frame: float) -> None:
        """Put held objects where they were assigned to be in the world, on this frame of the scene."""
        keyed = [item for item in items if set_keys(item, frame)]
        if keyed:
            self.refresh(item.transform for item in keyed)
            view_layer().update()
        for item in items:
            set_values(item)
            self.settled[item.transform.identity, item.before.tobytes()] = item
        if items:
            view_layer().update()

    def before_update(self, scene: bpy.types.Scene, *_: object) -> None:
        graphs = graphs_of(scene)
        actions, objects = edited_actions(*graphs), edited_objects(*graphs)
        self.assigned = [] if self.undoes else assigned(objects)
        self.followed = {action.session_uid for action in actions}
        self.follow(actions, scene.frame_current_final)
        self.follow_objects(objects, scene.frame_current_final)

    def after_update(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        if self.ranges is None or (depsgraph.id_type_updated("SCENE") and self.ranges != _scene_ranges()):
            self.refresh_file()
        actions = {action for action in edited_actions(depsgraph) if action.session_uid not in self.followed}
        self.followed = set()
        self.follow(actions, scene.frame_current_final)
        if depsgraph.id_type_updated("OBJECT"):
            edited, known = edited_objects(depsgraph), self.bits.keys()
            added = {obj for obj in edited if obj.session_uid not in known}
            for obj in edited:
                add_action(obj, depsgraph, self.added)
            self.follow_objects(added, scene.frame_current_final)
        unkeyed, self.unkeyed = self.unkeyed, []
        if sum(poses.set_again() for poses in unkeyed):
            view_layer().update()
        items, self.assigned, self.undoes = self.assigned, [], False
        self.settle(settled(items), scene.frame_current_final)

    def before_frame(self, scene: bpy.types.Scene, *_: object) -> None:
        if self.ranges is None:
            self.refresh_file()
        graphs = graphs_of(scene)
        items = [] if self.undoes else settled(assigned(edited_objects(*graphs)))
        for item in items:
            set_keys(item, existing(existing(view_layer().depsgraph).scene_eval).frame_current_final)
            set_values(item)
        self.follow(edited_actions(*graphs), scene.frame_current_final)
        self.unkeyed.clear()

    def before_undo(self, *_: object) -> None:
        self.undoes = True

    def after_undo(self, scene: bpy.types.Scene, *_: object) -> None:
        self.undoes = True
        # Undo restores the motion with its terms, but no stored state can be trusted.
        self.forget_snapshots()
        self.unkeyed.clear()
        objects = map(Transform, bpy.data.objects if self.settled else ())
        known = ((one, self.settled.get((one.identity, one.components().tobytes()))) for one in objects)
        items = [item._replace(transform=transform) for transform, item in known if item is not None]
        self.settle(items, scene.frame_current_final)

    def after_load(self, *_: object) -> None:
        source_cache.clear()
        self.begin_file()
        self.refresh_file()

    def before_saving(self, *_: object) -> None:
        self.refresh_file()
        for obj in bpy.data.objects:
            if obj.override_library is not None and obj.pose is not None:
                let_override_be_read(obj)


def has_modes(slot: Slot) -> bool:
    """Return whether the keys of a slot store a mode, or it has terms."""
    curves = (fcurve for fcurve in slot.fcurves if split_path(fcurve.data_path)[1] in WIDTHS)
    return any(has_marks(fcurve) or has_terms(fcurve) for fcurve in curves)


def _scene_ranges() -> dict[int, tuple[int, int]]:
    return {scene.session_uid: (scene.frame_start, scene.frame_end) for scene in bpy.data.scenes}


def _key_of(slot: Slot) -> tuple[int, int]:
    return slot.action.session_uid, slot.handle


def _count_keys(slot: Slot) -> int:
    return sum(len(fcurve.keyframe_points) for fcurve in slot.fcurves)


follower = Follower()
refresh = follower.refresh


def set_enabled(enabled: bool) -> None:
    """Follow edits immediately, or else only when `refresh` is called."""
    follower.enabled, follower.ranges = enabled, None


def is_enabled() -> bool:
    """Return whether edits are followed immediately."""
    return follower.enabled


def first_look() -> None:
    """Refresh the file as soon as Blender is idle."""
    follower.refresh_file()


def register() -> None:
    follower.begin_file()
    append_handlers(follower.handlers)
    if not bpy.app.background:
        # While an extension is being enabled, it cannot access the file.
        bpy.app.timers.register(first_look, first_interval=0.0)


def unregister() -> None:
    if bpy.app.timers.is_registered(first_look):
        bpy.app.timers.unregister(first_look)
    remove_handlers(follower.handlers)
    # Edits from now on must not be followed later.
    source_cache.clear()
