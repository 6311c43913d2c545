"""Cleaning dense keys: removes jitter and spikes from a recording while its keys stay, and the way back.

Cleaning works on the poses of the channels, each bone's in the space of its parent. The distance that anything moves
by that is measured in the scene, through all its parents. Frames are those of the Action, lengths the scene's units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...blender import scene
from ...motion import Poses, Skeleton, clean, standing
from ...motion.cleaning import SLIDE_RATIO, Looks
from ...motion.contacts import slide, slide_ratios, spans
from ...motion.jitter import DIFFERENCE_ORDERS, jitter
from ...motion.quaternions import conjugate, multiply, rotate, turned, turns_between
from ..actions.channels import key_fields, set_key_fields
from ..actions.refusals import refuse_drivers, refuse_linked, refuse_modified
from ..actions.slots import Binding
from ..edits.apply import Readings, Targets, apply_together, readable
from ..evaluation.bodies import turn_into_quaternions
from ..evaluation.channel_values import rotation_values
from ..evaluation.components import LOCATION, PART_OF, ROTATION, ROWS, SCALE
from ..evaluation.sources import SAME_FRAME, KeyedTransform
from ..holds.placing import channel_space
from ..queries.keyed import frames_in
from ..transforms import Refused, Transform, transform_of
from .bake import POINT_ATTRIBUTES
from .fewer_keys import count_of, united
from .motions import BodyMotion, continuous_values
from .originals import CLEANED, Originals

MAX_MOVE_PER_NOISE = 3.0
"""How far a point may be moved, as a multiple of its jitter: noise hardly ever exceeds this."""

MIN_NOISE_KEYS, MAX_KEY_SPACING_FRAMES = DIFFERENCE_ORDERS[-1] + 2, 2.0
"""The fewest keys from which jitter can be measured, and the largest number of frames between them."""

TRANSITION_KEYS = 8
"""The number of keys over which cleaned keys blend into uncleaned ones."""

MAX_DRAW_BACK_ROUNDS = 24
"""Rounds of pulling back all keys of a frame on which a point moved too far: in the second half completely."""

USED_TOLERANCE_RATIO = 0.999
"""The fraction of the tolerance that is used, as keys are rounded."""

_LOOKS = Looks()
"""Cached results, for while a slider is dragged."""

TOO_FEW = n_(
    "{name} has {count} keys of location and rotation: at least {least} are needed to distinguish jitter from motion"
)
NO_KEY_SELECTED = n_("{name}: no key of location, rotation or scale is selected")


class Cleaning(NamedTuple):
    """The result of cleaning an object, or all bones of a rig together."""

    transforms: Sequence[Transform]
    jitter: float
    """The root mean square jitter of any point within the radius; for a rig, of the point with the most jitter."""

    moved: float
    """The largest distance that any point moved, not counting spikes."""

    spikes: int
    """The number of keys that were off for a moment. Now they follow the motion around them."""

    repeats: int
    """The number of keys that repeated the one before while the motion went on."""

    alone: float
    """The fraction of keys left as they are, because motion cannot be told from noise there."""

    contacts: tuple[int, float, float] | None
    """The number of times bones stand, and the largest slide there, now and before; None if the object is no rig."""

    before: np.ndarray
    """The world position of each transform on each key before, shape (t, m, 3): for a bone its tail, for a camera that
    only turns a point it looks at."""

    after: np.ndarray
    bridged: np.ndarray
    """True for spikes and repeats, shape (t, m)."""


Planned = tuple[Binding, KeyedTransform, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""The planned keys of a slot: its binding and source, their frames (m,) now and afterwards (m,), their components
(10, m), and which keys were bridged (m,).
"""


def clean_motion(
    targets: Targets,
    strength: float = MAX_MOVE_PER_NOISE,
    radius: float | None = None,
    *,
    nearest: float | None = None,
    selected: bool = False,
    select_spikes: bool = True,
    refused: list[Refused] | None = None,
) -> list[Cleaning]:
    """Remove jitter and spikes from dense keys. Handles and all else of the keys stay.

    Bones of one rig are cleaned together, each in the space of its parent. Scale stays as it is. The keys from before
    are kept, for `restore_keys`.

    Parameters
    ----------
    targets, refused
        See `edits.apply`.
    strength : float
        How far any point within the radius may be moved, as a multiple of its jitter; spikes do not count. For bones
        this holds in the rig's space and for all their children. Bones that stand slide no further than before, or than
        a quarter of that distance.
    radius : float, optional
        In the scene's units. The default is the reach of each target.
    nearest : float, optional
        The radius for cameras: the distance of the nearest thing they look at. The default is the focus distance.
    selected : bool
        Clean only from the first to the last selected key. Cleaned keys blend into the others.
    select_spikes : bool
        Select the keys that were spikes or repeats, and no others, if there were any.

    Returns
    -------
    list of Cleaning
        One for each object, or rig, that did not refuse.
    """
    if not 0.0 < strength < math.inf:
        text = n_("the strength must be above 0, not {strength:g}")
        raise Refused(text, strength=strength)
    _LOOKS.turn_over()
    found: list[Cleaning] = []
    originals = Originals(CLEANED)

    def plan(readings: Mapping[Transform, Readings]) -> dict[Transform, list[Planned] | Refused]:
        plans: dict[Transform, list[Planned] | Refused] = {}
        together: dict[tuple, dict[Transform, tuple[Binding, KeyedTransform]]] = {}
        for transform, reading in readings.items():
            plans[transform] = []
            try:
                for binding, source in readable(transform, reading):
                    _check(transform, binding, source)
                    together.setdefault((transform.animated, *binding.slot.key), {})[transform] = binding, source
            except Refused as refusal:
                plans[transform] = refusal
        for (obj, *_), members in together.items():
            around = (nearest or focus_of(obj)) if obj.type == "CAMERA" else radius
            try:
                cleaning, planned = _plan_cleaning(obj, members, strength, around, selected=selected)
            except Refused as refusal:
                plans.update(dict.fromkeys(members, refusal))
                continue
            found.append(cleaning)
            for transform, one in planned.items():
                if isinstance(of_slots := plans[transform], list):
                    of_slots.append(one)
        few = {"count": 0, "least": MIN_NOISE_KEYS}
        return {transform: one or Refused(TOO_FEW, name=transform.name, **few) for transform, one in plans.items()}

    def act(transform: Transform, planned: list[Planned]) -> None:
        for one in planned:
            if originals.keep(one[0]):
                _write(transform, *one, select=select_spikes and any(cleaning.bridged.any() for cleaning in found))

    done = apply_together(targets, plan, act, refused)
    return [cleaning for cleaning in found if not done.keys().isdisjoint(cleaning.transforms)]


def focus_of(camera: Any) -> float:
    """Return the focus distance of a camera object."""
    dof = camera.data.dof
    if dof.focus_object is None:
        return dof.focus_distance
    return (dof.focus_object.matrix_world.translation - camera.matrix_world.translation).length


def pixels_of(camera: Any, nearest: float) -> float:
    """Return how many pixels anything in a camera object's picture moves, at most, for each unit of length that a point
    at the distance `nearest` moves.
    """
    scene: Any = bpy.context.scene
    corners = np.array(camera.data.view_frame(scene=scene))
    pixels = scene.render.resolution_x * scene.render.resolution_percentage / 100.0 / np.ptp(corners[:, 0])
    if camera.data.type == "ORTHO":
        return float(pixels)
    depth = abs(corners[0, 2])
    # A rotation moves the corners of the picture more than its center.
    return float(pixels * depth / nearest * (1.0 + (corners[:, :2] ** 2).sum(axis=1).max() / depth**2))


def _check(transform: Transform, binding: Binding, source: KeyedTransform) -> None:
    """Raise `Refused` if the keys are not dense, or anything besides the keys moves the transform."""
    if source.held is not None:
        raise Refused(n_("{name} is held: Bake to World first, and clean that"), name=transform.name)
    refuse_linked(transform, binding)
    refuse_modified(transform.name, binding)
    refuse_drivers(transform, binding, source.driven)
    count = count_of(source)
    if count < MIN_NOISE_KEYS:
        raise Refused(TOO_FEW, name=transform.name, count=count, least=MIN_NOISE_KEYS)
    if (step := float(np.median(np.diff(source.keyed_frames)))) > MAX_KEY_SPACING_FRAMES:
        text = n_("{name} has keys {step:g} frames apart: only keys on every frame can be cleaned")
        raise Refused(text, name=transform.name, step=step)


def _plan_cleaning(
    obj: bpy.types.Object,
    members: Mapping[Transform, tuple[Binding, KeyedTransform]],
    strength: float,
    radius: float | None,
    *,
    selected: bool,
) -> tuple[Cleaning, dict[Transform, Planned]]:
    """Return the result for all that one slot of an object moves, and their planned keys."""
    bones = cast(Any, obj.pose).bones if any(transform.is_part for transform in members) else ()
    joints = [transform_of(obj), *map(transform_of, bones)]
    sources = {number: members[joint][1] for number, joint in enumerate(joints) if joint in members}
    frames = united(source.keyed_frames for source in sources.values())
    inside = (
        _correction_shares(obj, frames, [binding for binding, _ in members.values()])
        if selected
        else np.ones(len(frames))
    )
    motion = BodyMotion(joints, next(iter(members.values()))[0].slot, sources, frames, radius)
    parents, poses, _ = motion.as_chains()
    stands, render = np.zeros((len(joints), len(frames)), dtype=bool), scene().render
    if bones:
        stands[1:] = standing(frames * render.fps_base / render.fps, motion.truth.origins[1:], shaky=True)
    # The object, targets and standing bones, and all their parents. Everything that is no target is at rest.
    wanted = *sources, *np.flatnonzero(stands.any(axis=1)).tolist()
    taking = np.array(sorted({0, *(above for number in wanted for above in motion.above(number))}))
    chain, resting = poses[taking], np.array([number not in sources for number in taking.tolist()])
    positions, quaternions = chain.positions.copy(), chain.quaternions.copy()
    positions[resting], quaternions[resting] = positions[resting, :1], quaternions[resting, :1]
    chain = Poses(positions, quaternions, chain.scales)
    skeleton = Skeleton(np.where(parents[taking] < 0, -1, np.searchsorted(taking, parents[taking])))
    reaches = np.array([motion.reach(number) for number in taking.tolist()])
    floor = _noise_floor(frames, chain, reaches, skeleton)
    radii = np.where((skeleton.sizes > 1) & (motion.radii[taking] > 0.0), motion.radii[taking], reaches)
    if floor * motion.unit <= motion.rounding:
        floor = 0.0
    tolerance = strength * floor * motion.unit
    within = USED_TOLERANCE_RATIO**2 * tolerance / motion.unit or None
    result = clean(frames, chain, within, radii, skeleton, _LOOKS, stands[taking])
    out = result.spikes | result.repeats
    bridged = np.zeros((len(joints), len(frames)), dtype=bool)
    bridged[taking] = out & (inside > 0.0)
    if not floor and not bridged.any():
        raise Refused(n_("{name} has no jitter: there is nothing to clean"), name=obj.name)
    corrections = {}
    for at, number in enumerate(taking.tolist()):
        if number in sources:
            # From the parent's axes to the axes of the channels.
            axes = multiply(motion.poses[number].quaternions[0], conjugate(poses.quaternions[number, 0]))
            size = 1.0 if number else float(cast(np.ndarray, motion.poses[0].scales)[0]) or 1.0
            slides = size * rotate(axes, result.poses.positions[at] - chain.positions[at])
            corrections[number] = slides, turns_between(chain.quaternions[at], result.poses.quaternions[at])
    start = {number: _values(joints[number], source, frames) for number, source in sources.items()}
    hangs, moving = bridged.copy(), np.isin(np.arange(len(joints)), list(sources))
    for own in Skeleton(motion.parents).levels[1:]:
        hangs[own] |= hangs[motion.parents[own]]
        moving[own] |= moving[motion.parents[own]]
    stands &= ~hangs & moving[:, None]
    allowed, share = USED_TOLERANCE_RATIO * tolerance, inside
    for left in range(MAX_DRAW_BACK_ROUNDS, -1, -1):
        shares = {number: np.where(bridged[number], 1.0, share)[:, None] for number in sources}
        rows = {
            number: _corrected(joints[number], sources[number], start[number], shares[number], *corrections[number])
            for number in sources
        }
        motion.show_values(rows)
        off = np.where(hangs, 0.0, motion.displacements())
        slid = slide_ratios(motion.now().origins, motion.truth.origins, stands, SLIDE_RATIO * allowed)
        over = np.maximum(slid.max(axis=0), off.max(axis=0) / (allowed or math.inf))
        if (over <= 1.0).all():
            break
        drawn = share * USED_TOLERANCE_RATIO / np.maximum(over, 1.0) * (left > MAX_DRAW_BACK_ROUNDS // 2)
        share = np.where(over > 1.0, drawn, share)
    numbers = list(sources)
    world = np.array(channel_space(joints[0], bpy.context.evaluated_depsgraph_get()).translation)
    # Rotation alone shows at the tail of a bone, and where a camera looks.
    turns_alone = np.ptp(motion.truth.origins[0], axis=0).max() < tolerance
    ends = np.array([_tracked_point(joints[number], turns_alone * float(motion.radii[number])) for number in numbers])
    before, after = (maps[numbers].at(ends[:, None]) + world for maps in (motion.truth, motion.now()))
    at_targets, of_targets = ~resting, inside > 0.0
    now, then = (slide(maps.origins, stands) for maps in (motion.now(), motion.truth))
    cleaning = Cleaning(
        [joints[number] for number in numbers],
        floor * motion.unit,
        float(off.max()),
        int((result.spikes[at_targets] & of_targets).sum()),
        int((result.repeats[at_targets] & of_targets).sum()),
        float(result.alone[at_targets].mean()),
        (len(spans(stands & of_targets)), now, then) if bones else None,
        before,
        after,
        bridged[numbers],
    )
    moved = frames + inside * (result.times - frames)
    return cleaning, {
        joints[number]: (*members[joints[number]], frames, moved, rows[number], bridged[number]) for number in numbers
    }


def _tracked_point(transform: Transform, reach: float) -> tuple[float, float, float]:
    carrier: Any = transform.carrier
    if transform.is_part:
        return 0.0, carrier.bone.length, 0.0
    return 0.0, 0.0, -reach if carrier.type == "CAMERA" else 0.0


def _correction_shares(obj: bpy.types.Object, frames: np.ndarray, bindings: Sequence[Binding]) -> np.ndarray:
    """Return the fractions (m,) of corrections to apply: rising to 1 within the range of selected keys, 0 outside."""
    selected = united(frames_in(binding, selected=True) for binding in bindings)
    if not len(selected):
        raise Refused(NO_KEY_SELECTED, name=obj.name)
    first, last = np.searchsorted(frames, selected[[0, -1]] - SAME_FRAME)
    rows, width = np.arange(len(frames)), min(TRANSITION_KEYS, (last - first) / 2.0 + 1e-9)
    begins = (rows - first) / width if first else np.ones(len(frames))
    ends = (last - rows) / width if last < len(frames) - 1 else np.ones(len(frames))
    part = np.clip(np.minimum(begins, ends), 0.0, 1.0)
    return part**2 * (3.0 - 2.0 * part)


def _noise_floor(frames: np.ndarray, poses: Poses, reaches: np.ndarray, skeleton: Skeleton) -> float:
    """Return the root mean square jitter of the point with the most jitter, of joints with these reaches."""
    noises = [jitter(frames, poses[joint])[:2] for joint in range(len(skeleton))]
    squares = np.array(
        [(math.sqrt(3.0) * p + math.sqrt(2.0) * r * reach) ** 2 for (p, r), reach in zip(noises, reaches, strict=True)]
    )
    for own in skeleton.levels[1:]:
        squares[own] += squares[skeleton.parents[own]]
    return math.sqrt(squares.max())


def _values(transform: Transform, source: KeyedTransform, frames: np.ndarray) -> np.ndarray:
    """Return the components (10, m) of a transform on frames (m,). Components without keys are as they are now."""
    rows, rest = continuous_values(source, frames), transform.components()
    for part in ROWS.keys() - source.keyed:
        rows[ROWS[part]] = rest[ROWS[part], None]
    return rows


def _corrected(
    transform: Transform,
    source: KeyedTransform,
    start: np.ndarray,
    share: np.ndarray,
    slides: np.ndarray,
    turns: np.ndarray,
) -> np.ndarray:
    """Return components (10, m) with a fraction (m, 1) of the corrections applied: slides and rotation vectors (m, 3)
    in the axes of the transform.
    """
    rows, along = start.copy(), transform.location_axes
    rows[ROWS[LOCATION]] += (share * (slides if along is None else slides @ along)).T
    turn_into_quaternions(quaternions := start.copy(), transform.order)
    turned_on = turned(quaternions[ROWS[ROTATION]].T, share * turns)
    rows[ROWS[ROTATION]] = rotation_values(turned_on, start[ROWS[ROTATION], 0], transform.order)
    fixed = [row for row in range(10) if not any(row in keyed for keyed, _ in source.channels)]
    rows[fixed] = start[fixed]
    return np.where(share[:, 0] > 0.0, rows, start)


def _write(
    transform: Transform,
    binding: Binding,
    source: KeyedTransform,
    frames: np.ndarray,
    moved: np.ndarray,
    values: np.ndarray,
    bridged: np.ndarray,
    *,
    select: bool,
) -> None:
    """Move the keys of location and rotation to their new frames and values, with their handles."""
    for row in (row for rows, _ in source.channels for row in rows if PART_OF[row] != SCALE):
        fcurve = binding.curves[transform.channels[row]]
        fields = key_fields(fcurve.keyframe_points)
        at = np.searchsorted(frames, fields["co"][:, 0] - SAME_FRAME)
        by = np.stack((moved[at] - frames[at], values[row, at] - fields["co"][:, 1]), axis=1)
        for name in POINT_ATTRIBUTES:
            fields[name] += by.astype(np.float32)
        for name in ("select_control_point", "select_left_handle", "select_right_handle") if select else ():
            fields[name][:, 0] = bridged[at]
        set_key_fields(fcurve, fields)
