"""The example of the text: bytes a second for each user, counted from packets that were really packed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion_batch.recordings.clips import Clip

from . import claims
from .streaming import PACKINGS, bandwidth, send


@dataclass(frozen=True)
class Bandwidth:
    """One packing at one rate. The fields are the columns of `bandwidth.csv`."""

    packing: str
    label: str
    bytes_a_pose: int

    position_error_m: float
    """The largest that the packing allows on this clip."""

    rotation_error_deg: float

    updates: int

    bytes_per_s: float
    """For each user, of the poses, as the paper counts."""

    with_headers_per_s: float
    """For each user, with the headers of the packets."""


def bandwidths(clip: Clip) -> list[Bandwidth]:
    """All packings at the rates of the example."""
    poses = clip.in_metres(clip.poses)
    rows = []
    for name, packing in PACKINGS.items():
        position, rotation = (float(np.max(bound)) for bound in packing.bounds(poses))
        for updates in claims.EXAMPLE:
            packets = send(clip.times, poses, updates, packing)
            rows.append(
                Bandwidth(
                    packing=name,
                    label=packing.label,
                    bytes_a_pose=packing.size,
                    position_error_m=position,
                    rotation_error_deg=float(np.degrees(rotation)),
                    updates=updates,
                    bytes_per_s=bandwidth(packets),
                    with_headers_per_s=bandwidth(packets, headers=True),
                )
            )
    return rows
