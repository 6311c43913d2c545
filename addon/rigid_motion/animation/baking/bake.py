"""Baking: poses written as real keys on an object's own channels, which any Blender plays without this extension.

`bake_poses` writes a motion that comes from elsewhere. `bake` puts the in-betweens of an object's keys on its channels,
in a copy of its Action, and `unbake` puts the original back.
"""

from __future__ import annotations

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion import Poses
from ...motion.eulers import extrinsic_eulers_from_quaternions
from ...motion.quaternions import align_signs
from ..actions.channels import add_cycles, code_of, empty_key_fields, key_fields, set_key_fields, write_channel
from ..actions.reading import added_values
from ..actions.slots import Binding
from ..compute.components import SMOOTH
from ..compute.differences import in_betweens
from ..compute.sources import SAME_FRAME, Source
from ..edits.apply import Readings, Target, Targets, apply_edit, readable, transforms_of
from ..edits.mode_keys import set_whole
from ..live.segment_keys import set_mode_in
from ..transforms import ObjectTransform, Refused, Transform, transform_of
from ..writers.channel_values import channel_values
from .originals import (
    BAKED,
    Lookup,
    has_original,
    move_by_copy,
    put_back,
    refuse_tweak_mode,
    refuse_without_original,
    refuse_without_slot,
)


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
    order, quaternions = ObjectTransform(obj).order, poses.quaternions
    turns = align_signs(quaternions) if order is None else extrinsic_eulers_from_quaternions(quaternions, order)
    channels = [("location", poses.positions), (ObjectTransform(obj).rotation, turns)]
    if poses.scales is not None:
        channels.append(("scale", np.repeat(poses.scales[:, None], 3, axis=1)))
    for data_path, values in channels:
        write_channel(obj, data_path, frames, values, key_type=key_type, group="Object Transforms")


def bake(
    targets: Targets,
    *,
    step: float = 1.0,
    first: float | None = None,
    last: float | None = None,
    interpolation: str = "LINEAR",
    refused: list[Refused] | None = None,
) -> tuple[float, float]:
    """Put in-betweens on the channels that they are between, as real keys, and return the first and the last frame.

    The animator's keys stay where they are; the others are of type GENERATED, and straight lines or holds run between
    all of them. Every target gets a copy of its Action for it, one for all bones of a rig. The original stays in the
    file, for `unbake`.

    Parameters
    ----------
    targets, refused
        See `edits.apply`.
    step : float
        Frames from key to key, counted from the first. The animator's own keys are kept whatever the step.
    first, last : float, optional
        The frames to bake, widened to whole segments, and over those of smooth modes beside them, which go by keys that
        would be others. From the first key to the last, otherwise.
    interpolation : str
        LINEAR, or CONSTANT to hold each pose until the next key: with a step of 2 the motion is on twos.
    """
    if interpolation not in ("LINEAR", "CONSTANT"):
        raise ValueError(f"interpolation: LINEAR or CONSTANT, not {interpolation!r}")
    if not step > 0.0:
        raise Refused(n_("the step between baked keys has to be above zero, not {step}"), step=step)

    def plan(transform: Transform, readings: Readings) -> list[tuple[Binding, Source, np.ndarray]]:
        refuse_tweak_mode(transform)
        live = [(binding, source) for binding, source in readable(transform, readings) if source.is_live]
        if not live:
            raise Refused(
                n_("{name} has no rigid in-betweens to bake: choose a mode for its keys first"), name=transform.name
            )
        return [
            (binding, source, _frames(source, *_widened(transform, source, first, last), step))
            for binding, source in live
        ]

    def act(transform: Transform, planned: list[tuple[Binding, Source, np.ndarray]]) -> tuple[float, float]:
        for binding, source, frames in planned:
            _bake_place(transform, binding, source, frames, interpolation)
        return (
            min(float(frames[0]) for *_, frames in planned),
            max(float(frames[-1]) for *_, frames in planned),
        )

    ranges = apply_edit(targets, plan, act, refused).values()
    return min((begin for begin, _ in ranges), default=0.0), max((end for _, end in ranges), default=0.0)


def unbake(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give the keys back that there were before baking, to the last handle: of objects the Action, of bones their own.

    For targets and refusals see `edits.apply`.
    """
    go_back(targets, BAKED, refused)


def go_back(targets: Targets, kind: str, refused: list[Refused] | None) -> None:
    """Give targets their original Actions back."""

    def plan(transform: Transform, _readings: Readings) -> None:
        refuse_without_original(transform, kind)
        refuse_without_slot(transform, kind)
        refuse_tweak_mode(transform)

    lookup = Lookup(transforms_of(targets))
    apply_edit(targets, plan, lambda transform, _: put_back(transform, kind, lookup), refused)


def is_baked(target: Target) -> bool:
    """Return whether something moves by an Action with baked keys, and its original is still in the file."""
    return has_original(transform_of(target), BAKED)


def _widened(transform: Transform, source: Source, first: float | None, last: float | None) -> tuple[float, float]:
    """Return the range from key to key around the frames from first to last, and what hangs together with them."""
    keys = source.key_frames
    if _may_repeat(source):
        # Cycles go on from the outermost keys: what lies in between is baked as a whole.
        return source.keyed_range
    if source.goes_on:
        return tuple(map(float, source.seen_range))
    if (first is not None and first > keys[-1]) or (last is not None and last < keys[0]):
        raise Refused(
            n_("{name} has its keys from frame {first:g} to {last:g}: none of them is in that range"),
            name=transform.name,
            first=keys[0],
            last=keys[-1],
        )
    if source.steps or source.modified:
        # Without its modifiers no part can be left as it is. Holds show what is between keys behind these, too.
        (earliest, latest), longest = source.keyed_range, sum(step.step for step in source.steps)
        has_before = any(earliest < step.offset for step in source.steps)
        return (earliest - longest if has_before else earliest), latest + longest
    begin = 0 if first is None else np.searchsorted(keys, first + SAME_FRAME) - 1
    end = len(keys) - 1 if last is None else np.searchsorted(keys, last - SAME_FRAME)
    begin, end = int(np.clip(begin, 0, len(keys) - 2)), int(np.clip(end, 1, len(keys) - 1))
    is_smooth = np.isin(source.modes, SMOOTH)
    while begin > 0 and (is_smooth[begin - 1] or source.passed[begin]):
        begin -= 1
    while end < len(keys) - 1 and (is_smooth[end] or source.passed[end]):
        end += 1
    return float(keys[begin]), float(keys[end])


def _may_repeat(source: Source) -> bool:
    """Return whether cycles show every round of what is baked: holds and additions may differ from round to round."""
    return source.repeats and not source.steps and not source.modified


def _frames(source: Source, begin: float, end: float, step: float) -> np.ndarray:
    """Return every step from begin to end, and the keys in between."""
    keys = source.key_frames
    keys = keys[(keys >= begin - SAME_FRAME) & (keys <= end + SAME_FRAME)]
    frames = begin + step * np.arange(np.floor((end - begin) / step + 1e-9) + 1)
    near = np.abs(frames[:, None] - keys[np.clip(np.searchsorted(keys, frames)[:, None] - (0, 1), 0, len(keys) - 1)])
    return np.sort(
        np.concatenate((frames[near.min(axis=1) >= SAME_FRAME], keys, (end,) if keys[-1] < end - SAME_FRAME else ()))
    )


def _bake_place(transform: Transform, binding: Binding, source: Source, frames: np.ndarray, interpolation: str) -> None:
    motion, added = in_betweens(source, frames), added_values(binding, transform, source, frames)
    copy = move_by_copy(transform, binding, BAKED)
    fcurves = copy.channelbag.fcurves
    driven = {transform.channels[row] for row in source.driven}
    cycles = source.cyclic.cycles if source.cyclic is not None and _may_repeat(source) else None
    for path, values in channel_values(transform, source, motion, added).items():
        for index, column in enumerate(values.T):
            if (path, index) in driven:
                continue
            fcurve = copy.curves.get((path, index))
            if fcurve is not None and fcurve.mute:
                # Its keys have had no say, and what there was in their place is baked.
                fcurves.remove(copy.curves.pop((path, index)))
            fcurve = copy.ensure_curve((path, index))
            _bake_channel(fcurve, frames, column, interpolation)
            if cycles is not None:
                add_cycles(fcurve, cycles)
    begin, end = source.keyed_range
    if frames[0] <= begin + SAME_FRAME and frames[-1] >= end - SAME_FRAME:
        set_whole(copy, "BLENDER")
    else:
        set_mode_in(copy, "BLENDER", frames[:-1])


def _bake_channel(fcurve: bpy.types.FCurve, frames: np.ndarray, values: np.ndarray, interpolation: str) -> None:
    """Put keys on these frames, all of this interpolation, and leave what is before and behind as it is."""
    old = key_fields(fcurve.keyframe_points)
    at = old["co"][:, 0]
    before, behind = at < frames[0] - SAME_FRAME, at > frames[-1] + SAME_FRAME
    new = empty_key_fields(len(frames))
    inside = np.flatnonzero(~(before | behind))
    indices = np.clip(np.searchsorted(frames, at[inside]), 1, len(frames) - 1)
    indices -= at[inside] - frames[indices - 1] <= frames[indices] - at[inside]
    new["type"][:] = code_of("type", "GENERATED")
    for name, numbers in new.items():
        numbers[indices] = old[name][inside]
    new["interpolation"][:] = code_of("interpolation", interpolation)
    points = np.stack((frames, values), axis=1).astype(np.float32)
    at_end = inside[indices == len(frames) - 1]
    if behind.any() and len(at_end):
        new["interpolation"][-1] = old["interpolation"][at_end[0]]
    # Handles keep their distance from the key, where there were any; the outer ones shape what is left alone.
    for side in ("handle_left", "handle_right"):
        handles = points.copy()
        handles[indices] += old[side][inside] - old["co"][inside]
        new[side] = handles
    new["co"] = points
    for name in ("handle_left_type", "handle_right_type"):
        new[name][[0, -1]] = code_of(name, "FREE")
    parts = {name: np.concatenate((old[name][before], numbers, old[name][behind])) for name, numbers in new.items()}
    set_key_fields(fcurve, parts)
    for modifier in list(fcurve.modifiers):
        fcurve.modifiers.remove(modifier)
