"""Recorded motions as .blend files of their own: an object or a rig with few keys, and the mode on them.

In metres and Blender's axes, where it was recorded; the first sample is on frame 1.
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
"""Frames between keys that Blender takes for two."""

ON_A_FRAME = 1e-3
"""The distance from a whole frame within which samples are put on it."""

SINGLE_PRECISION_RATIO = float(np.finfo(np.float32).eps)
"""By what share numbers of Blender are off."""

AXES_LENGTH_M = 0.2
"""Metres: how large the axes are drawn that move as a rigid body did."""


def rate_of(clip: Clip) -> float:
    """Return frames a second with a sample on every frame; of one that is not even,
    the whole number next to its rate.
    """
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
    """Return on which frames the samples are, shape (n,), the first on frame 1."""
    frames = 1.0 + (clip.times - clip.times[0]) * rate
    return np.where(np.abs(frames - np.round(frames)) < ON_A_FRAME, np.round(frames), frames)


def new_file(clip: Clip, tolerance: float, fps: int | None) -> np.ndarray:
    """Begin a file for a recording, and return on which frames its samples are, shape (n,).

    Raises
    ------
    FileProblem
        Where Blender has no room for it: it is too long, too fast, or too far away to be within the tolerance (metres).
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
    """Put axes or a rig into the open file that move as a recording did, with a key for every sample, frames (n,)."""
    if clip.rest_body is not None:
        return _rig(clip, frames, name).obj
    obj = _axes(name)
    animation.bake_poses(obj, frames, clip.in_blender(clip.poses), key_type="KEYFRAME")
    return obj


def key_object(clip: Clip, keys: np.ndarray, frames: np.ndarray, mode: str, name: str) -> bpy.types.Object:
    """Put axes into the open file that move as a rigid body did, with keys at these samples (k,) of all frames (n,)."""
    obj = _axes(name)
    poses = clip.in_blender(clip.poses[keys])
    animation.bake_poses(obj, frames[keys], poses, key_type="KEYFRAME")
    animation.set_mode(obj, mode)
    return obj


def key_body(clip: Clip, frames: np.ndarray, how: Reductions, name: str) -> Result:
    """Put axes or a rig into the open file that move as a recording did, its samples on frames (n,), with few keys.

    Returns
    -------
    Result
        What became of what moves; bones that were left play straight from sample to sample.
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


def _axes(name: str) -> bpy.types.Object:
    obj = bpy.data.objects.new(name, None)
    obj.empty_display_type, obj.empty_display_size = "ARROWS", AXES_LENGTH_M
    obj.rotation_mode = "QUATERNION"
    cast(bpy.types.Scene, bpy.context.scene).collection.objects.link(obj)
    return obj


def _rig(clip: Clip, frames: np.ndarray, name: str) -> Rig:
    """Return a rig in the open file with a key for every sample of a whole body, on frames (n,)."""
    scene, rest_body = cast(bpy.types.Scene, bpy.context.scene), clip.whole_body
    rest = RestFigure.of(clip)
    rig = Rig(name, rest, rest_body.joints, scene.collection)
    channels = rig.channels_of(clip.in_blender(clip.poses))
    for bone in range(len(rig.bones)):
        rig.key(bone, frames, channels[bone])
    return rig
