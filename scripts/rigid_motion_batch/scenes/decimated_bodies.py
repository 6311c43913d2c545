"""Blender's Decimate of the Graph Editor, of a whole rig: the fewest keys that it leaves where an error must not become
larger than asked.

Users give it one error margin for all F-curves, in the units of these. Which margin an error needs is searched for, and
what was tried for one error is known when another is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from rigid_motion import animation

FREE, STRAIGHT = 6, 2
"""The numbers of a key with free handles, and of one between straight lines."""

VARIES = 1e-4
"""A channel that never changes by more is one that does not vary: importers calculate in single precision."""

MARGINS = (1e-5, 10.0)
"""The smallest and the largest error margin of Decimate, in the units of the channels."""

TRIALS = 12
"""Margins tried for an error, at most."""

NEAR = 0.98
"""The part of the requested error that is as good as equal to it."""

CLOSE = 1.01
"""Two margins whose ratio is less leave the same keys, or nearly."""

EDGE = 0.1
"""The part of the margins in question that is left out with each trial at least."""

Curve = tuple[str, int]
"""A data path and an index."""


@dataclass(frozen=True)
class Left:
    """What is left of the keys of the channels that vary, and the largest error in metres."""

    how: str
    frames: int
    """With a key of any joint."""

    keys: int
    """Poses of joints; with Decimate, keys of F-curves."""

    numbers: int
    """A pose is a frame, and a value for each channel of the joint that varies; a key of an F-curve is six."""

    largest: float


def decimate(obj: bpy.types.Object, **options: object) -> None:
    """Decimate all keys of an object and its bones: `mode`, and `factor` or `remove_error_margin`.

    Raises
    ------
    RuntimeError
        Where Blender cannot: it has no window for its Graph Editor, or nothing in that to decimate.
    """
    for fcurve in animation.channelbag_of(obj).fcurves:
        fcurve.select = True
        fcurve.keyframe_points.foreach_set("select_control_point", np.ones(len(fcurve.keyframe_points), dtype=bool))
    window = next(iter(bpy.context.window_manager.windows), None)
    if window is None:
        raise RuntimeError("this Blender has no window for a Graph Editor")
    area = window.screen.areas[0]
    area.type = "GRAPH_EDITOR"
    area.spaces[0].dopesheet.show_only_selected = False
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.graph.decimate(**options)


def fcurves_of(obj: bpy.types.Object) -> dict[Curve, bpy.types.FCurve]:
    """Return the F-curves of an object and its bones."""
    return {(fcurve.data_path, fcurve.array_index): fcurve for fcurve in animation.channelbag_of(obj).fcurves}


def values_of(obj: bpy.types.Object, frames: np.ndarray) -> dict[Curve, np.ndarray]:
    """Return what they show on frames (n,), by Blender's own evaluation of F-curves, each of shape (n,)."""
    listed = frames.tolist()
    return {curve: np.array([fcurve.evaluate(frame) for frame in listed]) for curve, fcurve in fcurves_of(obj).items()}


def varying(values: dict[Curve, np.ndarray]) -> set[Curve]:
    """Return the F-curves that change, and count."""
    return {curve for curve, own in values.items() if np.ptp(own) > VARIES}


def key_frames_of(obj: bpy.types.Object, counted: set[Curve]) -> dict[Curve, list[float]]:
    """Return the frames of the keys of the F-curves that count."""
    return {
        curve: [key.co.x for key in fcurve.keyframe_points]
        for curve, fcurve in fcurves_of(obj).items()
        if curve in counted
    }


def left_of_fcurves(how: str, keys: dict[Curve, list[float]], largest: float, numbers_of_key: int) -> Left:
    """Return what is left where F-curves have keys on these frames."""
    count = sum(map(len, keys.values()))
    return Left(how, len(set().union(*keys.values())), count, numbers_of_key * count, largest)


class Decimations:
    """Decimate of an armature with keys on every sample, with one error margin for all F-curves.

    Parameters
    ----------
    obj : bpy.types.Object
        Each margin is tried on a copy of the Action that it has now. It has that again afterwards.
    seen : callable
        Tells what is left by the F-curves that the object has when it is called.
    trials : int
        Margins tried for an error, at most.
    """

    def __init__(self, obj: bpy.types.Object, seen: Callable[[], Left], trials: int = TRIALS) -> None:
        self.obj, self.seen, self.trials = obj, seen, trials
        self.recorded = obj.animation_data.action
        self.tried: dict[float, Left] = {}
        """The logarithm of a margin, and what it left."""

    def within(self, largest: float) -> Left | None:
        """Return the fewest keys found whose error is at most this, in metres;
        None where not even the smallest margin does.

        Margins are searched for between one that is too large and one that is not: from two errors, as if they were
        a power of the margin, and by halving in turn.
        """
        for count in range(self.trials):
            low, high = self._between(largest)
            if high - low < np.log(CLOSE) or any(NEAR * largest <= left.largest <= largest for left in self._tried()):
                break
            self._try(self._next(low, high, largest, halving=count % 3 == 2))
        good = [left for left in self._tried() if left.largest <= largest]
        return min(good, key=lambda left: left.keys, default=None)

    def _tried(self) -> list[Left]:
        return list(self.tried.values())

    def _between(self, largest: float) -> tuple[float, float]:
        """Return the logarithms of the smallest margin that is too large, and of the largest below that is not."""
        low, high = np.log(MARGINS)
        high = min((margin for margin, left in self.tried.items() if left.largest > largest), default=high)
        within = [margin for margin, left in self.tried.items() if left.largest <= largest and margin < high]
        return max(within, default=low), high

    def _next(self, low: float, high: float, largest: float, *, halving: bool) -> float:
        """Return the logarithm of the margin to try."""
        ends = [self.tried.get(low), self.tried.get(high)]
        if not any(ends):
            return float(np.clip(np.log(max(largest, 1e-12)), low, high))
        below, above = (np.log(max(end.largest, 1e-12)) if end else None for end in ends)
        requested = np.log(0.5 * (NEAR + 1.0) * max(largest, 1e-12))
        if halving or (below is not None and above is not None and above - below < 1e-9):
            return 0.5 * (low + high)
        if below is None:
            guess = high + requested - above
        elif above is None:
            guess = low + requested - below
        else:
            guess = low + (high - low) * (requested - below) / (above - below)
        edge = EDGE * (high - low)
        return float(np.clip(guess, low + edge * bool(ends[0]), high - edge * bool(ends[1])))

    def _try(self, margin: float) -> None:
        animated, copy = self.obj.animation_data, self.recorded.copy()
        try:
            animated.action = copy
            decimate(self.obj, mode="ERROR", remove_error_margin=float(np.exp(margin)))
            self.tried[margin] = self.seen()
        finally:
            animated.action = self.recorded
            bpy.data.actions.remove(copy)
