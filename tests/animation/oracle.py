"""Where objects have to be, worked out apart from `rigid_motion.animation`, and where Blender shows them.

`expected_bases` asks Blender's own `FCurve.evaluate` for keys and timing and `interpolate` for the motion of
each segment. Nothing here looks at delta transforms in the file: the ones an object has of its own are given.
Matrices are (m, 4, 4), frames are the scene's.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from rigid_motion.motion import KEYFRAME_MODES, Poses, in_betweens, interpolate, twists
from rigid_motion.motion.quaternions import multiply, normalise
from tests.animation.keyed import (
    WIDTHS,
    Carrier,
    curve_of,
    curves_of,
    key_frames,
    mode_at,
    rotation_path,
    transform_paths,
    turns_at,
)
from tests.animation.modified import acting, held_frames, without_modifiers
from tests.animation.path_oracle import DEPENDS_ON_KEYS, beside_path, goes_beside, lies_on_path
from tests.animation.smooth_oracle import share_of, with_tangents
from tests.animation.spin_oracle import Spin, spin_and_end
from tests.animation.timing_oracle import progress

SMOOTH = {name for name, mode in KEYFRAME_MODES.items() if mode.is_smooth}


@dataclass(frozen=True)
class Own:
    """Delta transforms that an object has of its own."""

    location: tuple[float, ...] = (0.0, 0.0, 0.0)
    quaternion: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)


def expected_bases(
    obj: Carrier, frames: Sequence[float], own: Own | None = None, keys: np.ndarray | None = None
) -> np.ndarray:
    """What moves the object in its parent's space. `FCurve.evaluate` is asked on each frame, extrapolation included.

    Segments run between `keys`, by default the object's own: cycles have more. Stepped modifiers hold the poses, and
    what others do to the location is added; those of other channels are left out.
    """
    fcurves = [fcurve for (path, _), fcurve in curves_of(obj).items() if path in WIDTHS]
    if not acting(fcurves):
        return matrices(*_components(obj, frames, own, keys))
    moved, held = _channels(obj, "location", frames), held_frames(fcurves, frames)
    with without_modifiers(fcurves):
        location, quaternion, scale = _components(obj, held, own, keys)
        return matrices(location + moved - _channels(obj, "location", held), quaternion, scale)


def _components(
    obj: Carrier, frames: Sequence[float], own: Own | None, keys: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    own = own or Own()
    frames = np.asarray(frames, dtype=np.float64)
    location, quaternion, scale = _native(obj, frames)
    location = location + own.location
    quaternion = multiply(np.array(own.quaternion), quaternion)
    scale = scale * own.scale
    keys = key_frames(obj) if keys is None else keys
    scaled, shaping = _scales_evenly(obj, keys), shaping_keys(obj, keys)
    for first, last in itertools.pairwise(keys):
        mode = mode_at(obj, first)
        inside = (frames > first if first > keys[0] else frames != first) & (frames < last if last < keys[-1] else True)
        inside &= frames != last
        if mode == "BLENDER" or not inside.any():
            continue
        share = progress(obj, first, last, frames[inside])
        path = Path(obj, shaping, first, mode, own, scaled)
        if (path.first, path.last) != (first, last):
            poses = beside_path(path, _key_poses(obj, np.array((first, last)), own, scaled), share)
        else:
            poses = path.poses(share, np.clip((frames[inside] - first) / (last - first), 0.0, 1.0))
        location[inside], quaternion[inside] = poses.positions @ _axes(obj), poses.quaternions
        if scaled:
            scale[inside] = poses.scales[:, None] * own.scale
    return location, quaternion, scale


def shaping_keys(obj: Carrier, keys: np.ndarray) -> np.ndarray:
    """The keys that shape a path: no breakdowns on the way, where it would matter."""
    return np.array([key for number, key in enumerate(keys) if not _is_passed(obj, keys, number)])


def is_beside_path(obj: Carrier, first: float, last: float, own: Own | None = None) -> bool:
    """Whether a breakdown at either end of a segment has a pose of its own, off the path of the keys around it."""
    own, keys = own or Own(), key_frames(obj)
    scaled = _scales_evenly(obj, keys)
    path = Path(obj, shaping_keys(obj, keys), first, mode_at(obj, first), own, scaled)
    if (path.first, path.last) == (first, last):
        return False
    return goes_beside(path, _key_poses(obj, np.array((first, last)), own, scaled))


class Path:
    """What a mode makes of the segment between keys that shape it."""

    def __init__(self, obj: Carrier, keys: np.ndarray, frame: float, mode: str, own: Own, scaled: bool) -> None:
        self.obj, self.mode, self.own, self.scaled = obj, mode, own, scaled
        self.keys = keys
        self.first, self.last = self.keys[self.keys <= frame][-1], self.keys[self.keys > frame][0]

    def poses(self, share: np.ndarray, elapsed: np.ndarray | None = None) -> Poses:
        """At this progress, which without times is along the path alone."""
        if self.mode not in SMOOTH:
            ends = _key_poses(self.obj, np.array((self.first, self.last)), self.own, self.scaled)
            spin, ends.quaternions[1] = _spin_and_end(self.obj, self.first, self.last, self.own)
            return spin.add_to(interpolate((0.0, 1.0), ends, share, self.mode, extrapolate=True), share)
        leaving, arriving = _passings(self.obj, self.keys, self.first, self.own)
        if elapsed is not None:
            share = share + leaving[1] * elapsed * (1.0 - elapsed) ** 2 - arriving[1] * elapsed**2 * (1.0 - elapsed)
        tangents = leaving[0], arriving[0]
        poses = _smooth(self.obj, self.keys, self.first, share, self.mode, self.own, self.scaled, tangents)
        return _spin(self.obj, self.first, self.last, self.own).add_to(poses, share)


def _is_passed(obj: Carrier, keys: np.ndarray, number: int) -> bool:
    """Whether a key lies on a path that it does not shape."""
    before, mode = (mode_at(obj, frame) for frame in keys[[number - 1, number]])
    if not 0 < number < len(keys) - 1 or before != mode or mode not in DEPENDS_ON_KEYS or may_spin(obj):
        return False
    curves = (curve_of(obj, path, index) for path in transform_paths(obj) for index in range(WIDTHS[path]))
    curves = [curve for curve in curves if curve is not None and len(curve.keyframe_points) and not curve.mute]
    return lies_on_path(curves, keys[number], mode)


def may_spin(obj: Carrier) -> bool:
    """Whether it has turns, or an angle that goes by half a turn or more from one of its keys to the next."""
    turns = curve_of(obj, "rigid_motion.turns")
    if turns is not None and len(turns.keyframe_points) and not turns.mute:
        return True
    if obj.rotation_mode == "QUATERNION":
        return False
    angles = (curve_of(obj, "rotation_euler", index) for index in range(3))
    values = ([key.co[1] for key in curve.keyframe_points] for curve in angles if curve is not None and not curve.mute)
    return any(np.abs(np.diff(of_one)).max(initial=0.0) >= np.pi - 1e-4 for of_one in values)


def _axes(obj: Carrier) -> np.ndarray:
    """The axes that location runs along, as columns in those of the body: a bone may have its parent's."""
    if isinstance(obj, bpy.types.Object) or obj.bone.use_local_location:
        return np.eye(3)
    above = obj.bone.parent.matrix_local.to_3x3() if obj.bone.parent else np.eye(3)
    return np.linalg.inv(np.array(obj.bone.matrix_local.to_3x3())) @ np.array(above)


def _key_poses(obj: Carrier, frames: np.ndarray, own: Own, scaled: bool) -> Poses:
    positions, quaternions, scales = _native(obj, frames)
    return Poses(
        (positions + own.location) @ _axes(obj).T,
        multiply(np.array(own.quaternion), quaternions),
        scales[:, 0] if scaled else None,
    )


def _spin(obj: Carrier, first: float, last: float, own: Own, *, channel: bool = True) -> Spin:
    """The whole turns more from one key to the next, of the angles and of the channel."""
    return _spin_and_end(obj, first, last, own, channel=channel, whole=True)[0]


def _spin_and_end(
    obj: Carrier, first: float, last: float, own: Own, *, channel: bool = True, whole: bool = False
) -> tuple[Spin, np.ndarray]:
    """The turns more from one key to the next, and where the body turns to without them."""
    ends, turns = np.array((first, last)), turns_at(obj, first) if channel else 0.0
    by_angles = {}
    if obj.rotation_mode != "QUATERNION":
        by_angles = {"angles": _channels(obj, "rotation_euler", ends), "order": obj.rotation_mode}
    quaternions = _key_poses(obj, ends, own, False).quaternions
    return spin_and_end(quaternions, turns, **by_angles, own=own.quaternion, whole=whole)


def _smooth(
    obj: Carrier,
    keys: np.ndarray,
    first: float,
    share: np.ndarray,
    mode: str,
    own: Own,
    scaled: bool,
    tangents: tuple[float, float],
) -> Poses:
    """A segment of a smooth mode with the keys next to it; beside a segment that holds, the object rests."""
    place = int(np.flatnonzero(keys == first)[0])
    around = keys[max(place - 1, 0) : place + 3]
    shown = around.copy()
    before = int(place > 0)
    if before and _codes(obj, around[0]) == {"CONSTANT"}:
        shown[0] = shown[1]
    if len(around) > before + 2 and _codes(obj, around[before + 1]) == {"CONSTANT"}:
        shown[before + 2] = shown[before + 1]
    counts = np.zeros(len(around) - 1, dtype=int)
    counts[before] = len(share)
    poses = _key_poses(obj, shown, own, scaled)
    spins = [
        _spin(obj, *pair, own) if pair == pair_shown else Spin()
        for pair, pair_shown in zip(itertools.pairwise(around), itertools.pairwise(shown), strict=True)
    ]
    if tangents == (1.0, 1.0) and not any(spin.turns for spin in spins):
        return in_betweens(around, poses, counts, share, mode)
    return with_tangents(around, poses, before, share, tangents, spins)


def _passings(obj: Carrier, keys: np.ndarray, first: float, own: Own) -> list[tuple[float, float]]:
    """At both ends of a segment how long the tangent is, and what the slope of progress lacks."""
    place, codes = int(np.flatnonzero(keys == first)[0]), _codes(obj, first)
    passings = [(1.0, 0.0), (1.0, 0.0)]
    if "BEZIER" in codes and codes <= {"LINEAR", "BEZIER"}:
        if place > 0:
            passings[0] = _passing(obj, keys[place - 1 : place + 2], own, after=True)
        if place + 2 < len(keys):
            passings[1] = _passing(obj, keys[place : place + 3], own, after=False)
    return passings


def _passing(obj: Carrier, keys: np.ndarray, own: Own, *, after: bool) -> tuple[float, float]:
    """The same before or after the key in the middle of three."""
    times = np.diff(keys)
    begin, end = keys[after : after + 2]
    steps = keys[1] + times[int(after)] / 8.0 * (np.arange(4) if after else -np.arange(4))
    poses = _key_poses(obj, keys, own, False)
    spins = [_spin(obj, *pair, own) for pair in itertools.pairwise(keys)]
    spun = np.array([spin.twist(poses.quaternions[1])[:6] for spin in spins])
    screws = _twists(poses, (0, 1), (1, 2)).T + spun
    progressed = progress(obj, begin, end, steps)
    # Angles turn by the spin, too, and less than half a turn is left without it.
    by_angles = _spin(obj, begin, end, own, channel=False)
    left = by_angles._replace(turns=-by_angles.turns).add_to(_key_poses(obj, steps, own, False), progressed)
    native = np.polyfit(steps - keys[1], _twists(left, (0,) * 4, range(4)).T, 3)[2]
    native = native + np.polyfit(steps - keys[1], progressed, 3)[2] * spun[int(after)]
    slope = np.polyfit(steps - keys[1], progressed, 3)[2] * times[int(after)]
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
    first, second = poses[list(froms)], poses[list(tos)]
    return twists.between(first.positions, first.quaternions, second.positions, second.quaternions)


def _codes(obj: Carrier, frame: float) -> set[str]:
    """The interpolations of all channels in the segment that begins on this frame."""
    result = set()
    for path in transform_paths(obj):
        for index in range(WIDTHS[path]):
            fcurve = curve_of(obj, path, index)
            if fcurve is not None and len(fcurve.keyframe_points) and not fcurve.mute:
                points = fcurve.keyframe_points
                earlier = [point for point in points if point.co[0] < frame + 0.005]
                result.add((earlier[-1] if earlier else points[0]).interpolation)
    return result


def expected_worlds(obj: bpy.types.Object, frames: Sequence[float], owns: dict[str, Own] | None = None) -> np.ndarray:
    """The same in the world, parents moving along. `owns` is by the objects' names."""
    owns = owns or {}
    bases = expected_bases(obj, frames, owns.get(obj.name))
    if obj.parent is None:
        return bases
    return expected_worlds(obj.parent, frames, owns) @ np.array(obj.matrix_parent_inverse) @ bases


def matrices(location: np.ndarray, quaternion: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Scaled first, then turned, then moved, shape (m, 4, 4)."""
    w, x, y, z = normalise(quaternion).T
    made = np.zeros((len(location), 4, 4))
    made[:, :3, 0] = np.stack((1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)), axis=1)
    made[:, :3, 1] = np.stack((2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)), axis=1)
    made[:, :3, 2] = np.stack((2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)), axis=1)
    made[:, :3, :3] *= scale[:, None, :]
    made[:, :3, 3], made[:, 3, 3] = location, 1.0
    return made


def play(objects: Iterable[bpy.types.Object], frame: float) -> None:
    """Go to a frame, as playback does.

    A driver of one component of a channel may run while Blender's animation still writes the others, which then are
    those of the frame before: of Location Y and Z with a driver on X, once in 50 000 to a million frames, without this
    extension, too (4.5 to 5.2). So where something is driven a frame is evaluated twice.
    """
    whole = int(np.floor(frame))
    driven = any(obj.animation_data and obj.animation_data.drivers for obj in objects)
    for _ in range(2 if driven else 1):
        bpy.context.scene.frame_set(whole, subframe=float(frame - whole))


def shown_worlds(objects: Iterable[bpy.types.Object], frames: Sequence[float]) -> list[np.ndarray]:
    """The world matrices of objects as the scene evaluates them. It returns to its frame."""
    objects, scene = list(objects), bpy.context.scene
    before, subframe = scene.frame_current, scene.frame_subframe
    shown = [np.empty((len(frames), 4, 4)) for _ in objects]
    for row, frame in enumerate(frames):
        play(objects, frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for result, obj in zip(shown, objects, strict=True):
            result[row] = obj.evaluated_get(depsgraph).matrix_world
    scene.frame_set(before, subframe=subframe)
    return shown


def world_now(name: str = "Tool") -> np.ndarray:
    """The world matrix of an object as it is on the screen."""
    bpy.context.view_layer.update()
    return np.array(bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)


def assert_shown(
    objects: Iterable[bpy.types.Object], frames: Sequence[float], owns: dict[str, Own] | None = None
) -> None:
    """The scene shows these objects where they have to be, to 1e-5 of their size.

    Where Blender's own quaternion passes near zero on its way, what single precision leaves of its direction is less,
    and no delta transform can mend that: the tolerance grows by the same factor.
    """
    objects = list(objects)
    for obj, shown in zip(objects, shown_worlds(objects, frames), strict=True):
        expected = expected_worlds(obj, frames, owns)
        size = max(1.0, np.abs(expected).max(initial=0.0), _reach(obj, frames))
        error = np.abs(shown - expected).max(axis=(1, 2), initial=0.0) / size * shortest_quaternion(obj, frames)
        worst = int(np.argmax(error))
        assert error[worst] < 1e-5, (
            f"{obj.name} is off by {error[worst]:.3g} of its size on frame {frames[worst]} "
            f"(keys on {key_frames(obj)}):\n{shown[worst]}\ninstead of\n{expected[worst]}"
        )


def _reach(obj: Carrier, frames: Sequence[float]) -> float:
    """How large Blender's own in-betweens get, which single precision has to hold beside their difference."""
    location, _, scale = _native(obj, np.asarray(frames))
    own = max(np.abs(location).max(initial=0.0), np.abs(scale).max(initial=0.0))
    return own if obj.parent is None else own * max(1.0, _reach(obj.parent, frames))


def shortest_quaternion(obj: Carrier, frames: Sequence[float]) -> np.ndarray:
    """How long Blender's own quaternion is on each frame, the shortest of the object and its parents, at most 1."""
    values = _channels(obj, rotation_path(obj), np.asarray(frames))
    own = np.minimum(np.linalg.norm(values, axis=1), 1.0) if obj.rotation_mode == "QUATERNION" else 1.0
    return own if obj.parent is None else own * shortest_quaternion(obj.parent, frames)


def _native(obj: Carrier, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Location, unit quaternion and scale from the object's channels alone."""
    location, turned, scale = (_channels(obj, path, frames) for path in transform_paths(obj))
    if obj.rotation_mode == "QUATERNION":
        lengths = np.linalg.norm(turned, axis=1)
        # Blender's own way with a quaternion that has no length.
        turned[lengths == 0.0] = (0.0, 1.0, 0.0, 0.0)
        turned /= np.where(lengths == 0.0, 1.0, lengths)[:, None]
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


def _channels(obj: Carrier, path: str, frames: np.ndarray) -> np.ndarray:
    values = np.empty((len(frames), WIDTHS[path]))
    for index, rest in enumerate(getattr(obj, path)):
        fcurve = curve_of(obj, path, index)
        keyed = fcurve is not None and len(fcurve.keyframe_points) and not fcurve.mute
        values[:, index] = [fcurve.evaluate(frame) for frame in frames] if keyed else rest
    return values


def _scales_evenly(obj: Carrier, keys: np.ndarray) -> bool:
    """Whether scale is animated, and on every key the same along all axes and positive."""
    curves = [curve_of(obj, "scale", axis) for axis in range(3)]
    if len(keys) < 2 or not any(curve and len(curve.keyframe_points) for curve in curves):
        return False
    scales = _channels(obj, "scale", keys)
    return bool(np.allclose(scales, scales[:, :1]) and np.all(scales > 0.0) and np.ptp(scales[:, 0]) > 0.0)


def as_quaternion(angles: Sequence[float], order: str) -> tuple[float, ...]:
    """What an object's own Euler delta is as a quaternion."""
    return tuple(Euler(angles, order).to_quaternion())


def unit(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(Quaternion(values).normalized())
