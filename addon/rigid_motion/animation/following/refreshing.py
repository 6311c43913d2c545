"""Refreshing: read the keys of transforms, plan terms, compare them with the existing ones, and write them.

The digest of a source tells whether anything has changed that in-betweens depend on: terms store the digest of the
source that they were planned from. Terms travel with the file through undo, redo, saving and loading.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

import bpy
import numpy as np

from ..actions.channels import key_points
from ..actions.marks import read_holds, read_marks, write_holds, write_marks
from ..actions.modifiers import add_cycles, cycles_of, has_terms, terms_in
from ..actions.reading import is_marked, keyed_in, planned_from
from ..actions.refusals import refuse_numbers
from ..actions.slots import Binding
from ..evaluation.components import MODE_NUMBERS
from ..evaluation.source_cache import cache_source, cached_source
from ..evaluation.sources import SAME_FRAME, KeyedTransform
from ..holds.apply import apply_holds, has_holders, restore_holds
from ..terms.apply import apply, remove_terms
from ..terms.planning import plan
from ..transforms import WIDTHS, Refused
from .inserted import divided, key_fellows
from .kept_timing import keep_timing
from .shared_turns import share_out_turns

Reading = tuple[Binding, KeyedTransform]


def refresh_bindings(
    bindings: Sequence[Binding],
    *,
    may_key: bool = False,
    is_doubtful: bool = False,
    before_writing: Callable[[Collection[Binding]], object] = lambda _: None,
) -> int:
    """Update the terms of these bindings from their keys.

    Parameters
    ----------
    bindings
        Bindings in Actions that are not editable are ignored.
    may_key
        Whether keys inserted on in-betweens may be completed.
    is_doubtful
        Whether terms may differ from those that were planned.
    before_writing
        Called once with the bindings to be written, before any writing makes Blender evaluate Actions again.

    Returns
    -------
    int
        The number of bindings that were changed.
    """
    bindings = [binding for binding in bindings if binding.slot.is_editable]
    for binding in bindings:
        _tidy(binding)
    _apply_awaited_modes(bindings)
    for binding in filter(has_holders, bindings):
        restore_holds(binding)
    marked = [binding for binding in bindings if is_marked(binding) or has_holders(binding)]
    stale: list[Reading] = []
    current: dict[Binding, KeyedTransform] = {}
    plain: dict[Binding, KeyedTransform] = {}
    for binding, source in zip(marked, keyed_in(marked), strict=True):
        if isinstance(source, KeyedTransform) and not _is_desired(binding, source):
            plain[binding] = source
        elif isinstance(source, KeyedTransform):
            current[binding] = source
            if is_doubtful or source.digest24 != planned_from(binding):
                stale.append((binding, current.pop(binding)))
    kept = {*current, *(binding for binding, _ in stale)}
    dropped = [item for item in bindings if item not in kept and any(map(has_terms, item.moving.values()))]
    held = [binding for binding in {**current, **plain} if has_holders(binding)]
    if stale or dropped or held:
        before_writing([*dropped, *held, *(binding for binding, _ in stale)])
    for binding in dropped:
        remove_terms(binding)
    stale = _complete_inserted_keys(stale) if stale and may_key else stale
    # Not earlier: a source that merely has the same keys as another one is no followed edit of that one.
    for source in current.values():
        cache_source(source)
    count = len(dropped) + (sum(_apply(stale)) if stale else 0)
    return count + sum(apply_holds(*reading, may_key=is_keying_safe()) for reading in (current | plain).items())


def _tidy(binding: Binding) -> None:
    """Do what Blender does for channels without modifiers: remove channels without keys, and let *Make Cyclic* work."""
    for channel, fcurve in list(binding.curves.items()):
        modifiers = fcurve.modifiers
        if not modifiers or channel[0].removeprefix(binding.prefix) not in WIDTHS:
            continue
        if not fcurve.keyframe_points and not fcurve.sampled_points:
            if len(terms := terms_in(fcurve)) == len(modifiers):
                binding.remove_curve(channel)
                continue
            for term in terms:
                modifiers.remove(term)
        elif len(modifiers) > 1 and isinstance(last := modifiers[-1], bpy.types.FModifierCycles):
            add_cycles(fcurve, cycles_of(last))


def _apply_awaited_modes(bindings: Iterable[Binding]) -> None:
    """Mark the first keys of transforms with the mode chosen before they had any."""
    for binding in bindings:
        for user in binding.users:
            if (mode := user.motion.awaited) != "BLENDER" and binding.is_keyed and user.animated.is_editable:
                user.motion.awaited = "BLENDER"
                if not is_marked(binding):
                    mark_all(binding, MODE_NUMBERS.get(mode, 0))


def mark_all(binding: Binding, number: int) -> None:
    """Mark all keys of a slot with this mode; remove the marks if it is Blender's own, except on keys with a hold."""
    for (path, _), fcurve in binding.curves.items():
        if path.removeprefix(binding.prefix) in WIDTHS and fcurve.keyframe_points:
            write_marks(fcurve, np.where(read_holds(fcurve) >= 0, number + 1, number + 1 if number else 0))


def _is_desired(binding: Binding, source: KeyedTransform | Refused) -> bool:
    """Return whether a source differs from Blender's own in-betweens, and its numbers are valid."""
    if isinstance(source, Refused):
        return False
    try:
        refuse_numbers(binding.name, source)
    except Refused:
        return False
    return source.is_live


def _complete_inserted_keys(stale: Sequence[Reading]) -> list[Reading]:
    """Complete keys that were inserted on in-betweens, and return the new readings."""
    olds = [cached_source(planned_from(binding)) for binding, _ in stale]
    result = list(stale)

    def known() -> Iterator[tuple[Binding, KeyedTransform, KeyedTransform]]:
        return ((*reading, old) for reading, old in zip(result, olds, strict=True) if old is not None)

    result = _read_anew(result, {binding for binding, now, old in known() if key_fellows(binding, now, old)})
    insertions = {binding: one for binding, now, old in known() if (one := divided(binding, now, old)) is not None}
    keep_timing(insertions.values())
    result = _read_anew(result, insertions)
    return _read_anew(result, {binding for binding, now, old in known() if share_out_turns(binding, now, old)})


def _read_anew(readings: Sequence[Reading], changed: Collection[Binding]) -> list[Reading]:
    """Return the readings, read again for the bindings that were changed."""
    old = [binding for binding, _ in readings if binding in changed]
    fresh = dict(zip(old, keyed_in(old), strict=True))
    return [
        (binding, now if isinstance(now := fresh.get(binding), KeyedTransform) else source)
        for binding, source in readings
    ]


def _apply(stale: Sequence[Reading]) -> list[bool]:
    """Plan and write the terms of these readings. Readings whose numbers give no motion get no terms."""
    try:
        planned = plan([source for _, source in stale])
    except ValueError:
        if len(stale) == 1:
            return [remove_terms(stale[0][0])]
        return [changed for reading in stale for changed in _apply([reading])]
    result = []
    for (binding, source), terms in zip(stale, planned, strict=True):
        result.append(apply(binding, source, terms))
        _complete_marks(binding, source)
        result[-1] |= apply_holds(binding, source, may_key=is_keying_safe())
        cache_source(source)
    return result


def _complete_marks(binding: Binding, source: KeyedTransform) -> None:
    """Mark keys that inherit a mode or hold from others or disagree with them, so that they keep it without those."""
    voting = {row for rows, _ in source.channels for row in rows}
    for row, channel in binding.users[0].channels.items():
        if (fcurve := binding.curves.get(channel)) is None or not fcurve.keyframe_points:
            continue
        frames = key_points(fcurve)[:, 0].astype(np.float64) + 0.5 * SAME_FRAME
        marks, modes = read_marks(fcurve), source.modes_at(frames) + 1
        # A channel that does not count now, because it is muted, may have another mode later.
        modes = modes if row in voting else np.where(marks, marks, modes)
        if not np.array_equal(marks, modes):
            write_marks(fcurve, modes)
        if source.held is not None:
            said, holds = read_holds(fcurve), source.held.at(frames)
            holds = holds if row in voting else np.where(said >= 0, said, holds)
            if not np.array_equal(said, holds):
                write_holds(fcurve, holds)


def is_keying_safe() -> bool:
    """Return whether keys may be inserted: not while Blender moves keys, as it remembers their memory addresses."""
    manager = bpy.context.window_manager
    windows = () if manager is None else manager.windows
    return not any(item.bl_idname.startswith("TRANSFORM_OT_") for window in windows for item in window.modal_operators)
