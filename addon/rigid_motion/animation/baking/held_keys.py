"""Fewer keys for held objects: run by run, each in the space of its holder.

Holders are rigid, so an error in the holder's space is the same in the world. The key at which an object passes from
one holder to the next stays, and so does the pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple, cast

import bpy
import numpy as np

from ..actions.channels import KeyFields, key_fields, key_points, new_key_fields, set_key_fields
from ..actions.marks import write_marks
from ..actions.slots import Binding
from ..evaluation.components import MODE_NUMBERS, PART_OF, SCALE
from ..evaluation.marks import turns_at
from ..evaluation.sources import SAME_FRAME, HoldRun, KeyedTransform
from ..fcurves.keys import LINEAR
from ..holds.holders import holders_of
from ..holds.placing import channel_space
from ..transforms import Transform
from ..transforms.sizes import radius_of, reaches_of, scale_in_scene
from .fewer_keys import WholeRig, count_of, has_uneven_scale
from .native_curves import fields_of
from .search import Wishes, fewer_keys
from .worlds import MAX_CHANNEL_ROUNDING, say_holds


class FewerRuns(NamedTuple):
    """The planned fewer keys of a held object's runs, and its present keys."""

    binding: Binding
    source: KeyedTransform
    runs: Sequence[tuple[HoldRun, KeyedTransform]]
    """The runs that get fewer keys, and those keys."""

    largest_error: float
    """In the scene's units."""

    rig: WholeRig | None = None
    between: float = 0.0

    @property
    def after(self) -> int:
        """The number of frames with keys after the reduction."""
        return count_of(self.source) - sum(count_of(run.source) - count_of(fewer) for run, fewer in self.runs)


def fewer_runs(transform: Transform, binding: Binding, source: KeyedTransform, wishes: Wishes) -> FewerRuns | None:
    """Return the runs of a held object that can have fewer keys, None if none can. For all else see `fewer_keys`."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    alone = Wishes(wishes.mode, wishes.tolerance, _reach(transform, wishes.radius))
    spaces = {one.number: one.matrix(depsgraph) for one in holders_of(transform) if one.target is not None}
    own = channel_space(transform, depsgraph)
    begins = [source.keyed_range[0], *(switch.begin for switch in source.switches)]
    chosen, largest, between = [], 0.0, 0.0
    for run, begin in zip(source.runs, begins, strict=True):
        if count_of(run.source) < 2 or _has_extra_turns(source, run):
            continue
        first, last = run.source.keyed_range
        first, last = (begin if run.stretch.comes else first), (run.stretch.until if run.stretch.goes else last)
        shown = replace(run.source, seen=(int(np.floor(first)), int(np.ceil(last))))
        space = np.array(spaces.get(source.hold_at(run.stretch.first)[0], own))[:3, :3]
        # A run that continues beyond its keys, as fewer keys would not, stays as it is.
        with suppress(ValueError):
            members = {transform: (binding, shown)}
            for plan in fewer_keys(transform.animated, members, alone, space=space).values():
                chosen.append((run, _at_rest_from(plan.fewer, run.stretch.first)))
                largest, between = max(largest, plan.largest_error), max(between, plan.between)
    return FewerRuns(binding, source, chosen, largest, between=between) if chosen else None


def _reach(transform: Transform, radius: float | None) -> float:
    """Return the reach of all that moves with a transform, in the scene's units: for a bone, with all its children."""
    if not transform.is_part:
        return radius or radius_of(transform.carrier)
    size = scale_in_scene(transform)
    reaches = {} if radius else reaches_of(transform.animated)
    own = cast(bpy.types.PoseBone, transform.carrier)
    away = (
        (bone.bone.head_local - own.bone.head_local).length + (radius / size if radius else reaches[bone.name])
        for bone in (own, *own.children_recursive)
    )
    return max(away) * size


def _has_extra_turns(source: KeyedTransform, run: HoldRun) -> bool:
    """Return whether a run has extra whole turns, which fewer keys cannot have."""
    if source.turns is None:
        return False
    inside = source.turns.times[(source.turns.times > run.stretch.first) & (source.turns.times < run.stretch.until)]
    return bool(turns_at(source.turns, np.append(run.stretch.first + SAME_FRAME, inside)).any())


def _at_rest_from(source: KeyedTransform, first: float) -> KeyedTransform:
    """Return the source with a single key on the first frame of its run if it is at rest, otherwise unchanged."""
    if any(np.ptp(keys.values, axis=1).max() > MAX_CHANNEL_ROUNDING for keys in source.curves):
        return source
    rests = [(rows, keys.at(np.arange(len(keys.times)) == 0)) for rows, keys in source.channels]
    for _, keys in rests:
        keys.points[..., 0] = first
    return replace(source, channels=tuple(rests))


def write_runs(transform: Transform, fewer: FewerRuns, mode: str) -> None:
    """Write the fewer keys of a held object's runs. All other keys stay."""
    binding, source = fewer.binding, fewer.source
    chosen = {run.stretch.first: keys for run, keys in fewer.runs}
    written = {row for keys in (*chosen.values(), source) for rows, _ in keys.channels for row in rows}
    if has_uneven_scale(source):
        written = {row for row in written if PART_OF[row] != SCALE}
    for row in sorted(written):
        fcurve = binding.ensure_curve(transform.channels[row])
        old = key_fields(fcurve.keyframe_points)
        times = old["co"][:, 0].astype(float)
        parts = []
        for run in source.runs:
            there = (times > run.stretch.first - SAME_FRAME) & (times < run.stretch.until - SAME_FRAME)
            new = _keys_of(chosen.get(run.stretch.first), row)
            if new is None:
                new = {name: numbers[there] for name, numbers in old.items()}
            if not len(new["co"]):
                # A channel without keys in a run must not rest at another run's value.
                begin = np.array([run.stretch.first])
                new = new_key_fields(begin, run.source.values_at(begin)[row], LINEAR)
            parts.append(new)
        set_key_fields(fcurve, {name: np.concatenate([part[name] for part in parts]) for name in old})
    frames = [run.stretch.first for run in source.runs]
    for fcurve in binding.keyed:
        at = key_points(fcurve)[:, 0].astype(float) + 0.5 * SAME_FRAME
        numbers = source.modes_at(at)
        for first, until in pairwise([*frames, np.inf]):
            if first in chosen:
                numbers = np.where((at > first - 0.5 * SAME_FRAME) & (at < until), MODE_NUMBERS.get(mode, 0), numbers)
        write_marks(fcurve, numbers + 1)
    assert source.held is not None
    say_holds(binding, source.held)


def _keys_of(source: KeyedTransform | None, row: int) -> KeyFields | None:
    """Return the keys of a component of a source, None if it has none."""
    for rows, keys in () if source is None else source.channels:
        if row in rows:
            return fields_of(keys, rows.index(row))
    return None
