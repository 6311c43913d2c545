"""A whole body's keys beside those that Blender's Decimate leaves at the same largest error: the rows of a table.

For every mode one of ours, and one of Decimate that is held to the largest error that our keys really had.
"""

from __future__ import annotations

from dataclasses import dataclass

from .body_metrics import numbers_of
from .metrics import Metrics
from .reconstructions import Reconstruction

DECIMATE, OWN, SHARED = "Decimate", "keys of each joint", "key poses"
"""How keys were chosen."""


@dataclass(frozen=True)
class KeysOfBody:
    """One clip with one choice of keys under one mode, as one of two keeps it: the columns of `decimated.csv`."""

    clip: str
    mode: str

    how: str
    """`OWN` or `SHARED`; `DECIMATE` with no larger error than these have under the mode."""

    rate_hz: str
    """As the user wrote it; empty where a tolerance decides."""

    frames_with_keys: int
    """Of any joint."""

    keys: int
    """Poses of joints; of Decimate keys of F-curves."""

    numbers: int
    """A pose is its time, and the place and the turn where these vary; a key of an F-curve with free handles is six."""

    max_shell_m: float
    decimation: str

    tolerance_m: float | None
    """The largest shell error that was allowed; None where a rate decides."""


def ours(made: Reconstruction, row: Metrics) -> KeysOfBody:
    """Return what was measured of a mode."""
    assert row.key_frames is not None
    assert row.keys is not None
    return KeysOfBody(
        clip=row.clip,
        mode=row.mode,
        how=SHARED if made.shared else OWN,
        rate_hz=row.rate_hz,
        frames_with_keys=row.key_frames,
        keys=row.keys,
        numbers=numbers_of(made, row.mode),
        max_shell_m=row.max_shell_m,
        decimation=row.decimation,
        tolerance_m=row.tolerance_m,
    )
