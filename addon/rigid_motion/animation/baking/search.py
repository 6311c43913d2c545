"""Search for the few keys that an object, or a rig and its bones, need: one plan for everything that one slot moves.

The search treats all joints as rigid. Its result is then proven in the motion that Blender plays, between keys too: the
tolerance is kept at every bone, whether it gets fewer keys itself or only follows a bone that does. Poses are those of
the channels, without constraints and drivers. Lengths are the scene's units.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...blender import pose_bones, scene
from ...motion import reduce_keys, reduce_skeleton_keys
from ...motion.contacts import slide, standing
from ..actions.slots import Binding
from ..evaluation.marks import without
from ..evaluation.sources import SAME_FRAME, KeyedTransform, distinct
from ..transforms import Refused, Transform, transform_of
from .fewer_keys import (
    FewerKeys,
    NeedsItsKeys,
    WholeRig,
    count_of,
    moments,
    samples_of,
    seen_frames,
    united,
    values_on,
    with_keys,
)
from .motions import BodyMotion, not_promised
from .native_curves import NATIVE, JointCurves, choose_handles, needed, scratch_curve

NO_FEWER = n_("{name} needs its {count} keys to stay within the tolerance: allow a larger one")
NOT_SO_MANY = n_("{name} has {count} keys: ask for fewer")

CONTACT_WEIGHT = 4.0
"""The weight of errors of bones that stand on the ground."""

MIN_MEND_SPACING_FRAMES = 4
"""The least number of frames between places where keys are added in the same round."""

AT_ONCE = 2**18
"""The number of joints times moments checked at once."""

MAX_CURVE_TRIES, TIGHTENING_POWER, MAX_TIGHTENING = 3, 0.8, 3.0
"""The most searches for curves; the power of the excess error by which each next search reduces the tolerance; and the
largest excess that counts."""

MAX_BUDGET_HALVINGS = 24
"""The most steps of searching the tolerance that gives the requested number of keys."""

Members = Mapping[Transform, tuple[Binding, KeyedTransform]]
"""The transforms of an object and its bones that one slot moves and that are reduced, with binding and source."""

Keyed = Callable[[int, np.ndarray], KeyedTransform]
"""Returns the source of a joint, by its number, with keys on only these frames (k,)."""

Over = list[tuple[float, int, int]]
"""Errors above the tolerance, see `BodyMotion.over`."""


@dataclass(frozen=True)
class Wishes:
    """The options of a reduction: see `reduce_keys_of`. A count overrides the tolerance."""

    mode: str
    tolerance: float
    radius: float | None
    shared: bool = False
    hold: bool = False
    count: int | None = None


class NotFewer(Exception):
    """Raised if a mode needs as many keys as another one, or more."""


def fewer_keys(
    obj: bpy.types.Object,
    members: Members,
    wishes: Wishes,
    *,
    below: float = math.inf,
    space: np.ndarray | None = None,
) -> dict[Transform, FewerKeys]:
    """Return the plans for those of an object and its bones that can have fewer keys.

    Raises `Refused` if none of several members can have fewer, and `NotFewer` if a mode needs `below` keys or more even
    before they are proven. With a `space`, see `BodyMotion`, the only member is treated by itself.
    """
    mode, count = wishes.mode, wishes.count
    tolerance = wishes.tolerance if count is None else math.inf
    body = SearchedBody(obj, members, tolerance, wishes.radius, hold=wishes.hold, space=space)
    shared = wishes.shared or count is not None
    if mode == NATIVE:
        fewer = body.curved(count, shared=shared)
    else:
        found = body.searched(mode, count, shared=shared)
        if sum(min(len(keys), count_of(body.sources[number])) for number, keys in found.items()) >= below:
            raise NotFewer
        fewer = body.proven(found, body.with_mode(mode), shared=shared)
    if not fewer and len(members) > 1:
        text = NO_FEWER if count is None else NOT_SO_MANY
        raise NeedsItsKeys(text, name=obj.name, count=np.count_nonzero(body.sampled))
    return body.plans(fewer)


class SearchedBody:
    """An object and its bones as one slot moves them: the joints to be reduced, and all others unchanged."""

    def __init__(
        self,
        obj: bpy.types.Object,
        members: Members,
        tolerance: float,
        radius: float | None,
        *,
        hold: bool,
        space: np.ndarray | None,
        places: np.ndarray | None = None,
    ) -> None:
        self.obj, self.tolerance, self.members = obj, tolerance, members
        bones = pose_bones(obj) if space is None and any(transform.is_part for transform in members) else ()
        joints = [transform_of(obj), *map(transform_of, bones)] if space is None else list(members)
        self.sources = {number: members[joint][1] for number, joint in enumerate(joints) if joint in members}
        samples = united(map(samples_of, self.sources.values()))
        self.frames = seen_frames(samples, list(self.sources.values()))
        self.sampled = np.isin(self.frames, samples if places is None else places)
        """True for the moments that keys may be on."""
        # If keys may be only on some moments, handles are still fitted to all of them.
        self._fitted = self.sampled if places is None else np.ones(len(self.frames), dtype=bool)
        slot = next(binding.slot for binding, _ in members.values())
        self.motion = BodyMotion(joints, slot, self.sources, self.frames, radius, space)
        self.allowed = tolerance + self.motion.rounding
        self.stands = np.zeros((len(joints), len(self.frames)), dtype=bool)
        """True for the bones that stand on the ground, at each moment."""
        if bones:
            render = scene().render
            seconds = self.frames * render.fps_base / render.fps
            self.stands[1:] = standing(seconds, self.motion.truth.origins[1:])
        self.weights = np.where(self.stands, CONTACT_WEIGHT, 1.0) if hold else np.ones(self.stands.shape)
        self.errors: np.ndarray = np.zeros(len(joints))
        """The largest displacement of any point in each joint's ball, from the last proof, shape (joints,)."""
        self.between: np.ndarray = np.zeros(len(joints))
        """The largest displacement at any moment if `errors` are those on frames, otherwise 0; shape (joints,)."""
        self.stretches = self.split(moments(self.frames, list(self.sources.values())))

    def split(self, frames: np.ndarray) -> list[np.ndarray]:
        """Return frames in stretches that are checked at once."""
        step = max(1, AT_ONCE // len(self.motion.joints))
        return [frames[first : first + step] for first in range(0, len(frames), step)]

    def searched(self, mode: str, count: int | None, *, shared: bool) -> dict[int, np.ndarray]:
        """Return the frames of the keys that joints need if all of them are rigid, by joint number."""
        motion, at = self.motion, np.flatnonzero(self.sampled)
        fixed = [number not in self.sources for number in range(len(motion.joints))]
        parents, poses, share = motion.as_chains()
        wish: dict[str, Any] = {"budget": count}
        if count is None:
            wish = {"tolerance": self.tolerance * share / motion.unit}
        times, poses = self.frames[at], poses[:, at]
        if len(fixed) == 1:
            keys: tuple[Any, ...] = (reduce_keys(times, poses[0], mode, radius=float(motion.radii[0]), **wish),)
        else:
            wish |= {"radius": motion.radii, "weights": self.weights[:, at], "fixed": fixed}
            keys = reduce_skeleton_keys(times, poses, parents, mode, shared=shared or count is not None, **wish)
        return {
            number: self._within_its_keys(times[rows], number) for number, rows in enumerate(keys) if not fixed[number]
        }

    def curved(self, count: int | None, *, shared: bool) -> dict[int, KeyedTransform]:
        """Return the joints that get fewer keys, with these as Blender's own curves: see `proven`.

        Joints keep to the tolerance on frames. `between` is set to their errors at all moments.
        """
        every, self.stretches = self.stretches, self.split(self.frames)
        curves = self.curves(every=shared, tolerance=self.motion.extent * self.motion.unit if count else self.tolerance)
        fewer, scales = self._with_key_count(curves, count) if count else self._fewest(curves, shared=shared)
        fewer = self.automatic(curves, fewer, scales)
        on_frames, self.stretches = self.stretches, every
        self.keep_to(math.inf, fewer)
        self.between, self.stretches = self.errors.copy(), on_frames
        self.keep_to(math.inf, fewer)
        return fewer

    def curves(self, tolerance: float, *, every: bool) -> dict[int, JointCurves]:
        """Return the curves to fit for joints, by number: on samples between each joint's outer keys, or on `every`."""
        samples, motion = self.frames[self._fitted], self.motion
        result = {}
        for number, source in self.sources.items():
            first, last = self._ends(number)
            frames = samples if every else samples[(samples >= first) & (samples <= last)]
            weights = self.weights[motion.below(number)].max(axis=0)[np.searchsorted(self.frames, frames)]
            allowed = tolerance / motion.unit / weights
            result[number] = JointCurves(motion.joints[number], source, frames, motion.reach(number), allowed)
        return result

    def _fewest(
        self, curves: dict[int, JointCurves], *, shared: bool
    ) -> tuple[dict[int, KeyedTransform], dict[int, float]]:
        """Return the fewest keys found for all joints, and the scale of each joint's allowed error."""
        choose_handles(curves)
        scales, best, fewest = dict.fromkeys(curves, 1.0), (dict[int, KeyedTransform](), dict[int, float]()), math.inf
        for _ in range(MAX_CURVE_TRIES):
            chosen, keyed = needed(curves, scales, shared=shared), _keyed(curves, scales)
            self.motion.show({number: keyed(number, keys) for number, keys in chosen.items()})
            # Errors add up from parents to children.
            errors = self.motion.largest_errors(self.weights) / self.allowed
            excess = {number: max(1.0, errors[self.motion.below(number)].max()) for number in curves}
            fewer = self.proven(chosen, keyed, shared=shared)
            count = sum(count_of(fewer.get(number, source)) for number, source in self.sources.items())
            if count < fewest:
                best, fewest = (fewer, scales), count
            if max(excess.values()) == 1.0:
                break
            scales = {
                number: scale / min(excess[number], MAX_TIGHTENING) ** TIGHTENING_POWER
                for number, scale in scales.items()
            }
        return best

    def _with_key_count(
        self, curves: dict[int, JointCurves], count: int
    ) -> tuple[dict[int, KeyedTransform], dict[int, float]]:
        """Return this number of keys on the same frames for all joints, and the scale of each joint's allowed error."""
        low, high, keys = 0.0, 1.0, self.frames[self.sampled][[0, -1]]
        for _ in range(MAX_BUDGET_HALVINGS):
            scale = math.sqrt(low * high) or high / MAX_TIGHTENING**2
            found = united(needed(curves, dict.fromkeys(curves, scale), shared=True).values())
            low, high, keys = (scale, high, keys) if len(found) > count else (low, scale, found)
            if len(keys) == count or low > high / 1.01:
                break
        scales = dict.fromkeys(curves, high)
        able, keyed = [n for n, source in self.sources.items() if count < count_of(source)], _keyed(curves, scales)
        while True:
            fewer = {number: keyed(number, keys) for number in able}
            if len(keys) >= count or not able:
                return fewer, scales
            # No tolerance gives exactly this number of keys: add the rest where the error is largest.
            self.motion.show({number: fewer.get(number) for number in self.sources})
            off = (self.frames[moment] for _, _, moment in self.motion.over(0.0, self.weights))
            left = np.setdiff1d(self.frames[self.sampled], keys)
            keys = np.union1d(keys, next((frame for frame in off if frame in left), left[0]))

    def automatic(
        self, curves: dict[int, JointCurves], fewer: dict[int, KeyedTransform], scales: dict[int, float]
    ) -> dict[int, KeyedTransform]:
        """Return the joints with Blender's automatic handles wherever everything keeps to the tolerance with them."""
        result = dict(fewer)
        with scratch_curve() as scratch:
            for number, source in fewer.items():
                result[number] = curves[number].automatic(source, scales[number], scratch)

        def mend(over: Over, motion: BodyMotion) -> bool:
            back = {item for _, number, _ in over for item in motion.above(number)}
            changed = [number for number in back if number in fewer and result[number] is not fewer[number]]
            result.update({number: fewer[number] for number in changed})
            return bool(changed)

        self.keep_to(self.allowed, result, mend)
        return result

    def plans(self, fewer: Mapping[int, KeyedTransform]) -> dict[Transform, FewerKeys]:
        """Return the plans for the joints that now have fewer keys."""
        joints, motion, whole = self.motion.joints, self.motion, None
        counted = np.ones(len(joints), dtype=bool)
        if fewer and len(joints) > 1:
            excepted = not_promised(self.obj)
            # Bones without a guarantee count only if they have fewer keys.
            counted[:] = [n in fewer or joint.carrier.name not in excepted for n, joint in enumerate(joints)]
            motion.show(fewer)
            before, after = (slide(maps.origins, self.stands) for maps in (motion.truth, motion.now()))
            frames = united(source.keyed_frames for source in fewer.values())
            whole = WholeRig(len(frames), before, after, excepted)
        largest, between = float(self.errors[counted].max()), float(self.between[counted].max())
        return {
            joints[number]: FewerKeys(*self.members[joints[number]], source, largest, whole, between)
            for number, source in fewer.items()
        }

    def _within_its_keys(self, keys: np.ndarray, number: int) -> np.ndarray:
        """Return a joint's key frames, limited to the range of its present keys: it holds still outside of that."""
        first, last = self._ends(number)
        inside = keys[(keys > first) & (keys < last)]
        return keys if len(keys) == 1 else np.union1d(inside, (first, last))

    def _ends(self, number: int) -> np.ndarray:
        """Return the frames of a joint's first and last key."""
        ends = distinct(self.sources[number].keyed_frames)[[0, -1]]
        return self.frames[np.searchsorted(self.frames, ends - SAME_FRAME)]

    def with_mode(self, mode: str) -> Keyed:
        """Return the function that gives a joint keys on only these frames, with a mode."""

        def keyed(number: int, keys: np.ndarray) -> KeyedTransform:
            source, every = self.sources[number], np.union1d(self.frames, keys)
            at = np.searchsorted(every, keys)
            values = values_on(self.motion.joints[number], source, every)
            return with_keys(source, keys, {row: column[at] for row, column in values.items()}, mode)

        return keyed

    def proven(self, chosen: dict[int, np.ndarray], keyed: Keyed, *, shared: bool) -> dict[int, KeyedTransform]:
        """Return the joints that get fewer keys, and those keys, with the whole body within the tolerance.

        Keys are put back in `chosen`, the key frames of each joint, where the actual errors are too large. A joint that
        would not have fewer keys than before stays unchanged.
        """
        fewer: dict[int, KeyedTransform] = {}

        def update_fewer(numbers: Iterable[int]) -> None:
            for number in numbers:
                fewer[number] = keyed(number, chosen[number])
                if count_of(fewer[number]) >= count_of(self.sources[number]):
                    del fewer[number], chosen[number]

        def mend(over: Over, motion: BodyMotion) -> bool:
            changed = self._put_back(over, motion, chosen, shared=shared)
            update_fewer(changed)
            return bool(changed)

        update_fewer(list(chosen))
        self.keep_to(self.allowed, fewer, mend)
        return fewer

    def keep_to(
        self, allowed: float, fewer: dict[int, KeyedTransform], mend: Callable[[Over, BodyMotion], bool] | None = None
    ) -> None:
        """Show `fewer` and call `mend` until no error is above the allowed one at any moment.

        Long recordings are checked one stretch at a time.
        """
        settled = False
        while not settled:
            settled = True
            self.errors[:] = 0.0
            for frames in self.stretches:
                motion = self.motion.at(frames)
                # Between two frames the smaller of their weights counts.
                before, behind = (np.searchsorted(self.frames, frames, side) for side in ("right", "left"))
                weights = np.minimum(self.weights[:, before - 1], self.weights[:, behind])
                while True:
                    motion.show({number: fewer.get(number) for number in self.sources})
                    over = motion.over(allowed, weights)
                    if not over or mend is None or not mend(over, motion):
                        break
                    settled = False
                self.errors = np.maximum(self.errors, motion.largest_errors())

    def _put_back(self, over: Over, motion: BodyMotion, chosen: dict[int, np.ndarray], *, shared: bool) -> set[int]:
        """Put keys back where errors are largest, and return the joints that got any."""
        changed: set[int] = set()
        for error, number, moment in _worst_errors(over, motion):
            able = [item for item in motion.above(number) if item in chosen]
            blamed = motion.to_blame(number, moment, able, self.allowed / error)
            for those in (list(chosen),) if shared else (blamed, able):
                if added := self._with_keys_at(float(motion.frames[moment]), those, chosen):
                    break
            chosen.update(added)
            changed.update(added)
        if not changed and self._fitted is self.sampled:
            raise Refused(
                n_(
                    "{name} continues beyond its keys, which fewer keys would change: give its channels constant "
                    "extrapolation and no cycles, or cycles that all have the same range"
                ),
                name=motion.joints[over[0][1]].name,
            )
        return changed

    def _with_keys_at(
        self, frame: float, numbers: Iterable[int], chosen: dict[int, np.ndarray]
    ) -> dict[int, np.ndarray]:
        """Return the new keys of the joints that get any: on the samples around a frame, or else on the frame."""
        samples = self.frames[self.sampled]
        for around in (True, False) if self._fitted is self.sampled else (True,):
            added = {}
            for number in numbers:
                # Outside of its keys a joint holds the outer pose, or repeats the keys.
                first, last = self._ends(number)
                folded = self.sources[number].folded(np.array((frame,)))
                places = np.clip(folded, first, last)
                if around:
                    at = np.concatenate(
                        (np.searchsorted(samples, places, "right") - 1, np.searchsorted(samples, places))
                    )
                    # The two keys at an end decide how the motion continues beyond it.
                    at += np.where(folded < first, 1, 0) * (0, 1) - np.where(folded > last, 1, 0) * (1, 0)
                    places = np.clip(samples[np.clip(at, 0, len(samples) - 1)], first, last)
                if len(more := without(places, chosen[number])):
                    added[number] = np.union1d(chosen[number], (first, *more, last))
            if added:
                return added
        return {}


def _keyed(curves: Mapping[int, JointCurves], scales: Mapping[int, float]) -> Keyed:
    """Return the function that gives a joint curves with keys on only these frames, with its allowed error scaled."""
    return lambda number, keys: curves[number].keyed(keys, scales[number])


def _worst_errors(over: Over, motion: BodyMotion) -> Iterator[tuple[float, int, int]]:
    """Yield the largest errors, each the worst within its chain of joints for a few frames."""
    taken: set[tuple[int, int]] = set()
    for error, number, moment in over:
        # Mending a parent may mend this joint too.
        chain, span = [*motion.above(number)], int(motion.frames[moment] // MIN_MEND_SPACING_FRAMES)
        if taken.isdisjoint((item, near) for item in chain for near in (span - 1, span, span + 1)):
            taken.update((item, span) for item in chain)
            yield error, number, moment
