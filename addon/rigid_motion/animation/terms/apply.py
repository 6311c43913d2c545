"""From planned terms to the modifiers of F-curves: compared with those that there are, and written where they differ.

What is there and is as it should be is left alone: to write a modifier has Blender evaluate its Action anew.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import bpy
import numpy as np

from ...motion import KEYFRAME_MODES
from ..actions.channels import ensure_group
from ..actions.modifiers import is_term, put_behind, terms_in
from ..actions.reading import influence_for
from ..actions.slots import Binding
from ..evaluation.components import MODE_NAMES
from ..evaluation.sources import Source
from ..transforms import WIDTHS
from .carriers import Term

FModifiers = bpy.types.bpy_prop_collection
"""The modifiers of an F-curve."""

COMMUTING = ("STEPPED", "NOISE", "GENERATOR", "FNGENERATOR")
"""Types of modifiers that say the same in front of terms as behind, as long as they add to the value."""


def apply(binding: Binding, source: Source, planned: Mapping[int, Sequence[Term]]) -> bool:
    """Have the channels of a slot have these terms, by the rows of their components, and no others.

    A channel that has none of its own yet, of a part that others have keys of, is made with one key.

    Returns
    -------
    bool
        Whether anything was changed that Blender evaluates.
    """
    channels, changed = binding.users[0].channels, False
    labels = {channels[row]: terms for row, terms in planned.items() if terms}
    for channel in labels.keys() - binding.curves.keys():
        _key_once(binding, channel, float(source.keyed_range[0]))
    for channel, fcurve in binding.curves.items():
        if channel in labels or (fcurve.modifiers and channel[0].removeprefix(binding.prefix) in WIDTHS):
            changed |= _apply_to(fcurve, labels.get(channel, ()), source)
    influence = influence_for(source, sum(map(len, labels.values())))
    for channel, terms in labels.items():
        modifiers = binding.curves[channel].modifiers
        _keep_influence(modifiers, influence, is_mixed=len(modifiers) > len(terms))
    return changed


def remove_terms(binding: Binding) -> bool:
    """Take all terms out of the channels of a slot. Returns whether there were any."""
    removed = False
    for fcurve in binding.moving.values():
        for modifier in terms_in(fcurve) if fcurve.modifiers else ():
            fcurve.modifiers.remove(modifier)
            removed = True
    return removed


def count_terms(binding: Binding) -> int:
    """Return the largest number of terms that a channel of a slot has."""
    return max((len(terms_in(fcurve)) for fcurve in binding.moving.values() if fcurve.modifiers), default=0)


def _key_once(binding: Binding, channel: tuple[str, int], frame: float) -> None:
    """Make a channel with one key that has the value of the property."""
    user, (path, index) = binding.users[0], channel
    fcurve = binding.ensure_curve(channel)
    fellow = next((curve for (other, _), curve in binding.curves.items() if other == path and curve.group), None)
    if fellow is not None:
        fcurve.group = ensure_group(binding.channelbag, fellow.group.name)
    value = getattr(user.carrier, path.removeprefix(user.prefix))[index]
    fcurve.keyframe_points.insert(frame, value)


def _apply_to(fcurve: bpy.types.FCurve, wanted: Sequence[Term], source: Source) -> bool:
    """Have an F-curve have these terms. Returns whether any was changed."""
    modifiers, ours = fcurve.modifiers, terms_in(fcurve)
    is_mixed = len(modifiers) > len(ours)
    free: defaultdict[Term, list[bpy.types.FModifierGenerator]] = defaultdict(list)
    for modifier in ours:
        has_less = modifier.mute or modifier.use_influence or modifier.blend_in or modifier.blend_out
        coefficients = () if has_less else tuple(modifier.coefficients)
        free[Term(modifier.frame_start, modifier.frame_end, coefficients)].append(modifier)
    missing = [
        (term, name)
        for term, name in zip(wanted, _names(wanted, source), strict=True)
        if not free[term] or free[term].pop() is None
    ]
    spare = [modifier for of_term in free.values() for modifier in of_term]
    while len(spare) > len(missing):
        modifiers.remove(spare.pop())
    # Names are unlike others: for one that is taken Blender looks through all of them.
    for modifier, (term, name) in zip(spare, missing, strict=False):
        modifier.name = name
        _write(modifier, term)
    if added := missing[len(spare) :]:
        _add(modifiers, added, one_by_one=is_mixed)
    if missing and is_mixed:
        _put_in_front(fcurve)
    return bool(missing) or len(ours) > len(wanted)


def _write(modifier: bpy.types.FModifierGenerator, term: Term) -> None:
    modifier.mode, modifier.poly_order = "POLYNOMIAL_FACTORISED", len(term.coefficients) // 2
    modifier.coefficients = term.coefficients
    modifier.use_additive = modifier.use_restricted_range = True
    # In this order: Blender keeps the end behind the start.
    modifier.frame_start, modifier.frame_end = term.first, term.last
    modifier.blend_in = modifier.blend_out = 0.0
    modifier.show_expanded = modifier.mute = modifier.use_influence = False


def _add(modifiers: FModifiers, named: Sequence[tuple[Term, str]], *, one_by_one: bool) -> None:
    """Add terms to the modifiers of an F-curve; many properties at once where all of these are terms."""
    had = len(modifiers)
    for term, name in named:
        modifier = modifiers.new("GENERATOR")
        modifier.name = name
        if one_by_one:
            _write(modifier, term)
        else:
            modifier.mode, modifier.poly_order = "POLYNOMIAL_FACTORISED", len(term.coefficients) // 2
            modifier.coefficients = term.coefficients
    if not one_by_one:
        count = len(modifiers)
        for name, value in (("use_additive", True), ("use_restricted_range", True), ("show_expanded", False)):
            modifiers.foreach_set(name, np.full(count, value))
        for name in ("frame_start", "frame_end"):
            frames = np.empty(count, np.float32)
            modifiers.foreach_get(name, frames)
            frames[had:] = [term.first if name == "frame_start" else term.last for term, _ in named]
            modifiers.foreach_set(name, frames)


def _names(terms: Sequence[Term], source: Source) -> list[str]:
    """Return what terms are called: by the modes and the frames that they are for, and numbered."""
    modes = source.modes_at(np.array([0.5 * (term.first + term.last) for term in terms]))
    result, number, before = [], 0, (0.0, 0.0)
    for term, mode in zip(terms, modes.tolist(), strict=True):
        number = number + 1 if term[:2] == before else 1
        before = term[:2]
        label = KEYFRAME_MODES[MODE_NAMES[mode]].label if MODE_NAMES.get(mode) in KEYFRAME_MODES else "Rigid Motion"
        result.append(f"{label} {term.first:.5g} to {term.last:.5g}" + (f" ({number})" if number > 1 else ""))
    return result


def _keep_influence(modifiers: FModifiers, influence: float, *, is_mixed: bool) -> None:
    """Have all terms keep an influence, which is not in use. This tags nothing."""
    influences = np.empty(len(modifiers), np.float32)
    modifiers.foreach_get("influence", influences)
    ours = np.fromiter(map(is_term, modifiers), bool, len(modifiers)) if is_mixed else slice(None)
    if np.any(influences[ours] != np.float32(influence)):
        influences[ours] = influence
        modifiers.foreach_set("influence", influences)


def _put_in_front(fcurve: bpy.types.FCurve) -> None:
    """Put those modifiers of the animator's behind our terms that say something else in front of them."""
    modifiers = list(fcurve.modifiers)
    last = max(number for number, modifier in enumerate(modifiers) if is_term(modifier))
    others = [modifier for modifier in modifiers[:last] if modifier.type != "CYCLES" and not is_term(modifier)]
    if not all(map(_commutes, others)):
        for modifier in [modifier for modifier in modifiers if modifier.type != "CYCLES" and not is_term(modifier)]:
            put_behind(fcurve, modifier)


def _commutes(modifier: bpy.types.FModifier) -> bool:
    if modifier.type == "NOISE":
        return modifier.blend_type != "MULTIPLY"
    return modifier.mute or (modifier.type in COMMUTING and getattr(modifier, "use_additive", True))
