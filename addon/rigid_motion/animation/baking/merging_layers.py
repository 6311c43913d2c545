"""Merging offset layers: writes the visible motion as keys of the previous Action, within a tolerance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...blender import existing
from ..actions.channels import ensure_group, key_points
from ..actions.marks import write_marks
from ..actions.refusals import refuse_linked, refuse_tolerance
from ..actions.slots import Binding
from ..edits.apply import Readings, Targets, apply_together, readable, transforms_of
from ..edits.holding import components_on
from ..evaluation.components import LOCATION, PART_OF, ROTATION, ROWS
from ..evaluation.differences import seen_values
from ..evaluation.marks import without
from ..evaluation.sources import SAME_FRAME, KeyedTransform
from ..fcurves.keys import CODE, LINEAR, Keys
from ..holds.dependencies import node_of
from ..holds.placing import hang_of, hangs_on_bone, matrices_of, poses_of, rows_of
from ..queries.keyed import source_of
from ..transforms import TURNS_PROPERTY, WIDTHS, Refused, Transform, bone_name, split_path, transform_of
from .fewer_keys import FewerKeys, has_uneven_scale, united
from .kept_keys import Kept, kept_keys
from .layers import influence_of, layered, remove_base, remove_layer, strips_of
from .reducing import Reduction, write_fewer
from .worlds import SEVERAL_REFUSAL, worlds_of

SAMPLES_PER_FRAME = 4
"""The number of samples per frame of the visible motion."""

MAX_SHEAR = 1e-4
"""The largest difference of matrices from a rotation times a scale."""

NO_LAYER = n_(
    "{name} has no layer alone: Add Layer first, or remove other strips and the Action on top of it (NLA Editor)"
)
LOST = n_("{name}: its layer has keys of {others} too: Add Layer to that as well, or delete these keys first")
SHEARED = n_("{name}: its scale differs from axis to axis as it turns: apply the scale (Ctrl A), or delete its keys")


Planned = tuple[FewerKeys, int]
"""The planned keys of a transform, and the number of frames with keys of its base, its layer and the influence."""


def merge_layer(
    targets: Targets, tolerance: float = 0.001, radius: float | None = None, *, refused: list[Refused] | None = None
) -> Reduction | None:
    """Write the visible motion of a layer as keys of the previous Action, and remove the layer.

    The keys are on the frames of those of the base, the layer and its influence. Extra keys are on whole frames where
    the motion needs them; around these there are Blender's own curves, elsewhere the modes of the base. For a rig, the
    layer of all its bones is merged.

    Parameters
    ----------
    targets, refused
        See `edits.apply`.
    tolerance : float
        The largest shell error on any frame, in the scene's units; for bones, through all their parents. Quarters of
        frames keep to it as far as keys on whole frames can.
    radius : float, optional
        The radius of the shell, in the scene's units. The default is `radius_of` each target.

    Returns
    -------
    Reduction or None
        The result for all targets that did not refuse; None if all did. Errors are those on frames, and `between` is
        the error on any quarter of a frame.
    """
    refuse_tolerance(tolerance)

    def plan(readings: Mapping[Transform, Readings]) -> dict[Transform, Planned | Refused]:
        plans: dict[Transform, Planned | Refused] = {}
        for obj in dict.fromkeys(transform.animated for transform in readings):
            members = {one: reading for one, reading in readings.items() if one.animated == obj}
            try:
                plans.update(_plan_merge(obj, members, tolerance, radius))
            except Refused as refusal:
                plans.update(dict.fromkeys(members, refusal))
        return plans

    def act(transform: Transform, planned: Planned) -> Planned:
        _write(transform, planned[0])
        if not layered(transform.animated):
            remove_layer(transform.animated)
        return planned

    every = [one for target in transforms_of(targets) for one in layered(target.animated) or [target]]
    done = apply_together(every, plan, act, refused).values()
    if not done:
        return None
    errors, between = (max(getattr(one, name) for one, _ in done) for name in ("largest_error", "between"))
    return Reduction(sum(before for _, before in done), sum(one.after for one, _ in done), errors, between=between)


def _plan_merge(
    obj: bpy.types.Object, members: Mapping[Transform, Readings], tolerance: float, radius: float | None
) -> dict[Transform, Planned]:
    """Return the planned keys of an object and its bones for merging their layer."""
    strips = strips_of(obj)
    if strips is None or any(transform.motion.base is None for transform in members):
        raise Refused(NO_LAYER, name=next(iter(members)).name)
    below, offset = ((existing(strip.action), strip.action_slot_handle) for strip in strips)
    keyed = {
        one: {binding.slot.key: (binding, source) for binding, source in readable(one, readings)}
        for one, readings in members.items()
    }
    binding, _ = next(iter(keyed.values()))[offset]
    for prefix, prop in (split_path(fcurve.data_path) for fcurve in binding.slot.fcurves):
        if prefix not in {one.prefix for one in members} or prop not in (*WIDTHS, TURNS_PROPERTY):
            raise Refused(LOST, name=obj.name, others=bone_name(prefix) or prop)
    blends, powers = influence_of(strips[1]).T
    bases = {one: source_of(existing(one.motion.base)) for one in members}
    keys = {one: _kept_frames(bases[one], keyed[one][offset][1], blends if np.ptp(powers) else ()) for one in members}
    frames, seen = _sample_motion(list(members), united(keys.values()))
    chosen, dense = dict[Transform, Kept](), dict[Transform, tuple[Binding, KeyedTransform]]()
    for transform, worlds in zip(members, seen, strict=True):
        binding, _ = keyed[transform][below]
        refuse_linked(transform, binding)
        if len(binding.users) > 1:
            raise Refused(SEVERAL_REFUSAL, name=transform.name)
        at = frames[np.searchsorted(frames, keys[transform] - SAME_FRAME)]
        base, inside = bases[transform], (frames >= at[0]) & (frames <= at[-1])
        start = components_on(transform_of(existing(transform.motion.base)), base, float(frames[0]))
        rows = rows_of(*poses_of(worlds), transform, start)
        is_sheared = np.abs(matrices_of(rows, transform.order) - worlds).max() > MAX_SHEAR
        if transform.is_part and transform.pose_bone.bone.use_connect:
            # A connected bone shows no location, but its modes take keys of location into account.
            rows[ROWS[LOCATION]] = 0.0 if base is None else seen_values(base, frames)[ROWS[LOCATION]]
        source = _dense_source(transform, base, keyed[transform][offset][1], frames[inside], rows[:, inside])
        if is_sheared or has_uneven_scale(source):
            raise Refused(SHEARED, name=transform.name)
        chosen[transform], dense[transform] = (at, base), (binding, source)
    whole = np.union1d(frames[frames % 1.0 == 0.0], united(at for at, _ in chosen.values()))
    plans = kept_keys(obj, dense, chosen, tolerance, radius, whole)
    return {one: (plans.get(one) or FewerKeys(*dense[one], dense[one][1], 0.0), len(chosen[one][0])) for one in members}


def _kept_frames(base: KeyedTransform | None, offset: KeyedTransform, blends: Sequence[float]) -> np.ndarray:
    """Return the frames on which keys stay, at least two."""
    frames = [np.array(blends), *(source.keyed_frames for source in (base, offset) if source is not None)]
    if base is not None and base.goes_on:
        frames.append(np.array(base.seen_range, dtype=float))
    result = united(frames)
    return result if len(result) > 1 else np.arange(2.0) + (result if len(result) else 0.0)


def _sample_motion(transforms: list[Transform], keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sampled frames (m,) from the first to the last of these keys, and the visible matrices of transforms
    there, in the spaces of their bases' channels, shape (k, m, 4, 4).
    """
    steps = np.arange(np.ceil(keys[0]), keys[-1], 1.0 / SAMPLES_PER_FRAME)
    frames = np.union1d(keys, without(steps, keys))
    bases = [transform_of(existing(transform.motion.base)) for transform in transforms]
    hung = [(base, parent) for base in bases if (parent := base.animated.parent) is not None]
    parents = [(parent, base.animated.parent_bone if hangs_on_bone(base) else "") for base, parent in hung]
    worlds = worlds_of(bases[0], [*map(node_of, transforms), *parents], frames).nodes
    result = worlds[: len(transforms)]
    for (base, _), parent in zip(hung, worlds[len(transforms) :], strict=True):
        offset = hang_of(base) if hangs_on_bone(base) else base.animated.matrix_parent_inverse
        result[bases.index(base)] = np.linalg.inv(parent @ np.array(offset)) @ result[bases.index(base)]
    return frames, result


def _dense_source(
    transform: Transform, base: KeyedTransform | None, offset: KeyedTransform, frames: np.ndarray, rows: np.ndarray
) -> KeyedTransform:
    """Return a source with keys on frames (m,) of components (10, m); scale only if it was keyed."""
    parts = frozenset((LOCATION, ROTATION)) | (offset.keyed if base is None else offset.keyed | base.keyed)
    kept = [row for row in transform.channels if PART_OF[row] in parts]
    points = np.empty((len(kept), len(frames), 2), np.float32)
    points[..., 0], points[..., 1] = frames, rows[kept]
    channels = ((kept, Keys(points, np.full(points.shape[:2], LINEAR, CODE))),)
    return replace(offset, channels=channels, keyed=parts, rest={}, mode=0, turns=None, held=None)


def _write(transform: Transform, fewer: FewerKeys) -> None:
    """Write these keys to a transform, and detach it from its base."""
    binding = fewer.binding
    write_fewer(transform, fewer)
    for row in (row for rows, _ in fewer.fewer.channels for row in rows):
        fcurve = binding.curves[transform.channels[row]]
        fcurve.group = ensure_group(binding.channelbag, transform.group)
        write_marks(fcurve, fewer.fewer.modes_at(key_points(fcurve)[:, 0].astype(float) + 0.5 * SAME_FRAME) + 1)
    remove_base(transform)
