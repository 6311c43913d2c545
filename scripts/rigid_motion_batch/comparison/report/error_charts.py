"""The errors of a reconstruction over time, as charts for the report."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rigid_motion_batch.analysis.reconstructions import Groups, Reconstruction, identical_modes
from rigid_motion_batch.palette import colour_of

from .charts import Axis, Marks, axis_over, line_chart, with_rows_below
from .elements import curve
from .markup import Markup, element, join

CLOSE_UP_SEGMENTS = 12
"""How many segments the close-up of the errors over time shows; curves of more than twice as many get one."""


def errors_over_time(reconstruction: Reconstruction) -> Markup:
    """The shell errors over the whole clip and, where that is too much to make out, over the segments at the worst."""
    return error_curves(
        # Nothing but blanks may not be in an id, and neither name has a slash.
        f"{reconstruction.clip.name}/{reconstruction.choice.name}",
        reconstruction.times - reconstruction.times[0],
        {mode: some.shell * 1e3 for mode, some in reconstruction.errors.items()},
        identical_modes([reconstruction]),
        {mode: kept - reconstruction.samples.start for mode, kept in reconstruction.keys.items()},
        alike=reconstruction.choice.decimation == "uniform",
    )


def error_curves(
    name: str,
    times: np.ndarray,
    errors: Mapping[str, np.ndarray],
    groups: Groups,
    keys: Mapping[str, np.ndarray],
    *,
    alike: bool,
    measured: str = "shell error",
) -> Markup:
    """Errors over time, and over the segments around the largest.

    Parameters
    ----------
    name : str
        Of the charts among all of the page.
    times : array, shape (n,)
        Seconds from the first key on.
    errors : mapping of mode to array, shape (n,)
        In millimetres, of the first mode of each group at least.
    groups : groups of modes that are one motion
    keys : mapping of mode to array of int, shape (k,)
        Which of the times are keys.
    alike : bool
        Whether the keys are those of all modes.
    measured : str
        What the errors are.
    """

    def marks(samples: slice) -> list[Marks]:
        def within(mode: str) -> np.ndarray:
            return times[keys[mode][(keys[mode] >= samples.start) & (keys[mode] < samples.stop)]]

        if alike:
            return [Marks(within(groups[0][0]))]
        return [Marks(within(group[0]), colour_of(group[0])) for group in groups]

    def chart(suffix: str, title: str, samples: slice) -> Markup:
        shown = {mode: some[samples] for mode, some in errors.items()}
        seconds, rows = times[samples], marks(samples)
        errors_axis = axis_over(measured, "mm", np.concatenate(list(shown.values())))
        # The larger errors behind, or they would cover the smaller ones.
        ordered = sorted(groups, key=lambda group: -shown[group[0]].mean())
        return element(
            "figure",
            line_chart(
                f"{name}-{suffix}",
                title,
                f"{measured.capitalize()} of each mode over time; strokes on the time axis mark the keys.",
                [curve(group, seconds, shown[group[0]]) for group in ordered],
                Axis("time since the first key", "s", float(seconds[0]), float(seconds[-1])),
                with_rows_below(errors_axis, len(rows)) if len(rows) > 1 else errors_axis,
                marks=rows,
            ),
            element("figcaption", title),
        )

    whole = chart("time", "Error over time, keys marked", slice(0, len(times)))
    worst_mode = max(errors, key=lambda mode: errors[mode].max())
    own = keys[worst_mode]
    if len(own) <= 2 * CLOSE_UP_SEGMENTS:
        return whole
    worst = int(errors[worst_mode].argmax())
    first = int(np.clip(np.searchsorted(own, worst) - CLOSE_UP_SEGMENTS // 2, 0, len(own) - 1 - CLOSE_UP_SEGMENTS))
    close = slice(int(own[first]), int(own[first + CLOSE_UP_SEGMENTS]) + 1)
    return join([whole, chart("close", f"The {CLOSE_UP_SEGMENTS} segments around the largest error", close)])
