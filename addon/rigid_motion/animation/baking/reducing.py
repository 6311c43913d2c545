"""Reducing keys: from a recording with a key on every frame to the few that a mode, or Blender's own curves, need.

A recording is any motion in an object's channels: imported mocap, a baked simulation, a solved camera. Its poses are in
the space of the channels, with the object's own delta transforms. The original keys stay in the file, for
`restore_keys`. Frames are those of the Action, lengths are the scene's units.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field

from bpy.app.translations import pgettext_n as n_

from ...motion import KEYFRAME_MODES
from ...motion.modes import no_such_mode
from ..actions.refusals import refuse_drivers, refuse_modified, refuse_tolerance
from ..actions.slots import Binding
from ..edits.apply import Readings, Target, Targets, apply_together, readable, transforms_of
from ..edits.mode_keys import set_mode_in
from ..evaluation.components import PART_OF, SCALE
from ..evaluation.sources import KeyedTransform
from ..transforms import Note, Refused, Transform, transform_of
from .bake import go_back
from .fewer_keys import FewerKeys, NeedsItsKeys, WholeRig, count_of, has_uneven_scale
from .held_keys import FewerRuns, fewer_runs, write_runs
from .native_curves import NATIVE, write_keys
from .originals import CLEANED, REDUCED, Originals, discard_originals, last_change, notes_of
from .search import NO_FEWER, NOT_SO_MANY, NotFewer, Wishes, fewer_keys

HELD_REFUSAL = n_("{name} is held, so each hold is reduced separately: by a tolerance, not to a number of keys")

SMOOTH_MODE = "motor_spline"
"""The mode that usually needs the fewest keys."""

FEWEST = "FEWEST"
"""Requests `NATIVE` or `SMOOTH_MODE`, the one that needs fewer keys, or another mode that needs fewer than both."""

Plans = dict[Transform, "list[FewerKeys | FewerRuns] | Refused"]
"""The planned keys of targets in each slot that moves them, or why a target refuses."""


@dataclass(frozen=True)
class Reduction:
    """The result of a reduction: the number of frames with keys before and after, and the largest shell error."""

    before: int
    after: int
    largest_error: float
    """See `FewerKeys`."""

    rig: WholeRig | None = None
    """The result for the whole rig, if this is the result for a bone."""

    channel_keys: tuple[int, int] = (0, 0)
    """The total keys of all channels, before and after. They may increase: a pose has keys in all channels."""

    between: float = 0.0
    """The largest error between frames, if only the error on frames keeps to the tolerance."""

    mode: str = ""
    """The mode of the keys, or `NATIVE`."""

    needed: Mapping[str, int] = field(default_factory=dict)
    """The number of keys left for all targets together with each mode that was tried."""

    held: Sequence[Sequence] = ()
    """If keys were reduced into holds: the names of the holders, first and last frames, and the number of keys that
    became one.
    """


def reduce_keys_of(
    targets: Targets,
    mode: str = SMOOTH_MODE,
    tolerance: float = 0.001,
    radius: float | None = None,
    *,
    shared: bool = False,
    hold: bool = True,
    count: int | None = None,
    refused: list[Refused] | None = None,
) -> Reduction | None:
    """Leave only the keys that a mode, or Blender's own curves, need to show the same motion.

    A key is a pose: location, rotation and, if it is uniform, scale have keys on the same frames, with the values of
    the recording. A changing scale that differs from axis to axis keeps its keys, as does everything else in the
    Action. Bones of one rig are reduced together, because a bone moves all its children. A held object is reduced
    separately, each hold in the space of its holder; the keys at which it passes to another holder stay. Native curves
    are Bezier keys: location, rotation and scale are fitted separately, as they are keyed, on the same frames.

    Parameters
    ----------
    targets, refused
        See `edits.apply`.
    mode : str
        The mode of all segments, one of `rigid_motion.motion.KEYFRAME_MODES`. `NATIVE` stands for Blender's own curves,
        `FEWEST` for the choice that needs the fewest keys.
    tolerance : float
        The largest shell error at any moment, or with native curves on any frame, in the scene's units. For bones it is
        measured in the rig's space, through all their parents, and also holds for all children of targets.
    radius : float, optional
        The radius of the shell, in the scene's units. The default is `radius_of` each target.
    shared : bool
        Give all bones of a rig keys on the same frames: key poses.
    hold : bool
        Keep bones that stand on the ground to a quarter of the tolerance while they do.
    count : int, optional
        The number of keys of an object, or of key poses of a rig, at least 2. The keys found with the smallest maximum
        error are used, and the tolerance is ignored. Bones with fewer keys keep these.

    Returns
    -------
    Reduction or None
        The result for all targets that did not refuse, see `reduction_of`.
    """
    modes: tuple[str, ...] = (mode,)
    if mode == FEWEST:  # With a count, every mode has the same number of keys.
        modes = (NATIVE, SMOOTH_MODE) if count else tuple(dict.fromkeys((NATIVE, SMOOTH_MODE, *KEYFRAME_MODES)))
    if mode not in (NATIVE, FEWEST) and mode not in KEYFRAME_MODES:
        raise Refused(no_such_mode(mode, KEYFRAME_MODES))
    refuse_tolerance(tolerance)
    if count is not None and count < 2:
        raise Refused(n_("a motion needs at least 2 keys, not {count}"), count=count)
    found: dict[str, Plans] = {}
    needed: dict[str, int] = {}
    originals = Originals(REDUCED)

    def plan(readings: Mapping[Transform, Readings]) -> Plans:
        for name in modes:
            with suppress(NotFewer):
                wishes = Wishes(name, tolerance, radius, shared, hold, count)
                found[name] = _plans(readings, wishes, min(needed.values()) if name in modes[2:] else math.inf)
                needed[name] = _keys_left(found[name], readings)
        nonlocal mode
        mode = min(needed, key=lambda name: (needed[name], name in modes[2:], _error_of(found[name])))
        return {
            transform: one or _refusal_to_reduce(transform, readable(transform, readings[transform]), count)
            for transform, one in found[mode].items()
        }

    def act(transform: Transform, fewer: list[FewerKeys | FewerRuns]) -> None:
        for reduced in fewer:
            _write(transform, reduced, mode, needed, originals)

    done = apply_together(targets, plan, act, refused)
    return reduction_of(done) if done else None


def _plans(readings: Mapping[Transform, Readings], wishes: Wishes, below: float) -> Plans:
    """Return plans for all targets; those moved by the same slot of an object are planned together: see `fewer_keys`.

    Held objects move with their holders, so they are planned separately. Raises `NotFewer` if `below` keys or more are
    left.
    """
    plans: Plans = {}
    together: dict[tuple, dict[Transform, tuple[Binding, KeyedTransform]]] = {}
    for transform, reading in readings.items():
        try:
            keyed = [(binding, source) for binding, source in readable(transform, reading) if source.channels]
            for binding, source in keyed:
                refuse_modified(transform.name, binding)
                refuse_drivers(transform, binding, source.driven)
        except Refused as refusal:
            plans[transform] = refusal
            continue
        of_runs: list[FewerKeys | FewerRuns] = []
        plans[transform] = of_runs
        for binding, source in keyed:
            if source.held is None:
                together.setdefault((transform.animated, *binding.slot.key), {})[transform] = binding, source
            elif wishes.count is not None:
                plans[transform] = Refused(HELD_REFUSAL, name=transform.name)
            elif (runs := fewer_runs(transform, binding, source, wishes)) is not None:
                of_runs.append(runs)
    for (obj, *_), members in together.items():
        try:
            fewer = fewer_keys(obj, members, wishes, below=below)
        except ValueError as problem:
            text = n_("{name} cannot be reduced: {problem}")
            why = problem if isinstance(problem, Refused) else Refused(text, name=obj.name, problem=problem)
            plans |= dict.fromkeys(members, why)
            continue
        for transform, plan in fewer.items():
            below -= plan.after
            if isinstance(result := plans[transform], list):
                result.append(plan)
    return plans


def _keys_left(plans: Plans, readings: Mapping[Transform, Readings]) -> int:
    """Return the total number of frames with keys of all targets after the reduction, including those that refuse."""
    count = 0
    for transform, plan in plans.items():
        fewer = {id(one.binding): one.after for one in plan} if isinstance(plan, list) else {}
        sources = (
            (id(binding), source) for binding, source in readings[transform] if isinstance(source, KeyedTransform)
        )
        count += sum(fewer.get(binding, count_of(source)) for binding, source in sources if source.channels)
    return count


def _error_of(plans: Plans) -> float:
    return max((one.largest_error for plan in plans.values() if isinstance(plan, list) for one in plan), default=0.0)


def reduction_of(targets: Targets) -> Reduction | None:
    """Return the result of the last reduction for all targets together, None if none were reduced."""
    notes: dict[tuple, Note] = {}
    # Transforms that share keys count once.
    for transform, in_use in notes_of(transforms_of(targets)):
        for note in in_use:
            if note.kind == REDUCED:
                notes.setdefault((transform.prefix, note.changed, note.handle), note)
    if not notes:
        return None
    reductions = list(map(_stored_reduction, notes.values()))
    rigs = [item.rig for item in reductions if item.rig is not None]
    return Reduction(
        sum(item.before for item in reductions),
        sum(item.after for item in reductions),
        max(item.largest_error for item in reductions),
        max(rigs, key=lambda rig: rig.frames, default=None),
        (sum(item.channel_keys[0] for item in reductions), sum(item.channel_keys[1] for item in reductions)),
        max(item.between for item in reductions),
        reductions[-1].mode,
        reductions[-1].needed,
        [one for item in reductions for one in item.held],
    )


def _stored_reduction(note: Note) -> Reduction:
    noted = json.loads(note.reduction)
    return Reduction(**noted | {"rig": noted["rig"] and WholeRig(**noted["rig"])})


def is_reduced(target: Target) -> bool:
    """Return whether the target has reduced keys and its original is still in the file."""
    return last_change(transform_of(target)) == REDUCED


def restore_keys(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Restore all keys from before they were last reduced or cleaned, handles included."""
    go_back(targets, (REDUCED, CLEANED), refused)


def discard_dense_keys(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Remove the keys from the file that `restore_keys` would restore. See `edits.apply`."""
    go_back(targets, (REDUCED, CLEANED), refused, by=discard_originals)


def _write(
    transform: Transform, fewer: FewerKeys | FewerRuns, mode: str, needed: Mapping[str, int], originals: Originals
) -> None:
    binding, before = fewer.binding, channel_keys(fewer.binding)
    notes = originals.keep(binding)
    if not notes:
        return
    if isinstance(fewer, FewerRuns):
        write_runs(transform, fewer, mode)
    else:
        write_fewer(transform, fewer)
        set_mode_in(binding, "BLENDER" if mode == NATIVE else mode)
    keys = before, channel_keys(binding)
    counts = count_of(fewer.source), fewer.after
    reduction = Reduction(*counts, fewer.largest_error, fewer.rig, keys, fewer.between, mode, needed)
    for note in notes:
        note.reduction = json.dumps(asdict(reduction))


def write_fewer(transform: Transform, fewer: FewerKeys) -> None:
    """Write the fewer keys to the channels of a transform, without a mode."""
    binding = fewer.binding
    for rows, keys in fewer.fewer.channels:
        for channel, row in enumerate(rows):
            if PART_OF[row] != SCALE or not has_uneven_scale(fewer.source):
                fcurve = binding.ensure_curve(transform.channels[row])
                write_keys(fcurve, keys, channel)
                fcurve.mute = False
    binding.remove_curve(transform.turns_channel)


def channel_keys(binding: Binding) -> int:
    """Return the total number of keys in all channels of a binding."""
    return sum(len(fcurve.keyframe_points) for fcurve in binding.curves.values())


def _refusal_to_reduce(
    transform: Transform, keyed: Sequence[tuple[Binding, KeyedTransform]], count: int | None
) -> Refused:
    before = sum(count_of(source) for _, source in keyed if source.channels)
    if before <= 2:
        text = n_(
            "{name} has at most two keys of location, rotation or scale: there is nothing to reduce. First convert "
            "constraints, drivers and simulations to keys (Animation > Bake Action, with Visual Keying)"
        )
        return Refused(text, name=transform.name)
    if any(source.channels and has_uneven_scale(source) for _, source in keyed):
        text = n_(
            "{name} keeps its {count} keys: its scale is not uniform or passes zero, which poses cannot have; move "
            "that animation to a child, or remove keys of the scale by hand"
        )
        return Refused(text, name=transform.name, count=before)
    return NeedsItsKeys(NO_FEWER if count is None else NOT_SO_MANY, name=transform.name, count=before)
