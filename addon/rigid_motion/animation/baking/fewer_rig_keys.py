"""Which keys the bones of a rig can do without: one plan for all of them, since what moves one moves all below it.

Keys are searched for in the rig as if it were rigid, and proven in what Blender makes of them: the tolerance is kept
at every bone, whether it gets fewer keys itself or only hangs on one that does, with the keys of the rig itself where
these are reduced along with them. Poses are those that the channels give, without constraints and drivers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion import Poses, Skeleton, reduce_skeleton_keys, shell_error
from ...motion.contacts import slide, standing
from ...motion.poses import placed
from ...motion.quaternions import align_signs
from ..actions.refusals import refuse_modified
from ..actions.slots import Binding
from ..edits.apply import Readings, readable
from ..evaluation.sources import SAME_FRAME, Source, distinct
from ..transforms import Refused, Transform, transform_of
from ..transforms.sizes import scale_in_scene
from .fewer_keys import (
    FewerKeys,
    NeedsItsKeys,
    WholeRig,
    count_of,
    fewer_keys,
    goes_elsewhere,
    samples_of,
    seen_frames,
    values_on,
    with_best_modes,
    with_keys,
)
from .motions import SMALLEST, RigMotion, not_promised, shown
from .proof import Proof

NO_FEWER = n_(
    "{name}: its bones need their keys on all of {frames} frames to stay within the tolerance: allow a larger one"
)
NOT_SO_MANY = n_("{name}: its bones have keys on {frames} frames: ask for fewer key poses")
NO_FEWER_POSES = n_(
    "{name}: its bones need their keys on all of {frames} frames to stay within the tolerance: "
    "allow a larger one, or give each bone keys of its own"
)

HOLD = 4.0
"""The weight of the error of what stands on the ground."""

APART = 4
"""Frames between places that are mended at once."""

SHARE = 0.5
"""The part of the tolerance for the bones that the keys of the rig itself may take."""

LEAST_SCALE = 1e-6
"""The scale that the search takes for one of zero."""

Plans = dict[Transform, "list[FewerKeys] | Refused"]
"""The keys that bones, and rigs with keys, are to have in each slot that moves them; or why they cannot."""

_Members = dict[Transform, tuple[Binding, Source]]


def fewer_keys_of_rigs(
    readings: Mapping[Transform, Readings],
    mode: str,
    tolerance: float,
    radius: float | None,
    *,
    shared: bool,
    hold: bool,
    best_of: bool,
    count: int | None = None,
) -> Plans:
    """Return plans for all bones among the targets, those together that one slot of a rig moves,
    and the rig along with them.

    Lengths are the scene's units. With a count there are so many key poses, whatever the tolerance.
    """
    together: dict[tuple[bpy.types.Object, bpy.types.Action, int], _Members] = {}
    for transform, reading in readings.items():
        if transform.animated.pose is None:
            continue
        try:
            keyed = readable(transform, reading)
            for binding, _ in keyed:
                refuse_modified(transform.name, binding)
        except Refused:
            continue  # Its own plan says so.
        for binding, source in keyed:
            if source.channels and not source.driven:
                together.setdefault((transform.animated, *binding.slot.key), {})[transform] = binding, source
    plans: Plans = {}
    for (obj, *_), members in together.items():
        own = members.pop(transform_of(obj), None)
        if not members:
            continue
        try:
            rig = _Rig(obj, members, tolerance if count is None else math.inf, radius, hold=hold)
            if count is not None:
                rig.find_key_poses(mode, count, None if own is None else own[1])
            if own is not None:
                of_object = plans.setdefault(transform_of(obj), [])
                of_object.append(rig.reduce_own_keys(transform_of(obj), *own, mode, best_of=best_of))
            fewer = rig.fewer_keys(mode, shared=shared, best_of=best_of)
        except ValueError as problem:
            text = n_("{name} cannot be reduced: {problem}")
            refusal = problem if isinstance(problem, Refused) else Refused(text, name=obj.name, problem=problem)
            plans.update(dict.fromkeys(members, refusal))
            continue
        if own is not None:
            # How far it is off counts at the bones, which is known by now.
            of_object[-1] = replace(of_object[-1], largest_error=next(iter(fewer.values())).rig.largest_error)
        for transform, plan in fewer.items():
            result = plans.setdefault(transform, [])
            if isinstance(result, list):
                result.append(plan)
    return plans


class _Rig:
    """The bones of a rig as one slot moves them: those that are to have fewer keys, and all others as they are."""

    def __init__(
        self, rig: bpy.types.Object, members: _Members, tolerance: float, radius: float | None, *, hold: bool
    ) -> None:
        self.rig, self.tolerance = rig, tolerance
        numbers = {bone.name: number for number, bone in enumerate(rig.pose.bones)}
        self.targets = {numbers[transform.carrier.name]: transform for transform in members}
        self.bindings = {number: members[transform][0] for number, transform in self.targets.items()}
        self.sources = {number: members[transform][1] for number, transform in self.targets.items()}
        self.before = {number: distinct(source.keyed_frames) for number, source in self.sources.items()}
        samples = _united(map(samples_of, self.sources.values()))
        self.frames = seen_frames(samples, list(self.sources.values()))
        self.sampled = np.isin(self.frames, samples)
        """True for the moments that keys may be on."""
        self.motion = RigMotion(rig, next(iter(self.bindings.values())).slot, self.sources, self.frames, radius)
        self.values = {
            number: values_on(self.targets[number], source, self.frames) for number, source in self.sources.items()
        }
        self.largest_own = 0.0
        self.key_poses: np.ndarray | None = None
        """The moments of the key poses, where so many of them were asked for."""
        render, truth = bpy.context.scene.render, self.motion.truth.origins
        self.stands = standing(self.frames * render.fps_base / render.fps, truth)
        """True for the bones that stand on the ground, at each moment."""
        self.weights = np.where(self.stands, HOLD, 1.0) if hold else np.ones(self.stands.shape)
        self.proof = Proof(self.motion, self.sources, self.weights)
        self._search_in()

    def _search_in(self) -> None:
        """Make the rig as the search has it: rigid, with even scale, in chains of bones that inherit all."""
        motion = self.motion
        for number, bone in enumerate(motion.bones):
            if motion.passes_zero(number):
                raise Refused(
                    n_(
                        "{name}: its scale passes zero, and with it the size of all that hangs on "
                        "it: reduce the bones above and below it apart from one another"
                    ),
                    name=f"{self.rig.name}/{bone.name}",
                )
        grows = any(np.abs(poses.scales - 1.0).max() > SMALLEST for poses in motion.poses)
        follows = [_follows(bone, grows) for bone in motion.bones]
        above = motion.hierarchy.parents
        self.skeleton = Skeleton(np.where(follows, above, -1))
        # The head of a bone that begins a chain still moves with its parent: each chain gets a part of the tolerance.
        chains = np.array([sum(not follows[item] for item in motion.above(number)) for number in range(len(above))])
        self.parts = np.sqrt(chains.max(initial=1))
        local = []
        for number, (bone, poses) in enumerate(zip(motion.bones, motion.poses, strict=True)):
            if bone.bone.use_connect and bone.parent:
                poses = replace(poses, positions=np.zeros_like(poses.positions))
            local.append(placed(_rest(motion, number, follows[number]), poses))
        self.poses = Poses(
            np.stack([poses.positions for poses in local]),
            align_signs(np.stack([poses.quaternions for poses in local])),
            np.maximum([poses.scales for poses in local], LEAST_SCALE) if grows else None,
        )

    def reduce_own_keys(
        self, transform: Transform, binding: Binding, source: Source, mode: str, *, best_of: bool
    ) -> FewerKeys:
        """Return fewer keys for the rig itself: on the key poses, or within a share of the tolerance at any bone."""
        if self.key_poses is not None:
            first, last = np.searchsorted(self.frames, distinct(source.keyed_frames)[[0, -1]] - SAME_FRAME)
            keys = np.union1d(np.clip(self.key_poses, first, last), (first, last))
            values = {row: column[keys] for row, column in values_on(transform, source, self.frames).items()}
            fewer = with_keys(source, self.frames[keys], values, mode)
            if count_of(fewer) >= count_of(source):
                fewer = source
            self.motion.carry(fewer)
            return FewerKeys(binding, source, fewer, 0.0)
        share = SHARE * self.tolerance / self.weights.max()
        reach = self.motion.extent * scale_in_scene(transform)
        plan = fewer_keys(transform, binding, source, mode, share, reach, best_of=best_of, more_frames=self.frames)
        if plan.after < plan.before:
            self.motion.carry(plan.fewer)
            self.largest_own = plan.largest_error
        return plan

    def find_key_poses(self, mode: str, count: int, of_rig: Source | None) -> None:
        """Find the best moments for so many key poses of all bones, and of the rig itself where it has keys."""
        fixed = self._fixed()
        poses, parents, radii, weights = self.poses, self.skeleton.parents, self.motion.radii, self.weights
        if of_rig is not None:
            # The bones hang on the rig as on one joint more, which counts by them alone.
            moved, _ = shown(transform_of(self.rig), of_rig, self.frames)
            scale = float(moved.scales[0]) or 1.0
            poses = Poses(
                np.concatenate((moved.positions[None] / scale, poses.positions)),
                np.concatenate((align_signs(moved.quaternions[None]), poses.quaternions)),
                None if poses.scales is None else np.concatenate((np.ones((1, len(self.frames))), poses.scales)),
            )
            parents = np.append(-1, np.where(parents < 0, 0, parents + 1))
            radii, fixed = np.append(0.0, radii), [False, *fixed]
            weights = np.vstack((np.zeros(len(self.frames)), weights))
        if not all(fixed):
            wishes = {"radius": radii, "fixed": fixed, "shared": True, "budget": count}
            self.key_poses = self._searched(poses, parents, mode, weights, **wishes)[fixed.index(False)]

    def _searched(
        self, poses: Poses, parents: np.ndarray, mode: str, weights: np.ndarray, **wishes: Any
    ) -> list[np.ndarray]:
        """Return the moments of the keys of each joint that are found."""
        at = np.flatnonzero(self.sampled)
        keys = reduce_skeleton_keys(self.frames[at], poses[:, at], parents, mode, weights=weights[:, at], **wishes)
        return [at[rows] for rows in keys]

    def _fixed(self) -> list[bool]:
        """Return which bones keep the keys that they have."""
        return [n not in self.targets or self._keeps_all(n) for n in range(len(self.motion.bones))]

    def fewer_keys(self, mode: str, *, shared: bool, best_of: bool) -> dict[Transform, FewerKeys]:
        fixed = self._fixed()
        able = [number for number, stays in enumerate(fixed) if not stays]
        chosen: dict[int, np.ndarray] = {}
        if self.key_poses is not None:
            chosen = {number: self._within_its_keys(self.key_poses, number) for number in able}
        elif able:
            tolerance = (self.tolerance - self.largest_own) / (self.motion.unit * self.parts)
            wishes = {"radius": self.motion.radii, "fixed": fixed, "shared": shared, "tolerance": tolerance}
            keys = self._searched(self.poses, self.skeleton.parents, mode, self.weights, **wishes)
            chosen = {number: self._within_its_keys(keys[number], number) for number in able}
        keyed = {number: self.frames[keys] for number, keys in chosen.items()}
        fewer = self._proven(keyed, mode, shared=shared)
        if not fewer:
            text = NOT_SO_MANY if self.key_poses is not None else NO_FEWER_POSES if shared else NO_FEWER
            raise NeedsItsKeys(text, name=self.rig.name, frames=np.count_nonzero(self.sampled))
        if best_of:
            self._mix(fewer)
        errors = self.proof.largest_errors().tolist()
        excepted = not_promised(self.rig)
        # Of what is not promised, that counts which has fewer keys.
        counted = [errors[n] for n, bone in enumerate(self.motion.bones) if n in fewer or bone.name not in excepted]
        self.motion.show(fewer)
        as_whole = WholeRig(
            len(_united(distinct(source.keyed_frames) for source in fewer.values())),
            *(slide(maps.origins, self.stands) for maps in (self.motion.truth, self.motion.now())),
            max(counted),
            excepted,
        )
        return {
            self.targets[number]: FewerKeys(
                self.bindings[number], self.sources[number], source, errors[number], as_whole
            )
            for number, source in fewer.items()
        }

    def _keeps_all(self, number: int) -> bool:
        """Return whether the scale of a bone, which keeps its keys, has some wherever anything of it has."""
        source, values = self.sources[number], self.values[number]
        kept = [keys.times for rows, keys in source.channels if any(row not in values for row in rows)]
        return bool(kept) and len(_united(kept)) >= len(self.before[number])

    def _within_its_keys(self, keys: np.ndarray, number: int) -> np.ndarray:
        """Return the moments of a bone's keys, none of them outside of those that it has: there it holds."""
        first, last = self._ends(number)
        inside = keys[(keys > first) & (keys < last)]
        return keys if len(keys) == 1 else np.union1d(inside, (first, last))

    def _ends(self, number: int) -> np.ndarray:
        """Return the moments of the first and the last key that a bone has."""
        return np.searchsorted(self.frames, self.before[number][[0, -1]] - SAME_FRAME)

    def _values_at(self, number: int, frames: np.ndarray) -> dict[int, np.ndarray]:
        """Return the values that a bone's channels get on these frames, each (k,), by the rows of components."""
        every, columns = self.frames, self.values[number]
        if not np.isin(frames, every).all():
            every = np.union1d(every, frames)
            columns = values_on(self.targets[number], self.sources[number], every)
        return {row: column[np.searchsorted(every, frames)] for row, column in columns.items()}

    def _proven(self, chosen: dict[int, np.ndarray], mode: str, *, shared: bool) -> dict[int, Source]:
        """Return the bones that get fewer keys, and these, so that all of the rig keeps to the tolerance.

        Keys are put back in `chosen`, the frames of each bone's, where the motion of the channels is off after all.
        What would not have fewer keys than before stays as it is.
        """
        fewer: dict[int, Source] = {}

        def have(numbers: Iterable[int]) -> None:
            for number in numbers:
                keys = chosen[number]
                source = with_keys(self.sources[number], keys, self._values_at(number, keys), mode)
                fewer[number] = source
                if count_of(source) >= len(self.before[number]):
                    del fewer[number], chosen[number]

        def mend(over: list[tuple[float, int, int]], motion: RigMotion) -> set[int]:
            changed = self._put_back(over, motion, chosen, shared=shared)
            have(changed)
            return changed

        have(list(chosen))
        self.proof.keep_to(self.tolerance + self.motion.rounding, fewer, mend)
        return fewer

    def _put_back(
        self, over: list[tuple[float, int, int]], motion: RigMotion, chosen: dict[int, np.ndarray], *, shared: bool
    ) -> set[int]:
        """Put keys back where bones are off the most, and return those that got any."""
        changed: set[int] = set()
        for error, number, moment in _apart(over, motion):
            able = [item for item in motion.above(number) if item in chosen]
            # What rests goes on resting, as long as others can make up for it.
            moving = [item for item in able if len(chosen[item]) > 1]
            share = (self.tolerance + self.motion.rounding) / error
            blamed = motion.to_blame(number, moment, moving, share) or motion.to_blame(number, moment, able, share)
            for those in (list(chosen),) if shared else (blamed, able):
                if added := self._with_keys_at(float(motion.frames[moment]), those, chosen):
                    break
            if not added and changed.isdisjoint(motion.above(number)):
                raise goes_elsewhere(motion.transforms[number].name)
            chosen.update(added)
            changed.update(added)
        return changed

    def _with_keys_at(
        self, frame: float, numbers: Iterable[int], chosen: dict[int, np.ndarray]
    ) -> dict[int, np.ndarray]:
        """Return the keys of those of these bones that get any more: on the samples around a frame, or else there."""
        samples = self.frames[self.sampled]
        first, last = np.searchsorted(samples, frame, side="right") - 1, np.searchsorted(samples, frame)
        around = samples[max(first, 0) : last + 1]
        for places in (around, np.array((frame,))):
            added = {}
            for number in numbers:
                first, last = self.frames[self._ends(number)]
                # Before and behind its keys it stays where they leave it.
                more = np.clip(places, first, last)
                more = more[np.abs(more[:, None] - chosen[number]).min(axis=1) > SAME_FRAME]
                if len(more):
                    added[number] = np.union1d(chosen[number], (first, *more, last))
            if added:
                return added
        return {}

    def _mix(self, fewer: dict[int, Source]) -> None:
        """Give segments their best modes, where the whole keeps to the tolerance; or by number is no farther off."""
        motion, single = self.motion, dict(fewer)
        by_number = float(self.proof.largest_errors().max()) * self.weights.max()
        allowed = self.tolerance + motion.rounding if self.key_poses is None else by_number
        for number, source in single.items():
            transform, radius = self.targets[number], float(motion.radii[number])
            keys, frames = distinct(source.keyed_frames), np.union1d(self.frames, source.keyed_frames)
            frames = frames[(frames >= keys[0] - SAME_FRAME) & (frames <= keys[-1] + SAME_FRAME)]
            if len(keys) > 1:
                truth = shown(transform, self.sources[number], frames)[0]
                largest = float(shell_error(shown(transform, source, frames)[0], truth, radius).max())
                rounding = motion.rounding / motion.unit
                fewer[number] = with_best_modes(transform, source, frames, truth, radius, rounding, largest)

        def mend(over: list[tuple[float, int, int]], there: RigMotion) -> set[int]:
            mixed = {number for number in single if fewer[number] is not single[number]}
            changed = mixed & {item for _, number, _ in _apart(over, there) for item in there.above(number)} or mixed
            fewer.update({number: single[number] for number in changed})
            return changed

        self.proof.keep_to(allowed, fewer, mend)


def _apart(over: list[tuple[float, int, int]], motion: RigMotion) -> Iterator[tuple[float, int, int]]:
    """Yield those of what is over that are the worst among all that hang together, for a few frames."""
    taken: set[tuple[int, int]] = set()
    for error, number, moment in over:
        chain, span = [*motion.above(number)], int(motion.frames[moment] // APART)
        # Once what it hangs on is put right, it may be, too.
        if taken.isdisjoint((item, near) for item in chain for near in (span - 1, span, span + 1)):
            taken.update((item, span) for item in chain)
            yield error, number, moment


def _united(frames: Iterable[np.ndarray]) -> np.ndarray:
    """Return all frames, those that are one to Blender once."""
    return distinct(np.unique(np.concatenate(list(frames))))


def _follows(bone: bpy.types.PoseBone, grows: bool) -> bool:
    """Return whether a bone is moved by all that its parent does."""
    settings = bone.bone
    return bool(bone.parent and settings.use_inherit_rotation and (settings.inherit_scale == "FULL" or not grows))


def _rest(motion: RigMotion, number: int, follows: bool) -> Poses:
    """Return where a bone is at rest: in its parent's space, or that of the rig."""
    bone = motion.bones[number]
    matrix = bone.bone.matrix_local
    if follows:
        matrix = bone.parent.bone.matrix_local.inverted() @ matrix
    position, turn, _ = matrix.decompose()
    return Poses(np.array(position), np.array(turn))
