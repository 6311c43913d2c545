"""Breakdowns: poses between the key before and the key after a frame, along the path of the mode, keyed on the frame.

They correspond to Blender's Breakdowner, Push and Relax, which treat each channel separately. A key on the frame itself
is ignored, as it is replaced. In a segment with Blender's own in-betweens, the pose is that of Blender's Breakdowner.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...blender import scene
from ...motion import Poses, interpolate
from ..actions.reading import added_values, read
from ..evaluation.bodies import body_poses
from ..evaluation.channel_values import channel_values
from ..evaluation.components import AXIS_ANGLE, DEPENDS_ON_KEYS, MODE_NAMES, MODE_NUMBERS, ROWS, SCALE
from ..evaluation.differences import in_betweens
from ..evaluation.sources import SAME_FRAME, KeyedTransform
from ..evaluation.turning import needs_turning
from ..following.inserted import set_key
from ..following.kept_timing import nearest_key
from ..following.shared_turns import share_out_turns
from ..queries.segments import frame_in_action
from ..transforms import Refused, Transform
from .apply import Readings, Targets, TriedEdit, TriedEdits, editable_keys

BREAKDOWN, PUSH, RELAX = KINDS = ("BREAKDOWN", "PUSH", "RELAX")
"""The kinds: between the keys before and after; away from the in-between of the mode; towards it."""


def breakdown(
    targets: Targets, factor: float = 0.5, kind: str = BREAKDOWN, *, refused: list[Refused] | None = None
) -> None:
    """Key a pose on the current frame at a fraction of the way from the key before it to the key after it.

    For targets and refusals see `apply`.

    Parameters
    ----------
    factor : float
        For BREAKDOWN 0 is the pose of the key before, 1 that of the key after; beyond these the motion continues. For
        RELAX 0 is the visible pose and 1 the in-between of the mode; PUSH goes as far in the other direction.
    kind : str
        One of `KINDS`.
    """
    Breakdowns(targets, kind, refused=refused).apply(factor)


class _Between(TriedEdit):
    """A transform between two keys on a frame of the scene. Raises `Refused` if there are no keys around the frame."""

    def __init__(self, transform: Transform, readings: Readings, frame: float) -> None:
        binding, whole = editable_keys(transform, readings)
        self.frame = frame = frame_in_action(transform.animated, frame)
        is_switch = any(abs(switch.frame - frame) < SAME_FRAME for switch in whole.switches)
        self.source = _without_frame(whole, frame)
        """The keys without those of this frame."""
        # Copies of keys in cycles do not count as keys before or after.
        first, last = self.source.keyed_range if self.source.channels else (np.inf, -np.inf)
        # At a switch of holders the keys before and after are in different spaces.
        if is_switch or not first < frame < last:
            text = n_("{name} needs a key before and a key after frame {frame:g}: go to a frame between two keys")
            raise Refused(text, name=transform.name, frame=frame)
        keys = self.source.key_frames
        after = int(np.searchsorted(keys, frame))
        self.ends = float(keys[after - 1]), float(keys[after])
        """The frames of the keys before and after."""
        rows = (row for rows, _ in self.source.channels for row in rows)
        channels = [transform.channels[row] for row in rows]
        super().__init__(transform, binding, (*channels, transform.turns_channel))
        self.seen = self.posed - added_values(binding, transform, whole, np.array([frame]))[:, 0]
        """The visible components, shape (10,)."""

    @property
    def mode(self) -> str:
        return MODE_NAMES[self.source.mode_at(self.ends[0] + SAME_FRAME)]

    def pose(self, kind: str, factor: float) -> np.ndarray:
        """Return the components to key, shape (10,)."""
        at = np.array([0.5 * sum(self.ends) if kind == BREAKDOWN else self.frame])
        if kind == BREAKDOWN:
            first, last = self.source.values_at(np.array(self.ends)).T
            straight = first + factor * (last - first)
            if self.mode == "BLENDER":
                return straight
            passed = in_betweens(self.source, at, progress=np.array([factor])).desired
            return _components_near(self.source, passed, straight)
        share = -factor if kind == PUSH else factor
        towards, native = in_betweens(self.source, at).desired, self.source.values_at(at)[:, 0]
        straight = self.seen + share * (_components_near(self.source, towards, native) - self.seen)
        if self.mode == "BLENDER":
            return straight
        original, axes = self.source.original[:, None, None], self.source.location_axes
        now = body_poses(self.seen[:, None, None], original, None if axes is None else axes[None], self.source)[0]
        ways = Poses(
            np.concatenate((now.positions, towards.positions)),
            np.concatenate((now.quaternions, towards.quaternions)),
            None if now.scales is None else np.append(now.scales * self.source.original[7:].mean(), towards.scales),
        )
        passed = interpolate((0.0, 1.0), ways, np.array([share]), self.mode, extrapolate=True)
        return _components_near(self.source, passed, straight)

    def key(self, kind: str, factor: float) -> None:
        """Key the pose in all channels that have keys, and divide the turns of the segment.

        If an ordinary key would change the path, a key on the path gets the type *Breakdown*, which keeps the path.
        """
        components, key_type = self.pose(kind, factor), scene().tool_settings.keyframe_type
        if kind == BREAKDOWN and MODE_NUMBERS[self.mode] in DEPENDS_ON_KEYS and not needs_turning(self.source):
            key_type = "BREAKDOWN"
        for row, channel in self.transform.channels.items():
            if channel in self.keys:
                fcurve = self.binding.curves[channel]
                before = len(fcurve.keyframe_points)
                set_key(fcurve, self.frame, components[row])
                if len(fcurve.keyframe_points) > before:
                    fcurve.keyframe_points[nearest_key(fcurve, self.frame)[0]].type = key_type
        if needs_turning(self.source):
            share_out_turns(self.binding, read(self.binding), self.source, factor if kind == BREAKDOWN else None)


class Breakdowns(TriedEdits):
    """Targets with keys before and after the current frame, for trying in-between poses until the user accepts one."""

    def __init__(self, targets: Targets, kind: str = BREAKDOWN, *, refused: list[Refused] | None = None) -> None:
        self.kind = kind
        frame = scene().frame_current_final

        def plan(transform: Transform, readings: Readings) -> _Between:
            return _Between(transform, readings, frame)

        super().__init__(targets, plan, refused)

    def apply(self, factor: float) -> None:
        """Key the poses for this factor, replacing those of the previous factor."""
        with self.edit():
            for between in self.tried:
                between.key(self.kind, factor)


def _without_frame(source: KeyedTransform, frame: float) -> KeyedTransform:
    """Return the source without the keys on this frame. A channel with no other key keeps its value."""
    channels, rest = [], dict(source.rest)
    for rows, keys in source.channels:
        others = np.abs(keys.times - frame) >= SAME_FRAME
        if others.any():
            channels.append((rows, keys if others.all() else keys.at(others)))
        else:
            rest |= dict(zip(rows, keys.values[:, 0].tolist(), strict=True))
    return replace(source, channels=tuple(channels), rest=rest)


def _components_near(source: KeyedTransform, pose: Poses, near: np.ndarray) -> np.ndarray:
    """Return the components that show one pose (1,) with the object's delta transforms, shape (10,).

    The rotation has the sign and the turn of `near` (10,). A scale that the modes leave to Blender is that of `near`.
    """
    original, axes = source.original, source.location_axes
    moved = replace(pose, positions=pose.positions if axes is None else pose.positions @ axes)
    ends = np.stack((near, near))[..., None]
    result = channel_values(moved, np.array([1]), np.zeros(1), ends, original[:, None], source.order)[:, 0]
    # A value between two opposite signs or axes may have nearly no length.
    turned = result[3 if source.order is None else 4 : 7]
    if source.order in (None, AXIS_ANGLE):
        turned /= np.linalg.norm(turned) or 1.0
    scale = original[ROWS[SCALE]].mean()
    result[ROWS[SCALE]] = near[ROWS[SCALE]] if pose.scales is None or scale == 0.0 else pose.scales[0] / scale
    return result
