"""Reducing keys: from a recording with a key on every frame to the few poses that a mode needs to tell its motion.

A recording is whatever an object's channels say: imported mocap, a baked simulation, a solved camera. Its poses are
those in the space of the channels, with the object's own delta transforms. The few keys go into a copy of the Action;
the original stays in the file, for `restore_keys`. Frames are those of the Action, lengths are the scene's units.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ...motion import KEYFRAME_MODES
from ...motion.modes import no_such_mode
from ..actions.channels import replace_keys
from ..actions.refusals import refuse_drivers, refuse_modified
from ..actions.slots import Binding, bindings_for, bindings_in_slot, slots_of
from ..edits.apply import Readings, Target, Targets, apply_edit, readable, transforms_of
from ..edits.mode_keys import set_mode_in
from ..evaluation.components import MODE_NAMES, PART_OF, SCALE
from ..evaluation.sources import SAME_FRAME, Source, distinct
from ..queries.keyed import segment_modes
from ..transforms import Refused, Transform, transform_of
from ..transforms.sizes import radius_of
from .bake import bindings_with_original, go_back
from .fewer_keys import FewerKeys, NeedsItsKeys, WholeRig, count_of, fewer_keys, has_uneven_scale
from .fewer_rig_keys import Plans, fewer_keys_of_rigs
from .motions import MOVING, NotPromised
from .originals import (
    REDUCED,
    Note,
    Originals,
    discard_originals,
    has_original,
    notes_of,
)

HAS_KEYS = (
    n_("{name} has no keys of location, rotation or scale"),
    n_("{name} has {count} key of location, rotation or scale"),
    n_("{name} has {count} keys of location, rotation or scale"),
)
"""The first words on something that has hardly a key, by the number of its keys."""

SIMULATED = n_("{has}, a simulation moves it: bake that first (Object > Rigid Body > Bake to Keyframes)")
SOLVED_CAMERA = n_(
    "{has}, a camera solution moves it: turn that into keys first (Object Constraint Properties, Constraint to F-Curve)"
)
CONSTRAINED = n_(
    "{has}, constraints or drivers move it: bake them first (Object > Animation > Bake Action, with Visual Keying)"
)
CONSTRAINED_BONE = n_(
    "{has}, constraints or drivers move it: bake them first (Pose > Animation > Bake Action, with Visual Keying)"
)

SOLVED = {"CAMERA_SOLVER", "OBJECT_SOLVER", "FOLLOW_TRACK"}
"""Constraints that have a button of their own for turning them into keys."""


@dataclass(frozen=True)
class Reduction:
    """What became of the keys of an object: how many there were, how many are left, and the largest shell error."""

    before: int
    after: int
    largest_error: float
    """In the scene's units; of a rig the largest of all its bones, with and without keys, but for `not_promised`."""

    segments: dict[str, int]
    """The number of segments that each mode has by now."""

    rig: WholeRig | None = None
    """The result for the rig, where it is a bone's."""

    channel_keys: tuple[int, int] = (0, 0)
    """The keys of all channels together, before and after. There may be more: a pose has all channels."""


def reduce_keys_of(
    targets: Targets,
    mode: str = "motor_spline",
    tolerance: float = 0.001,
    radius: float | None = None,
    *,
    best_of: bool = False,
    shared: bool = False,
    hold: bool = True,
    count: int | None = None,
    refused: list[Refused] | None = None,
) -> Reduction | None:
    """Leave only the keys that a mode needs to show the same motion.

    A key is a pose: location, rotation and, where it is even, scale have keys on the same frames, with the values that
    the recording has there. A scale that differs from axis to axis as it changes keeps the keys it has, and so does
    everything else in the Action. Bones of one rig are reduced together: what moves one moves all below it.

    Parameters
    ----------
    targets, refused
        See `edits.apply`.
    mode : str
        What fills in between the keys, one of `rigid_motion.motion.KEYFRAME_MODES`. It is that of all segments.
    tolerance : float
        The largest shell error on any frame, in the scene's units. Of bones it is that in the rig's space, through all
        that they hang on, and holds for every bone that hangs on a target too.
    radius : float, optional
        Of the shell, in the scene's units. `radius_of` each target, otherwise.
    best_of : bool
        Give each segment between these keys the mode with the least RMS shell error there that keeps to the tolerance;
        of equally good ones `mode`.
    shared : bool
        Give all bones of a rig keys on the same frames: key poses.
    hold : bool
        Keep bones that stand on the ground to a quarter of the tolerance while they do.
    count : int, optional
        So many keys of an object, or key poses of a rig, at least 2: those with the smallest largest error that is
        found, whatever the tolerance. Bones that have fewer keys keep these.

    Returns
    -------
    Reduction or None
        That of the last target which did not refuse.
    """
    if mode not in KEYFRAME_MODES:
        raise Refused(no_such_mode(mode, KEYFRAME_MODES))
    if not 0.0 < tolerance < math.inf:
        raise Refused(n_("the tolerance has to be a number above zero, not {tolerance:g}"), tolerance=tolerance)

    if count is not None and count < 2:
        raise Refused(n_("a motion has 2 keys at least, not {count}"), count=count)
    of_rigs: Plans = {}
    originals = Originals(REDUCED)

    def survey(readings: Mapping[Transform, Readings]) -> None:
        wishes = {"shared": shared, "hold": hold, "best_of": best_of, "count": count}
        of_rigs.update(fewer_keys_of_rigs(readings, mode, tolerance, radius, **wishes))

    def plan(transform: Transform, readings: Readings) -> list[FewerKeys]:
        keyed = [(binding, source) for binding, source in readable(transform, readings) if source.channels]
        if not keyed:
            raise Refused(_why_nothing_is_keyed(transform, 0))
        for binding, source in keyed:
            refuse_modified(transform.name, binding)
            refuse_drivers(transform, binding, source.driven)
        result = of_rigs.get(transform, [])
        if isinstance(result, Refused):
            raise result
        if transform.is_part:
            if not result:
                raise _no_fewer(transform, keyed, count)
            return result
        size = radius or radius_of(transform.carrier)
        planned = {fewer.binding for fewer in result}
        rest = [item for item in keyed if item[0] not in planned]
        wishes = {"best_of": best_of, "count": count}
        every = [*result, *(fewer_keys(transform, *item, mode, tolerance, size, **wishes) for item in rest)]
        if fewer := [reduced for reduced in every if reduced.after < reduced.before]:
            return fewer
        raise _no_fewer(transform, keyed, count)

    def act(transform: Transform, fewer: list[FewerKeys]) -> None:
        for reduced in fewer:
            _write(transform, reduced, originals)

    done = apply_edit(targets, plan, act, refused, survey=survey)
    return reduction_of(list(done)[-1]) if done else None


def reduction_of(target: Target) -> Reduction | None:
    """Return what became of the keys that something moves by when they were reduced. None where they were not."""
    transform = transform_of(target)
    notes = _notes_on([transform])
    if not notes:
        return None
    reduced = (binding for binding in bindings_for(transform) if (transform.prefix, *binding.slot.key) in notes)
    modes = Counter(mode for binding in reduced for mode in segment_modes(binding))
    return _summed(list(map(_noted_in, notes.values())), dict(modes))


def _notes_on(transforms: Iterable[Transform]) -> dict[tuple, Note]:
    """Return the latest notes on keys that were reduced, by prefixes and slots: once for all that move by them."""
    result: dict[tuple, Note] = {}
    for transform, notes in notes_of(transforms):
        for note in notes:
            if note.kind == REDUCED:
                result.setdefault((transform.prefix, note.changed, note.handle), note)
    return result


def _summed(reductions: Sequence[Reduction], segments: dict[str, int]) -> Reduction | None:
    """Return all of these together, None where there are none. What they say of a rig is that with the most frames."""
    if not reductions:
        return None
    rigs = [item.rig for item in reductions if item.rig is not None]
    return Reduction(
        sum(item.before for item in reductions),
        sum(item.after for item in reductions),
        max(item.largest_error for item in reductions),
        segments,
        max(rigs, key=lambda rig: rig.frames, default=None),
        tuple(map(sum, zip(*(item.channel_keys for item in reductions), strict=True))),
    )


def _noted_in(note: Note) -> Reduction:
    noted = json.loads(note.reduction)
    if rig := noted["rig"]:
        noted["rig"] = WholeRig(**{**rig, "not_promised": NotPromised(*map(tuple, rig["not_promised"]))})
    return Reduction(**noted)


def total_reduction(targets: Targets) -> Reduction | None:
    """Return what became of the keys of several targets together, without their modes. None where none were reduced."""
    noted = map(_noted_in, _notes_on(transforms_of(targets)).values())
    # Of bones it is the error of their rigs.
    of_whole = [replace(item, largest_error=item.rig.largest_error) if item.rig else item for item in noted]
    return _summed(of_whole, {})


def is_reduced(target: Target) -> bool:
    """Return whether something moves by an Action with reduced keys, and its original is still in the file."""
    return has_original(transform_of(target), REDUCED)


def restore_keys(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give all the keys back that there were before they were reduced, to the last handle. See `edits.apply`."""
    go_back(targets, REDUCED, refused)


def discard_dense_keys(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Remove the keys from the file that there were before they were reduced. See `edits.apply`."""
    apply_edit(
        targets,
        lambda transform, readings: bindings_with_original(transform, REDUCED, readings),
        lambda transform, bindings: discard_originals(transform, REDUCED, bindings),
        refused,
    )


def _write(transform: Transform, fewer: FewerKeys, originals: Originals) -> None:
    binding, channel_keys = fewer.binding, _channel_keys(fewer.binding)
    notes = originals.keep(binding)
    if not notes:
        return
    for rows, keys in fewer.fewer.channels:
        for row, values, codes in zip(rows, keys.values, keys.interpolation, strict=True):
            if PART_OF[row] != SCALE or not fewer.keeps_scale:
                fcurve = binding.ensure_curve(transform.channels[row])
                replace_keys(fcurve, keys.times, values, interpolation=codes, handle_type="AUTO_CLAMPED")
                fcurve.mute = False
    if transform.turns_channel in binding.curves:
        binding.channelbag.fcurves.remove(binding.curves.pop(transform.turns_channel))
    frames = distinct(fewer.fewer.keyed_frames)
    modes = fewer.fewer.modes_at(frames + SAME_FRAME)
    for mode in np.unique(modes).tolist():
        set_mode_in(binding, MODE_NAMES[mode], None if np.all(modes == mode) else frames[modes == mode])
    keys = channel_keys, _channel_keys(binding)
    reduction = Reduction(fewer.before, fewer.after, fewer.largest_error, {}, fewer.rig, keys)
    for note in notes:
        note.reduction = json.dumps(asdict(reduction))


def _channel_keys(binding: Binding) -> int:
    return sum(len(fcurve.keyframe_points) for fcurve in binding.curves.values())


def _no_fewer(transform: Transform, keyed: Sequence[tuple[Binding, Source]], count: int | None) -> Refused:
    before = sum(count_of(source) for _, source in keyed)
    if before <= 2:
        return Refused(_why_nothing_is_keyed(transform, before))
    if any(has_uneven_scale(source) for _, source in keyed):
        return Refused(
            n_(
                "{name} keeps its {count} keys: its scale changes differently along its axes, which is no "
                "part of a pose; move that animation to a child, or remove keys of the scale by hand"
            ),
            name=transform.name,
            count=before,
        )
    text = n_("{name} needs its {count} keys to stay within the tolerance: allow a larger one")
    if count is not None:
        text = n_("{name} has {count} keys: ask for fewer")
    return NeedsItsKeys(text, name=transform.name, count=before)


def _why_nothing_is_keyed(transform: Transform, count: int) -> str:
    """Return what moves something that has hardly a key, and how that becomes keys."""
    obj = transform.carrier
    has = rpt_(HAS_KEYS[min(count, 2)]).format(name=transform.name, count=count)
    constraints = {constraint.type for constraint in obj.constraints if constraint.enabled}
    if not transform.is_part and obj.rigid_body is not None and obj.rigid_body.type == "ACTIVE":
        return rpt_(SIMULATED).format(has=has)
    if constraints & SOLVED:
        return rpt_(SOLVED_CAMERA).format(has=has)
    data, paths = transform.animated.animation_data, tuple(transform.prefix + name for name in MOVING)
    if constraints or (data is not None and any(driver.data_path in paths for driver in data.drivers)):
        return rpt_(CONSTRAINED_BONE if transform.is_part else CONSTRAINED).format(has=has)
    if not transform.is_part and any(
        binding.kind.is_part for slot in slots_of([transform.animated]) for binding in bindings_in_slot(slot)
    ):
        return rpt_("{has}, its bones have: select those in Pose mode, and reduce theirs").format(has=has)
    return rpt_("{has}: there is nothing to reduce").format(has=has)
