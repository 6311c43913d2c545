"""From desired poses back to the values of channels: what keys have to have for the same motion without in-betweens."""

from __future__ import annotations

import numpy as np

from ...motion import Poses
from ...motion.eulers import extrinsic_eulers_from_quaternions
from ...motion.quaternions import align_signs, conjugate, multiply
from ..compute.bodies import other_angles, turn_into_quaternions
from ..compute.components import LOCATION, ROTATION, ROWS
from ..compute.differences import InBetweens
from ..compute.sources import FULL_TURN, SAME_FRAME, Source
from ..transforms import Transform


def channel_values(
    transform: Transform, source: Source, motion: InBetweens, added: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Return the values (m, channels) of the keyed properties that show the desired poses,
    with the own delta transforms.

    `added` is what modifiers add to the channels, shape (10, m), where that is to be in the values as well.
    """
    original, channels = source.original, {}
    poses = motion.desired if added is None else _with_added(source, motion, added)
    shown = source.held(motion.frames)
    first = source.values_at(shown[:1])[:, 0]
    if LOCATION in source.keyed:
        axes = source.location_axes
        channels["location"] = (poses.positions if axes is None else poses.positions @ axes) - original[:3]
    if ROTATION in source.keyed:
        # In the sign and the turn that the animator's first key has.
        quaternions = align_signs(multiply(conjugate(original[3:7]), poses.quaternions))
        if source.order is None:
            channels[transform.rotation] = quaternions * (-1.0 if first[3:7] @ quaternions[0] < 0.0 else 1.0)
        else:
            angles = extrinsic_eulers_from_quaternions(quaternions, source.order)
            channels[transform.rotation] = _beginning_near(first[3:6], angles, source.order)
    if poses.scales is not None and original[7:].mean() != 0.0:
        # Where Blender's own in-betweens stay, each axis may go its own way from key to key.
        segments = np.searchsorted(source.key_frames, shown, side="right") - 1
        is_even = source.modes[np.clip(segments, 0, len(source.modes) - 1)] > 0
        native = source.values_at(shown)[7:].T
        channels["scale"] = np.where(is_even[:, None], poses.scales[:, None] / original[7:].mean(), native)
    # What is left alone before and behind goes on from the animator's values, whatever sign or turn they are in.
    keys, ends = source.keyed_frames, source.values_at(motion.frames[[0, -1]]).T
    for end, goes_on in (
        (0, keys[0] < motion.frames[0] - SAME_FRAME),
        (-1, keys[-1] > motion.frames[-1] + SAME_FRAME),
    ):
        if goes_on:
            for name, prop in transform.properties.items():
                if prop in channels:
                    channels[prop][end] = ends[end, ROWS[name]][: channels[prop].shape[1]]
    return {transform.prefix + prop: values for prop, values in channels.items()}


def _with_added(source: Source, motion: InBetweens, added: np.ndarray) -> Poses:
    """Return the desired poses with what modifiers add to location along its axes, and to rotation."""
    now, then = source.values_at(source.held(motion.frames)), motion.desired
    rows = now + added
    moved = added[:3].T if source.location_axes is None else added[:3].T @ source.location_axes.T
    for channels in (now, rows):
        turn_into_quaternions(channels, source.order)
    turned = multiply(conjugate(now[ROWS[ROTATION]].T), rows[ROWS[ROTATION]].T)
    return Poses(then.positions + moved, multiply(then.quaternions, turned), then.scales)


def components_near(source: Source, pose: Poses, near: np.ndarray) -> np.ndarray:
    """Return the components that show one pose (1,) with the own delta transforms, shape (10,).

    The rotation is in the sign and the turn that `near` (10,) has, and so is the scale that the modes leave to Blender.
    """
    original, result = source.original, near.copy()
    axes = np.eye(3) if source.location_axes is None else source.location_axes
    result[:3] = (pose.positions @ axes)[0] - original[:3]
    quaternion = multiply(conjugate(original[3:7]), pose.quaternions)
    if source.order is None:
        result[3:7] = quaternion[0] * (-1.0 if quaternion[0] @ near[3:7] < 0.0 else 1.0)
    else:
        angles = extrinsic_eulers_from_quaternions(quaternion, source.order)
        result[3:6] = _beginning_near(near[3:6], angles, source.order)[0]
    if pose.scales is not None and original[7:].mean() != 0.0:
        result[7:] = pose.scales / original[7:].mean()
    return result


def _beginning_near(first: np.ndarray, angles: np.ndarray, order: str) -> np.ndarray:
    """Return the same turns as these Euler angles (m, 3), of which the first are as near to `first` (3,) as may be."""
    both = angles, other_angles(angles, order)
    near = [turned + FULL_TURN * np.rint((first - turned[0]) / FULL_TURN) for turned in both]
    return min(near, key=lambda turned: float(np.abs(turned[0] - first).sum()))
