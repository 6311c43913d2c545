"""Motion of objects and their bones from their channels: poses to search for keys, affine maps to prove the result.

Constraints and drivers are ignored; `not_promised` names the bones that follow them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, cast

import bpy
import numpy as np

from ...blender import existing, pose_bones
from ...motion import Poses
from ...motion.affine import AffineMaps, ball_displacement, displacement_over, largest_displacement
from ...motion.poses import placed
from ...motion.quaternions import align_signs, matrices, multiply
from ..actions.slots import Slot, slots_alone
from ..evaluation.bodies import turn_into_quaternions
from ..evaluation.channel_values import rotation_values
from ..evaluation.components import LOCATION, ROTATION, ROWS, SCALE
from ..evaluation.differences import channel_differences, seen_values
from ..evaluation.sources import KeyedTransform
from ..fcurves.keys import MAX_NUMBER
from ..transforms import WIDTHS, Channel, Transform
from ..transforms.posing import Hierarchy
from ..transforms.sizes import into_scene, radius_of, reaches_of, scale_in_scene

MOVING_CHANNELS = {*WIDTHS, "rotation_mode"}
"""The properties of a bone by which a driver can move it."""

SINGLE_PRECISION_RATIO = 1e-6
"""The error of single precision, relative to the largest distance."""

LEAST_SCALE = 1e-6
"""The scale that the search uses instead of zero."""

AT_ONCE = 2**17
"""The number of transforms times frames computed at once."""


def not_promised(rig: bpy.types.Object) -> tuple[str, ...]:
    """Return the names of the bones for which a tolerance is not guaranteed: they, or their parents, follow constraints
    or drivers.
    """
    drivers = () if rig.animation_data is None else list(rig.animation_data.drivers)
    driven = {driver.data_path for driver in drivers if not driver.mute}
    animated = {fcurve.data_path for slot in slots_alone(rig) for fcurve in slot.fcurves}
    animated |= {driver.data_path for driver in drivers}
    bones, followers = pose_bones(rig), set()
    for bone in bones:
        if driven and not driven.isdisjoint(f"{bone.path_from_id()}.{name}" for name in MOVING_CHANNELS):
            followers.add(bone.name)
        for constraint in bone.constraints:
            switches = {f"{constraint.path_from_id()}.{name}" for name in ("influence", "mute", "enabled")}
            if not animated.isdisjoint(switches) or (not constraint.mute and constraint.influence > 0.0):
                followers.add(bone.name)
                if isinstance(constraint, bpy.types.KinematicConstraint | bpy.types.SplineIKConstraint):
                    # The bone itself is the last of the chain, unless the chain reaches for its head.
                    count = constraint.chain_count - getattr(constraint, "use_tail", True)
                    above = bone.parent_recursive[:count] if constraint.chain_count else bone.parent_recursive
                    followers |= {parent.name for parent in above}
    if not followers:
        return ()
    return tuple(bone.name for bone in bones if any(item.name in followers for item in (bone, *bone.parent_recursive)))


def shown(transform: Transform, source: KeyedTransform, frames: np.ndarray) -> tuple[Poses, AffineMaps]:
    """Return the visible motion of a source on these frames (n,), with delta transforms and the values without keys.

    Returns
    -------
    poses : Poses, shape (n,)
        Along the axes of the body at rest. An uneven scale is replaced by its geometric mean.
    maps : AffineMaps, shape (n,)
        The channels as Blender has them: location runs along its own axes, and scale may be uneven or negative.
    """
    (result,) = shown_together([transform], [source], frames)
    return result


def shown_together(
    transforms: Sequence[Transform], sources: Sequence[KeyedTransform], frames: np.ndarray
) -> Iterator[tuple[Poses, AffineMaps]]:
    """Yield the result of `shown` for each of several transforms."""
    step = max(1, AT_ONCE // len(frames))
    for first in range(0, len(sources), step):
        some = sources[first : first + step]
        through = [source for source in some if source.cyclic is None]
        values = iter(channel_differences(through, [frames] * len(through)))
        for transform, source in zip(transforms[first : first + step], some, strict=True):
            rows = seen_values(source, frames) if source.cyclic is not None else np.add(*next(values))
            rest = transform.components()
            for part in ROWS.keys() - source.keyed:
                rows[ROWS[part]] = rest[ROWS[part], None]
            yield _poses_and_maps(transform, rows, source.original)


def evaluated(
    transform: Transform, curves: Mapping[Channel, bpy.types.FCurve], frames: np.ndarray
) -> tuple[Poses, AffineMaps]:
    """Return the same as `shown`, from any F-curves as Blender evaluates them."""
    rest = transform.components()
    rows = np.tile(rest[:, None], (1, len(frames)))
    for row, channel in transform.channels.items():
        fcurve = curves.get(channel)
        if fcurve is not None and not fcurve.mute and not fcurve.is_empty:
            rows[row] = [fcurve.evaluate(frame) for frame in frames.tolist()]
    rows = np.where(np.abs(rows) < MAX_NUMBER, rows, rest[:, None])
    return _poses_and_maps(transform, rows, transform.original())


def _poses_and_maps(transform: Transform, rows: np.ndarray, delta: np.ndarray) -> tuple[Poses, AffineMaps]:
    """Return the same as `shown`, from channel values (10, n), turned into quaternions in place, and deltas (10,)."""
    turn_into_quaternions(rows, transform.order)
    along, (positions, quaternions, scale) = transform.location_axes, (rows[part].T for part in ROWS.values())
    positions, scale = positions + delta[ROWS[LOCATION]], scale * delta[ROWS[SCALE]]
    quaternions = multiply(delta[ROWS[ROTATION]], quaternions)
    maps = AffineMaps(np.moveaxis(matrices(quaternions), -1, 0) * scale[:, None, :], positions)
    mean = np.cbrt(np.abs(scale.prod(axis=1)))
    return Poses(positions if along is None else positions @ along.T, quaternions, mean), maps


def continuous_values(source: KeyedTransform, frames: np.ndarray, added: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the channel values of a source on rising frames (m,), without jumps of rotation, shape (10, m).

    `added` (10, m) is added to the values of the source.
    """
    values = seen_values(source, frames) + added
    turned = values if source.order is None else values.copy()
    if source.order is not None:
        turn_into_quaternions(turned, source.order)
    values[ROWS[ROTATION]] = rotation_values(turned[ROWS[ROTATION]].T, values[ROWS[ROTATION], 0], source.order)
    return values


class BodyMotion:
    """An object and its bones on frames (m,) of an Action, as recorded and as they are now.

    They are the *joints*: the object is number 0 and carries the bones. Its own parents are taken as they are now.

    Parameters
    ----------
    joints : sequence of Transform
        The object, alone or with all bones that it has.
    slot : Slot
        The slot that moves them.
    sources : mapping
        The sources of the joints that may get other keys, by their numbers.
    frames : array, shape (m,)
    radius : float, optional
        The radius of the ball around each bone's head, or around the origin of a single object, in the scene's units.
        The default is the reach of each.
    space : array, shape (3, 3), optional
        For a single joint, which may be a bone: the map from the axes of its channels to those of the scene.
    """

    def __init__(
        self,
        joints: Sequence[Transform],
        slot: Slot,
        sources: Mapping[int, KeyedTransform],
        frames: np.ndarray,
        radius: float | None,
        space: np.ndarray | None = None,
    ) -> None:
        self.joints, self._sources = joints, sources
        bones, size = [joint.pose_bone for joint in joints[1:]], scale_in_scene(joints[0])
        self.hierarchy = Hierarchy(bones)
        self.parents = np.append(-1, self.hierarchy.parents + 1)
        if bones:
            reaches = {} if radius else reaches_of(joints[0].animated)
            self.radii = np.array([0.0, *(radius / size if radius else reaches[bone.name] for bone in bones)])
        else:
            self.radii = np.array([(radius or radius_of(joints[0].carrier)) / size])
        self._curves = {(fcurve.data_path, fcurve.array_index): fcurve for fcurve in slot.fcurves}
        self._parent = AffineMaps(into_scene(joints[0]) if space is None else space, np.zeros(3))
        self.poses = self._record(frames)
        """Poses of each joint's channels, each of shape (m,)."""
        scales = existing(self.poses[0].scales)
        sizes = np.maximum(scales / (scales[0] or 1.0), LEAST_SCALE)
        self.unit = float((np.linalg.norm(self.truth.axes[0], 2, axis=(-2, -1)) / sizes).max()) or 1.0
        """The largest length in the scene of one unit of the bones, or of the object at its first size."""
        sizes = np.sqrt(np.einsum("...ij,...ij->...j", self.truth.axes, self.truth.axes).max(axis=-1))
        away = np.linalg.norm(self.truth.origins - self.truth.origins[0], axis=-1) + self.radii[:, None] * sizes
        self.extent = float(away.max()) / self.unit
        """The largest distance of any ball's surface from the object's origin, in that unit."""
        moved = float(np.abs(self.truth.origins[0]).max()) if 0 in sources else 0.0
        self.rounding = SINGLE_PRECISION_RATIO * (moved + float(away.max()))

    def _record(self, frames: np.ndarray) -> list[Poses]:
        """Reset all joints to the recording on these frames, and return the poses of their channels."""
        self.frames = frames
        self._shown: dict[int, KeyedTransform | None] = {}
        keyed = shown_together([self.joints[number] for number in self._sources], [*self._sources.values()], frames)
        known = dict(zip(self._sources, keyed, strict=True))
        result = [known.get(n) or evaluated(joint, self._curves, frames) for n, joint in enumerate(self.joints)]
        axes, origins = (np.stack([getattr(maps, name) for _, maps in result]) for name in ("axes", "origins"))
        self._recorded = AffineMaps(axes, origins)
        self._channels, self._posed = self._recorded.copy(), self._recorded.copy()
        self._pose(range(len(result)))
        self.truth = self.now()
        """The maps of the joints in the scene as recorded, shape (joints, m)."""
        return [poses for poses, _ in result]

    def at(self, frames: np.ndarray) -> BodyMotion:
        """Return the same joints on other frames, as recorded."""
        result = copy(self)
        result.poses = result._record(frames)
        return result

    def as_chains(self) -> tuple[np.ndarray, Poses, float]:
        """Return joints for the search, with uniform scale, in chains of bones that inherit everything.

        The result is their parents (joints,), where the first bone of each chain has the object as its parent; their
        poses (joints, m); and the fraction of the tolerance for each chain, as it still moves with its real parent.
        """
        own, *of_bones = self.poses
        own_scales, *bone_scales = (cast(np.ndarray, poses.scales) for poses in self.poses)
        size = float(own_scales[0]) or 1.0
        local = [Poses(own.positions / size, own.quaternions, own_scales / size)]
        grows = any(np.abs(scales - 1.0).max() > SINGLE_PRECISION_RATIO for scales in bone_scales)
        parents = self.parents.copy()
        for number, poses in enumerate(of_bones, 1):
            bone: Any = self.joints[number].carrier
            settings, rest = bone.bone, bone.bone.matrix_local
            if not settings.use_inherit_rotation or (grows and settings.inherit_scale != "FULL"):
                parents[number] = 0
            elif bone.parent:
                rest = bone.parent.bone.matrix_local.inverted() @ rest
            if settings.use_connect and bone.parent:
                poses = replace(poses, positions=np.zeros_like(poses.positions))
            position, turn, _ = rest.decompose()
            local.append(placed(Poses(np.array(position), np.array(turn)), poses))
        scales = np.maximum([poses.scales for poses in local], LEAST_SCALE)
        positions, quaternions = (np.stack([getattr(p, name) for p in local]) for name in ("positions", "quaternions"))
        grows = np.abs(scales - 1.0).max() > SINGLE_PRECISION_RATIO
        heads = parents != self.parents
        chains = 1 + max(np.count_nonzero(heads[[*self.above(number)]]) for number in range(len(heads)))
        return parents, Poses(positions, align_signs(quaternions), scales if grows else None), chains**-0.5

    def _pose(self, numbers: Collection[int]) -> None:
        """Update these joints and all their children from their channels; bones are in the rig's space."""
        if 0 in numbers:
            self._posed[0] = self._parent @ self._channels[0]
        self.hierarchy.pose([number - 1 for number in numbers if number], self._channels[1:], self._posed[1:])

    def show(self, sources: Mapping[int, KeyedTransform | None]) -> None:
        """Move joints by other keys, or by the recorded ones where the source is None."""
        changed = {number: source for number, source in sources.items() if source is not self._shown.get(number)}
        now = {number: source for number, source in changed.items() if source is not None}
        shown_now = shown_together([self.joints[number] for number in now], [*now.values()], self.frames)
        maps_now = {number: maps for number, (_, maps) in zip(now, shown_now, strict=True)}
        for number in changed:
            self._channels[number] = maps_now.get(number) or self._recorded[number]
        self._shown |= changed
        self._pose(changed)

    def show_values(self, rows: Mapping[int, np.ndarray]) -> None:
        """Move joints by these values of their channels (10, m)."""
        for number, values in rows.items():
            joint = self.joints[number]
            self._channels[number] = _poses_and_maps(joint, values.copy(), joint.original())[1]
        self._pose(rows)

    def now(self) -> AffineMaps:
        """Return the present maps of all joints in the scene, shape (joints, m)."""
        result = self._posed[0] @ self._posed
        result[0] = self._posed[0]
        return result

    def above(self, number: int) -> Iterator[int]:
        """Yield a joint and all its parents."""
        while number >= 0:
            yield number
            number = int(self.parents[number])

    def below(self, number: int) -> np.ndarray:
        """Return True for a joint and all its children, shape (joints,)."""
        return np.array([number in self.above(other) for other in range(len(self.joints))])

    def reach(self, number: int) -> float:
        """Return the largest distance from a joint of itself and all its children, in the unit of bones."""
        others = np.flatnonzero(self.below(number))
        away = np.linalg.norm(self.truth.origins[others] - self.truth.origins[number], axis=-1).max(axis=1)
        counted = self.radii[others] > 0.0
        return float((away / self.unit + self.radii[others])[counted].max())

    def over(self, allowed: float, weights: np.ndarray) -> list[tuple[float, int, int]]:
        """Return the errors above the allowed one: weighted error, joint and moment, the largest first.

        `weights` are of shape (joints, m).
        """
        now = self.now()
        of_joints = (
            displacement_over(now[number], self.truth[number], radius, allowed / weight.max()) * weight
            for number, (radius, weight) in enumerate(zip(self.radii, weights, strict=True))
        )
        errors = np.stack([*of_joints])
        at = np.nonzero(~(errors <= allowed))
        return sorted(zip(errors[at].tolist(), *(part.tolist() for part in at), strict=True), reverse=True)

    def largest_errors(self, weights: np.ndarray | None = None) -> np.ndarray:
        """Return the largest displacement of any point in each joint's ball, in the scene's units, shape (joints,).

        Displacements are multiplied by weights (joints, m) if these are given.
        """
        now, truth = self.now(), self.truth
        if weights is None:
            return np.array([largest_displacement(now[n], truth[n], radius) for n, radius in enumerate(self.radii)])
        return (self.displacements() * weights).max(axis=1)

    def displacements(self) -> np.ndarray:
        """Return the largest displacement of each joint's ball by moments, in the scene's units, shape (joints, m)."""
        now, balls = self.now(), (np.full(len(self.frames), radius) for radius in self.radii)
        return np.array([ball_displacement(now[n], self.truth[n], radii) for n, radii in enumerate(balls)])

    def to_blame(self, number: int, moment: int, among: Iterable[int], share: float) -> list[int]:
        """Return a few of these joints that reduce a joint's error at a moment to a fraction of it, if set as recorded.

        The joint that helps most is first, and so on. The list is empty if even all of them do not suffice.
        """
        chain, left, result = [*self.above(number)][::-1], list(among), []
        least = share * self._errors_with(number, moment, self._channels[chain, moment, None])[0]
        while left:
            restored = np.array([np.isin(left, item) | (item in result) for item in chain])
            both = [maps[chain, moment, None] for maps in (self._recorded, self._channels)]
            axes = np.where(restored[..., None, None], both[0].axes, both[1].axes)
            channels = AffineMaps(axes, np.where(restored[..., None], both[0].origins, both[1].origins))
            errors = self._errors_with(number, moment, channels)
            best = int(np.argmin(errors))
            result.append(left.pop(best))
            if errors[best] <= least:
                return result
        return []

    def _errors_with(self, number: int, moment: int, channels: AffineMaps) -> np.ndarray:
        """Return a joint's errors (n,) at a moment for n variants of its chain's channels (k, n), the object first."""
        chain, above = [*self.above(number)][-2::-1], None
        for row, item in enumerate(chain, 1):
            above = self.hierarchy.placed(item - 1, channels[row], above)
        world = self._parent @ channels[0]
        placed = world if above is None else world @ above
        return ball_displacement(
            placed, self.truth[number, moment, None], np.full(len(placed.axes), self.radii[number])
        )
