"""Motions with Stepped modifiers: each moment that is shown is worked out once, however many frames hold it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .sources import Source


def at_moments(
    move: Callable[..., None],
    sources: Sequence[Source],
    frames: Sequence[np.ndarray],
    native: np.ndarray,
    delta: np.ndarray,
    *rest: object,
) -> None:
    """Have `move` fill in what is shown on the frames of each source, where that is a moment held from before.

    Its arguments are sources, the rising frames of each, two arrays with a column for every frame, which may be in the
    same place, and the rest.
    """
    if not any(source.steps for source in sources):
        move(sources, frames, native, delta, *rest)
        return
    pairs = [np.unique(source.held(own), return_inverse=True) for source, own in zip(sources, frames, strict=True)]
    counts = [len(moments) for moments, _ in pairs]
    found = np.empty((2, len(native), sum(counts)))
    move(sources, [moments for moments, _ in pairs], found[0], found[1][: len(delta)], *rest)
    begins = np.cumsum([0, *counts[:-1]])
    places = np.concatenate([begin + inverse for begin, (_, inverse) in zip(begins, pairs, strict=True)])
    native[:] = found[0][:, places]
    delta[:] = found[1][: len(delta), places]
