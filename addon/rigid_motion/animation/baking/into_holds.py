"""Holds found in recordings: dense world-space keys of a prop reduced to a few keys in the hands that held it.

A prop is held where it is at rest relative to a hand, but not in the world. There one key replaces its keys: the grip
with the smallest maximum error. Keys outside of holds stay. Frames are those of the Action, lengths the scene's units.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion.quaternions import matrices
from ..actions.channels import key_fields, key_points, merged_keys, new_key_fields, set_key_fields
from ..actions.marks import hold, read_marks, write_holds, write_marks
from ..actions.refusals import refuse_drivers, refuse_linked, refuse_modified, refuse_tolerance
from ..actions.slots import Binding
from ..edits.apply import Readings, Target, apply_edit, readable
from ..edits.holding import DEFAULT_MODE
from ..evaluation.components import LOCATION, MODE_NUMBERS, PART_OF, ROTATION, ROWS, SCALE
from ..evaluation.differences import seen_values
from ..evaluation.marks import near
from ..evaluation.sources import SAME_FRAME, KeyedTransform, distinct
from ..fcurves.keys import CONSTANT, LINEAR
from ..holds.dependencies import Node, follows, node_of
from ..holds.holders import add_holder, holders_of
from ..holds.placing import poses_of, rows_of
from ..holds.problems import refuse_motion
from ..queries.keyed import frames_in
from ..transforms import Refused, Transform
from ..transforms.sizes import radius_of
from .fewer_keys import count_of, samples_of
from .originals import REDUCED, Originals
from .reducing import Reduction, channel_keys
from .resting import BodyPoses, RestStretch, relative
from .worlds import alone_in, worlds_of

DEFAULT_MIN_HOLD_FRAMES = 5
"""The default for the fewest frames of a hold."""

DEFAULT_HAND_TOLERANCE = 0.005
"""The default tolerance, in the scene's units: recorded hands are not rigid."""

MIN_MOVE_PER_TOLERANCE = 4.0
"""The least motion of a held prop in the world, as a multiple of the tolerance and of its own error."""

MAX_GROWTH_RATIO = 1e-3
"""The largest change of size, as a fraction of the size, at which a thing still counts as rigid."""

NOTHING_HELD = n_(
    "{name} is at rest in none of {count} bones and objects for {least} frames, to {tolerance:g}: allow a larger "
    "tolerance, or select what holds it"
)
NO_HANDS = n_("There is nothing that could hold {name}: select objects or rigs, too")
SPARSE_REFUSAL = n_(
    "{name} has distant keys around frame {frame:g}, whose in-betweens would change: bake them first (Bake to Keys)"
)
NO_KEYS = n_("{name} has no keys of location or rotation to reduce: bake its motion first (Object > Animation)")
SCALE_REFUSAL = n_("{name} grows or shrinks, but held things have a constant size: remove the keys of its scale first")

Offer = tuple[Node, RestStretch, float]
"""A possible holder, the stretch on which the prop rests in it, and its distance."""

Holders = Iterable[bpy.types.Object | bpy.types.PoseBone]


@dataclass(frozen=True)
class HeldSegment:
    """Frames on which a prop is at rest in a holder."""

    holder: bpy.types.Object
    bone: str
    """The name of the holder's bone that holds the prop, "" for the holder itself."""

    first: float
    last: float

    largest: float
    """The largest error of a constant grip, in the scene's units."""

    keys_before: int
    """The number of these frames on which the prop has keys."""

    grip: np.ndarray = field(repr=False, compare=False)
    """The prop's matrix in the space of the holder, with the scales of both, shape (4, 4)."""

    @property
    def name(self) -> str:
        """The name of the holding bone or object."""
        return self.bone or self.holder.name


def held_segments(
    prop: Target,
    holders: Holders | None = None,
    tolerance: float = DEFAULT_HAND_TOLERANCE,
    radius: float | None = None,
    *,
    least: int = DEFAULT_MIN_HOLD_FRAMES,
) -> list[HeldSegment]:
    """Return the segments on which a prop was held, according to its keys: the longest and tightest first.

    Segments do not overlap. Frames before and after on which the prop also rests in the space of its channels do not
    count as held.

    Parameters
    ----------
    prop
        An object or a pose bone with keys.
    holders : iterable, optional
        Objects and pose bones; a rig stands for all its bones. The default is all rigs of the scene. Anything that
        follows the prop is ignored.
    tolerance : float
        The largest shell error on any frame, in the scene's units.
    radius : float, optional
        The radius of the shell. The default is `radius_of` the prop.
    least : int
        The fewest frames of a segment.

    Raises
    ------
    Refused
        If the prop has no keys, or anything besides its keys moves it.
    """
    found: list[HeldSegment] = []

    def survey(transform: Transform, readings: Readings) -> None:
        found.extend(_find_segments(transform, readings, holders, tolerance, radius, least))

    apply_edit(prop, survey, lambda *_: None, None)
    return found


def reduce_into_holds(
    prop: Target,
    holders: Holders | None = None,
    tolerance: float = DEFAULT_HAND_TOLERANCE,
    radius: float | None = None,
    *,
    least: int = DEFAULT_MIN_HOLD_FRAMES,
    segments: Sequence[HeldSegment] | None = None,
) -> list[HeldSegment]:
    """Hold a prop where its keys show that it was held, with one key for each hold, and return the segments.

    `segments` are the chosen results of `held_segments`, by default all of them; for all else see there. `restore_keys`
    restores all keys.
    """
    originals = Originals(REDUCED)

    def plan(transform: Transform, readings: Readings) -> tuple[Binding, KeyedTransform, list[HeldSegment]]:
        found = segments
        if found is None:
            found = _find_segments(transform, readings, holders, tolerance, radius, least)
        if not found:
            count = len(_possible_holders(transform, holders))
            raise Refused(NOTHING_HELD, name=transform.name, count=count, least=least, tolerance=tolerance)
        binding, source = _keyed(transform, readings)
        refuse_linked(transform, binding)
        chosen = sorted(found, key=lambda segment: segment.first)
        _refuse_sparse(transform, source, chosen)
        return binding, source, chosen

    def act(transform: Transform, planned: tuple[Binding, KeyedTransform, list[HeldSegment]]) -> list[HeldSegment]:
        _hold(transform, *planned, originals)
        return planned[2]

    (done,) = apply_edit(prop, plan, act, None).values()
    return done


def _keyed(transform: Transform, readings: Readings) -> tuple[Binding, KeyedTransform]:
    """Return the binding and the source that move a prop. Raise `Refused` if holds cannot follow from its keys."""
    keyed = [(binding, source) for binding, source in readable(transform, readings) if source.channels]
    if not any({LOCATION, ROTATION} & source.keyed for _, source in keyed):
        raise Refused(NO_KEYS, name=transform.name)
    binding = alone_in(transform, [binding for binding, _ in keyed])
    source = keyed[0][1]
    refuse_motion(transform, source)
    refuse_modified(transform.name, binding)
    refuse_drivers(transform, binding, source.driven)
    return binding, source


def _possible_holders(transform: Transform, holders: Holders | None) -> list[Node]:
    """Return the possible holders of a prop, each once."""
    if holders is None:
        scene = cast(bpy.types.Scene, bpy.context.scene)
        holders = [obj for obj in scene.objects if obj.type == "ARMATURE"]
    result: dict[Node, None] = {}
    for holder in holders:
        if isinstance(holder, bpy.types.PoseBone):
            result[cast(bpy.types.Object, holder.id_data), holder.name] = None
        elif holder.pose is not None and len(holder.pose.bones):
            result |= dict.fromkeys((holder, bone.name) for bone in holder.pose.bones)
        else:
            result[holder, ""] = None
    own = node_of(transform)
    return [node for node in result if node != own and not follows(node, own)]


def _find_segments(
    transform: Transform,
    readings: Readings,
    holders: Holders | None,
    tolerance: float,
    radius: float | None,
    least: int,
) -> list[HeldSegment]:
    """Return `held_segments` of a transform with these readings."""
    refuse_tolerance(tolerance)
    binding, source = _keyed(transform, readings)
    nodes = _possible_holders(transform, holders)
    if not nodes:
        raise Refused(NO_HANDS, name=transform.name)
    frames, radius = samples_of(source), radius or radius_of(transform.carrier)
    worlds = worlds_of(transform, nodes, frames)
    prop, sizes = poses_of(worlds.prop)
    if np.ptp(sizes, axis=0).max() > MAX_GROWTH_RATIO * np.abs(sizes).max():
        raise Refused(SCALE_REFUSAL, name=transform.name)
    # The space of the channels: where the prop would be with all of them at rest.
    own = BodyPoses(relative(poses_of(worlds.prop @ np.linalg.inv(worlds.local))[0], prop), radius)
    free = _free(source, frames)
    # If the visible range extends beyond the keys, the prop rests there.
    free[[0, -1]] &= binding.slot.seen[0] >= frames[0], binding.slot.seen[1] <= frames[-1]
    lies, anyway = own.rests(tolerance, free, least), own.reached(tolerance, free)
    offers: list[Offer] = []
    scales: dict[Node, np.ndarray] = {}
    for node, places in zip(nodes, worlds.nodes, strict=True):
        holder, growth = poses_of(places)
        # A prop held by a growing bone would grow with it.
        if np.ptp(growth, axis=0).max() > MAX_GROWTH_RATIO * np.abs(growth).max():
            continue
        there = BodyPoses(relative(holder, prop), radius)
        for whole in there.rests(tolerance, free, least, anyway):
            rest = _without(whole, lies)
            distance = max(tolerance, rest.largest) * MIN_MOVE_PER_TOLERANCE
            if rest.frames >= least and own.moves(rest, distance):
                offers.append((node, rest, float(np.linalg.norm(rest.pose.positions))))
                scales[node] = growth[0]
    keys = distinct(source.keyed_frames)
    return [
        _segment(node, rest, frames, keys, (sizes[0], scales[node]))
        for node, rest in _best_offers(offers, tolerance, least)
    ]


def _free(source: KeyedTransform, frames: np.ndarray) -> np.ndarray:
    """Return True for the frames (m,) on which nothing holds the prop and it is not passing to another holder."""
    free = np.ones(len(frames), dtype=bool)
    for run in source.runs:
        if source.hold_at(run.stretch.first)[0]:
            free &= ~((frames > run.stretch.first - SAME_FRAME) & (frames < run.stretch.until - SAME_FRAME))
    for switch in source.switches:
        free &= ~((frames > switch.begin - SAME_FRAME) & (frames < switch.frame - SAME_FRAME))
    return free


def _without(rest: RestStretch, others: Iterable[RestStretch]) -> RestStretch:
    """Return a rest without the parts at its ends that lie in other rests."""
    first, last = rest.first, rest.last
    for other in sorted(others):
        if other.first <= first <= other.last:
            first = other.last + 1
    for other in sorted(others, reverse=True):
        if other.first <= last <= other.last:
            last = other.first - 1
    return rest._replace(first=first, last=last)


def _best_offers(offers: list[Offer], tolerance: float, least: int) -> Iterator[tuple[Node, RestStretch]]:
    """Yield the best offers that do not overlap, as nodes and rests.

    The longest and tightest offer is the best: no error at all is worth twice the length. Among equal offers, as from
    bones that do not move relative to each other, the nearest is the best, and among similarly near ones the first.
    """

    def quality(offer: Offer) -> tuple[float, float]:
        _, rest, away = offer
        return rest.frames * (2.0 - round(20.0 * rest.largest / tolerance) / 20.0), -round(math.log2(away + tolerance))

    while offers:
        node, best, _ = max(offers, key=quality)
        yield node, best
        cut = [(other, _longer_remainder(rest, best), away) for other, rest, away in offers]
        offers = [offer for offer in cut if offer[1].frames >= least]


def _longer_remainder(rest: RestStretch, taken: RestStretch) -> RestStretch:
    """Return the longer of the two parts of a rest that are outside of another rest."""
    before = rest._replace(last=min(rest.last, taken.first - 1))
    after = rest._replace(first=max(rest.first, taken.last + 1))
    return max(before, after, key=lambda part: part.frames)


def _segment(
    node: Node, rest: RestStretch, frames: np.ndarray, keys: np.ndarray, scales: tuple[np.ndarray, np.ndarray]
) -> HeldSegment:
    """Return the segment for a rest. Scales (3,) are those of the prop and the holder in the world."""
    first, last = frames[[rest.first, rest.last]].tolist()
    inside = int(np.count_nonzero((keys > first - SAME_FRAME) & (keys < last + SAME_FRAME)))
    grip, (own, holder) = np.eye(4), scales
    grip[:3, :3], grip[:3, 3] = matrices(rest.pose.quaternions) * own, rest.pose.positions
    grip[:3] /= np.where(holder == 0.0, 1.0, holder)[:, None]
    return HeldSegment(*node, first, last, rest.largest, inside, grip)


def _refuse_sparse(transform: Transform, source: KeyedTransform, segments: Iterable[HeldSegment]) -> None:
    """Raise `Refused` if in-betweens that are not straight lines depend on keys to be removed."""
    keys, frames = source.key_frames, samples_of(source)
    shaped = (source.modes != 0) | np.array([_is_shaped(source, frame) for frame in keys[:-1].tolist()], dtype=bool)
    shaped &= (np.diff(keys) > 1.0 + SAME_FRAME) & _free(source, keys[:-1])
    for segment in segments:
        behind = np.append(frames, np.inf)[np.searchsorted(frames, segment.last + SAME_FRAME)]
        first, until = np.searchsorted(keys, np.array((segment.first, behind)) - SAME_FRAME).tolist()
        # The gap at each end of the hold, and the gap next to it, whose tangent changes.
        for place in (first - 2, first - 1, until - 1, until):
            if 0 <= place < len(shaped) and shaped[place]:
                raise Refused(SPARSE_REFUSAL, name=transform.name, frame=keys[place])


def _is_shaped(source: KeyedTransform, frame: float) -> bool:
    """Return whether any interpolation from a key is neither linear nor constant."""
    return any(
        not np.isin(keys.interpolation[:, place], (LINEAR, CONSTANT)).all()
        for keys in source.curves
        if (place := int(np.searchsorted(keys.times, frame + SAME_FRAME)) - 1) >= 0
    )


class _Switches:
    """The k successive holds of a prop: their frames and their new holders."""

    def __init__(self, source: KeyedTransform, segments: Sequence[HeldSegment], numbers: Sequence[int]) -> None:
        frames = samples_of(source)
        self.source, self.holds = source, np.array([hold(number) for number in numbers])
        self.begins = np.array([segment.first for segment in segments])
        behind = np.searchsorted(frames, [segment.last + SAME_FRAME for segment in segments])
        self.untils = np.append(frames, np.inf)[behind]
        """The frames from which on the prop is no longer held, shape (k,)."""
        before = frames[np.clip(np.searchsorted(frames, self.begins - SAME_FRAME) - 1, 0, None)]
        before = before[before < self.begins - SAME_FRAME]
        self.rests = before[~self.are_held(before)]
        """The last frames before holds begin, from which on the prop rests."""
        self.resumes = self.untils[np.isfinite(self.untils) & ~self.are_held(self.untils)]
        """The frames on which the prop is free again."""

    def are_held(self, frames: np.ndarray) -> np.ndarray:
        """Return True for the frames (m,) on which the prop is held."""
        after = frames[:, None]
        return ((after > self.begins - SAME_FRAME) & (after < self.untils - SAME_FRAME)).any(axis=1)

    def holds_on(self, frames: np.ndarray) -> np.ndarray:
        """Return the hold codes for keys on these frames (m,): see `marks.hold`."""
        source = self.source
        old = np.zeros(len(frames), int) if source.held is None else source.held.at(frames + 0.5 * SAME_FRAME)
        old[near(frames, self.resumes)] = hold(0)
        place = np.searchsorted(self.begins, frames + SAME_FRAME) - 1
        return np.where(self.are_held(frames), self.holds[np.clip(place, 0, None)], old)


def _hold(
    transform: Transform, binding: Binding, source: KeyedTransform, segments: list[HeldSegment], originals: Originals
) -> None:
    """Hold a prop in these segments, which are in order: a key where each begins, and one after it."""
    notes, before = originals.keep(binding), channel_keys(binding)
    numbers = [add_holder(binding, segment.holder, segment.bone) for segment in segments]
    switches, rest = _Switches(source, segments, numbers), transform.components()
    offsets = {holder.number: np.array(holder.offset) for holder in holders_of(transform)}
    grips = [np.linalg.inv(offsets[number]) @ one.grip for number, one in zip(numbers, segments, strict=True)]
    rows = rows_of(*poses_of(np.stack(grips)), transform, rest)
    outside = np.union1d(switches.rests, switches.resumes)
    seen = seen_values(source, outside) if len(outside) else np.empty((10, 0))
    scales = SCALE in source.keyed or not np.allclose(rows[ROWS[SCALE], 0], rest[ROWS[SCALE]], rtol=1e-4)
    group = next((fcurve.group for fcurve in binding.curves.values() if fcurve.group is not None), None)
    for row, channel in transform.channels.items():
        if PART_OF[row] == SCALE and not scales:
            continue
        fcurve = binding.ensure_curve(channel)
        if fcurve.group is None and group is not None:
            fcurve.group = group
        fields = key_fields(fcurve.keyframe_points)
        left = ~switches.are_held(fields["co"][:, 0].astype(float))
        fields = {name: numbers[left] for name, numbers in fields.items()}
        lacking = ~near(outside, fields["co"][:, 0])
        fields = merged_keys(fields, new_key_fields(outside[lacking], seen[row, lacking], "LINEAR", "GENERATED"))
        fields["interpolation"][near(fields["co"][:, 0], switches.rests)] = CONSTANT
        fields = merged_keys(fields, new_key_fields(switches.begins, rows[row], "CONSTANT"))
        set_key_fields(fcurve, fields)
    for fcurve in binding.keyed:
        frames, marks = key_points(fcurve)[:, 0].astype(float), read_marks(fcurve)
        marks = np.where(marks, marks, MODE_NUMBERS["BLENDER"] + 1)
        write_marks(fcurve, np.where(switches.are_held(frames), MODE_NUMBERS[DEFAULT_MODE] + 1, marks))
        write_holds(fcurve, switches.holds_on(frames))
    reduction = Reduction(
        count_of(source),
        len(frames_in(binding)),
        max(segment.largest for segment in segments),
        channel_keys=(before, channel_keys(binding)),
        held=[(segment.name, segment.first, segment.last, segment.keys_before) for segment in segments],
    )
    for note in notes:
        note.reduction = json.dumps(asdict(reduction))
