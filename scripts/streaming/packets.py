"""Packets: a pose on its way, with a number and the moment it belongs to, and the bytes that takes.

A packet is a header of 12 bytes, the sequence number (uint32) and the time stamp in seconds (float64), and then the
pose in its packing, all little-endian. The paper counts the poses alone; here the two are told apart. What a
protocol puts around a packet (28 bytes for UDP over IPv4) is not counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from addon.motion import Poses

from .packing import Packing

HEADER = np.dtype([("sequence", "<u4"), ("stamp", "<f8")])
"""What goes before the pose."""


@dataclass(frozen=True, eq=False)
class Packets:
    """n packets of one stream, in the order in which they were sent."""

    data: np.ndarray
    """uint8, shape (n, 12 + packing.size)."""

    packing: Packing

    interval: float
    """Seconds from one packet to the next, as sender and receiver agreed beforehand."""

    @classmethod
    def of(cls, times: np.ndarray, poses: Poses, interval: float, packing: Packing) -> Packets:
        """Poses (n,) at rising times (n,) as packets, numbered from 0.

        Raises
        ------
        ValueError
            For times that do not rise, and poses that the packing cannot say.
        """
        times = np.asarray(times, dtype=np.float64)
        if times.shape != poses.shape:
            raise ValueError(f"times of shape {times.shape} do not fit poses of shape {poses.shape}")
        if not (np.isfinite(interval) and interval > 0.0):
            raise ValueError(f"an interval of {interval} s between packets is not a positive number")
        if not (np.isfinite(times).all() and np.all(np.diff(times) > 0.0)):
            raise ValueError("the times of a stream need to be finite, and each later than the one before")
        header = np.empty(len(times), dtype=HEADER)
        header["sequence"], header["stamp"] = np.arange(len(times)), times
        front = header.view(np.uint8).reshape(len(times), HEADER.itemsize)
        return cls(np.concatenate((front, packing.pack(poses)), axis=-1), packing, float(interval))

    def __len__(self) -> int:
        return len(self.data)

    def __getitem__(self, index: Any) -> Packets:
        """Some of the packets, by NumPy's rules: a slice, a mask, or indices, of which some may come again."""
        return Packets(self.data[index], self.packing, self.interval)

    @cached_property
    def _headers(self) -> np.ndarray:
        return np.ascontiguousarray(self.data[:, : HEADER.itemsize]).view(HEADER)[:, 0]

    @property
    def sequences(self) -> np.ndarray:
        """Sequence numbers, int64 of shape (n,)."""
        return self._headers["sequence"].astype(np.int64)

    @property
    def stamps(self) -> np.ndarray:
        """The moments that the poses belong to, by the sender's clock: seconds, shape (n,)."""
        return self._headers["stamp"].astype(np.float64)

    @cached_property
    def poses(self) -> Poses:
        """What the receiver reads from the bytes, shape (n,)."""
        return self.packing.unpack(self.data[:, HEADER.itemsize :])

    @property
    def pose_bytes(self) -> int:
        """Bytes of the poses, headers not counted."""
        return len(self) * self.packing.size

    @property
    def header_bytes(self) -> int:
        """Bytes of the headers."""
        return self.data.size - self.pose_bytes


def bandwidth(packets: Packets, users: int = 1, *, headers: bool = False) -> float:
    """Bytes a second of `users` streams like this one, counted from what was packed.

    The first packet is not counted, since a stretch of the motion costs the pose at its end: poses exactly a
    twentieth of a second apart are 1120 bytes a second, as 7 doubles, for any length of the stream.

    Raises
    ------
    ValueError
        For fewer than two packets, which have no time between them.
    """
    if len(packets) < 2:
        raise ValueError(f"{len(packets)} packets have no time between them that bytes could be counted over")
    later = packets[1:]
    stamps = packets.stamps
    seconds = float(stamps[-1] - stamps[0])
    return users * (later.pose_bytes + (later.header_bytes if headers else 0)) / seconds
