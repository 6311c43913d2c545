"""Which keys the bones of a rig can do without: one plan for all of them, since what moves one moves all below it.

The tolerance is kept in the space of the rig, at every bone, whether it gets fewer keys itself or only hangs on one
that does. Poses are those that the channels give, without other constraints. A bone that does not inherit rotation, or
not all of the scale where there is any, begins a chain of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ...motion import Poses, Skeleton, reduce_skeleton_keys, shell_error
from ...motion.contacts import slide, standing
from ...motion.poses import placed
from ...motion.quaternions import align_signs
from ..actions.reading import sources_of_users
from ..actions.slots import Slot, SlotTransform, transforms_in
from ..compute.sources import SAME_FRAME, Source, distinct
from ..edits.apply import Readings, readable
from ..transforms import Refused, Transform, transform_of
from .fewer_keys import (
    SMALLEST,
    FewerKeys,
    NeedsItsKeys,
    WholeRig,
    goes_elsewhere,
    samples_of,
    seen_frames,
    shown_poses,
    values_on,
    with_best_modes,
    with_keys,
)
from .sizes import radius_of, size_of

NO_FEWER = n_(
    "{name}: its bones need their keys on all of {frames} frames to stay within the tolerance: allow a larger one"
)
NO_FEWER_POSES = n_(
    "{name}: its bones need their keys on all of {frames} frames to stay within the tolerance: "
    "allow a larger one, or give each bone keys of its own"
)

HOLD = 4.0
"""How many times the error counts of what stands on the ground."""

Plans = dict[Transform, "list[FewerKeys] | Refused"]
"""What each bone is to have in each slot that moves it, or why it cannot have it."""


def fewer_keys_of_rigs(
    readings: Mapping[Transform, Readings],
    mode: str,
    tolerance: float,
    radius: float | None,
    *,
    shared: bool,
    hold: bool,
    best_of: bool,
) -> Plans:
    """Plans for all bones among the targets, those together that one slot of a rig moves."""
    together: dict[tuple[bpy.types.Object, bpy.types.Action, int], dict[Transform, tuple[SlotTransform, Source]]] = {}
    for transform, reading in readings.items():
        if transform.is_part:
            try:
                keyed = readable(transform, reading)
            except Refused:
                continue  # Its own plan says so.
            for place, source in keyed:
                if source.channels:
                    key = transform.animated, place.slot.action, place.slot.handle
                    together.setdefault(key, {})[transform] = place, source
    plans: Plans = {}
    for (rig, *_), members in together.items():
        try:
            fewer = _Rig(rig, members, tolerance, radius, hold=hold).fewer_keys(mode, shared=shared, best_of=best_of)
        except Refused as refusal:
            plans.update(dict.fromkeys(members, refusal))
            continue
        except ValueError as problem:
            why = rpt_("{name} cannot be reduced: {problem}").format(name=rig.name, problem=problem)
            plans.update(dict.fromkeys(members, Refused(why)))
            continue
        for transform, plan in fewer.items():
            found = plans.setdefault(transform, [])
            if isinstance(found, list):
                found.append(plan)
    return plans


class _Rig:
    """The bones of a rig as one slot moves them: those that are to have fewer keys, and all others as they are."""

    def __init__(
        self,
        rig: bpy.types.Object,
        members: dict[Transform, tuple[SlotTransform, Source]],
        tolerance: float,
        radius: float | None,
        *,
        hold: bool,
    ) -> None:
        self.rig, self.bones = rig, list(rig.pose.bones)
        numbers = {bone.name: number for number, bone in enumerate(self.bones)}
        self.targets = {numbers[transform.carrier.name]: transform for transform in members}
        self.places = {numbers[transform.carrier.name]: place for transform, (place, _) in members.items()}
        self.sources = {numbers[transform.carrier.name]: source for transform, (_, source) in members.items()}
        slot = next(iter(self.places.values())).slot
        others = {transform: source for transform, source in _keyed_in(rig, slot) if transform not in members}
        self._look_at_frames()
        self._pose_bones({numbers[one.carrier.name]: source for one, source in others.items() if one.is_part})
        self.unit = size_of(rig.matrix_world) or 1.0
        self.tolerance = tolerance / self.unit
        self.radii = np.array([(radius or radius_of(bone)) / self.unit for bone in self.bones])
        self.rounding = SMALLEST * (float(np.abs(self.truth.positions).max()) + self.radii.max())
        self._stand(others.get(transform_of(rig)), hold=hold)

    def _look_at_frames(self) -> None:
        """The frames that keys are for, and those that are seen: where channels go on outside of their keys, more."""
        sources = [self.sources[number] for number in self.targets]
        self.frames = _united(map(samples_of, sources))
        self.seen = seen_frames(self.frames, sources)
        self.own = np.isin(self.seen, self.frames)

    def _pose_bones(self, others: dict[int, Source]) -> None:
        """The poses of all bones on the frames that are seen, in their parents' space and in the rig's."""
        basis = [self._basis(number, (others | self.sources).get(number)) for number in range(len(self.bones))]
        for bone, poses in zip(self.bones, basis, strict=True):
            if poses.scales is not None and poses.scales.min() <= 0.0:
                raise Refused(
                    rpt_(
                        "{name}: its scale passes zero, and with it the size of all that hangs on "
                        "it: reduce the bones above and below it apart from one another"
                    ).format(name=f"{self.rig.name}/{bone.name}")
                )
        grows = any(poses.scales is not None and np.abs(poses.scales - 1.0).max() > SMALLEST for poses in basis)
        follows = [_follows(bone, grows) for bone in self.bones]
        numbers = {bone: number for number, bone in enumerate(self.bones)}
        parents = [numbers[bone.parent] if whole else -1 for bone, whole in zip(self.bones, follows, strict=True)]
        self.skeleton = Skeleton(parents)
        self.rest = [_rest(bone, whole) for bone, whole in zip(self.bones, follows, strict=True)]
        local = [placed(rest, poses) for rest, poses in zip(self.rest, basis, strict=True)]
        one = np.ones(len(self.seen))
        self.poses = Poses(
            np.stack([poses.positions for poses in local]),
            align_signs(np.stack([poses.quaternions for poses in local])),
            np.stack([one if poses.scales is None else poses.scales for poses in local]) if grows else None,
        )
        self.truth = self.skeleton.in_root_space(self.poses)

    def _stand(self, own: Source | None, *, hold: bool) -> None:
        """Which bones stand on the ground, with what is keyed of the rig itself, and how much their errors count."""
        self.world = _world(self.rig, own, self.seen)
        self.in_world = placed(self.world, self.truth).positions
        render = bpy.context.scene.render
        self.stands = standing(self.seen * render.fps_base / render.fps, self.in_world)
        self.weights = np.where(self.stands, HOLD, 1.0) if hold else np.ones(self.stands.shape)

    def fewer_keys(self, mode: str, *, shared: bool, best_of: bool) -> dict[Transform, FewerKeys]:
        keys = reduce_skeleton_keys(
            self.frames,
            self.poses[:, self.own],
            self.skeleton.parents,
            mode,
            tolerance=self.tolerance,
            radius=self.radii,
            shared=shared,
            weights=self.weights[:, self.own],
            fixed=[number not in self.targets for number in range(len(self.bones))],
        )
        before = {number: distinct(self.sources[number].keyed_frames) for number in self.targets}
        values = {number: values_on(self.targets[number], self.sources[number], self.frames) for number in self.targets}
        chosen = {number: self._within_its_keys(keys[number], before[number]) for number in self.targets}
        # What has as few keys already stays as it is.
        chosen = {number: own for number, own in chosen.items() if len(own) < len(before[number])}
        if not chosen:
            text = NO_FEWER_POSES if shared else NO_FEWER
            raise NeedsItsKeys(rpt_(text).format(name=self.rig.name, frames=len(self.frames)))
        shown = self.poses.copy()
        fewer: dict[int, Source] = {}

        def show(number: int, source: Source) -> None:
            fewer[number] = source
            shown[number] = placed(self.rest[number], self._basis(number, source))

        def show_keys(number: int) -> None:
            own = chosen[number]
            columns = {row: column[own] for row, column in values[number].items()}
            show(number, with_keys(self.sources[number], self.frames[own], columns, mode))

        for number in chosen:
            show_keys(number)
        self._densify(chosen, shown, show_keys)
        if best_of:
            self._mix(fewer, shown, show)
        errors = self._errors(shown).max(axis=1) * self.unit
        standing_at = (self.in_world, placed(self.world, self.skeleton.in_root_space(shown)).positions)
        as_whole = WholeRig(
            len(_united(distinct(source.keyed_frames) for source in fewer.values())) if fewer else 0,
            *(slide(places, self.stands) for places in standing_at),
        )
        return {
            self.targets[number]: FewerKeys.planned(
                self.targets[number],
                self.places[number],
                self.sources[number],
                source,
                self.frames[chosen[number]],
                {row: column[chosen[number]] for row, column in values[number].items()},
                float(errors[number]),
                as_whole,
            )
            for number, source in fewer.items()
        }

    def _basis(self, number: int, source: Source | None) -> Poses:
        """How a bone is posed on all frames: by what is keyed, or as it stands."""
        bone, count = self.bones[number], len(self.seen)
        if source is not None and source.channels:
            poses = shown_poses(source, self.seen)
        else:
            place, turn, scale = bone.matrix_basis.decompose()
            poses = Poses(np.tile(place, (count, 1)), np.tile(turn, (count, 1)), np.full(count, np.mean(scale)))
        # Blender leaves a connected bone where its parent ends.
        return _unmoved(poses) if bone.bone.use_connect and bone.parent else poses

    def _errors(self, shown: Poses) -> np.ndarray:
        """Of all bones on all frames (bones, m), in the rig's unit."""
        return shell_error(self.skeleton.in_root_space(shown), self.truth, self.radii[:, None])

    def _within_its_keys(self, keys: np.ndarray, before: np.ndarray) -> np.ndarray:
        """The samples of a bone's keys, none of them outside of those that it has: there it holds."""
        first, last = np.searchsorted(self.frames, before[[0, -1]] - SAME_FRAME)
        inside = keys[(keys > first) & (keys < last)]
        return keys if len(keys) == 1 else np.union1d(inside, (first, last))

    def _densify(self, chosen: dict[int, np.ndarray], shown: Poses, show_keys: Callable[[int], None]) -> None:
        """Put keys back where the motion of the channels is off after all."""
        samples = np.flatnonzero(self.own)
        allowed = self.tolerance + self.rounding
        while True:
            errors = self._errors(shown) * self.weights
            if errors.max() <= allowed:
                return
            number, moment = np.unravel_index(np.argmax(errors), errors.shape)
            chain = [one for one in self._chain(int(number)) if one in chosen]
            sample = int(np.searchsorted(samples, moment))
            off = [one for one in chain if self.own[moment] and sample not in chosen[one]]
            if not off:
                raise goes_elsewhere(self.targets[chain[0]].name if chain else self.bones[number].name)
            # What rests goes on resting, as long as others can make up for it.
            for one in [one for one in off if len(chosen[one]) > 1] or off:
                chosen[one] = np.union1d(chosen[one], (0, sample, len(samples) - 1))
                show_keys(one)

    def _chain(self, number: int) -> Iterator[int]:
        """A bone and all that it hangs on."""
        while number >= 0:
            yield number
            number = int(self.skeleton.parents[number])

    def _mix(self, fewer: dict[int, Source], shown: Poses, show: Callable[[int, Source], None]) -> None:
        """Give segments their best modes, bone by bone from the roots on, where the whole keeps to the tolerance."""
        allowed = self.tolerance + self.rounding
        for number in sorted(fewer, key=self.skeleton.depths.__getitem__):
            single, radius = fewer[number], float(self.radii[number])
            truth, frames = self._basis(number, self.sources[number])[self.own], self.frames
            largest = float(shell_error(self._basis(number, single)[self.own], truth, radius).max())
            keys = distinct(single.keyed_frames)
            inside = (frames >= keys[0] - SAME_FRAME) & (frames <= keys[-1] + SAME_FRAME)
            if len(keys) < 2:
                continue
            show(number, with_best_modes(single, frames[inside], truth[inside], radius, self.rounding, largest))
            if (self._errors(shown) * self.weights).max() > allowed:
                show(number, single)


def _keyed_in(rig: bpy.types.Object, slot: Slot) -> Iterator[tuple[Transform, Source]]:
    """What is keyed of a rig in a slot, itself and its bones. What cannot be read stands as it is."""
    places = transforms_in(slot)
    for place, sources in zip(places, sources_of_users(places), strict=True):
        for user, source in zip(place.users, sources, strict=True):
            if user.animated == rig and isinstance(source, Source) and source.channels:
                yield user, source


def _world(rig: bpy.types.Object, source: Source | None, frames: np.ndarray) -> Poses:
    """Where a rig is on these frames, shape (m,): by its own keys where nothing else moves it, or as it stands."""
    if source is not None and rig.parent is None and not rig.constraints:
        poses = shown_poses(source, frames)
        size = rig.scale[0] * rig.delta_scale[0] if poses.scales is None else poses.scales
    else:
        place, turn, scale = rig.matrix_world.decompose()
        poses, size = Poses(np.tile(place, (len(frames), 1)), np.tile(turn, (len(frames), 1))), np.mean(scale)
    return Poses(poses.positions, poses.quaternions, np.broadcast_to(size, frames.shape))


def _united(frames: Iterable[np.ndarray]) -> np.ndarray:
    """All frames, those that are one to Blender once."""
    return distinct(np.unique(np.concatenate(list(frames))))


def _follows(bone: bpy.types.PoseBone, grows: bool) -> bool:
    """Whether a bone is moved by all that its parent does."""
    own = bone.bone
    return bool(bone.parent and own.use_inherit_rotation and (own.inherit_scale == "FULL" or not grows))


def _rest(bone: bpy.types.PoseBone, follows: bool) -> Poses:
    """Where a bone is at rest: in its parent's space, or that of the rig."""
    matrix = bone.bone.matrix_local
    if follows:
        matrix = bone.parent.bone.matrix_local.inverted() @ matrix
    place, turn, _ = matrix.decompose()
    return Poses(np.array(place), np.array(turn))


def _unmoved(poses: Poses) -> Poses:
    return Poses(np.zeros_like(poses.positions), poses.quaternions, poses.scales)
