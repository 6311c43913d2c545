"""Reducing keys: from a recording with a key on every frame to the few poses that a mode needs to tell its motion.

A recording is whatever an object's channels say: imported mocap, a baked simulation, a solved camera. Its poses are
those in the space of the channels, with the object's own delta transforms. The few keys go into a copy of the Action;
the original stays in the file, for `restore_keys`. Frames are those of the Action, lengths are the scene's units.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...motion import KEYFRAME_MODES, Poses, reduce_keys, shell_error
from ...motion.best_of import least_errors
from ..actions.channels import replace_keys
from ..actions.slots import SlotTransform, places_of, slots_of, transforms_in
from ..actions.sources import MODE_NAMES, MODE_NUMBERS, SAME_FRAME, Source, distinct
from ..curves import CODE, CONSTANT, LINEAR, Keys
from ..inbetweens.acting import Readings, Target, Targets, act_on, readable
from ..inbetweens.channel_values import channel_values
from ..inbetweens.differences import in_betweens
from ..inbetweens.mode_keys import segment_modes, set_mode_in
from ..transforms import ROWS, SCALE, Channel, Refused, Transform, is_ours, transform_of
from .bake import go_back
from .copies import REDUCED, entries_in_use
from .originals import (
    discard_originals,
    has_original,
    move_by_copy,
    refuse_tweak_mode,
    refuse_without_original,
)

SMALLEST = 1e-6
"""Errors of single precision, relative to how far the object gets."""

SOME_SIZE = 0.1
"""The radius, in metres, of what has no size."""

SOLVED = {"CAMERA_SOLVER", "OBJECT_SOLVER", "FOLLOW_TRACK"}
"""Constraints that have a button of their own for turning them into keys."""


@dataclass(frozen=True)
class Reduction:
    """What became of the keys of an object: how many there were, how many are left, and the largest shell error."""

    before: int
    after: int
    largest_error: float
    segments: dict[str, int]
    """How many segments each mode has by now."""


@dataclass(frozen=True, eq=False)
class _Fewer:
    """The keys that one slot is to have, and what had them before."""

    place: SlotTransform
    before: int
    frames: np.ndarray
    """Shape (k,)."""

    values: dict[Channel, np.ndarray]
    """What is written on these frames, by data path and index, each of shape (k,)."""

    key_frames: np.ndarray
    """The same with frames of keys that a scale keeps, shape (n,)."""

    modes: np.ndarray
    """The numbers of the modes that go on from each of these, shape (n,)."""

    keeps_scale: bool

    largest_error: float


def reduce_keys_of(
    targets: Targets,
    mode: str = "motor_spline",
    tolerance: float = 0.001,
    radius: float | None = None,
    *,
    best_of: bool = False,
    refused: list[Refused] | None = None,
) -> Reduction | None:
    """Leave only the keys that a mode needs to show the same motion.

    A key is a pose: location, rotation and, where it is even, scale have keys on the same frames, with the values that
    the recording has there. A scale that differs from axis to axis as it changes keeps the keys it has, and so does
    everything else in the Action.

    Parameters
    ----------
    targets : bpy.types.Object or bpy.types.PoseBone, or several of them
    mode : str
        What fills in between the keys, one of `addon.motion.KEYFRAME_MODES`. It is keyed with them.
    tolerance : float
        The largest shell error on any frame, in the scene's units.
    radius : float, optional
        Of the shell, in the scene's units. `radius_of` each target, otherwise.
    best_of : bool
        Give each segment between these keys the mode with the least RMS shell error there that keeps to the tolerance;
        of equally good ones `mode`.
    refused : list, optional
        Takes the refusals, and all other targets are reduced.

    Returns
    -------
    Reduction or None
        That of the last target which did not refuse.

    Raises
    ------
    Refused
        Where there are no keys, or no fewer will do, or rigid motion cannot act on a target, and there is no list to
        take that. Nothing is changed then.
    """
    if mode not in KEYFRAME_MODES:
        raise Refused(f"there is no mode {mode!r}; the modes are {', '.join(KEYFRAME_MODES)}")
    if not 0.0 < tolerance < math.inf:
        raise Refused(f"the tolerance has to be a number above zero, not {tolerance:g}")

    def plan(transform: Transform, readings: Readings) -> list[_Fewer]:
        refuse_tweak_mode(transform)
        found = [
            _fewer_keys(
                transform, place, source, mode, tolerance, radius or radius_of(transform.carrier), best_of=best_of
            )
            for place, source in readable(transform, readings)
            if source.channels
        ]
        if not found:
            raise Refused(_why_nothing_is_keyed(transform, 0))
        fewer = [reduced for reduced in found if len(reduced.key_frames) < reduced.before]
        if not fewer:
            before, keeps_scale = sum(kept.before for kept in found), any(kept.keeps_scale for kept in found)
            raise Refused(_why_no_fewer(transform, before, keeps_scale=keeps_scale))
        return fewer

    def act(transform: Transform, fewer: list[_Fewer]) -> None:
        for reduced in fewer:
            _write(transform, reduced)

    done = act_on(targets, plan, act, refused)
    return reduction_of(list(done)[-1]) if done else None


def reduction_of(target: Target) -> Reduction | None:
    """What became of the keys that something moves by when they were reduced. None where they were not."""
    transform = transform_of(target)
    if not len(transform.motion.bakes):
        return None
    places = places_of(transform)
    entries = [entry for entry in entries_in_use(transform, places) if entry.kind == REDUCED]
    if not entries:
        return None
    reduced = {entry.changed for entry in entries}
    modes = [mode for place in places if place.slot.action in reduced for mode in segment_modes(place)]
    return Reduction(
        sum(entry.keys_before for entry in entries),
        sum(entry.keys_after for entry in entries),
        max(entry.largest_error for entry in entries),
        dict(Counter(modes)),
    )


def is_reduced(target: Target) -> bool:
    """Whether something moves by an Action with reduced keys, and its original is still in the file."""
    return has_original(transform_of(target), REDUCED)


def restore_keys(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give all the keys back that there were before they were reduced, to the last handle.

    Parameters
    ----------
    targets : bpy.types.Object or bpy.types.PoseBone, or several of them
    refused : list, optional
        Takes the refusals, and all other targets get their keys back.

    Raises
    ------
    Refused
        Where the keys of a target are not reduced, or gone, and there is no list to take that. Nothing is changed then.
    """
    go_back(targets, REDUCED, refused)


def discard_dense_keys(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Remove the keys from the file that there were before they were reduced.

    Parameters
    ----------
    targets : bpy.types.Object or bpy.types.PoseBone, or several of them
    refused : list, optional
        Takes the refusals, and the dense keys of all other targets are removed.

    Raises
    ------
    Refused
        Where the keys of a target are not reduced, or gone, and there is no list to take that. Nothing is changed then.
    """
    act_on(
        targets,
        lambda transform, _: refuse_without_original(transform, REDUCED),
        lambda transform, _: discard_originals(transform, REDUCED),
        refused,
    )


def radius_of(obj: bpy.types.Object | bpy.types.PoseBone) -> float:
    """How far an object or a pose bone reaches from its origin as it is now, in the scene's units.

    That is the farthest corner of its bounding box, and the length of a bone. Empties and cameras are as large as they
    are drawn; what has no size at all counts as ten centimetres.
    """
    if isinstance(obj, bpy.types.PoseBone):
        return obj.length * _size(_evaluated(obj.id_data).matrix_world) or SOME_SIZE / metres_per_unit(
            bpy.context.scene
        )
    evaluated = _evaluated(obj)
    corners = np.array(evaluated.bound_box)
    size = 0.0
    if np.ptp(corners) > 0.0:
        size = float(np.linalg.norm(corners @ np.array(evaluated.matrix_world.to_3x3()).T, axis=1).max())
    elif obj.type == "EMPTY":
        size = obj.empty_display_size * _size(evaluated.matrix_world)
    elif obj.type == "CAMERA":
        size = obj.data.display_size * _size(evaluated.matrix_world)
    return size or SOME_SIZE / metres_per_unit(bpy.context.scene)


def metres_per_unit(scene: bpy.types.Scene) -> float:
    return 1.0 if scene.unit_settings.system == "NONE" else scene.unit_settings.scale_length


def _evaluated(obj: bpy.types.Object) -> bpy.types.Object:
    return obj.evaluated_get(bpy.context.evaluated_depsgraph_get())


def _size(matrix: object) -> float:
    """The scale of a matrix, the same along all axes."""
    return float(np.cbrt(abs(np.linalg.det(np.array(matrix)[:3, :3]))))


def _fewer_keys(
    transform: Transform,
    place: SlotTransform,
    source: Source,
    mode: str,
    tolerance: float,
    radius: float,
    *,
    best_of: bool,
) -> _Fewer:
    """The keys that one slot needs, which may be as many as it has."""
    before, frames = distinct(source.keyed_frames), _samples(source)
    # What goes on outside of the keys, by cycles or at a slope, has to stay as well.
    around = np.arange(source.seen_range[0], source.seen_range[1] + 1.0)
    around = around[(around < frames[0]) | (around > frames[-1])]
    seen = np.concatenate((around[around < frames[0]], frames, around[around > frames[-1]]))
    truth, own = _poses(source, seen), np.isin(seen, frames)
    unit, radius = _in_channels(transform, radius, truth.scales is not None)
    tolerance /= unit
    rounding = SMALLEST * (float(np.abs(truth.positions).max()) + radius)
    allowed = tolerance + rounding
    values = _values(transform, source, frames)
    chosen = _chosen(transform, source, frames, truth[own], mode, tolerance, radius)
    while True:
        fewer = _with_keys(source, frames[chosen], {row: column[chosen] for row, column in values.items()}, mode)
        error = shell_error(_poses(fewer, seen), truth, radius)
        if error.max() <= allowed:
            break
        more = _worst(chosen, error[own], allowed)
        if not len(more):
            raise Refused(
                f"{transform.name} goes on outside of its keys, and with fewer of them would go elsewhere there: "
                "give its channels constant extrapolation and no cycles, or cycles that all have the same range"
            )
        chosen = np.union1d(chosen, more)
    if best_of:
        mixed = _with_best_modes(fewer, frames, truth[own], radius, rounding, allowed)
        error_of_mixed = shell_error(_poses(mixed, seen), truth, radius)
        # Outside of the keys cycles of different lengths may meet in other segments than inside.
        if error_of_mixed.max() <= allowed:
            fewer, error = mixed, error_of_mixed
    key_frames = distinct(fewer.keyed_frames)
    channels = transform.channels
    return _Fewer(
        place,
        len(before),
        frames[chosen],
        {channels[row]: column[chosen] for row, column in values.items()},
        key_frames,
        fewer.modes_at(key_frames + SAME_FRAME),
        SCALE in source.keyed and ROWS[SCALE].start not in values,
        float(error.max()) * unit,
    )


def _in_channels(transform: Transform, radius: float, scaled: bool) -> tuple[float, float]:
    """The length of a unit of the channels in the scene, and a radius in it, before the pose itself scales it."""
    own, world = _size(transform.carrier.matrix_basis), _size(_evaluated(transform.animated).matrix_world)
    if transform.prefix:
        world *= _size(transform.carrier.matrix)
    if not (own > 0.0 and world > 0.0):
        return 1.0, radius
    return world / own, radius / (world if scaled else world / own)


def _chosen(
    transform: Transform,
    source: Source,
    frames: np.ndarray,
    poses: Poses,
    mode: str,
    tolerance: float,
    radius: float,
) -> np.ndarray:
    """The samples that are to be keys, if nothing but poses counted."""
    if poses.scales is not None and not source.uniform_scale:
        # It stays what it is, and makes the object this large.
        radius, poses = radius * float(np.abs(poses.scales).max()), Poses(poses.positions, poses.quaternions)
    elif poses.scales is not None and not np.all(poses.scales > 0.0):
        raise Refused(
            f"{transform.name}: its scale passes zero between two keys: ease those in another way (Dope Sheet, T)"
        )
    return reduce_keys(frames, poses, mode, tolerance, radius)


def _with_best_modes(
    source: Source, frames: np.ndarray, truth: Poses, radius: float, rounding: float, allowed: float
) -> Source:
    """The source with the best mode in each segment, of those that keep within what is allowed on these frames."""
    keys = distinct(source.keyed_frames)
    numbers = np.array([source.mode, *(mode.number for mode in KEYFRAME_MODES.values() if mode.number != source.mode)])
    errors = np.stack([shell_error(_poses(replace(source, mode=int(n)), frames), truth, radius) for n in numbers])
    best = least_errors(errors, np.searchsorted(frames, keys - SAME_FRAME), rounding, allowed)
    points = np.stack((keys, numbers[[*best, best[-1]]]), axis=-1)[None].astype(np.float32)
    return replace(source, mode=Keys(points, np.full(points.shape[:2], CONSTANT, CODE)))


def _worst(chosen: np.ndarray, error: np.ndarray, allowed: float) -> np.ndarray:
    """In each segment between chosen samples the one that is furthest off, where it is too far."""
    error[chosen] = 0.0
    segment = np.searchsorted(chosen, np.arange(len(error)), side="right")
    order = np.lexsort((error, segment))
    furthest = order[np.flatnonzero(np.diff(segment[order], append=-1))]
    return furthest[error[furthest] > allowed]


def _samples(source: Source) -> np.ndarray:
    """Where the recording is looked at: on its keys, and on whole frames where those are further apart."""
    keys = distinct(source.keyed_frames)
    whole = np.arange(np.ceil(keys[0]), np.floor(keys[-1]) + 1.0)
    place = np.clip(np.searchsorted(keys, whole), 1, max(len(keys) - 1, 1))
    before, behind = keys[place - 1], keys[np.minimum(place, len(keys) - 1)]
    apart = (whole - before > SAME_FRAME) & (behind - whole > SAME_FRAME) & (behind - before > 1.0 + SAME_FRAME)
    return np.union1d(keys, whole[apart])


def _poses(source: Source, frames: np.ndarray) -> Poses:
    """What is to be seen of a source, with a scale wherever it has keys of it."""
    wanted = in_betweens(source, frames).wanted
    if wanted.scales is not None or SCALE not in source.keyed:
        return wanted
    return Poses(
        wanted.positions,
        wanted.quaternions,
        (source.values_at(frames)[ROWS[SCALE]] * source.original[ROWS[SCALE], None]).mean(axis=0),
    )


def _values(transform: Transform, source: Source, frames: np.ndarray) -> dict[int, np.ndarray]:
    """What the channels that get other keys have on these frames, each (n,), by their rows among the components."""
    by_path = channel_values(transform, source, in_betweens(source, frames))
    if SCALE in source.keyed and not source.uniform_scale:
        scale = source.values_at(frames)[ROWS[SCALE]].T
        if np.all(_is_constant(scale)):
            by_path[transform.prefix + transform.properties[SCALE]] = scale
    keyed = {row for own, _ in source.channels for row in own}
    columns = {row: by_path[path][:, index] for row, (path, index) in transform.channels.items() if path in by_path}
    return {row: column for row, column in columns.items() if row in keyed or not _is_constant(column)}


def _is_constant(columns: np.ndarray) -> np.ndarray:
    return np.ptp(columns, axis=0) <= SMALLEST * np.maximum(np.abs(columns).max(axis=0), 1.0)


def _with_keys(source: Source, frames: np.ndarray, values: dict[int, np.ndarray], mode: str) -> Source:
    """The source with these keys alone in the channels that have values, straight lines between them."""
    old = {row: keys for own, keys in source.channels for row in own}
    alike: dict[tuple, list[int]] = {}
    for row in values:
        alike.setdefault((old[row].linear, old[row].cycles) if row in old else (False, None), []).append(row)
    channels = []
    for (linear, cycles), rows in alike.items():
        points = np.empty((len(rows), len(frames), 2), np.float32)
        points[..., 0], points[..., 1] = frames, [values[row] for row in rows]
        codes = np.full(points.shape[:2], LINEAR, CODE)
        channels.append((rows, Keys(points, codes, linear=linear, cycles=cycles)))
    for own, keys in source.channels:
        places = [place for place, row in enumerate(own) if row not in values]
        if places:
            channels.append(([own[place] for place in places], keys.only(places)))
    rest = {row: value for row, value in source.rest.items() if row not in values}
    return replace(source, channels=tuple(channels), rest=rest, mode=MODE_NUMBERS[mode])


def _write(transform: Transform, fewer: _Fewer) -> None:
    copy = move_by_copy(transform, fewer.place, REDUCED)
    entry = transform.motion.bakes[-1]
    entry.keys_before, entry.keys_after = fewer.before, len(fewer.key_frames)
    entry.largest_error = fewer.largest_error
    fcurves = copy.channelbag.fcurves
    for (path, index), values in fewer.values.items():
        fcurve = copy.curves.get((path, index)) or fcurves.new(path, index=index)
        replace_keys(fcurve, fewer.frames, values, handle_type="AUTO_CLAMPED")
        fcurve.mute = False
    copy = copy.read_again()
    if transform.mode_channel in copy.curves:
        fcurves.remove(copy.curves.pop(transform.mode_channel))
    for mode in np.unique(fewer.modes):
        set_mode_in(copy, MODE_NAMES[mode], fewer.key_frames[fewer.modes == mode])


def _why_no_fewer(transform: Transform, count: int, *, keeps_scale: bool) -> str:
    if count <= 2:
        return _why_nothing_is_keyed(transform, count)
    if keeps_scale:
        return (
            f"{transform.name} keeps its {count} keys: its scale changes differently along its axes, which is no "
            "part of a pose; move that animation to a child, or remove keys of the scale by hand"
        )
    return f"{transform.name} needs its {count} keys to stay within the tolerance: allow a larger one"


def _why_nothing_is_keyed(transform: Transform, count: int) -> str:
    """What moves something that has hardly a key, and how that becomes keys."""
    obj = transform.carrier
    has = f"{transform.name} has {count or 'no'} key{'s' * (count != 1)} of location, rotation or scale"
    constraints = {constraint.type for constraint in obj.constraints if constraint.enabled and not is_ours(constraint)}
    if not transform.prefix and obj.rigid_body is not None and obj.rigid_body.type == "ACTIVE":
        return f"{has}, a simulation moves it: bake that first (Object > Rigid Body > Bake to Keyframes)"
    if constraints & SOLVED:
        return (
            f"{has}, a camera solution moves it: turn that into keys first "
            "(Object Constraint Properties, Constraint to F-Curve)"
        )
    if constraints or _is_driven(transform):
        menu = "Pose" if transform.prefix else "Object"
        return (
            f"{has}, constraints or drivers move it: bake them first "
            f"({menu} > Animation > Bake Action, with Visual Keying)"
        )
    if not transform.prefix and any(
        place.prefix for slot in slots_of([transform.animated]) for place in transforms_in(slot)
    ):
        return f"{has}, its bones have: select those in Pose mode, and reduce theirs"
    return f"{has}: there is nothing to reduce"


def _is_driven(transform: Transform) -> bool:
    data = transform.animated.animation_data
    paths = [driver.data_path for driver in (data.drivers if data else ())]
    begins = tuple(transform.prefix + name for name in ("location", "rotation", "scale"))
    return any(path.startswith(begins) for path in paths)
