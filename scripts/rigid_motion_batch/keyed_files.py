"""Recorded motions as .blend files of their own: an object or a rig with few keys, and the mode on them.

In metres and Blender's axes, where it was recorded; the first sample is on frame 1.
"""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.animation.transforms import transform_of
from rigid_motion.motion.quaternions import align_signs
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.blend_files import FileProblem
from rigid_motion_batch.blend_targets import Result
from rigid_motion_batch.comparison.stage.armature import Rest, Rig
from rigid_motion_batch.comparison.stage.timeline import Timeline
from rigid_motion_batch.comparison.study.clips import Clip
from rigid_motion_batch.hushing import hushed
from rigid_motion_batch.reduce_targets import Wishes, reduced
from rigid_motion_batch.trajectories.rigs import LAST_FRAME

RATES = 1, 240
"""Frames a second that a file may be given for the rate of its recording."""

CLOSEST = 0.01
"""Frames between keys that Blender takes for two."""

SINGLE = float(np.finfo(np.float32).eps)
"""By what share numbers of Blender are off."""

ARROW = 0.2
"""Metres: how large the axes are drawn that move as a rigid body did."""


def rate_of(clip: Clip) -> int:
    """Whole frames a second that are nearest to the samples of a recording."""
    return int(np.clip(round(1.0 / float(np.median(np.diff(clip.times)))), *RATES))


def new_file(clip: Clip, wishes: Wishes, fps: int | None) -> Timeline:
    """Begin a file for a recording, and return which moments of it the frames show.

    Raises
    ------
    FileProblem
        Where Blender has no room for it: it is too long, too fast, or too far away.
    """
    fps = fps or rate_of(clip)
    timeline = Timeline.between(float(clip.times[0]), float(clip.times[-1]), fps, 1.0)
    if timeline.count > LAST_FRAME:
        raise FileProblem(f"at {fps} frames a second this has more than {LAST_FRAME} frames: give a smaller --fps")
    if float(np.diff(timeline.frames_of(clip.times)).min()) < CLOSEST:
        raise FileProblem(f"at {fps} frames a second some samples are on one frame to Blender: give a larger --fps")
    farthest = float(np.abs(clip.in_metres(clip.poses).positions).max())
    if farthest * SINGLE > wishes.tolerance.tolerance(clip):
        raise FileProblem(
            f"this is up to {farthest:.3g} m from its origin, where Blender's numbers are coarser than the tolerance: "
            "move the origin nearer in the recording"
        )
    with hushed():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = fps, 1.0
    scene.frame_start, scene.frame_end = 1, timeline.count
    return timeline


def key_object(clip: Clip, keys: np.ndarray, mode: str, timeline: Timeline, name: str) -> bpy.types.Object:
    """Put axes into the open file that move as a rigid body did, with keys at these samples (k,) alone."""
    obj = bpy.data.objects.new(name, None)
    obj.empty_display_type, obj.empty_display_size = "ARROWS", ARROW
    obj.rotation_mode = "QUATERNION"
    bpy.context.scene.collection.objects.link(obj)
    frames, poses = timeline.frames_of(clip.times[keys]), to_blender(clip.in_metres(clip.poses[keys]), clip.axes)
    animation.write_channel(obj, "location", frames, poses.positions)
    animation.write_channel(obj, "rotation_quaternion", frames, align_signs(poses.quaternions))
    if poses.scales is not None:
        animation.write_channel(obj, "scale", frames, np.repeat(poses.scales[:, None], 3, axis=1))
    animation.set_mode(obj, mode)
    return obj


def key_body(clip: Clip, wishes: Wishes, timeline: Timeline, name: str) -> Result:
    """Put a rig into the open file that moves as a whole body did, with the few keys that its bones need."""
    rest = Rest.of(clip.figure, clip.metres_per_unit, clip.axes)
    rig = Rig(name, rest, clip.figure.joints, bpy.context.scene.collection)
    channels = rig.channels_of(to_blender(clip.in_metres(clip.poses), clip.axes))
    frames = timeline.frames_of(clip.times)
    for bone in range(len(rig.bones)):
        rig.key(bone, frames, channels[bone])
    keyed = [transform_of(bone) for bone in rig.obj.pose.bones if len(animation.key_frames(bone))]
    if not keyed:
        raise FileProblem("nothing of this body moves: there are no keys to reduce")
    result = reduced(keyed, wishes)
    if result.done:
        animation.discard_dense_keys(result.done)  # The recording has them.
    if result.left:
        animation.set_mode(list(result.left), wishes.mode)
    return result
