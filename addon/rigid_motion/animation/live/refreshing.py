"""Bringing the in-betweens of bindings up to date with what is keyed in them.

Whether something has changed that in-betweens depend on, the digest of the source tells: the Action keeps that of what
it was filled in from. It travels with the file through undo, redo, saving and loading.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

from ..actions.mode_property import has_to_do_with_modes, show_modes
from ..actions.reading import keyed_in
from ..actions.records import follow_renamed, recorded_digest
from ..actions.refusals import refuse_numbers
from ..actions.slots import Binding, bindings_of, read_again
from ..compute.source_cache import cache_source
from ..compute.sources import Source
from ..transforms import Refused, Transform
from ..writers.constraints import remove_orphans
from ..writers.filling import clear, fill_in, finish_drafts, hold, is_complete, limit_ranges
from ..writers.sampled import regroup
from ..writers.table import leave_other_way, release, writer_of
from .dense_keys import keep_motion
from .inserted_keys import InsertedKeys
from .segment_keys import share_out_turns


def refresh_bindings(
    bindings: Sequence[Binding],
    sources: Sequence[Source | Refused | None] | None,
    inserted: InsertedKeys,
    frame: float,
    *,
    again: bool,
    in_draft: bool,
) -> int:
    """Fill in what has changed in these bindings, and clear what has no in-betweens any more.

    Parameters
    ----------
    bindings
    sources
        What is keyed in each of them, read already; None to read it here.
    inserted, frame, again
        What keys that were inserted in between keep their pose by: see `InsertedKeys.keep_pose`.
    in_draft
        Whether whole frames will do for now, of large Actions.

    Returns
    -------
    int
        How many of them had to be filled in anew.
    """
    follow_renamed(bindings)
    show_modes(bindings)
    if sources is None:
        with_modes = [binding for binding in bindings if has_to_do_with_modes(binding)]
        keyed = dict(zip(with_modes, keyed_in(with_modes), strict=True))
        sources = [keyed.get(binding) for binding in bindings]
    stale, idle, emptied, keyed_anew = [], [], [], []
    read = [(binding, recorded_digest(binding), source) for binding, source in zip(bindings, sources, strict=True)]
    inserted.look_at((change for change in read if isinstance(change[2], Source)), frame)
    for binding, source in zip(bindings, sources, strict=True):
        if binding.slot.action.is_editable:
            leave_other_way(binding)
        writer_of(binding).show(binding)
        # What is linked has the in-betweens that its own file was saved with.
        if not binding.slot.action.is_editable:
            continue
        regroup(binding)
        before = recorded_digest(binding)
        if not _is_desired(binding, source, before):
            # Blender can bring differences of bones that no record speaks of: it flips Actions, F-curve by F-curve.
            if before or (binding.kind.has_difference_slot and binding.filled):
                emptied.append(binding)
            idle.append(binding)
        elif source.digest != before or not is_complete(binding, source):
            if inserted.keep_pose(binding, again=again) or keep_motion(binding, before, source):
                keyed_anew.append(binding)
            else:
                stale.append((binding, source))
    inserted.keep_timing()
    clear(emptied)
    release(user for binding in idle for user in binding.users)
    stale += _read_anew(keyed_anew)
    if divided := [binding for binding, source in stale if share_out_turns(binding, source)]:
        stale = [pair for pair in stale if pair[0] not in divided] + _read_anew(divided)
    idle += _fill_in(stale, in_draft)
    editable = [binding for binding in bindings if binding.slot.action.is_editable]
    # Keys of what has no mode count in the frame range of an Action as well.
    limit_ranges({binding.slot.action for binding in editable} - {binding.slot.action for binding, _ in stale})
    finish_drafts({slot.action for slot in {binding.slot for binding in editable} if slot.is_seen_between})
    _hold(idle, editable)
    # A bone was renamed or deleted: then it is no edit of a single one.
    if len(editable) > 1:
        for slot in dict.fromkeys(binding.slot for binding in editable if binding.kind.has_difference_slot):
            remove_orphans(slot)
    return len(stale)


def _fill_in(readings: Sequence[tuple[Binding, Source]], in_draft: bool) -> list[Binding]:
    """Fill in these. Those with numbers that make no motion keep Blender's own, and are returned."""
    try:
        fill_in(readings, in_draft=in_draft)
    except ValueError:
        failed = []
        for binding, source in readings:
            try:
                fill_in([(binding, source)])
            except ValueError:
                clear([binding])
                failed.append(binding)
        return failed
    return []


def _read_anew(bindings: Sequence[Binding]) -> list[tuple[Binding, Source]]:
    """Return what is keyed by now in those of these bindings that are to be filled in."""
    read = read_again(bindings)
    return [pair for pair in zip(read, keyed_in(read), strict=True) if _is_desired(*pair, recorded_digest(pair[0]))]


def _is_desired(binding: Binding, source: Source | Refused | None, before: str) -> bool:
    """Return whether there is more to a source than Blender's own in-betweens, and it can be had.

    `before` is the digest of what the slot is filled in from: that needs no second examination.
    """
    if source is None or isinstance(source, Refused):
        return False
    if source.digest != before:
        try:
            refuse_numbers(binding.name, source)
        except Refused:
            return False
        if not source.is_live:
            return False
    cache_source(source)
    return True


def _hold(idle: Iterable[Binding], edited: Iterable[Binding]) -> None:
    """Have slots hold what the NLA needs of them: all that move what was edited, and those that are not filled in."""
    tracked = {user for binding in edited for user in binding.users if len(user.animated.animation_data.nla_tracks)}
    for binding in idle:
        if tracked.isdisjoint(binding.users):
            hold(binding, ())
    in_nla = bindings_of(tracked) if tracked else []
    beside: defaultdict[Transform, list[Binding]] = defaultdict(list)
    for binding in in_nla:
        for user in binding.users:
            beside[user].append(binding)
    for binding in in_nla:
        if binding.slot.action.is_editable:
            hold(binding, [other for user in binding.users for other in beside[user]])
