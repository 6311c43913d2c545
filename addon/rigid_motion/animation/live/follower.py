"""Keeping in-betweens up to date: whatever the animator edits, by hand or by script, shows at once.

Blender's handlers tell that something was edited; those of a `Follower` find out what, and refresh it. For the
in-betweens to be right nothing has to be remembered here, see `refreshing`. A frame that is played costs nothing.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager

import bpy
from bpy.app.handlers import persistent

from ..actions.mode_property import show_pending_modes
from ..actions.records import forget_names
from ..actions.slots import Binding, bindings_of, choose_slots, filled_bindings, slots_in
from ..compute import source_cache
from ..compute.sources import Source
from ..handlers import append_handlers, remove_handlers
from ..transforms import ObjectTransform, Refused, Transform, let_override_be_read, prefix_of, transform_of
from ..writers.filling import finish_drafts
from ..writers.table import release, writer_of
from .edited import (
    BlockKey,
    OperatorWatch,
    actions_to_evaluate,
    add_actions,
    edited_actions,
    has_bones,
    has_mode,
    key_of,
    objects_of,
    objects_to_evaluate,
    on_main_thread,
    shows_between_frames,
    transforms_under,
    uses_modes,
)
from .inserted_keys import InsertedKeys
from .refreshing import refresh_bindings
from .rigs import SlotNames, are_separated, discard, give_keys_back, notice_slots
from .seen_pose import LeftInPlace, SeenInChannels, assigned_to, is_baking
from .snapshots import Snapshots

log = logging.getLogger(__package__)

Targets = Iterable[bpy.types.Object | bpy.types.PoseBone | Transform]


class Follower:
    """Follows the edits of the file that is open."""

    def __init__(self) -> None:
        self.enabled = True
        """True if edits are followed at once."""
        self.busy = False
        """True if the edits that Blender tells of are the extension's."""
        self.drafts = False
        """True if large Actions may be edited in draft: see `writers.filling`."""
        self.operators = OperatorWatch()
        self.handlers = {
            "depsgraph_update_pre": self._handler(self.before_update),
            "depsgraph_update_post": self._handler(self.after_update),
            "frame_change_pre": self._handler(self.before_frame),
            "frame_change_post": self._handler(self.after_frame),
            "undo_post": self._handler(self.after_undo),
            "redo_post": self._handler(self.after_undo),
            "load_post": self._handler(self.after_load),
            "save_pre": self._handler(self.before_saving),
            "render_init": self._handler(self.before_rendering),
        }
        self.begin_file()

    def begin_file(self) -> None:
        """Know nothing of the file that is open."""
        self.unseen = True
        """True if the file has yet to be looked through."""
        self.frame = 0.0
        """The frame that was last shown."""
        self.ranges: dict[int, tuple[int, int]] = {}
        """First and last frame of each scene when last seen, by session id."""
        self.waiting: list[BlockKey] = []
        """The objects that a script has edited before it went on to another frame."""
        self.posed: set[BlockKey] = set()
        """Objects that have a whole pose without keys, which in-betweens go by as soon as another frame is shown."""
        self.followed: set[int] = set()
        """The Actions, by session id, that were followed before Blender evaluated them."""
        self.moved: set[Transform] = set()
        """Transforms that these move."""
        self.objects: set[int] = set()
        """The objects of which something was set before Blender evaluated them, by session id."""
        self.evaluated: set[int] = set()
        """The addresses of the dependency graphs that have been evaluated."""
        self.added: set[tuple[int, int]] = set()
        """See `add_actions`."""
        self.snapshots = Snapshots()
        self.inserted = InsertedKeys()
        self.left = LeftInPlace()
        self.channels = SeenInChannels()
        self.slot_names: SlotNames = {}

    def _handler(self, method: Callable) -> Callable:
        """Return a handler that stays quiet while edits are not followed, and never raises into Blender."""

        @persistent
        @functools.wraps(method)
        def follow(*arguments: object) -> None:
            if self.enabled:
                try:
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

    def alone(self, act: Callable, *arguments: object) -> None:
        """Do something in a turn, unless there is one already."""
        if not self.busy:
            with self.turn():
                act(*arguments)

    def refresh(self, targets: Targets | None = None, *, again: bool = False) -> int:
        """Bring the in-betweens of these up to date, or of all in the file: see the function of this name."""
        transforms = (
            transforms_under(bpy.data.objects) if targets is None else [transform_of(target) for target in targets]
        )
        if self.busy:
            return 0
        with self.turn():
            separated = give_keys_back(bpy.data.actions, self.slot_names) if targets is None else set()
            bindings = bindings_of(transforms)
            moved = {user for binding in bindings for user in binding.users}
            unmoved = [transform for transform in transforms if transform not in moved]
            with self.left.keep(unmoved):
                release(unmoved)
            show_pending_modes(unmoved)
            forget_names(unmoved)
            count = self.refresh_bindings(bindings, again=again)
            notice_slots({binding.slot for binding in bindings}, self.slot_names)
            discard(separated)
            return count

    def refresh_bindings(
        self,
        bindings: Sequence[Binding],
        sources: Sequence[Source | Refused | None] | None = None,
        *,
        again: bool = False,
    ) -> int:
        with self.left.keep(bindings=bindings):
            in_draft = self.drafts and not shows_between_frames()
            return refresh_bindings(bindings, sources, self.inserted, self.frame, again=again, in_draft=in_draft)

    def finish_drafts(self) -> None:
        """Have all in the file be exact between frames."""
        with self.turn():
            finish_drafts(bpy.data.actions)

    def finish_what_is_seen(self) -> None:
        """Finish drafts where what is between frames is shown."""
        if self.drafts and shows_between_frames():
            self.finish_drafts()

    def refresh_edited(self, actions: Collection[bpy.types.Action]) -> set[Transform]:
        """Refresh what these Actions, which were edited, move; and say what that is."""
        if not actions:
            return set()
        slots = slots_in(actions)
        notice_slots(slots, self.slot_names)
        bindings = [binding for slot in slots for binding in self.snapshots.edited_in(slot)]
        self.alone(self.refresh_bindings, bindings)
        return {user for binding in bindings for user in binding.users}

    def refresh_objects(self, depsgraph: bpy.types.Depsgraph, seen: set[Transform]) -> None:
        """Refresh after an edit of scenes, or of other objects than these, and notice how one was posed by hand."""
        edited = []
        for update in depsgraph.updates:
            block = update.id
            if isinstance(block, bpy.types.Scene):
                # Only the original has an identity: that of the evaluated scene is 0.
                scene, frames = block.original, (block.frame_start, block.frame_end)
                if self.ranges.get(scene.session_uid) != frames:
                    edited += transforms_under(filter(uses_modes, scene.objects))
                self.ranges[scene.session_uid] = frames
            if isinstance(block, bpy.types.Object) and uses_modes(block):
                if block.original.is_editable:
                    add_actions(block.original, depsgraph, self.added)
                for transform in self.edited_of(block.original):
                    if transform in seen:
                        continue
                    if self.inserted.notice_pose(transform, self.frame):
                        # In-betweens depend on the properties of muted channels: filled in now, they would replace it.
                        self.posed.add(key_of(transform.animated))
                    else:
                        edited.append(transform)
        if edited:
            self.refresh(edited)

    def edited_of(self, obj: bpy.types.Object) -> list[Transform]:
        """Return an object that was evaluated on the frame that is shown, and of a rig the bones that were edited."""
        if obj.pose is None or not has_bones(obj):
            return [transform_of(obj)]
        changed = self.snapshots.changed_bones(obj, self.frame, is_set=obj.session_uid in self.objects)
        posed = self.inserted.posed_of(obj)
        also = [bone for bone in obj.pose.bones if prefix_of(bone.name) in posed] if posed else []
        itself = (obj,) if has_mode(obj) else ()
        return list(dict.fromkeys(map(transform_of, (*itself, *changed, *also))))

    def before_evaluation(self, scene: bpy.types.Scene) -> list[bpy.types.Object]:
        """Look at what was set and is not evaluated yet: what in-betweens will overwrite, and poses set in one go.

        Returns the objects of which anything was, as far as they have to do with modes.
        """
        waiting = objects_to_evaluate(scene, self.evaluated)
        edited = {obj: depsgraph for obj, depsgraph in waiting if uses_modes(obj)}
        operators = self.operators.look()
        for obj, depsgraph in edited.items():
            if not obj.is_editable:
                continue
            choose_slots(obj)
            assigned = {} if depsgraph is None else assigned_to(obj, depsgraph)
            self.left.notice_assignments(assigned)
            if depsgraph is not None and obj.animation_data is not None and obj.animation_data.action is None:
                self.left.keep_without_action(obj, depsgraph)
            for binding in filled_bindings(obj):
                self.alone(writer_of(binding).prepare, binding)
                for transform in assigned.keys() & binding.users:
                    evaluated, parts = assigned[transform]
                    if self.inserted.notice_assignment(transform, evaluated, len(parts), self.frame, operators):
                        writer_of(binding).hide(binding, transform)
        return list(edited)

    def look_through(self, *, again: bool = False) -> None:
        """Refresh all there is in the file, whatever it is."""
        self.unseen = False
        self.keep_ranges()
        self.refresh(again=again)

    def look_again(self, *_: object, again: bool = False) -> None:
        """Refresh all in the file that has anything to do with modes."""
        self.frame = bpy.context.scene.frame_current_final if bpy.context.scene else 0.0
        if self.unseen:
            self.look_through(again=again)
        else:
            self.keep_ranges()
            self.refresh(transforms_under(filter(uses_modes, bpy.data.objects)), again=again)
        if not self.drafts or shows_between_frames():
            self.finish_drafts()

    def keep_ranges(self) -> None:
        self.ranges = {scene.session_uid: (scene.frame_start, scene.frame_end) for scene in bpy.data.scenes}

    def before_update(self, scene: bpy.types.Scene, *_: object) -> None:
        self.frame = scene.frame_current_final
        self.objects = {obj.session_uid for obj in self.before_evaluation(scene)}
        # In-betweens that are there by now are evaluated with the edit; later they would cost one more evaluation.
        edited = actions_to_evaluate(scene)
        self.followed = {action.session_uid for action in edited}
        self.moved = self.refresh_edited(edited)
        self.finish_what_is_seen()
        self.inserted.forget_poses(self.moved)
        self.channels.put_back(edited)

    def after_update(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        self.frame = scene.frame_current_final
        edited = edited_actions(depsgraph)
        if self.unseen or are_separated(edited):
            self.look_through()
            # Some may have been deleted by that.
            edited = edited_actions(depsgraph)
        later = self.refresh_edited([action for action in edited if action.session_uid not in self.followed])
        self.inserted.forget_poses(later)
        seen = self.moved | later
        self.followed, self.moved = set(), set()
        if depsgraph.id_type_updated("OBJECT") or depsgraph.id_type_updated("SCENE"):
            self.refresh_objects(depsgraph, seen)
        self.left.forget_assignments()
        self.inserted.forget_undo()

    def before_frame(self, scene: bpy.types.Scene, *_: object) -> None:
        self.channels.put_back()
        # Edits not seen yet were made on the frame before this one. Afterwards all that is played looks edited.
        self.waiting = [*self.posed, *map(key_of, self.before_evaluation(scene))]
        self.posed.clear()
        self.refresh_edited(actions_to_evaluate(scene))
        self.finish_what_is_seen()

    def after_frame(self, scene: bpy.types.Scene, *_: object) -> None:
        edited = objects_of(self.waiting)
        if self.unseen:
            self.look_through()
        elif edited:
            self.refresh(transforms_under(edited))
        self.waiting = []
        self.inserted.forget_poses()
        self.left.forget_assignments()
        self.inserted.forget_undo()
        self.frame = scene.frame_current_final
        if is_baking():
            self.alone(self.channels.show, transforms_under(filter(uses_modes, scene.objects)))

    def after_undo(self, *_: object) -> None:
        self.snapshots.clear()
        self.inserted.forget_poses()
        self.channels.forget()
        self.look_again(again=True)
        for obj in filter(uses_modes, bpy.data.objects):
            for binding in filled_bindings(obj) if obj.is_editable else ():
                for transform in binding.users:
                    self.inserted.notice_undo(transform)
                    if self.inserted.is_whole_again(transform, self.frame):
                        writer_of(binding).hide(binding, transform)

    def after_load(self, *_: object) -> None:
        source_cache.clear()
        self.begin_file()
        self.look_again()

    def make_exact(self) -> None:
        """Bring all in the file up to date, between frames too."""
        self.look_again()
        self.finish_drafts()

    def before_rendering(self, *_: object) -> None:
        on_main_thread(self.make_exact)

    def before_saving(self, *_: object) -> None:
        self.make_exact()
        for obj in bpy.data.objects:
            if obj.rigid_motion.has_bones:
                let_override_be_read(obj)


follower = Follower()


def set_enabled(enabled: bool) -> None:
    """Follow edits at once, or else only when `refresh` is called."""
    if not enabled:
        follower.finish_drafts()
    follower.enabled, follower.unseen = enabled, enabled


def is_enabled() -> bool:
    """Return whether edits are followed at once."""
    return follower.enabled


def set_drafts(allowed: bool) -> None:
    """Edit large Actions in draft, as in a window: see `writers.filling`."""
    follower.drafts = allowed
    if not allowed:
        follower.finish_drafts()


def refresh(targets: Targets | None = None) -> int:
    """Bring the in-betweens of these up to date, or of all in the file.

    Returns
    -------
    int
        How much had to be filled in anew, counted in transforms of slots.
    """
    return follower.refresh(targets)


def follow_original(transform: ObjectTransform) -> None:
    """Follow an edit of what is written down of a transform's original difference."""

    def follow() -> None:
        transform.follow_original()
        follower.refresh_bindings(bindings_of([transform]))

    follower.alone(follow)


def show_seen_in_channels(transforms: Iterable[Transform]) -> None:
    """Give the properties of these the pose that is seen, until the frame changes: for what reads them."""
    for transform in follower.channels.show(transforms):
        follower.inserted.notice_whole(transform, follower.frame)


def first_look() -> None:
    """Look through the file as soon as Blender is idle."""
    follower.look_through()


def register() -> None:
    follower.begin_file()
    follower.drafts = not bpy.app.background
    append_handlers(follower.handlers)
    if not bpy.app.background:
        # While an extension is switched on, the file is out of its reach.
        bpy.app.timers.register(first_look, first_interval=0.0)


def unregister() -> None:
    if bpy.app.timers.is_registered(first_look):
        bpy.app.timers.unregister(first_look)
    remove_handlers(follower.handlers)
    follower.finish_drafts()
    # What is edited from now on is no edit that is followed later.
    source_cache.clear()
