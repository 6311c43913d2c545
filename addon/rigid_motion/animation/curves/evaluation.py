"""The values of many curves on many frames. Results are doubles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...motion.piecewise import combine
from .grouping import Group, blocks, group_by_timing
from .keys import BEZIER, Keys
from .spans import Spans

CHUNK = 65536
"""Values of curves with the same timing that are worked out at once."""


def evaluate(
    curves: Sequence[Keys],
    times: Sequence[np.ndarray],
    *,
    unit_elastic: bool = False,
    out: Sequence[np.ndarray] | None = None,
) -> Sequence[np.ndarray]:
    """Return the values of curves at their times.

    Parameters
    ----------
    curves : sequence of Keys
        Without keys curves are 0 everywhere, as in Blender.
    times : sequence of array, shape (m,)
        Frames for each of them, sub-frames allowed, best in rising order. Curves that have their keys and handles on
        the same frames, and that are asked for the same frames, share the work.
    unit_elastic : bool
        Take the amplitude of ELASTIC relative to the change of value in its segment, instead of in units of value:
        then curves keyed together have the same timing there too.
    out : sequence of array, shape (c, m), optional
        What to put the values into.

    Returns
    -------
    sequence of array, shape (c, m)
        NaN where keys or handles are not finite. What Blender does to the channels
        of whole numbers and enumerations, which it rounds, is left out.
    """
    if out is None:
        out = [np.empty((len(keys.points), len(frames))) for keys, frames in zip(curves, times, strict=True)]
    if curves:
        with np.errstate(all="ignore"):
            spans = Spans.of(curves, unit_elastic)
            for groups in blocks(group_by_timing(curves, times, spans)):
                _evaluate_groups(groups, spans, out)
    return out


def _evaluate_groups(groups: list[Group], spans: Spans, out: Sequence[np.ndarray]) -> None:
    """Write the values of groups with equally many curves each to where they belong, see `evaluate`."""
    spans_of_first = np.concatenate([group.spans for group in groups])
    counts = np.concatenate([group.counts for group in groups])
    parameters = spans.parameters(spans_of_first, counts, np.concatenate([group.frames for group in groups]))
    # The curves of a group go through spans in the same way: those of the others are as far from their first ones.
    first_spans = spans.first_span[np.stack([group.curves for group in groups], axis=1)]
    rows = spans_of_first + np.repeat(first_spans - first_spans[0], [len(group.spans) for group in groups], axis=1)
    degree = 3 if BEZIER in spans.interpolation[spans_of_first] else 1
    powers = np.empty((degree + 1, len(parameters)))
    powers[0] = 1.0
    for power in range(degree):
        np.multiply(powers[power], parameters, out=powers[power + 1])

    def values_of(curves: slice) -> np.ndarray:
        values = np.empty((len(rows[curves]), len(parameters)))
        combine(spans.polynomials[: degree + 1, rows[curves]].transpose(1, 0, 2), powers, counts, values)
        return values

    if len(groups) == 1:
        for chunk, group in groups[0].chunks(CHUNK // max(1, len(parameters))):
            group.write(values_of(chunk), out)
        return
    begin, values = 0, values_of(slice(None))
    for group in groups:
        group.write(values[:, begin : begin + len(group.frames)], out)
        begin += len(group.frames)
