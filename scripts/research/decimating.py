"""Blender's Decimate of the Graph Editor: the fewest keys that it leaves within a maximum error.

Users give it one error margin for all F-curves, in the F-curves' units. The margin for a given error is searched for.
Errors are shell errors in metres at eighths of frames, because motion between frames counts as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.animation.actions.channels import replace_keys
from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch.analysis.reconstructions import Reconstruction
from rigid_motion_batch.scenes.armature import RestFigure, Rig

NUMBERS_PER_FREE_KEY = 6  # numbers per key with free handles
MARGIN_RANGE = (1e-5, 10.0)  # minimum and maximum error margin of Decimate, in the units of the channels
MAX_TRIALS = 12  # maximum number of margins tried for an error
MIN_ERROR_RATIO = 0.98  # an error of at least this fraction of the requested one counts as equal to it
MAX_MARGIN_RATIO = 1.01  # two margins with a smaller ratio leave (nearly) the same keys
PARTS_PER_FRAME = 8  # errors are measured at this many parts of a frame
MIN_VARIATION = 1e-4  # a channel that varies less is constant: importers calculate in single precision


@dataclass(frozen=True)
class Left:
    """Counts of the remaining keys of channels that vary: frames with a key, keys, numbers; and the largest error."""

    frames: int
    keys: float
    numbers: int
    largest: float

    def figures(self) -> dict[str, float]:
        """Return the counts as they are published."""
        return {"frames": self.frames, "key_count": self.keys, "numbers": self.numbers, "error_mm": 1e3 * self.largest}


def between(frames: np.ndarray) -> np.ndarray:
    """Return frames (n,) and the moments between them for measuring errors, shape (`PARTS_PER_FRAME` (n - 1) + 1,)."""
    count = len(frames)
    return np.interp(np.arange(PARTS_PER_FRAME * (count - 1) + 1) / PARTS_PER_FRAME, np.arange(count), frames)


def decimate(obj: bpy.types.Object, **options: object) -> None:
    """Decimate all keys of an object and its bones: `mode`, and `factor` or `remove_error_margin`."""
    for fcurve in animation.channelbag_of(obj).fcurves:
        fcurve.select = True
        fcurve.keyframe_points.foreach_set("select_control_point", np.ones(len(fcurve.keyframe_points), dtype=bool))
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.type = "GRAPH_EDITOR"
    area.spaces[0].dopesheet.show_only_selected = False
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.graph.decimate(**options)


def fcurves_of(obj: bpy.types.Object) -> dict[tuple[str, int], bpy.types.FCurve]:
    """Return the F-curves of an object and its bones, by path and index."""
    return {(fcurve.data_path, fcurve.array_index): fcurve for fcurve in animation.channelbag_of(obj).fcurves}


def values_of(obj: bpy.types.Object, frames: np.ndarray) -> dict[tuple[str, int], np.ndarray]:
    """Return the values of an object's F-curves at frames (n,), evaluated by Blender, each of shape (n,)."""
    at = frames.tolist()
    return {key: np.array([curve.evaluate(frame) for frame in at]) for key, curve in fcurves_of(obj).items()}


def bend(obj: bpy.types.Object) -> None:
    """Make all keys of an object and its bones Bézier keys, with the handles that Blender gives new keys."""
    for fcurve in fcurves_of(obj).values():
        keys = np.array([key.co for key in fcurve.keyframe_points])
        replace_keys(fcurve, keys[:, 0], keys[:, 1], interpolation="BEZIER")


def decimated_within(
    obj: bpy.types.Object, left: Callable[[], Left], largest: float, trials: int = MAX_TRIALS
) -> Left | None:
    """Return the fewest keys that Decimate leaves with at most this error, from linear or Bézier keys; None if no
    margin tried achieves it. For arguments see `Decimations`.
    """
    animated = obj.animation_data
    straight = Decimations(obj, left, trials)
    result = [straight.within(largest)]
    animated.action = animated.action.copy()
    bend(obj)
    result.append(Decimations(obj, left, trials).within(largest))
    animated.action = straight.recorded
    return min(filter(None, result), key=lambda left: left.keys, default=None)


class Decimations:
    """Decimate applied to an object, with one error margin for all F-curves.

    Each margin is tried on a copy of the object's current Action, which is restored afterwards; `left` measures the
    object's current F-curves when called.
    """

    def __init__(self, obj: bpy.types.Object, left: Callable[[], Left], trials: int = MAX_TRIALS) -> None:
        self.obj, self.left, self.trials = obj, left, trials
        self.recorded = obj.animation_data.action
        self.tried: dict[float, Left] = {}  # the logarithm of a margin, and its result

    def within(self, largest: float) -> Left | None:
        """Return the fewest keys found with at most this error; None if no margin tried achieves it.

        Bisects between the smallest margin that is too large and the largest margin below it that is not.
        """
        for _ in range(self.trials):
            low, high = self._between(largest)
            near = any(MIN_ERROR_RATIO * largest <= left.largest <= largest for left in self.tried.values())
            if near or high - low < np.log(MAX_MARGIN_RATIO):
                break
            self._try((low + high) / 2.0)
        good = [left for left in self.tried.values() if left.largest <= largest]
        return min(good, key=lambda left: left.keys, default=None)

    def _between(self, largest: float) -> tuple[float, float]:
        low, high = np.log(MARGIN_RANGE)
        high = min((margin for margin, left in self.tried.items() if left.largest > largest), default=high)
        within = [margin for margin, left in self.tried.items() if left.largest <= largest and margin < high]
        return max(within, default=low), high

    def _try(self, margin: float) -> None:
        copy = self.obj.animation_data.action = self.recorded.copy()
        decimate(self.obj, mode="ERROR", remove_error_margin=float(np.exp(margin)))
        self.tried[margin] = self.left()
        self.obj.animation_data.action = self.recorded
        bpy.data.actions.remove(copy)


class DecimatedBody:
    """A whole body as a rig with a key on every sample, alone in an empty file."""

    def __init__(self, made: Reconstruction) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        clip = made.clip
        frames = 1.0 + (made.times - made.times[0]) * clip.samples_a_second
        self.frames = between(frames)
        self._skeleton, self._radius = made.skeleton, made.radii[:, None]
        joints = clip.in_blender(clip.poses[:, made.samples])
        roots = clip.whole_body.parents < 0
        places = joints.positions[roots]
        # Single precision is most accurate near the origin.
        joints.positions[roots] -= (places.min(axis=(0, 1)) + places.max(axis=(0, 1))) / 2.0
        self.rig = Rig("Body", RestFigure.of(clip), clip.whole_body.joints, bpy.context.scene.collection)
        channels = self.rig.channels_of(joints)
        for bone in range(len(self.rig.bones)):
            self.rig.key(bone, frames, channels[bone])
        self._counted = {
            curve for curve, values in values_of(self.rig.obj, frames).items() if np.ptp(values) > MIN_VARIATION
        }
        self._truth = self.shown()
        self._truth[:, ::PARTS_PER_FRAME] = self._skeleton.in_root_space(joints)

    def within(self, largest: float) -> Left | None:
        """Return the fewest keys with at most this error, from linear or Bézier keys."""
        return decimated_within(self.rig.obj, self.left, largest)

    def errors(self) -> np.ndarray:
        """Return the error of each joint with the rig's current F-curves, shape (joints, n)."""
        return shell_error(self.shown(), self._truth, self._radius)

    def shown(self) -> Poses:
        """Return the joints with the rig's current F-curves, in the root's space, shape (joints, n)."""
        obj = self.rig.obj
        values, bones = values_of(obj, self.frames), [obj.pose.bones[name] for name in self.rig.bones]

        def channels(name: str) -> np.ndarray:
            result = np.array([getattr(bone, name) for bone in bones])[:, None].repeat(len(self.frames), axis=1)
            for own, path in zip(result, (bone.path_from_id(name) for bone in bones), strict=True):
                for index in range(own.shape[1]):
                    own[:, index] = values.get((path, index), own[:, index])
            return result

        joints = self.rig.joints_of(Poses(channels("location"), normalise(channels("rotation_quaternion"))))
        return self._skeleton.in_root_space(joints)

    def left(self) -> Left:
        """Return the counts of the rig's current keys, and their largest error."""
        curves = [fcurve for curve, fcurve in fcurves_of(self.rig.obj).items() if curve in self._counted]
        keys = [key.co.x for fcurve in curves for key in fcurve.keyframe_points]
        return Left(len(set(keys)), len(keys), NUMBERS_PER_FREE_KEY * len(keys), float(self.errors().max()))
