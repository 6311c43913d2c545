"""Writing planned terms to the modifiers of F-curves, where they differ from the present ones.

Modifiers that are already right are left alone, because writing one makes Blender evaluate its Action again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, cast

import bpy
import numpy as np

from ...motion import KEYFRAME_MODES
from ..actions.channels import ensure_group
from ..actions.modifiers import is_term, misplaced, put_behind, terms_in
from ..actions.reading import influence_for
from ..actions.slots import Binding
from ..evaluation.components import MODE_NAMES
from ..evaluation.sources import KeyedTransform
from ..transforms import WIDTHS
from .carriers import Term

SETTINGS = (
    ("mode", "POLYNOMIAL_FACTORISED"),
    ("use_additive", True),
    ("use_restricted_range", True),
    ("mute", False),
    ("use_influence", False),
    ("blend_in", 0.0),
    ("blend_out", 0.0),
)
"""The settings that all terms share."""


def apply(binding: Binding, source: KeyedTransform, planned: Mapping[int, Sequence[Term]]) -> bool:
    """Give the channels of a slot exactly these terms, by the rows of their components.

    A channel that needs terms but does not exist yet is created with one key.

    Returns
    -------
    bool
        Whether anything changed that Blender evaluates.
    """
    channels, changed = binding.users[0].channels, False
    named = {channels[row]: of_row for row, of_row in _terms_by_name(planned, source).items()}
    for channel in named.keys() - binding.curves.keys():
        _key_once(binding, channel, float(source.keyed_range[0]))
    influence = influence_for(source, sum(map(len, named.values())))
    for channel, fcurve in binding.curves.items():
        if channel in named or (fcurve.modifiers and channel[0].removeprefix(binding.prefix) in WIDTHS):
            changed |= _apply_to(fcurve, named.get(channel, {}))
        if channel in named:
            _keep_influence(fcurve.modifiers, influence, len(named[channel]))
    return changed


def remove_terms(binding: Binding) -> bool:
    """Remove all terms from the channels of a slot, and return whether there were any."""
    removed = [fcurve for fcurve in binding.moving.values() if fcurve.modifiers and _apply_to(fcurve, {})]
    return bool(removed)


def _terms_by_name(planned: Mapping[int, Sequence[Term]], source: KeyedTransform) -> dict[int, dict[str, Term]]:
    """Return terms by their names, which consist of modes, frames and numbers."""
    ranges = list({term[:2] for terms in planned.values() for term in terms})
    modes = source.modes_at(np.array(ranges).reshape(-1, 2).mean(axis=1)).tolist()
    bases = {}
    for (first, last), mode in zip(ranges, modes, strict=True):
        label = KEYFRAME_MODES[MODE_NAMES[mode]].label if MODE_NAMES.get(mode) in KEYFRAME_MODES else "Rigid Motion"
        bases[first, last] = f"{label} {first:.6g} to {last:.6g}"
    result: dict[int, dict[str, Term]] = {}
    for row, terms in planned.items():
        of_row, counts = result.setdefault(row, {}), Counter[str]()
        for term in terms:
            base = bases[term[:2]]
            counts[base] += 1
            of_row[base if counts[base] == 1 else f"{base} ({counts[base]})"] = term
    return result


def _key_once(binding: Binding, channel: tuple[str, int], frame: float) -> None:
    """Create a channel with one key that has the value of the property."""
    user, (path, index) = binding.users[0], channel
    fcurve = binding.ensure_curve(channel)
    group = next((curve.group for (other, _), curve in binding.curves.items() if other == path and curve.group), None)
    if group is not None:
        fcurve.group = ensure_group(binding.channelbag, group.name)
    value = getattr(user.carrier, path.removeprefix(user.prefix))[index]
    fcurve.keyframe_points.insert(frame, value)


def _apply_to(fcurve: bpy.types.FCurve, named: Mapping[str, Term]) -> bool:
    """Give an F-curve exactly these terms, by their names, and return whether anything changed."""
    modifiers, missing, spare, changed = fcurve.modifiers, dict(named), [], False
    ours = terms_in(fcurve)
    is_mixed = len(modifiers) > len(ours)
    for modifier in ours:
        term = missing.pop(modifier.name, None)
        if term is None:
            spare.append(modifier)
        else:
            changed |= write(modifier, term)
    changed |= bool(spare or missing)
    # Reused modifiers are renamed last: Blender changes a name that is still in use.
    while len(spare) > len(missing):
        modifiers.remove(spare.pop())
    for modifier in spare:
        modifier.name, term = missing.popitem()
        write(modifier, term)
    if missing:
        _add(modifiers, missing, is_mixed=is_mixed)
    # Python loses its references to recreated modifiers: so only move those that act on less than they should.
    for other in misplaced(fcurve) if is_mixed else ():
        put_behind(fcurve, other)
        changed = True
    return changed


def write(modifier: bpy.types.FModifierGenerator, term: Term) -> bool:
    """Set a modifier to this term, and return whether it was different."""
    ends = ("poly_order", len(term.coefficients) // 2), ("frame_start", term.first), ("frame_end", term.last)
    changed = cast(Any, modifier.coefficients)[:] != term.coefficients
    for name, value in (*SETTINGS, *ends):
        if getattr(modifier, name) != value:
            setattr(modifier, name, value)
            changed = True
    if changed:
        modifier.coefficients = cast(Any, term.coefficients)
    return changed


def _add(modifiers: bpy.types.FCurveModifiers, named: Mapping[str, Term], *, is_mixed: bool) -> None:
    """Add terms to the modifiers of an F-curve. If all modifiers are terms, set ranges together, which is quicker."""
    for name, term in named.items():
        modifier: Any = modifiers.new("GENERATOR")
        modifier.name, modifier.show_expanded = name, False
        if is_mixed:
            write(modifier, term)
        else:
            modifier.mode, modifier.use_additive = "POLYNOMIAL_FACTORISED", True
            modifier.poly_order = len(term.coefficients) // 2
            modifier.coefficients = term.coefficients
    if not is_mixed:
        modifiers.foreach_set("use_restricted_range", np.ones(len(modifiers), bool))
        # In this order, as Blender keeps the end after the start.
        for number, name in enumerate(("frame_start", "frame_end")):
            frames = np.empty(len(modifiers), np.float32)
            modifiers.foreach_get(name, frames)
            frames[-len(named) :] = [term[number] for term in named.values()]
            modifiers.foreach_set(name, frames)


def _keep_influence(modifiers: bpy.types.bpy_prop_collection, influence: float, count: int) -> None:
    """Store an influence in all `count` terms, where Blender does not use it. This tags nothing for an update."""
    influences = np.empty(len(modifiers), np.float32)
    modifiers.foreach_get("influence", influences)
    ours = np.fromiter(map(is_term, modifiers), bool, len(modifiers)) if len(modifiers) > count else slice(None)
    influences[ours] = influence
    modifiers.foreach_set("influence", influences)
