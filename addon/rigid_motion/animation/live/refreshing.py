"""Bringing the in-betweens of places up to date with what is keyed in them.

Whether something has changed that in-betweens depend on, the digest of the source tells: the Action keeps that of what
it was filled in from. It travels with the file through undo, redo, saving and loading.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

from ..actions.mode_property import has_to_do_with_modes, show_modes
from ..actions.reading import keyed_in
from ..actions.records import recorded_digest
from ..actions.refusals import refuse_numbers
from ..actions.renaming import follow_renamed
from ..actions.slots import SlotTransform, read_again, slot_transforms_of
from ..compute.source_cache import cache_source
from ..compute.sources import Source
from ..transforms import Refused, Transform
from ..writers.filling import clear, fill_in, finish_drafts, follow_ranges, hold, is_complete
from ..writers.sampled import regroup
from ..writers.table import leave_other_way, release, remove_orphans, writer_of
from .dense_keys import keep_motion
from .inserted_keys import InsertedKeys
from .segment_keys import share_out_turns


def refresh_places(
    places: Sequence[SlotTransform],
    sources: Sequence[Source | Refused | None] | None,
    inserted: InsertedKeys,
    frame: float,
    *,
    again: bool,
    in_draft: bool,
) -> int:
    """Fill in what has changed in these places, and clear what has no in-betweens any more.

    Parameters
    ----------
    places
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
    follow_renamed(places)
    show_modes(places)
    if sources is None:
        with_modes = [place for place in places if has_to_do_with_modes(place)]
        keyed = dict(zip(with_modes, keyed_in(with_modes), strict=True))
        sources = [keyed.get(place) for place in places]
    stale, idle, emptied, keyed_anew = [], [], [], []
    read = [(place, recorded_digest(place), source) for place, source in zip(places, sources, strict=True)]
    inserted.look_at((change for change in read if isinstance(change[2], Source)), frame)
    for place, source in zip(places, sources, strict=True):
        if place.slot.action.is_editable:
            leave_other_way(place)
        writer_of(place).show(place)
        # What is linked has the in-betweens that its own file was saved with.
        if not place.slot.action.is_editable:
            continue
        regroup(place)
        before = recorded_digest(place)
        if not _is_desired(place, source, before):
            # Blender can bring differences of bones that no record speaks of: it flips Actions, F-curve by F-curve.
            if before or (place.kind.has_difference_slot and place.filled):
                emptied.append(place)
            idle.append(place)
        elif source.digest != before or not is_complete(place, source):
            if inserted.keep_pose(place, again=again) or keep_motion(place, before, source):
                keyed_anew.append(place)
            else:
                stale.append((place, source))
    inserted.keep_timing()
    clear(emptied)
    release(user for place in idle for user in place.users)
    read = read_again(keyed_anew)
    stale += [pair for pair in zip(read, keyed_in(read), strict=True) if _is_desired(*pair, recorded_digest(pair[0]))]
    if divided := [place for place, source in stale if share_out_turns(place, source)]:
        read = read_again(divided)
        anew = zip(read, keyed_in(read), strict=True)
        stale = [pair for pair in stale if pair[0] not in divided]
        stale += [pair for pair in anew if _is_desired(*pair, recorded_digest(pair[0]))]
    idle += _fill_in(stale, in_draft)
    editable = [place for place in places if place.slot.action.is_editable]
    # Keys of what has no mode count in the frame range of an Action as well.
    follow_ranges({place.slot.action for place in editable} - {place.slot.action for place, _ in stale})
    finish_drafts({place.slot.action for place in editable if place.slot.in_nla})
    _hold(idle, editable)
    # A bone was renamed or deleted: then it is no edit of a single one.
    if len(editable) > 1:
        remove_orphans(editable)
    return len(stale)


def _fill_in(readings: Sequence[tuple[SlotTransform, Source]], in_draft: bool) -> list[SlotTransform]:
    """Fill in these. Those with numbers that make no motion keep Blender's own, and are returned."""
    try:
        fill_in(readings, in_draft=in_draft)
    except ValueError:
        failed = []
        for place, source in readings:
            try:
                fill_in([(place, source)])
            except ValueError:
                clear([place])
                failed.append(place)
        return failed
    return []


def _is_desired(place: SlotTransform, source: Source | Refused | None, before: str) -> bool:
    """Return whether there is more to a source than Blender's own in-betweens, and it can be had.

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
    cache_source(source)
    return True


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
