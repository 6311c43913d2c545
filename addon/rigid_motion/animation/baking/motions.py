"""How transforms and whole rigs move as their channels say: poses for the search for keys, affine maps for its proof.

Bones are numbered as the rig has them. Moments are the frames that are looked at, those between and around samples
among them. Poses are those that the channels give: constraints and drivers have no part in it, and of the bones that
follow these it is told which they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from types import MappingProxyType

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from ...motion import Poses
from ...motion.affine import AffineMaps, ball_displacement, displacement_over, largest_displacement
from ...motion.eulers import ORDERS
from ...motion.quaternions import matrices, multiply
from ..actions.reading import sources_of_users
from ..actions.refusals import refuse_numbers
from ..actions.slots import Slot, bindings_in_slot, slots_alone
from ..compute.bodies import turn_into_quaternions
from ..compute.components import LOCATION, ROTATION, ROWS, SCALE
from ..compute.differences import in_betweens
from ..compute.sources import Source
from ..curves.keys import LARGEST
from ..transforms import WIDTHS, Channel, Refused, Transform, shows_differences, split_path, transform_of
from ..transforms.posing import Hierarchy
from ..transforms.sizes import into_scene, reaches_of, scale_in_scene

MOVING = {*WIDTHS, "rotation_axis_angle", "rotation_mode"}
"""Properties of bones that a driver moves them by."""

CHAINS = ("IK", "SPLINE_IK")
"""Constraints that move bones above the one that has them."""

SMALLEST = 1e-6
"""Errors of single precision, relative to how far something gets."""


@dataclass(frozen=True)
class NotPromised:
    """The bones that a tolerance is not promised for, by their names."""

    followers: tuple[str, ...] = ()
    """Bones that follow constraints or drivers."""

    below: tuple[str, ...] = ()
    """Bones that hang on these."""

    def __bool__(self) -> bool:
        return bool(self.followers)

    def __contains__(self, name: str) -> bool:
        return name in self.followers or name in self.below


ALL_PROMISED = NotPromised()


def not_promised(rig: bpy.types.Object) -> NotPromised:
    """Return the bones of a rig whose motion is not that of their channels, and of those above them, alone."""
    followers = {*_constrained(rig), *_driven(rig)}
    bones = rig.pose.bones
    below = {bone.name for bone in bones if any(parent.name in followers for parent in bone.parent_recursive)}
    ordered = [bone.name for bone in bones]
    return NotPromised(
        tuple(name for name in ordered if name in followers),
        tuple(name for name in ordered if name in below - followers),
    )


def _constrained(rig: bpy.types.Object) -> Iterator[str]:
    animated = _animated_paths(rig)
    for bone in rig.pose.bones:
        for constraint in bone.constraints:
            if shows_differences(constraint):
                continue
            path = constraint.path_from_id()
            is_switched = any(f"{path}.{name}" in animated for name in ("influence", "mute", "enabled"))
            if is_switched or (not constraint.mute and constraint.influence > 0.0):
                yield bone.name
                if constraint.type in CHAINS:
                    # The bone itself is the last of a chain, unless that is to reach for its head.
                    count = constraint.chain_count - getattr(constraint, "use_tail", True)
                    above = bone.parent_recursive[:count] if constraint.chain_count else bone.parent_recursive
                    yield from (parent.name for parent in above)


def _driven(rig: bpy.types.Object) -> Iterator[str]:
    names = {f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].': bone.name for bone in rig.pose.bones}
    for driver in _drivers(rig):
        prefix, prop = split_path(driver.data_path)
        if prefix in names and prop in MOVING and not driver.mute:
            yield names[prefix]


def _drivers(rig: bpy.types.Object) -> Iterator[bpy.types.FCurve]:
    data = rig.animation_data
    yield from data.drivers if data is not None else ()


def _animated_paths(rig: bpy.types.Object) -> set[str]:
    """Return the data paths that drivers or F-curves of the rig set."""
    curves = {fcurve.data_path for slot in slots_alone(rig) for fcurve in slot.fcurves}
    return curves | {driver.data_path for driver in _drivers(rig)}


def shown(
    transform: Transform, source: Source, frames: np.ndarray, rate: int | None = None
) -> tuple[Poses, AffineMaps]:
    """Return how a source is seen on these frames (n,), with the object's own delta transforms, and what is not keyed.

    With so many samples of its in-betweens a frame, if given; what moves by delta transforms has one.

    Returns
    -------
    poses : Poses, shape (n,)
        Along the axes of the body at rest. Where the scale is uneven, its geometric mean.
    maps : AffineMaps, shape (n,)
        Of the channels as Blender has them: location runs along its own axes, and scale may be uneven or negative.
    """
    desired = in_betweens(source, frames, rate=rate if transform.has_difference_slot else 1).desired
    delta, rest, along, count = source.original, transform.components(), source.location_axes, len(frames)
    positions, quaternions = desired.positions, desired.quaternions
    if LOCATION not in source.keyed:
        position = rest[ROWS[LOCATION]] + delta[ROWS[LOCATION]]
        positions = np.tile(position if along is None else along @ position, (count, 1))
    if ROTATION not in source.keyed:
        column = rest[:, None].copy()
        turn_into_quaternions(column, source.order)
        quaternions = np.tile(multiply(delta[ROWS[ROTATION]], column[ROWS[ROTATION], 0]), (count, 1))
    if desired.scales is not None:
        return Poses(positions, quaternions, desired.scales), _maps(
            positions, quaternions, desired.scales[:, None], along
        )
    scale = np.tile(rest[ROWS[SCALE]] * delta[ROWS[SCALE]], (count, 1))
    if SCALE in source.keyed:
        scale = (source.values_at(frames)[ROWS[SCALE]] * delta[ROWS[SCALE], None]).T
    mean = np.cbrt(np.abs(scale.prod(axis=1)))
    return Poses(positions, quaternions, mean), _maps(positions, quaternions, scale, along)


def evaluated(
    transform: Transform, curves: Mapping[Channel, bpy.types.FCurve], frames: np.ndarray
) -> tuple[Poses, AffineMaps]:
    """Return what `shown` does, for a bone that makes no source: as Blender evaluates its F-curves, or as it stands."""
    bone, frame_list = transform.carrier, frames.tolist()

    def values(name: str) -> np.ndarray:
        stands = getattr(bone, name)
        columns = []
        for index, value in enumerate(stands):
            fcurve = curves.get((transform.prefix + name, index))
            has_say = fcurve is not None and not fcurve.mute and not fcurve.is_empty
            columns.append([fcurve.evaluate(frame) for frame in frame_list] if has_say else [value] * len(frame_list))
        result = np.array(columns, dtype=np.float64).T
        return result if (np.abs(result) < LARGEST).all() else np.tile(np.array(stands), (len(frame_list), 1))

    mode = bone.rotation_mode
    if mode in ORDERS:
        turns = [Euler(angles, mode).to_quaternion() for angles in values("rotation_euler").tolist()]
    elif mode == "AXIS_ANGLE":
        turns = [Quaternion(axis, angle) for angle, *axis in values("rotation_axis_angle").tolist()]
    else:
        turns = [Quaternion(turn).normalized() for turn in values("rotation_quaternion").tolist()]
    along, scale = transform.location_axes, values("scale")
    positions = values("location") if along is None else values("location") @ along.T
    quaternions = np.array(turns, dtype=np.float64)
    mean = np.cbrt(np.abs(scale.prod(axis=1)))
    return Poses(positions, quaternions, mean), _maps(positions, quaternions, scale, along)


def _maps(positions: np.ndarray, quaternions: np.ndarray, scale: np.ndarray, along: np.ndarray | None) -> AffineMaps:
    """Return the maps with positions (n, 3) along the body's axes, quaternions (n, 4) and scales (n, 3) or (n, 1)."""
    axes = np.moveaxis(matrices(quaternions), -1, 0) * scale[:, None, :]
    return AffineMaps(axes, positions if along is None else positions @ along)


class RigMotion:
    """The bones of a rig on many frames, as they were recorded and as they are by now.

    Parameters
    ----------
    rig : bpy.types.Object
    slot : Slot
        What moves them.
    sources : mapping
        What is keyed of bones, by their numbers, where that is read already.
    frames : array, shape (m,)
        Those of the Action that are looked at.
    radius : float or None
        Of the ball around every bone's head, in the scene's units; as far as each bone reaches where None.
    """

    def __init__(
        self,
        rig: bpy.types.Object,
        slot: Slot,
        sources: Mapping[int, Source],
        frames: np.ndarray,
        radius: float | None,
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
        self._shown: dict[int, tuple[Source | None, int | None]] = {}
        result = [
            shown(transform, self._recorded[number], frames)
            if number in self._recorded
            else evaluated(transform, self._curves.get(transform.prefix, {}), frames)
            for number, transform in enumerate(self.transforms)
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

    def show(self, sources: Mapping[int, Source | None], rates: Mapping[int, int] = MappingProxyType({})) -> None:
        """Let bones be moved by other keys, or as they were where it is None; with so many samples a frame, if said."""
        asked = {number: (source, rates.get(number)) for number, source in sources.items()}
        changed = {number: item for number, item in asked.items() if item != self._shown.get(number, (None, None))}
        for number, (source, rate) in changed.items():
            if source is None:
                self._channels[number] = self._recorded_channels[number]
            else:
                self._channels[number] = shown(self.transforms[number], source, self.frames, rate)[1]
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
        for user, source in zip(binding.users, of_users, strict=True):
            if user.animated == rig and isinstance(source, Source) and source.channels and not source.driven:
                with suppress(Refused):
                    refuse_numbers(user.name, source)
                    sources[binding.prefix] = source
    curves: dict[str, dict[Channel, bpy.types.FCurve]] = {}
    for fcurve in slot.fcurves:
        path = fcurve.data_path
        curves.setdefault(split_path(path)[0], {})[path, fcurve.array_index] = fcurve
    return sources, curves
