"""How all bones of a rig move as one slot has it, and how far off they are with other keys: exactly, frame by frame.

Bones are numbered as the rig has them. Moments are the frames that are looked at, those between and around samples
among them. Poses are those that the channels give: constraints and drivers have no part in it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress

import bpy
import numpy as np

from ...motion.affine import AffineMaps, ball_displacement, displacement_bound
from ..actions.reading import sources_of_users
from ..actions.refusals import refuse_numbers
from ..actions.slots import Slot, bindings_in_slot
from ..compute.sources import Source
from ..transforms import Channel, Refused, split_path, transform_of
from ..transforms.posing import Hierarchy
from .channel_maps import evaluated, shown
from .sizes import into_scene, reach_of, scale_in_scene

SMALLEST = 1e-6
"""Errors of single precision, relative to how far something gets."""


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
        self.rig, self.frames, self.bones = rig, frames, list(rig.pose.bones)
        self.transforms = [transform_of(bone) for bone in self.bones]
        self.hierarchy, scale = Hierarchy(self.bones), scale_in_scene(transform_of(rig))
        self.radii = np.array([radius / scale if radius else reach_of(bone) for bone in self.bones])
        keyed, curves = _keyed_in(rig, slot)
        result = [
            shown(transform, source, frames)
            if (source := sources.get(number) or keyed.get(transform.prefix)) is not None
            else evaluated(transform, curves.get(transform.prefix, {}), frames)
            for number, transform in enumerate(self.transforms)
        ]
        self.poses = [poses for poses, _ in result]
        """Poses of each bone's channels, each of shape (m,)."""
        self._channels = AffineMaps(
            np.stack([maps.axes for _, maps in result]), np.stack([maps.origins for _, maps in result])
        )
        self._recorded_channels = self._channels.copy()
        self._posed = self.hierarchy.posed(self._channels)
        recorded = self._posed.copy()
        self.world = self.carried_by(keyed.get(""))
        """The place of the rig, shape (m,) or (1,)."""
        self._carried = self.world
        self.truth = self.world @ recorded
        """The positions of the bones in the scene, shape (bones, m)."""
        self.unit = float(np.linalg.norm(self.world.axes, 2, axis=(-2, -1)).max()) or 1.0
        """The length of the rig's unit of length in the scene, at most."""
        sizes = np.sqrt(np.einsum("...ij,...ij->...j", recorded.axes, recorded.axes).max(axis=-1))
        away = np.linalg.norm(recorded.origins, axis=-1) + self.radii[:, None] * sizes
        self.extent = float(away.max())
        """The distance that any bone's ball gets from the rig's origin, in its unit."""
        self.rounding = SMALLEST * self.unit * self.extent

    def carried_by(self, source: Source | None) -> AffineMaps:
        """Return where the rig itself is, by its own keys or as it stands. Its parents are where they are now."""
        transform = transform_of(self.rig)
        if source is None:
            world = np.array(self.rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)
            return AffineMaps(world[None, :3, :3], world[None, :3, 3])
        return AffineMaps(into_scene(transform), np.zeros(3)) @ shown(transform, source, self.frames)[1]

    def carry(self, source: Source) -> None:
        """Let the rig itself be moved by other keys."""
        self._carried = self.carried_by(source)

    def show(self, sources: Mapping[int, Source | None]) -> None:
        """Let bones be moved by other keys, or as they were where it is None."""
        for number, source in sources.items():
            if source is None:
                self._channels[number] = self._recorded_channels[number]
            else:
                self._channels[number] = shown(self.transforms[number], source, self.frames)[1]
        self.hierarchy.pose(sources, self._channels, self._posed)

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

    def below(self, number: int) -> list[int]:
        """Return a bone and all that hang on it."""
        return [item for item in range(len(self.bones)) if number in self.above(item)]

    def over(
        self, allowed: float, weights: np.ndarray, numbers: Iterable[int] | None = None
    ) -> list[tuple[float, int, int]]:
        """Return where errors are over what is allowed: weighted error, bone and moment, the largest first.

        `weights` are of shape (bones, m). Of these bones, or all.
        """
        result = []
        for number in range(len(self.bones)) if numbers is None else numbers:
            now, truth, radius = self.now(number), self.truth[number], self.radii[number]
            # What is not finite is not within it, either.
            may = np.flatnonzero(~(displacement_bound(now, truth, radius) * weights[number] <= allowed))
            if len(may):
                errors = ball_displacement(now[may], truth[may], np.full(len(may), radius)) * weights[number, may]
                over = ~(errors <= allowed)
                result += [(float(e), number, int(at)) for e, at in zip(errors[over], may[over], strict=True)]
        return sorted(result, reverse=True)

    def largest_error(self, number: int) -> float:
        """Return the largest displacement of any point in a bone's ball on any frame, in the scene's units."""
        now, truth, radius = self.now(number), self.truth[number], self.radii[number]
        bounds = displacement_bound(now, truth, radius)
        at = [int(np.argmax(bounds))]
        least = ball_displacement(now[at], truth[at], np.full(1, radius))
        may = np.flatnonzero(bounds >= least)
        return float(ball_displacement(now[may], truth[may], np.full(len(may), radius)).max(initial=least[0]))


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
    for fcurve in () if slot.channelbag is None else slot.channelbag.fcurves:
        path = fcurve.data_path
        curves.setdefault(split_path(path)[0], {})[path, fcurve.array_index] = fcurve
    return sources, curves
