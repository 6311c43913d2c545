"""How transforms and whole rigs move as their channels say: poses for the search for keys, affine maps for its proof.

Bones are numbered as the rig has them. Moments are the frames that are looked at, those between and around samples
among them. Poses are those that the channels give: constraints and drivers have no part in it, and of the bones that
follow these it is told which they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from typing import NamedTuple

import bpy
import numpy as np

from ...motion import Poses
from ...motion.affine import AffineMaps, ball_displacement, displacement_over, largest_displacement
from ...motion.quaternions import align_signs, matrices, multiply
from ..actions.modifiers import on_top
from ..actions.reading import sources_of_users
from ..actions.refusals import refuse_numbers
from ..actions.slots import Slot, bindings_in_slot, slots_alone
from ..evaluation.bodies import turn_into_quaternions
from ..evaluation.channel_values import channel_values
from ..evaluation.components import LOCATION, REST, ROTATION, ROWS, SCALE
from ..evaluation.differences import channel_differences, seen_values
from ..evaluation.sources import Source
from ..fcurves.keys import LARGEST
from ..transforms import WIDTHS, Channel, Refused, Transform, is_part, split_path, transform_of
from ..transforms.posing import Hierarchy
from ..transforms.sizes import into_scene, reaches_of, scale_in_scene

MOVING = {*WIDTHS, "rotation_axis_angle", "rotation_mode"}
"""Properties of bones that a driver moves them by."""

CHAINS = ("IK", "SPLINE_IK")
"""Constraints that move bones above the one that has them."""

SMALLEST = 1e-6
"""Errors of single precision, relative to how far something gets."""


AT_ONCE = 2**17
"""Transforms times frames that are worked out in one go."""


class NotPromised(NamedTuple):
    """The names of the bones that a tolerance is not promised for."""

    followers: tuple[str, ...] = ()
    """Those that follow constraints or drivers."""

    below: tuple[str, ...] = ()
    """Those that hang on these."""

    def __bool__(self) -> bool:
        return bool(self.followers)

    def __contains__(self, name: object) -> bool:
        return name in self.followers or name in self.below


def not_promised(rig: bpy.types.Object) -> NotPromised:
    """Return the bones of a rig whose motion is not that of their channels, and of those above them, alone."""
    drivers = () if rig.animation_data is None else list(rig.animation_data.drivers)
    driven = {driver.data_path for driver in drivers if not driver.mute}
    animated = {fcurve.data_path for slot in slots_alone(rig) for fcurve in slot.fcurves}
    animated |= {driver.data_path for driver in drivers}
    bones, followers = rig.pose.bones, set()
    for bone in bones:
        if not driven.isdisjoint(f"{bone.path_from_id()}.{name}" for name in MOVING):
            followers.add(bone.name)
        for constraint in bone.constraints:
            switches = {f"{constraint.path_from_id()}.{name}" for name in ("influence", "mute", "enabled")}
            if not animated.isdisjoint(switches) or (not constraint.mute and constraint.influence > 0.0):
                followers.add(bone.name)
                if constraint.type in CHAINS:
                    # The bone itself is the last of a chain, unless that is to reach for its head.
                    count = constraint.chain_count - getattr(constraint, "use_tail", True)
                    above = bone.parent_recursive[:count] if constraint.chain_count else bone.parent_recursive
                    followers |= {parent.name for parent in above}
    below = {bone.name for bone in bones if any(parent.name in followers for parent in bone.parent_recursive)}
    names = [bone.name for bone in bones]
    return NotPromised(
        tuple(name for name in names if name in followers), tuple(name for name in names if name in below - followers)
    )


def shown(transform: Transform, source: Source, frames: np.ndarray) -> tuple[Poses, AffineMaps]:
    """Return how a source is seen on these frames (n,), with the object's own delta transforms, and what is not keyed.

    Returns
    -------
    poses : Poses, shape (n,)
        Along the axes of the body at rest. Where the scale is uneven, its geometric mean.
    maps : AffineMaps, shape (n,)
        Of the channels as Blender has them: location runs along its own axes, and scale may be uneven or negative.
    """
    (result,) = shown_together([transform], [source], frames)
    return result


def shown_together(
    transforms: Sequence[Transform], sources: Sequence[Source], frames: np.ndarray
) -> Iterator[tuple[Poses, AffineMaps]]:
    """Yield what `shown` returns for each of several transforms."""
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
            yield _placed(transform, rows, source.original)


def evaluated(
    transform: Transform, curves: Mapping[Channel, bpy.types.FCurve], frames: np.ndarray
) -> tuple[Poses, AffineMaps]:
    """Return what `shown` does as Blender evaluates F-curves, for what makes no source or has more to it than keys."""
    rest = transform.components()
    rows = np.tile(rest[:, None], (1, len(frames)))
    for row, channel in transform.channels.items():
        fcurve = curves.get(channel)
        if fcurve is not None and not fcurve.mute and not fcurve.is_empty:
            rows[row] = [fcurve.evaluate(frame) for frame in frames.tolist()]
    for part in ROWS.values():
        if not (np.abs(rows[part]) < LARGEST).all():
            rows[part] = rest[part, None]
    return _placed(transform, rows, REST)


def _placed(transform: Transform, rows: np.ndarray, delta: np.ndarray) -> tuple[Poses, AffineMaps]:
    """Return what `shown` does for values of channels (10, n), which become quaternions, and delta transforms (10,)."""
    turn_into_quaternions(rows, transform.order)
    along, (positions, quaternions, scale) = transform.location_axes, (rows[part].T for part in ROWS.values())
    positions, scale = positions + delta[ROWS[LOCATION]], scale * delta[ROWS[SCALE]]
    quaternions = multiply(delta[ROWS[ROTATION]], quaternions)
    maps = AffineMaps(np.moveaxis(matrices(quaternions), -1, 0) * scale[:, None, :], positions)
    mean = np.cbrt(np.abs(scale.prod(axis=1)))
    return Poses(positions if along is None else positions @ along.T, quaternions, mean), maps


def continuous_values(source: Source, frames: np.ndarray, added: np.ndarray | float = 0.0) -> np.ndarray:
    """Return what the channels of a source have on rising frames (m,), without jumps of rotation, shape (10, m).

    `added` (10, m) is what is on top of that.
    """
    values = seen_values(source, frames) + added
    turned = values if source.order is None else values.copy()
    if source.order is not None:
        turn_into_quaternions(turned, source.order)
    values[ROWS[ROTATION]] = rotation_values(turned[ROWS[ROTATION]].T, values[ROWS[ROTATION], 0], source.order)
    return values


def rotation_values(quaternions: np.ndarray, first: np.ndarray, order: str | None) -> np.ndarray:
    """Return a motion's rotations (m, 4) as the rows of channels, the first as near to `first` (4,) as may be, (4, m).

    The order is None for quaternions, which stay as long as they are and of which the first one stays, AXIS_ANGLE, or
    that of Euler angles, which have the first three rows.
    """
    if order is None:
        return align_signs(quaternions).T
    count = len(quaternions)
    ends = np.concatenate((REST[:3], first, REST[7:]))[None, :, None].repeat(2, axis=0)
    poses, progress = Poses(np.zeros((count, 3)), align_signs(quaternions)), np.arange(count) / count
    return channel_values(poses, np.array([count]), progress, ends, REST[:, None], order)[ROWS[ROTATION]]


class RigMotion:
    """The bones of a rig on frames (m,) of an Action, as they were recorded and as they are by now.

    `sources` is what is keyed of bones, by their numbers, where that is read already. The radius is that of the ball
    around every bone's head, in the scene's units; as far as each bone reaches where None.
    """

    def __init__(
        self, rig: bpy.types.Object, slot: Slot, sources: Mapping[int, Source], frames: np.ndarray, radius: float | None
    ) -> None:
        self.rig, self.bones = rig, list(rig.pose.bones)
        self.transforms = [transform_of(bone) for bone in self.bones]
        self.hierarchy, scale = Hierarchy(self.bones), scale_in_scene(transform_of(rig))
        reaches = {} if radius else reaches_of(rig)
        self.radii = np.array([radius / scale if radius else reaches[bone.name] for bone in self.bones])
        keyed, self._curves = _keyed_in(rig, slot)
        self._recorded = {
            number: source
            for number, transform in enumerate(self.transforms)
            if (source := sources.get(number) or keyed.get(transform.prefix)) is not None
        }
        self._carrier = self._recorded_carrier = keyed.get("")
        self.poses = self._look_at(frames)
        """Poses of each bone's channels, each of shape (m,)."""
        self.unit = float(np.linalg.norm(self.world.axes, 2, axis=(-2, -1)).max()) or 1.0
        """The length of the rig's unit of length in the scene, at most."""
        sizes = np.sqrt(np.einsum("...ij,...ij->...j", self._posed.axes, self._posed.axes).max(axis=-1))
        away = np.linalg.norm(self._posed.origins, axis=-1) + self.radii[:, None] * sizes
        self.extent = float(away.max())
        """The distance that any bone's ball gets from the rig's origin, in its unit."""
        self.rounding = SMALLEST * self.unit * self.extent

    def _look_at(self, frames: np.ndarray) -> list[Poses]:
        """Have all bones be as they were recorded on these frames, and return the poses of their channels."""
        self.frames = frames
        self._shown: dict[int, Source | None] = {}
        recorded = [self.transforms[number] for number in self._recorded]
        known = dict(zip(recorded, shown_together(recorded, [*self._recorded.values()], frames), strict=True))
        result = [
            known.get(transform) or evaluated(transform, self._curves.get(transform.prefix, {}), frames)
            for transform in self.transforms
        ]
        self._channels = AffineMaps(
            np.stack([maps.axes for _, maps in result]), np.stack([maps.origins for _, maps in result])
        )
        self._recorded_channels = self._channels.copy()
        self._posed = self.hierarchy.posed(self._channels)
        self.world = self._carried_by(self._recorded_carrier)
        """The place of the rig, shape (m,) or (1,)."""
        self._carried = self._carried_by(self._carrier)
        self.truth = self.world @ self._posed
        """The positions of the bones in the scene, shape (bones, m)."""
        return [poses for poses, _ in result]

    def at(self, frames: np.ndarray) -> RigMotion:
        """Return the same rig on other frames, its bones as they were recorded."""
        result = copy(self)
        result.poses = []
        result._look_at(frames)
        return result

    def _carried_by(self, source: Source | None) -> AffineMaps:
        """Return where the rig itself is, by its own keys or as it stands. Its parents are where they are now."""
        transform = transform_of(self.rig)
        if source is None:
            world = np.array(self.rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)
            return AffineMaps(world[None, :3, :3], world[None, :3, 3])
        return AffineMaps(into_scene(transform), np.zeros(3)) @ shown(transform, source, self.frames)[1]

    def carry(self, source: Source) -> None:
        """Let the rig itself be moved by other keys."""
        self._carrier, self._carried = source, self._carried_by(source)

    def among(self, moments: np.ndarray) -> RigMotion:
        """Return the same rig at some of its moments, by a mask (m,)."""
        result = copy(self)
        result.poses, result.frames, result._shown = [], self.frames[moments], dict(self._shown)
        for name in ("_channels", "_recorded_channels", "_posed", "truth", "world", "_carried"):
            maps = getattr(self, name)
            setattr(result, name, maps if maps.axes.shape[-3] == 1 else maps[..., moments])
        return result

    def show(self, sources: Mapping[int, Source | None]) -> None:
        """Let bones be moved by other keys, or as they were where it is None."""
        changed = {number: source for number, source in sources.items() if source is not self._shown.get(number)}
        now = {number: source for number, source in changed.items() if source is not None}
        shown_now = shown_together([self.transforms[number] for number in now], [*now.values()], self.frames)
        for number, (_, maps) in zip(now, shown_now, strict=True):
            self._channels[number] = maps
        for number in changed.keys() - now.keys():
            self._channels[number] = self._recorded_channels[number]
        self._shown |= changed
        self.hierarchy.pose(changed, self._channels, self._posed)

    def now(self, number: int | slice = slice(None)) -> AffineMaps:
        """Return where a bone, or all of them, are in the scene by now, shape (m,) or (bones, m)."""
        return self._carried @ self._posed[number]

    def passes_zero(self, number: int) -> bool:
        """Return whether the scale of a bone's channels changes, and is zero or another way round at times."""
        volumes = np.linalg.det(self._recorded_channels[number].axes)
        return bool(np.ptp(volumes) > 0.0 and volumes.min() <= 0.0 <= volumes.max())

    def above(self, number: int) -> Iterator[int]:
        """Yield a bone and all that it hangs on."""
        while number >= 0:
            yield number
            number = int(self.hierarchy.parents[number])

    def over(self, allowed: float, weights: np.ndarray) -> list[tuple[float, int, int]]:
        """Return where errors are over what is allowed: weighted error, bone and moment, the largest first.

        `weights` are of shape (bones, m).
        """
        result = []
        for number, (radius, weight) in enumerate(zip(self.radii, weights, strict=True)):
            errors = displacement_over(self.now(number), self.truth[number], radius, allowed / weight.max()) * weight
            at = np.flatnonzero(~(errors <= allowed))
            result += [(error, number, moment) for error, moment in zip(errors[at].tolist(), at.tolist(), strict=True)]
        return sorted(result, reverse=True)

    def to_blame(self, number: int, moment: int, among: Iterable[int], share: float) -> list[int]:
        """Return which of these bones, as they were recorded, would take a bone's error at a moment to a share of it.

        They are few: that which helps most is the first, and so on. None where all of them would not.
        """
        chain, left, result = [*self.above(number)][::-1], list(among), []
        now, recorded = self._channels[chain, moment], self._recorded_channels[chain, moment]
        truth, world = self.truth[number, moment], self._carried[moment if len(self._carried.axes) > 1 else 0]
        least = share * ball_displacement(self.now(number)[moment], truth, self.radii[number])
        while left:
            above = None
            for row, item in enumerate(chain):
                restored = np.isin(left, item) | (item in result)
                axes = np.where(restored[:, None, None], recorded.axes[row], now.axes[row])
                channels = AffineMaps(axes, np.where(restored[:, None], recorded.origins[row], now.origins[row]))
                above = self.hierarchy.placed(item, channels, above)
            assert above is not None  # the bone itself is the last of its chain
            errors = ball_displacement(world @ above, truth[None], np.full(len(left), self.radii[number]))
            best = int(np.argmin(errors))
            result.append(left.pop(best))
            if errors[best] <= least:
                return result
        return []

    def largest_errors(self) -> np.ndarray:
        """Return the largest displacement of any point in each bone's ball, in the scene's units, shape (bones,)."""
        numbers = range(len(self.bones))
        return np.array([largest_displacement(self.now(n), self.truth[n], self.radii[n]) for n in numbers])


def _keyed_in(
    rig: bpy.types.Object, slot: Slot
) -> tuple[dict[str, Source], dict[str, dict[Channel, bpy.types.FCurve]]]:
    """Return what a slot has of a rig and its bones, by the prefixes of their data paths: sources, and all F-curves."""
    sources: dict[str, Source] = {}
    bindings = bindings_in_slot(slot)
    for binding, of_users in zip(bindings, sources_of_users(bindings), strict=True):
        source = next((one for user, one in zip(binding.users, of_users, strict=True) if user.animated == rig), None)
        has_more = is_part(binding.prefix) and any(any(on_top(fcurve)) for fcurve in binding.curves.values())
        if isinstance(source, Source) and source.channels and not source.driven and not has_more:
            with suppress(Refused):
                refuse_numbers(binding.name, source)
                sources[binding.prefix] = source
    curves: dict[str, dict[Channel, bpy.types.FCurve]] = {}
    for fcurve in slot.fcurves:
        path = fcurve.data_path
        curves.setdefault(split_path(path)[0], {})[path, fcurve.array_index] = fcurve
    return sources, curves
