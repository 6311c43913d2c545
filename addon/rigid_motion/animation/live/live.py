"""Keeping in-betweens up to date: whatever the animator edits, by hand or by script, shows at once.

Blender's handlers tell that something was edited. Whether it matters, the digest of the source tells: the Action keeps
that of what it was filled in from. It travels with the file through undo, redo, saving and loading, so nothing has to
be remembered here for the in-betweens to be right. A frame that is merely played costs nothing.
"""

from __future__ import annotations

import functools
import logging
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import ClassVar

import bpy
from bpy.app.handlers import persistent

from ..actions.mode_property import adopt_from_properties, has_to_do_with_modes, show_awaited, show_modes
from ..actions.reading import keyed_in, leading
from ..actions.records import recorded_digest
from ..actions.refusals import refuse_numbers
from ..actions.renaming import follow_renamed, forget_names
from ..actions.slots import SlotTransform, choose_slots, filled_places_of, read_again, slot_transforms_of, slots_in
from ..compute import known_sources
from ..compute.sources import Source
from ..handlers import append_handlers, remove_handlers
from ..transforms import ObjectTransform, Refused, Transform, let_override_be_read, prefix_of, transform_of
from ..writers.filling import clear, fill_in, follow_ranges, hold, is_complete
from ..writers.sampled import regroup
from ..writers.table import outlet_of, release, remove_orphans
from . import glances, insertion
from .concerned import all_under, concerns_us, has_bones, has_mode
from .densification import keep_motion
from .graphs import (
    BlockKey,
    actions_to_evaluate,
    edited_actions,
    forget_graphs,
    key_of,
    objects_of,
    objects_to_evaluate,
)
from .separated import are_separated, discard, give_keys_back, notice_slots

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

    waiting: ClassVar[list[BlockKey]] = []
    """The objects that a script has edited before it went on to another frame."""

    followed: ClassVar[set[int]] = set()
    """The Actions, by session id, that were followed before Blender evaluated them."""

    moved: ClassVar[set[Transform]] = set()
    """What these move."""

    objects: ClassVar[set[int]] = set()
    """The objects of which something was set before Blender evaluated them, by session id."""

    operator = (0, "")
    """The operator that had ended last when edits were last seen."""

    ranges: ClassVar[dict[int, tuple[int, int]]] = {}
    """First and last frame of each scene when last seen, by session id."""


def set_enabled(enabled: bool) -> None:
    """Follow edits at once, or else only when `refresh` is called."""
    _State.enabled, _State.unseen = enabled, enabled


def is_busy() -> bool:
    """Whether the edits that Blender tells of at this moment are our own."""
    return _State.busy


def refresh(targets: Iterable[bpy.types.Object | bpy.types.PoseBone | Transform] | None = None) -> int:
    """Bring the in-betweens of these up to date, or of all in the file.

    Returns
    -------
    int
        How much had to be filled in anew, counted in transforms of slots.
    """
    transforms = all_under(bpy.data.objects) if targets is None else [transform_of(target) for target in targets]
    with _turn() as ours:
        if not ours:
            return 0
        separated = give_keys_back(bpy.data.actions) if targets is None else set()
        places = slot_transforms_of(transforms)
        moved = {user for place in places for user in place.users}
        unmoved = [transform for transform in transforms if transform not in moved]
        release(unmoved)
        show_awaited(unmoved)
        forget_names(unmoved)
        count = _refresh(places)
        notice_slots({place.slot for place in places})
        discard(separated)
        return count


def _edited_in(obj: bpy.types.Object, frame: float) -> list[Transform]:
    """An object that was evaluated on the frame that is shown, and of a rig the bones of which anything was edited."""
    if obj.pose is None or not has_bones(obj):
        return [transform_of(obj)]
    is_set = obj.session_uid in _State.objects
    changed, posed = glances.changed_bones(obj, frame, is_set=is_set), insertion.posed_of(obj)
    also = [bone for bone in obj.pose.bones if prefix_of(bone.name) in posed] if posed else []
    itself = (obj,) if has_mode(obj) else ()
    return list(dict.fromkeys(map(transform_of, (*itself, *changed, *also))))


def refresh_read(readings: Sequence[tuple[SlotTransform, list[Source | Refused]]]) -> None:
    """Bring the in-betweens of these up to date, which are read already, as each of their users has them."""
    with _turn() as ours:
        if ours:
            _refresh([place for place, _ in readings], [leading(place, sources) for place, sources in readings])


def follow_original(transform: ObjectTransform) -> None:
    """Follow an edit of what is written down of a transform's original difference."""
    with _turn() as ours:
        if not ours:
            return
        transform.follow_original()
        _refresh(slot_transforms_of([transform]))


def _refresh(places: Sequence[SlotTransform], sources: Sequence[Source | Refused | None] | None = None) -> int:
    follow_renamed(places)
    show_modes(places)
    if sources is None:
        concerned = [place for place in places if has_to_do_with_modes(place)]
        keyed = dict(zip(concerned, keyed_in(concerned), strict=True))
        sources = [keyed.get(place) for place in places]
    stale, idle, emptied, keyed_anew = [], [], [], []
    for place, source in zip(places, sources, strict=True):
        outlet_of(place).show(place)
        # What is linked has the in-betweens that its own file was saved with.
        if not place.slot.action.is_editable:
            continue
        regroup(place)
        before = recorded_digest(place)
        if not _is_wanted(place, source, before):
            # Blender can bring differences of bones that no record speaks of: it flips Actions, F-curve by F-curve.
            if before or (place.kind.has_difference_slot and place.filled):
                emptied.append(place)
            idle.append(place)
        elif source.digest != before or not is_complete(place, source):
            kept = insertion.keep_pose(place, before, source, _State.frame, again=_State.again)
            if kept or keep_motion(place, before, source):
                keyed_anew.append(place)
            else:
                stale.append((place, source))
    clear(emptied)
    release(user for place in idle for user in place.users)
    again = read_again(keyed_anew)
    stale += [pair for pair in zip(again, keyed_in(again), strict=True) if _is_wanted(*pair, recorded_digest(pair[0]))]
    try:
        fill_in(stale)
    except ValueError:
        # One of them has numbers that make no motion: it keeps Blender's own, and the others get theirs.
        for place, source in stale:
            try:
                fill_in([(place, source)])
            except ValueError:
                clear([place])
                idle.append(place)
    editable = [place for place in places if place.slot.action.is_editable]
    # Keys of what has no mode count in the frame range of an Action as well.
    follow_ranges({place.slot.action for place in editable} - {place.slot.action for place, _ in stale})
    _hold(idle, editable)
    # A bone was renamed or deleted: then it is no edit of a single one.
    if len(editable) > 1:
        remove_orphans(editable)
    return len(stale)


def _hold(idle: Iterable[SlotTransform], edited: Iterable[SlotTransform]) -> None:
    """Have slots hold what the NLA needs of them: all that move what was edited, and those that are not filled in."""
    tracked = {user for place in edited for user in place.users if len(user.animated.animation_data.nla_tracks)}
    for place in idle:
        if tracked.isdisjoint(place.users):
            hold(place, ())
    in_nla = slot_transforms_of(tracked) if tracked else []
    beside: defaultdict[Transform, list[SlotTransform]] = defaultdict(list)
    for place in in_nla:
        for user in place.users:
            beside[user].append(place)
    for place in in_nla:
        if place.slot.action.is_editable:
            hold(place, [other for user in place.users for other in beside[user]])


def _is_wanted(place: SlotTransform, source: Source | Refused | None, before: str) -> bool:
    """Whether there is more to a source than Blender's own in-betweens, and it can be had.

    `before` is the digest of what the slot is filled in from: that needs no second examination.
    """
    if source is None or isinstance(source, Refused):
        return False
    if source.digest != before:
        try:
            refuse_numbers(place.name, source)
        except Refused:
            return False
        if not source.is_live:
            return False
    known_sources.remember(source)
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


def _follow(actions: Collection[bpy.types.Action]) -> set[Transform]:
    """Refresh what these Actions, which were edited, move; and say what that is."""
    if not actions:
        return set()
    slots = slots_in(actions)
    notice_slots(slots)
    places = [place for slot in slots for place in glances.edited_in(slot)]
    with _turn() as ours:
        if ours:
            _refresh(places)
    return {user for place in places for user in place.users}


def _follow_objects(depsgraph: bpy.types.Depsgraph, frame: float, seen: set[Transform]) -> None:
    """Refresh after an edit of scenes, or of other objects than these, and notice how one was posed by hand."""
    edited = []
    for update in depsgraph.updates:
        block = update.id
        if isinstance(block, bpy.types.Scene):
            # Only the original has an identity: that of the evaluated scene is 0.
            scene, frames = block.original, (block.frame_start, block.frame_end)
            if _State.ranges.get(scene.session_uid) != frames:
                edited += all_under(filter(concerns_us, scene.objects))
            _State.ranges[scene.session_uid] = frames
        if isinstance(block, bpy.types.Object) and concerns_us(block):
            for transform in _edited_in(block.original, frame):
                if transform not in seen:
                    insertion.notice_pose(transform, frame)
                    edited.append(transform)
    if edited:
        refresh(edited)


def _before_evaluation(scene: bpy.types.Scene, frame: float) -> list[bpy.types.Object]:
    """Look at what was set and is not evaluated yet: what in-betweens will overwrite, and poses set in one go.

    Returns the objects of which anything was, as far as they have to do with modes.
    """
    edited = {obj: depsgraph for obj, depsgraph in objects_to_evaluate(scene) if concerns_us(obj)}
    operator = _last_operator()
    name = operator[1] if operator != _State.operator else ""
    _State.operator = operator
    for obj, depsgraph in edited.items():
        if not obj.is_editable:
            continue
        choose_slots(obj)
        for place in filled_places_of(obj):
            with _turn() as ours:
                if ours:
                    outlet_of(place).prepare(place)
            if depsgraph is not None:
                for transform in place.users:
                    with suppress(Refused):
                        insertion.notice_assignment(transform, depsgraph, frame, operator=name)
    return list(edited)


def _last_operator() -> tuple[int, str]:
    """The operator that has ended last, told from others of its kind, and its name."""
    manager = bpy.context.window_manager
    operators = manager.operators if manager is not None else ()
    return (operators[-1].as_pointer(), operators[-1].bl_idname) if len(operators) else (0, "")


def _look_through(*_: object) -> None:
    """Refresh all there is in the file, whatever it is."""
    _State.unseen = False
    _keep_ranges()
    refresh()


def _look_again() -> None:
    """Refresh all in the file that has anything to do with modes."""
    if _State.unseen:
        _look_through()
    else:
        _keep_ranges()
        refresh(all_under(filter(concerns_us, bpy.data.objects)))


def _keep_ranges() -> None:
    _State.ranges = {scene.session_uid: (scene.frame_start, scene.frame_end) for scene in bpy.data.scenes}


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
def _before_update(scene: bpy.types.Scene, *_: object) -> None:
    _State.frame = scene.frame_current_final
    _State.objects = {obj.session_uid for obj in _before_evaluation(scene, _State.frame)}
    # In-betweens that are there by now are evaluated with the edit; later they would cost an evaluation of their own.
    edited = actions_to_evaluate(scene)
    _State.followed = {action.session_uid for action in edited}
    _State.moved = _follow(edited)
    insertion.forget_poses(_State.moved)


@_careful
def _on_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    _State.frame = scene.frame_current_final
    edited = edited_actions(depsgraph)
    if _State.unseen or are_separated(edited):
        _look_through()
        # Some may have been deleted by that.
        edited = edited_actions(depsgraph)
    later = _follow([action for action in edited if action.session_uid not in _State.followed])
    insertion.forget_poses(later)
    seen = _State.moved | later
    _State.followed, _State.moved = set(), set()
    if depsgraph.id_type_updated("OBJECT") or depsgraph.id_type_updated("SCENE"):
        _follow_objects(depsgraph, _State.frame, seen)


@_careful
def _before_frame(scene: bpy.types.Scene, *_: object) -> None:
    # Edits that nobody has seen yet were made on the frame before this one. Afterwards all that is played looks edited.
    _State.waiting = [key_of(obj) for obj in _before_evaluation(scene, _State.frame)]
    _follow(actions_to_evaluate(scene))


@_careful
def _on_frame(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    edited = objects_of(_State.waiting)
    if _State.unseen:
        _look_through()
    elif edited:
        refresh(all_under(edited))
    _State.waiting = []
    insertion.forget_poses()
    _State.frame = scene.frame_current_final


@_careful
def _on_file(*_: object) -> None:
    _State.frame = bpy.context.scene.frame_current_final if bpy.context.scene else 0.0
    _look_again()


@_careful
def _before_saving(*arguments: object) -> None:
    _on_file(*arguments)
    for obj in bpy.data.objects:
        if obj.rigid_motion.has_bones:
            let_override_be_read(obj)


@_careful
def _on_load(*arguments: object) -> None:
    insertion.forget_file()
    known_sources.forget_all()
    glances.forget_all()
    forget_graphs()
    _State.unseen = True
    with _turn() as ours:
        if ours:
            transforms = all_under(bpy.data.objects)
            moved = {user for place in slot_transforms_of(transforms) for user in place.users}
            adopt_from_properties(transform for transform in transforms if transform not in moved)
    _on_file(*arguments)


@_careful
def _on_undo(*arguments: object) -> None:
    _State.again = True
    glances.forget_all()
    try:
        _on_file(*arguments)
    finally:
        _State.again = False


HANDLERS = {
    "depsgraph_update_pre": _before_update,
    "depsgraph_update_post": _on_update,
    "frame_change_pre": _before_frame,
    "frame_change_post": _on_frame,
    "undo_post": _on_undo,
    "redo_post": _on_undo,
    "load_post": _on_load,
    "save_pre": _before_saving,
    "render_init": _on_file,
}


def register() -> None:
    _State.unseen = True
    forget_graphs()
    append_handlers(HANDLERS)
    if not bpy.app.background:
        # While an extension is switched on, the file is out of its reach.
        bpy.app.timers.register(_look_through, first_interval=0.0)


def unregister() -> None:
    if bpy.app.timers.is_registered(_look_through):
        bpy.app.timers.unregister(_look_through)
    remove_handlers(HANDLERS)
