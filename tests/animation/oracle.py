"""Oracle for objects: where they must be, computed without `rigid_motion.animation`, and where Blender shows them.

`expected_bases` uses Blender's own `FCurve.evaluate` for keys and timing, and `interpolate` for the motion of each
segment. Matrices are (m, 4, 4), frames are the scene's.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy
import numpy as np

from rigid_motion.animation.actions.modifiers import on_top
from rigid_motion.motion import quaternions
from tests.animation.body_oracle import Body, channels, native
from tests.animation.keyed import WIDTHS, Carrier, curve_of, curves_of, key_frames, rotation_path
from tests.animation.modified import held_frames, modified, without_modifiers


def expected_bases(obj: Carrier, frames: Sequence[float], keys: np.ndarray | None = None) -> np.ndarray:
    """Return the object's matrices in its parent's space, by `FCurve.evaluate` on each frame, extrapolation included.

    Segments run between `keys`, by default the object's own; cycles have more. Stepped modifiers hold the poses. Other
    modifiers of the animator act on location and scale; those of rotations are ignored.
    """
    fcurves = [fcurve for (path, _), fcurve in curves_of(obj).items() if path in WIDTHS]
    held, body = held_frames(fcurves, frames), Body(obj, keys)
    with without_modifiers(fcurves):
        location, quaternion, scale = body.components(np.asarray(held, dtype=np.float64))
    for path, values, delta in (("location", location, body.own.location), ("scale", scale, body.own.scale)):
        for index in range(3):
            fcurve = curve_of(obj, path, index)
            if fcurve is not None and len(fcurve.keyframe_points) and not fcurve.mute and list(on_top(fcurve)):
                has = values[:, index] - delta[index] if path == "location" else values[:, index] / delta[index]
                has = modified(fcurve, held, has, frames)
                values[:, index] = has + delta[index] if path == "location" else has * delta[index]
    return matrices(location, quaternion, scale)


def expected_worlds(obj: bpy.types.Object, frames: Sequence[float]) -> np.ndarray:
    """Return the object's world matrices, with moving parents."""
    bases = expected_bases(obj, frames)
    if obj.parent is None:
        return bases
    return expected_worlds(obj.parent, frames) @ np.array(obj.matrix_parent_inverse) @ bases


def matrices(location: np.ndarray, quaternion: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return matrices that scale, then rotate, then translate, shape (m, 4, 4)."""
    made = np.zeros((len(location), 4, 4))
    made[:, :3, :3] = np.moveaxis(quaternions.matrices(quaternions.normalise(quaternion)), 2, 0) * scale[:, None, :]
    made[:, :3, 3], made[:, 3, 3] = location, 1.0
    return made


def play(carriers: Iterable[Carrier], frame: float) -> None:
    """Go to a frame as playback does.

    A driver of one component of a channel may run while Blender's animation still writes the other components, which
    then have their values of the previous frame. With a driver on Location X this happens to Y and Z once in 50 000 to
    a million frames, also without this extension (4.5 to 5.2). So frames are evaluated twice if anything is driven.
    """
    whole = int(np.floor(frame))
    data = [carrier.id_data.animation_data for carrier in carriers]
    driven = any(one and one.drivers for one in data)
    for _ in range(2 if driven else 1):
        bpy.context.scene.frame_set(whole, subframe=float(frame - whole))


def shown_worlds(carriers: Iterable[Carrier], frames: Sequence[float]) -> list[np.ndarray]:
    """Return the world matrices of objects and bones as the scene evaluates them. The scene returns to its frame."""
    carriers, scene = list(carriers), bpy.context.scene
    before, subframe = scene.frame_current, scene.frame_subframe
    shown = [np.empty((len(frames), 4, 4)) for _ in carriers]
    for row, frame in enumerate(frames):
        play(carriers, frame)
        for result, carrier in zip(shown, carriers, strict=True):
            result[row] = world_of(carrier)
    scene.frame_set(before, subframe=subframe)
    return shown


def world_of(carrier: Carrier) -> np.ndarray:
    """Return the world matrix of an object or a bone as evaluated now, multiplied in double precision."""
    shown = carrier.id_data.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = np.array(shown.matrix_world, float)
    return world if carrier == carrier.id_data else world @ np.array(shown.pose.bones[carrier.name].matrix, float)


def world_now(name: str = "Tool") -> np.ndarray:
    """Return the world matrix of an object as displayed now."""
    bpy.context.view_layer.update()
    return world_of(bpy.data.objects[name])


def assert_near(now: np.ndarray, then: np.ndarray, what: str = "it", tolerance: float = 1e-5) -> None:
    """Check that arrays are equal, to this fraction of the largest value, or of 1."""
    error = np.abs(now - then).max(initial=0.0) / max(1.0, np.abs(then).max(initial=0.0))
    assert error < tolerance, f"{what} is off by {error:.3g} of its size"


def assert_shown(objects: Iterable[bpy.types.Object], frames: Sequence[float]) -> None:
    """Check that the scene shows these objects where they must be, to 1e-5 of their size.

    Where Blender's own quaternion passes near zero, single precision leaves less of its direction, and no delta
    transform can repair that: the tolerance grows by the same factor.
    """
    objects = list(objects)
    for obj, shown in zip(objects, shown_worlds(objects, frames), strict=True):
        assert_there(obj, frames, shown, expected_worlds(obj, frames), _native_size(obj, frames))


def assert_there(
    carrier: Carrier, frames: Sequence[float], shown: np.ndarray, expected: np.ndarray, size: float = 1.0
) -> None:
    """Check that these matrices are as expected on frames, to 1e-5 of the largest value."""
    size = max(1.0, np.abs(expected).max(initial=0.0), size)
    error = np.abs(shown - expected).max(axis=(1, 2), initial=0.0) / size * shortest_quaternion(carrier, frames)
    worst = int(np.argmax(error))
    assert error[worst] < 1e-5, (
        f"{carrier!r} is off by {error[worst]:.3g} of its size on frame {frames[worst]} "
        f"(keys on {key_frames(carrier)}):\n{shown[worst]}\ninstead of\n{expected[worst]}"
    )


def _native_size(obj: Carrier, frames: Sequence[float]) -> float:
    """Return the size of Blender's own in-betweens, which shares single precision with the difference added to them."""
    location, _, scale = native(obj, np.asarray(frames))
    own = max(np.abs(location).max(initial=0.0), np.abs(scale).max(initial=0.0))
    return own if obj.parent is None else own * max(1.0, _native_size(obj.parent, frames))


def shortest_quaternion(obj: Carrier, frames: Sequence[float]) -> np.ndarray:
    """Return the length of Blender's own quaternion on each frame: the shortest of object and parents, at most 1."""
    values = channels(obj, rotation_path(obj), np.asarray(frames))
    own = np.minimum(np.linalg.norm(values, axis=1), 1.0) if obj.rotation_mode == "QUATERNION" else 1.0
    return own if obj.parent is None else own * shortest_quaternion(obj.parent, frames)
