"""New .blend files of recorded motions: an object or a rig with few keys and a mode.

Poses are in metres and Blender's axes, at the recorded place; the first sample is on frame 1.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.animation.transforms import transform_of
from rigid_motion_batch.keying.jobs import Result
from rigid_motion_batch.keying.records import FileProblem
from rigid_motion_batch.keying.reducing import reduced
from rigid_motion_batch.keying.reductions import FRAME_RATE_RANGE, Reductions
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.looks import LAST_FRAME
from rigid_motion_batch.scenes.armature import RestFigure, Rig
from rigid_motion_batch.silencing import silenced

MIN_KEY_GAP_FRAMES = 0.01
"""The smallest gap between two keys, in frames, at which Blender keeps both."""

ON_A_FRAME = 1e-3
"""Samples this near a whole frame, in frames, are put on it."""

SINGLE_PRECISION_RATIO = float(np.finfo(np.float32).eps)
"""Relative rounding error of Blender's single-precision numbers."""

AXES_LENGTH_M = 0.2
"""Display size, in metres, of the axes that stand for a rigid body."""


def rate_of(clip: Clip) -> float:
    """Return the frame rate that puts a sample on every frame; for uneven sampling, the nearest whole rate."""
    whole = float(np.clip(round(clip.samples_a_second), *FRAME_RATE_RANGE))
    even = (len(clip.times) - 1) / float(clip.times[-1] - clip.times[0])
    return (
        even
        if FRAME_RATE_RANGE[0] <= even <= FRAME_RATE_RANGE[1]
        and _are_on_frames(clip, even) > _are_on_frames(clip, whole)
        else whole
    )


def _are_on_frames(clip: Clip, rate: float) -> bool:
    return bool(np.all(frames_of(clip, rate) % 1.0 == 0.0))


def frames_of(clip: Clip, rate: float) -> np.ndarray:
    """Return the frames of the samples, shape (n,), beginning with frame 1."""
    frames = 1.0 + (clip.times - clip.times[0]) * rate
    return np.where(np.abs(frames - np.round(frames)) < ON_A_FRAME, np.round(frames), frames)


def new_file(clip: Clip, tolerance: float, fps: int | None) -> np.ndarray:
    """Begin an empty file for a recording, and return the frames of its samples, shape (n,).

    Raises
    ------
    FileProblem
        If the recording is too long, too fast, or too far from the origin to be within the tolerance (metres).
    """
    rate = fps or rate_of(clip)
    frames = frames_of(clip, rate)
    if frames[-1] > LAST_FRAME:
        raise FileProblem(f"at {rate:g} frames a second this has more than {LAST_FRAME} frames: give a smaller --fps")
    if float(np.diff(frames).min()) < MIN_KEY_GAP_FRAMES:
        raise FileProblem(f"at {rate:g} frames a second some samples are on one frame to Blender: thin them out")
    farthest = float(np.abs(clip.in_metres(clip.poses).positions).max())
    if farthest * SINGLE_PRECISION_RATIO > tolerance:
        raise FileProblem(
            f"this is up to {farthest:.3g} m from its origin, where Blender's numbers are coarser than the tolerance: "
            "move the origin nearer in the recording"
        )
    with silenced():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = cast(bpy.types.Scene, bpy.context.scene)
    scene.render.fps = max(round(rate), 1)
    scene.render.fps_base = scene.render.fps / rate
    scene.frame_start, scene.frame_end = 1, int(frames[-1])
    return frames


def key_densely(clip: Clip, frames: np.ndarray, name: str) -> bpy.types.Object:
    """Add axes or a rig to the open file that move as recorded, with a key for every sample, on frames (n,)."""
    if clip.rest_body is not None:
        return _add_rig(clip, frames, name).obj
    obj = _add_axes(name)
    animation.bake_poses(obj, frames, clip.in_blender(clip.poses), key_type="KEYFRAME")
    return obj


def key_object(clip: Clip, keys: np.ndarray, frames: np.ndarray, mode: str, name: str) -> bpy.types.Object:
    """Add axes to the open file that move as a rigid body did, keyed at samples `keys` (k,) of all `frames` (n,)."""
    obj = _add_axes(name)
    poses = clip.in_blender(clip.poses[keys])
    animation.bake_poses(obj, frames[keys], poses, key_type="KEYFRAME")
    animation.set_mode(obj, mode)
    return obj


def key_body(clip: Clip, frames: np.ndarray, how: Reductions, name: str) -> Result:
    """Add axes or a rig with few keys to the open file that move as recorded, the samples on frames (n,).

    Returns
    -------
    Result
        What became of the moving targets. Bones left as they are keep a key for every sample.
    """
    obj = key_densely(clip, frames, name)
    keyed = [
        target
        for target in map(transform_of, obj.pose.bones if obj.pose else (obj,))
        if len(animation.key_frames(target))
    ]
    if not keyed:
        return Result()
    if how.fewest:
        how = replace(how, mode=animation.FEWEST)
    return reduced(keyed, replace(how, discard=True))  # The recording has the dense keys.


def _add_axes(name: str) -> bpy.types.Object:
    obj = bpy.data.objects.new(name, None)
    obj.empty_display_type, obj.empty_display_size = "ARROWS", AXES_LENGTH_M
    obj.rotation_mode = "QUATERNION"
    cast(bpy.types.Scene, bpy.context.scene).collection.objects.link(obj)
    return obj


def _add_rig(clip: Clip, frames: np.ndarray, name: str) -> Rig:
    """Return a new rig in the open file with a key for every sample of a whole body, on frames (n,)."""
    scene, rest_body = cast(bpy.types.Scene, bpy.context.scene), clip.whole_body
    rest = RestFigure.of(clip)
    rig = Rig(name, rest, rest_body.joints, scene.collection)
    channels = rig.channels_of(clip.in_blender(clip.poses))
    for bone in range(len(rig.bones)):
        rig.key(bone, frames, channels[bone])
    return rig
