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

FREE = 6
"""The numbers of a key with free handles."""

MARGINS = (1e-5, 10.0)
"""The smallest and the largest error margin of Decimate, in the units of the channels."""

TRIALS = 12
"""Margins tried for an error, at most."""

NEAR = 0.98
"""The part of the requested error that is as good as equal to it."""

CLOSE = 1.01
"""Two margins whose ratio is less leave the same keys, or nearly."""


@dataclass(frozen=True)
class Left:
    """What is left of the keys of the channels that vary, and the largest error in metres."""

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
        """Return the fewest keys found whose error is at most this, in metres; None where no margin tried does.

        Margins are halved between the smallest that is too large and the largest below it that is not.
        """
        for _ in range(self.trials):
            low, high = self._between(largest)
            near = any(NEAR * largest <= left.largest <= largest for left in self.tried.values())
            if near or high - low < np.log(CLOSE):
                break
            self._try((low + high) / 2.0)
        good = [left for left in self.tried.values() if left.largest <= largest]
        return min(good, key=lambda left: left.keys, default=None)

    def _between(self, largest: float) -> tuple[float, float]:
        """Return the logarithms of the smallest margin that is too large, and of the largest below that is not."""
        low, high = np.log(MARGINS)
        high = min((margin for margin, left in self.tried.items() if left.largest > largest), default=high)
        within = [margin for margin, left in self.tried.items() if left.largest <= largest and margin < high]
        return max(within, default=low), high

    def _try(self, margin: float) -> None:
        animated, copy = self.obj.animation_data, self.recorded.copy()
        try:
            animated.action = copy
            decimate(self.obj, mode="ERROR", remove_error_margin=float(np.exp(margin)))
            self.tried[margin] = self.seen()
        finally:
            animated.action = self.recorded
            bpy.data.actions.remove(copy)
