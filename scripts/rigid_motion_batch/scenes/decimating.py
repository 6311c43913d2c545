"""A whole body as a rig with a key on every sample, and what Blender's Decimate leaves of these keys.

F-curves are read as Blender evaluates them, at the samples, and errors are those of `analysis.errors`: in metres, in
the root's space, through the hierarchy, of balls around the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.animation.actions.channels import replace_keys
from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch.analysis.body_decimated import DECIMATE, KeysOfBody, ours
from rigid_motion_batch.analysis.metrics import Metrics
from rigid_motion_batch.analysis.reconstructions import Reconstruction

from .armature import Rest, Rig
from .decimated_bodies import FREE, Decimations, Left

EVEN = 0.1
"""Frames that evenly spaced samples may be off a whole one: times are often rounded to milliseconds."""

VARIES = 1e-4
"""A channel that never changes by more is one that does not vary: importers calculate in single precision."""

APART = 1e-3
"""Frames between two keys, at least: Blender has them in single precision."""


class DecimatedBody:
    """A recording on a rig of its own, in an empty file.

    Parameters
    ----------
    made : Reconstruction
        All its modes begin and end with the same samples; Decimate gets these and all between.

    Raises
    ------
    RuntimeError
        Where Blender cannot have the keys.
    """

    def __init__(self, made: Reconstruction) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        clip = made.clip
        self.frames = frames_of(made.times)
        self._skeleton, self._radius = made.skeleton, made.radii[:, None]
        joints = clip.in_blender(clip.poses[:, made.samples])
        roots = clip.whole_body.parents < 0
        places = joints.positions[roots]
        # Single precision is best around the origin.
        joints.positions[roots] -= (places.min(axis=(0, 1)) + places.max(axis=(0, 1))) / 2.0
        self._truth = self._skeleton.in_root_space(joints)
        rest = Rest.of(clip)
        self.rig = Rig("Body", rest, clip.whole_body.joints, bpy.context.scene.collection)
        channels = self.rig.channels_of(joints)
        for bone in range(len(self.rig.bones)):
            self.rig.key(bone, self.frames, channels[bone])
        self._counted = {curve for curve, own in self._values().items() if np.ptp(own) > VARIES}
        self.decimations = [Decimations(self.rig.obj, self.left)] if self._counted else []
        if self._counted:
            smooth(self.rig.obj)
            self.decimations.append(Decimations(self.rig.obj, self.left))

    def errors(self) -> np.ndarray:
        """Return how far off each joint is by the F-curves that the rig has now, in metres, shape (joints, n)."""
        shown = self._skeleton.in_root_space(self.rig.joints_of(self._channels()))
        return shell_error(shown, self._truth, self._radius)

    def left(self) -> Left:
        """Return the keys that the rig has now, and their largest error."""
        curves = [fcurve for curve, fcurve in fcurves_of(self.rig.obj).items() if curve in self._counted]
        keys = [key.co.x for fcurve in curves for key in fcurve.keyframe_points]
        return Left(len(set(keys)), len(keys), FREE * len(keys), float(self.errors().max()))

    def within(self, largest: float) -> Left | None:
        """Return the fewest keys whose error is nowhere larger than this, in metres.

        None where it is smaller than what Blender can keep in single precision, or no channel varies.
        """
        result = [left for decimations in self.decimations if (left := decimations.within(largest))]
        if self._counted and (everything := self.left()).largest <= largest:
            result.append(everything)
        return min(result, key=lambda left: left.keys, default=None)

    def _values(self) -> dict[tuple[str, int], np.ndarray]:
        """Return what F-curves show at the samples, by Blender's own evaluation, each of shape (n,)."""
        frames = self.frames.tolist()
        return {
            curve: np.array([fcurve.evaluate(frame) for frame in frames])
            for curve, fcurve in fcurves_of(self.rig.obj).items()
        }

    def _channels(self) -> Poses:
        """Return the channels of all bones at the samples, shape (joints, n): what is not keyed stays as it is."""
        values, bones = self._values(), [self.rig.obj.pose.bones[name] for name in self.rig.bones]

        def channels(name: str) -> np.ndarray:
            result = np.array([getattr(bone, name) for bone in bones])[:, None].repeat(len(self.frames), axis=1)
            for own, path in zip(result, (bone.path_from_id(name) for bone in bones), strict=True):
                for index in range(own.shape[1]):
                    own[:, index] = values.get((path, index), own[:, index])
            return result

        return Poses(channels("location"), normalise(channels("rotation_quaternion")))


def beside_decimate(made: Reconstruction, measured: Sequence[Metrics]) -> list[KeysOfBody]:
    """Return the keys of each mode, and behind each what Decimate needs for the largest error that these have.

    Parameters
    ----------
    made : Reconstruction
    measured : sequence of Metrics
        Of the modes. One whose error Blender cannot keep to, in single precision, has no row of Decimate.

    Raises
    ------
    RuntimeError
        Where Blender cannot have the keys, or cannot decimate.
    """
    body = DecimatedBody(made)
    rows = []
    for row in measured:
        own = ours(made, row)
        rows.append(own)
        # What was tried for one mode is known for the next, and their errors are often nearly the same.
        if left := body.within(row.max_shell_m):
            rows.append(
                replace(
                    own,
                    how=DECIMATE,
                    frames_with_keys=left.frames,
                    keys=left.keys,
                    numbers=left.numbers,
                    max_shell_m=left.largest,
                )
            )
    return rows


def fcurves_of(obj: bpy.types.Object) -> dict[tuple[str, int], bpy.types.FCurve]:
    """Return the F-curves of an object and its bones, by data path and index."""
    return {(fcurve.data_path, fcurve.array_index): fcurve for fcurve in animation.channelbag_of(obj).fcurves}


def smooth(obj: bpy.types.Object) -> None:
    """Give an object an Action of its own like the one it has, with curves through the keys in place of straight lines.

    Decimate takes both, and leaves fewer keys now of the one, now of the other.
    """
    animated = obj.animation_data
    animated.action = animated.action.copy()
    for fcurve in fcurves_of(obj).values():
        keys = np.array([key.co for key in fcurve.keyframe_points])
        replace_keys(fcurve, keys[:, 0], keys[:, 1], interpolation="BEZIER", handle_type="AUTO_CLAMPED")


def frames_of(times: np.ndarray) -> np.ndarray:
    """Return frames for samples at these times (n,), from 1 on, at their own rate:
    whole ones where they are evenly spaced.

    Raises
    ------
    RuntimeError
        Where two of them are too close for Blender.
    """
    frames = 1.0 + (times - times[0]) / float(np.median(np.diff(times)))
    even = 1.0 + np.arange(len(times))
    rate = (len(times) - 1) / float(times[-1] - times[0])
    if np.abs(1.0 + (times - times[0]) * rate - even).max() <= EVEN:
        return even
    kept = frames.astype(np.float32).astype(np.float64)
    close = np.diff(kept) < APART
    if close.any():
        raise RuntimeError(f"two samples are too close for Blender's frames, at {times[:-1][close][0]:.6g} s")
    return kept
