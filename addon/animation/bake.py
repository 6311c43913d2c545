"""Baking: poses written as real keys on an object's own channels, which any Blender plays without this extension.

`bake_poses` writes a motion that comes from elsewhere. `bake` puts the in-betweens of an object's keys on its channels,
in a copy of its Action, and `unbake` puts the original back.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..motion import Poses
from ..motion.eulers import ORDERS, extrinsic_eulers_from_quaternions
from ..motion.quaternions import align_signs, conjugate, multiply
from . import live
from .channels import code_of, write_channel
from .inbetweens import InBetweens, in_betweens
from .mode_keys import set_mode_in
from .originals import BAKED, has_original, move_by_copy, put_back, refuse_tweak_mode, refuse_without_original
from .reading import read
from .slots import Refused, Slot, Transformable, curves_in, slots_of
from .sources import LOCATION, ROTATION, ROWS, SAME_FRAME, Source

FIELDS = {
    "co": (2, np.float32),
    "handle_left": (2, np.float32),
    "handle_right": (2, np.float32),
    **dict.fromkeys(("handle_left_type", "handle_right_type", "interpolation", "easing", "type"), (1, np.int32)),
    **dict.fromkeys(("back", "amplitude", "period"), (1, np.float32)),
    **dict.fromkeys(("select_control_point", "select_left_handle", "select_right_handle"), (1, np.bool_)),
}
"""All there is to a key: how many numbers, and of which type."""


def bake_poses(obj: bpy.types.Object, frames: np.ndarray, poses: Poses, *, key_type: str = "GENERATED") -> None:
    """Key `obj` with one pose per frame, straight lines between them.

    Parameters
    ----------
    obj : bpy.types.Object
        With rotation mode Quaternion or Euler of any order. Its location, rotation and (where poses have scales) scale
        channels are replaced.
    frames : array, shape (n,)
        Rising; sub-frames allowed.
    poses : Poses, shape (n,)
        In the object's parent space: the channels' own.
    key_type : str
        GENERATED, as Blender has it for keys that a program made and may remove again.

    Raises
    ------
    ValueError
        Where the object turns by axis and angle, or frames and poses differ in number.
    """
    if poses.shape != np.shape(frames):
        raise ValueError(f"{obj.name}: {np.shape(frames)} frames do not fit poses of shape {poses.shape}")
    channels = [("location", poses.positions), _rotation(obj, poses.quaternions)]
    if poses.scales is not None:
        channels.append(("scale", np.repeat(poses.scales[:, None], 3, axis=1)))
    for data_path, values in channels:
        write_channel(obj, data_path, frames, values, key_type=key_type, group="Object Transforms")


def _rotation(obj: bpy.types.Object, quaternions: np.ndarray) -> tuple[str, np.ndarray]:
    """The rotation channels of the object's mode, and their values."""
    if obj.rotation_mode == "QUATERNION":
        return "rotation_quaternion", align_signs(quaternions)
    if obj.rotation_mode in ORDERS:
        return "rotation_euler", extrinsic_eulers_from_quaternions(quaternions, obj.rotation_mode)
    raise ValueError(
        f"{obj.name}: rotation by axis and angle cannot be baked; set its rotation mode to Quaternion first"
    )


def bake(
    obj: bpy.types.Object, *, step: float = 1.0, first: float | None = None, last: float | None = None
) -> tuple[float, float]:
    """Put the in-betweens of an object on its own channels, as real keys.

    The animator's keys stay where they are; the others are of type GENERATED, and straight lines run between all of
    them. The object gets a copy of its Action for it. The original stays in the file, for `unbake`.

    Parameters
    ----------
    obj : bpy.types.Object
    step : float
        Frames from key to key, counted from the first. The animator's own keys are kept whatever the step.
    first, last : float, optional
        The frames to bake, widened to whole segments. From the first key to the last, otherwise.

    Returns
    -------
    tuple of float
        The first and last frame with baked keys.

    Raises
    ------
    Refused
        Where there is nothing to bake, or no way. Nothing is changed then.
    """
    if not step > 0.0:
        raise Refused(f"{obj.name}: the step between baked keys has to be above zero, not {step}")
    refuse_tweak_mode(obj)
    readings = [(slot, read(slot, curves_in(slot.channelbag))) for slot in slots_of([obj])]
    readings = [(slot, source) for slot, source in readings if source.is_live]
    if not readings:
        raise Refused(f"{obj.name} has no rigid in-betweens to bake: choose a mode for its keys first")
    ranges = [_widened(obj, source, first, last) for _, source in readings]
    with live.paused():
        for (slot, source), (begin, end) in zip(readings, ranges, strict=True):
            _bake_slot(obj, slot, source, _frames(source, begin, end, step))
    live.refresh([obj])
    return min(begin for begin, _ in ranges), max(end for _, end in ranges)


def unbake(obj: bpy.types.Object) -> None:
    """Give an object the Actions back that it had before it was baked, to the last handle.

    Raises
    ------
    Refused
        Where it is not baked, or its Actions cannot be exchanged. Nothing is changed then.
    """
    refuse_without_original(obj, BAKED)
    refuse_tweak_mode(obj)
    put_back(obj, BAKED)


def is_baked(obj: bpy.types.Object) -> bool:
    """Whether an object moves by an Action with baked keys, and its original is still in the file."""
    return has_original(obj, BAKED)


def _widened(obj: bpy.types.Object, source: Source, first: float | None, last: float | None) -> tuple[float, float]:
    """The range from key to key that has the frames from first to last in it."""
    keys = source.key_frames
    if source.span is not None:
        # What goes on outside of the keys is baked as far as it is seen, and all of it: cycles end where keys are.
        return tuple(map(float, source.frame_range))
    if (first is not None and first > keys[-1]) or (last is not None and last < keys[0]):
        raise Refused(f"{obj.name} has its keys from frame {keys[0]:g} to {keys[-1]:g}: none of them is in that range")
    begin = 0 if first is None else np.searchsorted(keys, first + SAME_FRAME) - 1
    end = len(keys) - 1 if last is None else np.searchsorted(keys, last - SAME_FRAME)
    return float(keys[np.clip(begin, 0, len(keys) - 2)]), float(keys[np.clip(end, 1, len(keys) - 1)])


def _frames(source: Source, begin: float, end: float, step: float) -> np.ndarray:
    """Every step from begin to end, and the keys in between."""
    keys = source.key_frames
    keys = keys[(keys >= begin - SAME_FRAME) & (keys <= end + SAME_FRAME)]
    frames = begin + step * np.arange(np.floor((end - begin) / step + 1e-9) + 1)
    near = np.abs(frames[:, None] - keys[np.clip(np.searchsorted(keys, frames)[:, None] - (0, 1), 0, len(keys) - 1)])
    return np.sort(
        np.concatenate((frames[near.min(axis=1) >= SAME_FRAME], keys, (end,) if keys[-1] < end - SAME_FRAME else ()))
    )


def _bake_slot(obj: bpy.types.Object, slot: Slot, source: Source, frames: np.ndarray) -> None:
    motion = in_betweens(source, frames)
    copy = move_by_copy(obj, slot, BAKED)
    curves = curves_in(copy.channelbag)
    for path, values in channel_values(Transformable.of(obj), source, motion).items():
        for index, column in enumerate(values.T):
            fcurve = curves.get((path, index)) or copy.channelbag.fcurves.new(path, index=index)
            _bake_channel(fcurve, frames, column)
    set_mode_in(copy, "BLENDER", frames[:-1])


def channel_values(what: Transformable, source: Source, motion: InBetweens) -> dict[str, np.ndarray]:
    """The values (m, channels) of the keyed properties that show the wanted poses, with the own delta transforms."""
    own, poses, channels = source.own, motion.wanted, {}
    first = source.values_at(motion.frames[:1])[:, 0]
    if LOCATION in source.keyed:
        channels["location"] = poses.positions - own[:3]
    if ROTATION in source.keyed:
        # In the sign and the turn that the animator's first key has.
        quaternions = align_signs(multiply(conjugate(own[3:7]), poses.quaternions))
        if source.order is None:
            channels[what.rotation] = quaternions * (-1.0 if first[3:7] @ quaternions[0] < 0.0 else 1.0)
        else:
            angles = extrinsic_eulers_from_quaternions(quaternions, source.order)
            channels[what.rotation] = _beginning_near(first[3:6], angles, source.order)
    if poses.scales is not None and own[7:].mean() != 0.0:
        # Where Blender's own in-betweens stay, each axis may go its own way from key to key.
        segments = np.searchsorted(source.key_frames, motion.frames, side="right") - 1
        is_even = source.modes[np.clip(segments, 0, len(source.modes) - 1)] > 0
        native = source.values_at(motion.frames)[7:].T
        channels["scale"] = np.where(is_even[:, None], poses.scales[:, None] / own[7:].mean(), native)
    # What is left alone before and behind goes on from the animator's values, whatever sign or turn they are in.
    keys, ends = source.keyed_frames, source.values_at(motion.frames[[0, -1]]).T
    for place, goes_on in (
        (0, keys[0] < motion.frames[0] - SAME_FRAME),
        (-1, keys[-1] > motion.frames[-1] + SAME_FRAME),
    ):
        if goes_on:
            for name, prop in what.properties.items():
                if prop in channels:
                    channels[prop][place] = ends[place, ROWS[name]][: channels[prop].shape[1]]
    return {what.prefix + prop: values for prop, values in channels.items()}


def _beginning_near(first: np.ndarray, angles: np.ndarray, order: str) -> np.ndarray:
    """The same turns as these Euler angles (m, 3), of which the first are as near to `first` (3,) as may be."""
    # Half a turn more about the outer axes, and the middle one from the other side, turn alike.
    middle = "XYZ".index(order[1])
    others = angles + np.pi
    others[:, middle] = np.pi - angles[:, middle]
    near = [some + 2.0 * np.pi * np.rint((first - some[0]) / (2.0 * np.pi)) for some in (angles, others)]
    return min(near, key=lambda some: float(np.abs(some[0] - first).sum()))


def _bake_channel(fcurve: bpy.types.FCurve, frames: np.ndarray, values: np.ndarray) -> None:
    """Put keys on these frames, straight lines between them, and leave what is before and behind as it is."""
    keys = fcurve.keyframe_points
    old = {name: np.empty((len(keys), width), kind) for name, (width, kind) in FIELDS.items()}
    for name, numbers in old.items():
        keys.foreach_get(name, numbers.ravel())
    at = old["co"][:, 0]
    before, behind = at < frames[0] - SAME_FRAME, at > frames[-1] + SAME_FRAME
    new = {name: np.zeros((len(frames), width), kind) for name, (width, kind) in FIELDS.items()}
    own = np.flatnonzero(~(before | behind))
    places = np.clip(np.searchsorted(frames, at[own]), 1, len(frames) - 1)
    places -= at[own] - frames[places - 1] <= frames[places] - at[own]
    new["type"][:] = code_of("type", "GENERATED")
    for name, numbers in new.items():
        numbers[places] = old[name][own]
    new["interpolation"][:] = code_of("interpolation", "LINEAR")
    points = np.stack((frames, values), axis=1).astype(np.float32)
    at_end = own[places == len(frames) - 1]
    if behind.any() and len(at_end):
        new["interpolation"][-1] = old["interpolation"][at_end[0]]
    # Handles keep their distance from the key, where there were any; the outer ones shape what is left alone.
    for side in ("handle_left", "handle_right"):
        handles = points.copy()
        handles[places] += old[side][own] - old["co"][own]
        new[side] = handles
    new["co"] = points
    for name in ("handle_left_type", "handle_right_type"):
        new[name][[0, -1]] = code_of(name, "FREE")
    keys.clear()
    keys.add(int(before.sum() + len(frames) + behind.sum()))
    for name, numbers in new.items():
        keys.foreach_set(name, np.concatenate((old[name][before], numbers, old[name][behind])).ravel())
    for modifier in list(fcurve.modifiers):
        fcurve.modifiers.remove(modifier)
    fcurve.update()
