"""What modes make of the keys of one carrier: which of its channels run between which keys, and along what path.

`FCurve.evaluate` is asked for keys and timing, `interpolate` for the motion of each segment. Terms have to be muted.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Quaternion

from rigid_motion.motion import KEYFRAME_MODES, Poses, in_betweens, interpolate, twists
from rigid_motion.motion.quaternions import multiply
from tests.animation.keyed import (
    WIDTHS,
    Carrier,
    curve_of,
    distinct,
    key_frames,
    mode_at,
    moving_in,
    muted_in,
    rotation_path,
    transform_paths,
    turns_at,
)
from tests.animation.path_oracle import DEPENDS_ON_KEYS, beside_path, goes_beside, lies_on_path
from tests.animation.smooth_oracle import share_of, with_tangents
from tests.animation.spin_oracle import Spin, about_one_axis, spin_and_end
from tests.animation.timing_oracle import progress

SMOOTH = {name for name, mode in KEYFRAME_MODES.items() if mode.is_smooth}


@dataclass(frozen=True)
class Own:
    """Delta transforms that an object has of its own."""

    location: tuple[float, ...] = (0.0, 0.0, 0.0)
    quaternion: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)


def bodies_of(obj: Carrier, own: Own, keys: np.ndarray | None = None) -> list[Body]:
    """What runs between keys of its own: all together, or else location, rotation and scale each by itself."""
    parts, paths = part_keys(obj), transform_paths(obj)
    first, *others = parts.values() or [key_frames(obj)]
    if keys is not None or all(len(first) == len(other) and np.abs(first - other).max() < 0.01 for other in others):
        return [Body(obj, own, paths, first if keys is None else keys)]
    if paths[1] not in parts and _has_turns(obj) and not muted_in(obj, paths[1]):
        parts[paths[1]] = parts.get(paths[0], parts.get(paths[2]))
    every = Body(obj, own, paths, distinct(frame for of_part in parts.values() for frame in of_part))
    _, rotation, scale = [Body(obj, own, (path,), parts.get(path, np.empty(0)), every=every) for path in paths]

    def beside(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned, sizes = rotation.components(frames)[1], scale.components(frames)[2] / own.scale
        turned = np.tile(own.quaternion, (len(frames), 1)) if muted_in(obj, paths[1]) else turned
        sizes = np.ones_like(sizes) if muted_in(obj, paths[2]) else sizes
        return turned, np.maximum(sizes, 1e-3)

    location = Body(obj, own, paths[:1], parts.get("location", np.empty(0)), beside, rotation.keys, every)
    bodies = [location, rotation, scale]
    for body in bodies:
        body.fellows = [fellow for fellow in bodies if len(fellow.keys)]
    return bodies


class Body:
    """Channels of a carrier that run between keys together.

    Parameters
    ----------
    obj, own
    paths
        Of the properties whose channels have a say.
    keys
        The frames of the keys that segments run between.
    beside
        From frames to the quaternions and scales that are seen, where location alone has a say.
    turning
        The keys of the rotation then.
    every
        All channels together, which have the say where a segment is the same for all parts.
    """

    fellows: Sequence[Body] = ()
    """All parts that have keys."""

    def __init__(
        self,
        obj: Carrier,
        own: Own,
        paths: Sequence[str],
        keys: np.ndarray,
        beside: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None,
        turning: np.ndarray | None = None,
        every: Body | None = None,
    ) -> None:
        self.obj, self.own, self.paths, self.keys, self.beside, self.turning = obj, own, paths, keys, beside, turning
        self.every = every
        self.curves = {(path, index): fcurve for path in paths for index, fcurve in moving_in(obj, path).items()}
        self.scaled = ("scale" in paths or beside is not None) and _scales_evenly(obj)
        self.shaping = np.array([key for number, key in enumerate(keys) if not self._is_passed(number)])

    def leading(self, first: float, last: float, *, on_paths: bool = False) -> Body:
        """Whose channels say how far a segment has come: all, where each part has it, on its path or from its keys."""
        for fellow in self.fellows:
            keys = fellow.shaping if on_paths else fellow.keys
            within = keys[(keys > first - 0.01) & (keys < last + 0.01)]
            if len(within) != 2 or np.abs(within - (first, last)).max() > 0.01:
                return self
        goes_on = any(curve.extrapolation == "LINEAR" for curve in (self.every or self).curves.values())
        outermost = [side for side, end in ((0, first), (-1, last)) if abs(self.keys[side] - end) < 0.01]
        return self if goes_on and any(map(self._ends_alone, outermost)) else self.every or self

    def _ends_alone(self, side: int) -> bool:
        """Whether other parts have keys before its first one, or behind its last."""
        return any(abs(fellow.keys[side] - self.keys[side]) > 0.01 for fellow in self.fellows)

    def components(self, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Location, quaternion and scale on frames."""
        location, quaternion, scale = self.native(frames)
        location = location + self.own.location
        quaternion = multiply(np.array(self.own.quaternion), quaternion)
        scale = scale * self.own.scale
        keys = self.keys
        for first, last in itertools.pairwise(keys):
            mode = mode_at(self.obj, first)
            inside = frames > first if first > keys[0] else frames != first
            inside = inside & (frames < last if last < keys[-1] else frames != last)
            if mode == "BLENDER" or not inside.any():
                continue
            leading = self.leading(first, last)
            if leading is not self:
                # Where nothing goes on it rests outside of its keys, and others may have keys of theirs.
                inside &= (frames >= keys[0]) | ~np.array(self._ends_alone(0))
                inside &= (frames <= keys[-1]) | ~np.array(self._ends_alone(-1))
                if not inside.any():
                    continue
            share = progress(leading.curves, first, last, frames[inside], leading.turns(first))
            path = Path(self, first, mode)
            if (path.first, path.last) != (first, last):
                poses = beside_path(path, np.array((first, last)), share)
            else:
                poses = path.poses(share, np.clip((frames[inside] - first) / (last - first), 0.0, 1.0))
            location[inside], quaternion[inside] = poses.positions @ _axes(self.obj), poses.quaternions
            if self.scaled:
                scale[inside] = poses.scales[:, None] * self.own.scale
        # What is muted is not moved; without one of its components Blender's own is left of a rotation or a scale.
        places, turned, sizes = native(self.obj, frames)
        muted = [muted_in(self.obj, path) for path in transform_paths(self.obj)]
        location[:, muted[0]] = (places + self.own.location)[:, muted[0]]
        quaternion = multiply(np.array(self.own.quaternion), turned) if muted[1] else quaternion
        return location, quaternion, sizes * self.own.scale if muted[2] else scale

    def native(self, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Location, unit quaternion and scale of the channels that have a say, and of what is beside them."""
        location, quaternion, scale = native(self.obj, frames)
        _, *turning_and_scaling = (muted_in(self.obj, path) for path in transform_paths(self.obj))
        is_turned, is_scaled = (not muted for muted in turning_and_scaling)
        quaternion = quaternion if is_turned else np.tile((1.0, 0.0, 0.0, 0.0), (len(frames), 1))
        scale = scale if is_scaled else np.ones_like(scale)
        if len(self.paths) == 3:
            return location, quaternion, scale
        if self.beside is not None:
            quaternion, scale = self.beside(frames)
            return location, multiply(np.array(self.own.quaternion) * (1.0, -1.0, -1.0, -1.0), quaternion), scale
        if rotation_path(self.obj) not in self.paths:
            quaternion = np.tile((1.0, 0.0, 0.0, 0.0), (len(frames), 1))
        return np.zeros_like(location), quaternion, scale

    def key_poses(self, frames: np.ndarray) -> Poses:
        positions, quaternions, scales = self.native(frames)
        return Poses(
            (positions + self.own.location) @ _axes(self.obj).T,
            multiply(np.array(self.own.quaternion), quaternions),
            scales[:, 0] if self.scaled else None,
        )

    def turns(self, first: float) -> float:
        """The turns of the channel in the segment that begins on this frame."""
        return turns_at(self.obj, first) if self._turns_with_keys(first) else 0.0

    def _turns_with_keys(self, first: float) -> bool:
        """Whether the rotation has the keys of this segment, and none between."""
        if muted_in(self.obj, rotation_path(self.obj)):
            return False
        if self.turning is None:
            return rotation_path(self.obj) in self.paths
        ends = self.keys[self.keys > first - 0.005][:2]
        within = self.turning[(self.turning > ends[0] - 0.01) & (self.turning < ends[1] + 0.01)]
        return len(within) == 2 and bool(np.abs(within - ends).max() < 0.01)

    def may_spin(self) -> bool:
        return may_spin(self.obj)

    def _is_passed(self, number: int) -> bool:
        """Whether a key lies on a path that it does not shape."""
        keys = self.keys
        before, mode = (mode_at(self.obj, frame) for frame in keys[[number - 1, number]])
        if not 0 < number < len(keys) - 1 or before != mode or mode not in DEPENDS_ON_KEYS or self.may_spin():
            return False
        return lies_on_path([*(self.every or self).curves.values()], keys[number], mode)

    def is_beside_path(self, first: float, last: float) -> bool:
        """Whether a breakdown at either end of a segment has a pose of its own, off the path of the keys around it."""
        path = Path(self, first, mode_at(self.obj, first))
        if (path.first, path.last) == (first, last):
            return False
        return goes_beside(path, np.array((first, last)))

    def spin(self, first: float, last: float, *, channel: bool = True) -> Spin:
        """The whole turns more from one key to the next, of the angles and of the channel."""
        return self.spin_and_end(first, last, channel=channel, whole=True)[0]

    def spin_and_end(
        self, first: float, last: float, *, channel: bool = True, whole: bool = False
    ) -> tuple[Spin, np.ndarray]:
        """The turns more from one key to the next, and where the body turns to without them."""
        ends, order = np.array((first, last)), self.obj.rotation_mode
        by_angles = {}
        if order != "QUATERNION" and self._turns_with_keys(first):
            by_angles = {"angles": channels(self.obj, rotation_path(self.obj), ends), "order": order}
        turns = self.turns(first) if channel else 0.0
        return spin_and_end(self.key_poses(ends).quaternions, turns, **by_angles, own=self.own.quaternion, whole=whole)

    def codes(self, frame: float) -> set[str]:
        """The interpolations of all channels in the segment that begins on this frame."""
        result = set()
        for fcurve in self.curves.values():
            points = fcurve.keyframe_points
            earlier = [point for point in points if point.co[0] < frame + 0.005]
            result.add((earlier[-1] if earlier else points[0]).interpolation)
        return result


class Path:
    """What a mode makes of the segment between keys that shape it."""

    def __init__(self, body: Body, frame: float, mode: str) -> None:
        self.body, self.mode, self.keys = body, mode, body.shaping
        self.first, self.last = self.keys[self.keys <= frame][-1], self.keys[self.keys > frame][0]

    def shared_with_key(self, frame: float) -> Path:
        """That of the whole body where all parts have this path, and a key on this frame; or else the same."""
        place = int(np.flatnonzero(self.keys == self.first)[0])
        around = self.keys[max(place - 1, 0) : place + 3] if self.mode in SMOOTH else self.keys[place : place + 2]
        leaders = {self.body.leading(*pair, on_paths=True) for pair in itertools.pairwise(around)}
        is_common = all(np.abs(fellow.keys - frame).min() < 0.01 for fellow in self.body.fellows)
        return Path(*leaders, self.first, self.mode) if is_common and len(leaders) == 1 else self

    def poses(self, share: np.ndarray, elapsed: np.ndarray | None = None) -> Poses:
        """At this progress, which without times is along the path alone."""
        if self.mode not in SMOOTH:
            body = self.body.leading(self.first, self.last, on_paths=True)
            ends = body.key_poses(np.array((self.first, self.last)))
            spin, ends.quaternions[1] = body.spin_and_end(self.first, self.last)
            return spin.add_to(interpolate((0.0, 1.0), ends, share, self.mode, extrapolate=True), share)
        leaving, arriving = self._passings()
        if elapsed is not None:
            share = share + leaving[1] * elapsed * (1.0 - elapsed) ** 2 - arriving[1] * elapsed**2 * (1.0 - elapsed)
        return self.body.spin(self.first, self.last).add_to(self._smooth(share, (leaving[0], arriving[0])), share)

    def _smooth(self, share: np.ndarray, tangents: tuple[float, float]) -> Poses:
        """The segment with the keys next to it; beside a segment that holds, the object rests."""
        place = int(np.flatnonzero(self.keys == self.first)[0])
        around = self.keys[max(place - 1, 0) : place + 3]
        shown = around.copy()
        before = int(place > 0)
        if before and self._codes(*around[:2]) == {"CONSTANT"}:
            shown[0] = shown[1]
        if len(around) > before + 2 and self._codes(*around[before + 1 : before + 3]) == {"CONSTANT"}:
            shown[before + 2] = shown[before + 1]
        counts = np.zeros(len(around) - 1, dtype=int)
        counts[before] = len(share)
        poses = self.body.key_poses(shown)
        spins = [
            self.body.spin(*pair) if pair == pair_shown else Spin()
            for pair, pair_shown in zip(itertools.pairwise(around), itertools.pairwise(shown), strict=True)
        ]
        if self.body.every is None and tangents == (1.0, 1.0) and not any(spin.turns for spin in spins):
            return in_betweens(around, poses, counts, share, self.mode)
        rests = [self._rests(around, shown, key) for key in (before, before + 1)]
        return with_tangents(around, poses, before, share, tangents, spins, rests)

    def _rests(self, around: np.ndarray, shown: np.ndarray, key: int) -> bool:
        """Whether nothing moves before or after a key: of the body, or of all where both segments are those of all."""
        sides = [slice(at, at + 2) for at in (key - 1, key) if 0 <= at < len(around) - 1]
        leaders = {self.body.leading(*around[side], on_paths=True) for side in sides}
        body = leaders.pop() if len(leaders) == 1 else self.body
        for side in sides:
            poses, ends = body.key_poses(shown[side]), around[side]
            spins = np.all(ends == shown[side]) and body.spin(*ends).turns
            if not spins and not _twists(poses, [0], [1]).any():
                return True
        return False

    def _passings(self) -> list[tuple[float, float]]:
        """At both ends of a segment how long the tangent is, and what the slope of progress lacks."""
        place, codes = int(np.flatnonzero(self.keys == self.first)[0]), self._codes(self.first, self.last)
        passings = [(1.0, 0.0), (1.0, 0.0)]
        if "BEZIER" in codes and codes <= {"LINEAR", "BEZIER"}:
            if place > 0:
                passings[0] = _passing(self.body, self.keys[place - 1 : place + 2], after=True)
            if place + 2 < len(self.keys):
                passings[1] = _passing(self.body, self.keys[place : place + 3], after=False)
        return passings

    def _codes(self, first: float, last: float) -> set[str]:
        return self.body.leading(first, last, on_paths=True).codes(first)


def _passing(body: Body, keys: np.ndarray, *, after: bool) -> tuple[float, float]:
    """The same before or after the key in the middle of three."""
    leaders = [body.leading(*pair, on_paths=True) for pair in itertools.pairwise(keys)]
    leading = leaders[int(after)]
    if leaders[0] is leaders[1]:
        body = leading
    times = np.diff(keys)
    begin, end = keys[after : after + 2]
    steps = keys[1] + times[int(after)] / 8.0 * (np.arange(4) if after else -np.arange(4))
    poses = body.key_poses(keys)
    spins = [body.spin(*pair) for pair in itertools.pairwise(keys)]
    spun = np.array([spin.twist(poses.quaternions[1]) for spin in spins])
    screws = _twists(poses, (0, 1), (1, 2)).T + spun
    progressed = progress(leading.curves, begin, end, steps, leading.turns(begin))
    # Angles turn by the spin, too, and less than half a turn is left without it.
    by_angles = body.spin(begin, end, channel=False)
    stepping = body if body.beside is None else leading
    left = by_angles._replace(turns=-by_angles.turns).add_to(stepping.key_poses(steps), progressed)
    native = np.polyfit(steps - keys[1], _twists(left, (0,) * 4, range(4)).T, 3)[2]
    native = native + np.polyfit(steps - keys[1], progressed, 3)[2] * spun[int(after)]
    slope = np.polyfit(steps - keys[1], progressed, 3)[2] * times[int(after)]
    if np.abs(screws[:, :6]).max() > 1e-9:
        screws[:, 6] = 0.0
    share = share_of(*times)
    speeds = [part * screw / time for part, screw, time in zip((share, 1.0 - share), screws, times, strict=True)]
    mean = sum(speeds)
    squared = max(mean @ mean, 0.01 * sum(speed @ speed for speed in speeds))
    if not squared > 0.0:
        return 0.0, 0.0
    length = screws[int(after)] / times[int(after)] @ mean / squared
    if share == float(not after):
        return length, 0.0
    passed = native @ mean / squared / np.copysign(max(abs(length), 0.1), length)
    return length, np.clip(passed, -3.0, 3.0) - np.clip(slope, -3.0, 3.0)


def _twists(poses: Poses, froms: Sequence[int], tos: Sequence[int]) -> np.ndarray:
    """Those from poses to others, and how log scale grows, shape (7, n)."""
    first, second = poses[list(froms)], poses[list(tos)]
    grown = np.zeros(len(tos)) if poses.scales is None else np.log(np.maximum(second.scales, 1e-3) / first.scales)
    return np.vstack((twists.between(first.positions, first.quaternions, second.positions, second.quaternions), grown))


def part_keys(obj: Carrier) -> dict[str, np.ndarray]:
    """The frames of the keys of location, rotation and scale, as far as these change and have several."""
    result = {}
    for path in transform_paths(obj):
        curves = moving_in(obj, path).values()
        frames = distinct(key.co[0] for curve in curves for key in curve.keyframe_points)
        changes = any(map(_changes, curves)) or (path == rotation_path(obj) and _has_turns(obj))
        if changes and len(frames) > 1:
            result[path] = frames
    return result


def _changes(fcurve: bpy.types.FCurve) -> bool:
    values = [
        value
        for key in fcurve.keyframe_points
        for value in (key.co[1], *((key.handle_left[1], key.handle_right[1]) if key.interpolation == "BEZIER" else ()))
    ]
    return len(fcurve.keyframe_points) > 1 and max(values) > min(values)


def _has_turns(obj: Carrier) -> bool:
    turns = curve_of(obj, "rigid_motion.turns")
    return turns is not None and not turns.mute and any(key.co[1] for key in turns.keyframe_points)


def is_beside_path(obj: Carrier, frame: float, own: Own | None = None) -> bool:
    """Whether a breakdown beside this frame has a pose of its own, off the path of the keys around it."""
    for body in bodies_of(obj, own or Own()):
        before, behind = body.keys[body.keys < frame], body.keys[body.keys > frame]
        if len(before) and len(behind) and body.is_beside_path(before[-1], behind[0]):
            return True
    return False


def may_spin(obj: Carrier) -> bool:
    """Whether it has turns, or an angle that goes by half a turn or more from one of its keys to the next."""
    turns = curve_of(obj, "rigid_motion.turns")
    if turns is not None and len(turns.keyframe_points) and not turns.mute:
        return True
    if obj.rotation_mode == "QUATERNION":
        return False
    path = rotation_path(obj)
    if obj.rotation_mode == "AXIS_ANGLE":
        values = channels(obj, path, part_keys(obj).get(path, np.empty(0)))
        changes = [abs(about_one_axis(*pair)) for pair in itertools.pairwise(values)]
        return max(changes, default=0.0) >= np.pi - 1e-4
    values = ([key.co[1] for key in curve.keyframe_points] for curve in moving_in(obj, path).values())
    return any(np.abs(np.diff(of_one)).max(initial=0.0) >= np.pi - 1e-4 for of_one in values)


def _axes(obj: Carrier) -> np.ndarray:
    """The axes that location runs along, as columns in those of the body: a bone may have its parent's."""
    if isinstance(obj, bpy.types.Object) or obj.bone.use_local_location:
        return np.eye(3)
    above = obj.bone.parent.matrix_local.to_3x3() if obj.bone.parent else np.eye(3)
    return np.linalg.inv(np.array(obj.bone.matrix_local.to_3x3())) @ np.array(above)


def native(obj: Carrier, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Location, unit quaternion and scale from the object's channels alone."""
    location, turned, scale = (channels(obj, path, frames) for path in transform_paths(obj))
    if obj.rotation_mode == "QUATERNION":
        lengths = np.linalg.norm(turned, axis=1)
        # Blender's own way with a quaternion that has no length.
        turned[lengths == 0.0] = (0.0, 1.0, 0.0, 0.0)
        turned /= np.where(lengths == 0.0, 1.0, lengths)[:, None]
    elif obj.rotation_mode == "AXIS_ANGLE":
        quaternions = [Quaternion(axis, angle) if any(axis) else Quaternion() for angle, *axis in turned]
        turned = np.reshape(quaternions, (-1, 4))
    else:
        turned = _from_eulers(turned, obj.rotation_mode)
    return location, turned, scale


def _from_eulers(angles: np.ndarray, order: str) -> np.ndarray:
    """One turn after the other about the axes in their order."""
    turned = np.zeros((len(angles), 4))
    turned[:, 0] = 1.0
    for axis in map("XYZ".index, order):
        about = np.zeros_like(turned)
        about[:, 0], about[:, 1 + axis] = np.cos(0.5 * angles[:, axis]), np.sin(0.5 * angles[:, axis])
        turned = multiply(about, turned)
    return turned


def channels(obj: Carrier, path: str, frames: np.ndarray) -> np.ndarray:
    values = np.empty((len(frames), WIDTHS[path]))
    for index, rest in enumerate(getattr(obj, path)):
        fcurve = curve_of(obj, path, index)
        keyed = fcurve is not None and len(fcurve.keyframe_points) and not fcurve.mute
        values[:, index] = [fcurve.evaluate(frame) for frame in frames] if keyed else rest
    return values


def _scales_evenly(obj: Carrier) -> bool:
    """Whether scale is animated, and on every key of its own the same along all axes and positive."""
    scales = channels(obj, "scale", part_keys(obj).get("scale", np.empty(0)))
    return len(scales) > 1 and bool(
        np.allclose(scales, scales[:, :1]) and np.all(scales > 0.0) and np.ptp(scales[:, 0]) > 0.0
    )
