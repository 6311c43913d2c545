"""A figure of 20 bones keyed by an animator: few keys, on different frames for each bone, with Bezier curves."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.bones.rigs import Rest, new_rig
from tests.animation.keyed import curves_of, key_frames, rotation_path
from tests.animation.scenes import write

LAST = 120
"""The last frame, at 24 fps."""

THIRD, AUTOMATIC, OF_OLD = "third", "automatic", "automatic, without smoothing"
"""Handles: set by hand to a third of the segment; automatic; and automatic without smoothing, as in old files."""


def _chain(first: str, names: str, head: tuple[float, float, float], step: tuple[float, float, float]) -> list[Rest]:
    result, parent = [], first
    for name in names.split():
        tail = tuple(a + b for a, b in zip(head, step, strict=True))
        result.append(Rest(name, head, tail, parent))
        head, parent = tail, name
    return result


FIGURE = (
    Rest("Hips", (0.0, 0.0, 1.0), (0.0, 0.0, 1.12)),
    *_chain("Hips", "Spine Chest Neck Head", (0.0, 0.0, 1.12), (0.0, 0.02, 0.16)),
    *_chain("Chest", "Shoulder.L Arm.L Fore.L Hand.L", (0.05, 0.0, 1.4), (0.2, 0.01, -0.03)),
    *_chain("Chest", "Shoulder.R Arm.R Fore.R Hand.R", (-0.05, 0.0, 1.4), (-0.2, 0.01, -0.03)),
    *_chain("Hips", "Thigh.L Shin.L Foot.L", (0.1, 0.0, 1.0), (0.0, 0.02, -0.4)),
    *_chain("Hips", "Thigh.R Shin.R Foot.R", (-0.1, 0.0, 1.0), (0.0, 0.02, -0.4)),
    Rest("Tail", (0.0, 0.1, 1.0), (0.0, 0.4, 0.9), "Hips"),
)
"""20 bones, 1.8 m tall."""


def hand_made(handles: str, rotation_mode: str = "QUATERNION", seed: int = 0) -> bpy.types.Object:
    """Return the figure with rotation keys on all bones, and location keys on the first bone."""
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 24, 1.0
    scene.frame_start, scene.frame_end = 0, LAST
    rig, rng = new_rig("Figure", FIGURE, rotation_mode), np.random.default_rng(seed)
    for number, bone in enumerate(rig.pose.bones):
        inner = rng.choice(np.arange(1, LAST // 6), rng.integers(5, 9), replace=False)
        frames = np.unique(np.concatenate(((0, LAST), 6 * inner + rng.integers(-2, 3, len(inner))))).astype(float)
        turns = np.cumsum(rng.normal(0.0, 0.35, (len(frames), 3)), axis=0) * 0.6
        values = turns
        if rotation_mode == "QUATERNION":
            values = np.column_stack((np.ones(len(frames)), 0.5 * turns))
            values /= np.linalg.norm(values, axis=1, keepdims=True)
        paths = {rotation_path(bone): values}
        if not number:
            paths["location"] = np.cumsum(rng.normal(0.0, 0.12, (len(frames), 3)), axis=0)
        for path, column in paths.items():
            write(bone, path, frames, column, "BEZIER")
        for fcurve in curves_of(bone).values():
            _give_handles(fcurve, handles)
    return rig


def _give_handles(fcurve: bpy.types.FCurve, handles: str) -> None:
    if handles == OF_OLD:
        fcurve.auto_smoothing = "NONE"
    keys = fcurve.keyframe_points
    frames, values = np.array([key.co for key in keys]).T
    slopes = np.gradient(values, frames)
    for number, key in enumerate(keys):
        if handles != THIRD:
            key.handle_left_type = key.handle_right_type = "AUTO_CLAMPED"
            continue
        key.handle_left_type = key.handle_right_type = "FREE"
        before = (frames[number] - frames[max(number - 1, 0)]) / 3.0
        behind = (frames[min(number + 1, len(frames) - 1)] - frames[number]) / 3.0
        key.handle_left = frames[number] - before, values[number] - slopes[number] * before
        key.handle_right = frames[number] + behind, values[number] + slopes[number] * behind
    fcurve.update()


def keys_of(rig: bpy.types.Object) -> dict[str, np.ndarray]:
    """Return the key frames of each bone."""
    return {bone.name: key_frames(bone) for bone in rig.pose.bones}


def bake_each_frame(rig: bpy.types.Object) -> None:
    """Bake as Blender's Bake Action does: a key on each frame at the displayed pose, rotations as unit quaternions."""
    frames = np.arange(LAST + 1.0)
    for bone in rig.pose.bones:
        for path in {path for path, _ in curves_of(bone)}:
            columns = [curves_of(bone)[path, index] for index in range(4) if (path, index) in curves_of(bone)]
            values = np.array([[fcurve.evaluate(frame) for fcurve in columns] for frame in frames])
            if path == "rotation_quaternion":
                values /= np.linalg.norm(values, axis=1, keepdims=True)
            write(bone, path, frames, values, "LINEAR")
