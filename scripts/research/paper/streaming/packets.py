"""Packets: a pose on its way, with a number and the moment it belongs to, and the bytes that takes.

A packet is a header of 26 bytes, the pose in its packing, and in some streams its twist, all little-endian. The header
has a checksum of all that follows it, so that a flipped bit costs the packet and nothing else; the stream, for several
may come to one address; the sequence number; the time stamp of the pose, in seconds by the sender's clock; how many
seconds later it was sent; and what kind of packet it is, in which packing. The paper counts the poses alone; here the
two are told apart. What a protocol puts around a packet (28 bytes for UDP over IPv4) is not counted.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rigid_motion.motion import Poses

from .packing import PACKINGS, Packing

HEADER = np.dtype(
    [
        ("check", "<u4"),
        ("stream", "<u4"),
        ("sequence", "<u4"),
        ("stamp", "<f8"),
        ("age", "<f4"),
        ("kind", "u1"),
        ("packing", "u1"),
    ]
)
"""What goes before the pose."""

KEY = 1
"""The kind of a packet that has a pose, and nothing else."""

TWISTED = 0x80
"""Added to the number of a packing where twists follow the poses."""

FORMAT = zlib.crc32(b"Rigid Motion 1")
"""Where checksums begin: packets of other programs, and of another format, do not have one that fits."""


@dataclass(frozen=True, eq=False)
class Packets:
    """n packets of one stream, in the order in which they were sent."""

    data: np.ndarray
    """uint8, shape (n, 26 + packing.size), and with twists `packing.twist_size` more."""

    packing: Packing

    interval: float
    """Seconds from one packet to the next, as sender and receiver agreed beforehand. Where packets come when they are
    needed, a measure for what is soon and what is late."""

    twisted: bool = False
    """Whether there are twists."""

    @classmethod
    def of(
        cls,
        times: np.ndarray,
        poses: Poses,
        interval: float,
        packing: Packing,
        *,
        twists: np.ndarray | None = None,
        ages: np.ndarray | float = 0.0,
        first: int = 0,
        stream: int = 0,
    ) -> Packets:
        """Poses (n,) at rising times (n,) as packets.

        Parameters
        ----------
        times : array, shape (n,)
        poses : Poses, shape (n,)
        interval : float
        packing : Packing
        twists : array, shape (n, 6), optional
            In radians and units of the positions a second, along the body's own axes; see `rigid_motion.motion.twists`.
        ages : array, shape (n,), or float
            How much later each is sent.
        first : int
            The number of the first of them.
        stream : int

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
        header = np.zeros(len(times), dtype=HEADER)
        header["sequence"], header["stamp"], header["age"] = first + np.arange(len(times)), times, ages
        header["stream"], header["kind"] = stream, KEY
        header["packing"] = list(PACKINGS.values()).index(packing) if packing in PACKINGS.values() else len(PACKINGS)
        parts = [header.view(np.uint8).reshape(len(times), HEADER.itemsize), packing.pack(poses)]
        if twists is not None:
            header["packing"] |= TWISTED
            parts.append(packing.pack_twists(twists))
        return cls(sealed(np.concatenate(parts, axis=-1)), packing, float(interval), twists is not None)

    def __len__(self) -> int:
        return len(self.data)

    def __getitem__(self, index: Any) -> Packets:
        """Some of the packets, by NumPy's rules: a slice, a mask, or indices, of which some may come again."""
        return Packets(self.data[index], self.packing, self.interval, self.twisted)

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

    @property
    def sent(self) -> np.ndarray:
        """When they were sent, by the sender's clock: seconds, shape (n,)."""
        with np.errstate(invalid="ignore"):  # Bytes that nobody packed may be signalling NaNs.
            return self.stamps + self._headers["age"].astype(np.float64)

    @cached_property
    def poses(self) -> Poses:
        """What the receiver reads from the bytes, shape (n,)."""
        return self.packing.unpack(self.data[:, HEADER.itemsize :][:, : self.packing.size])

    @cached_property
    def twists(self) -> np.ndarray | None:
        """The twists that it reads, shape (n, 6)."""
        return self.packing.unpack_twists(self.data[:, HEADER.itemsize + self.packing.size :]) if self.twisted else None

    @property
    def are_whole(self) -> np.ndarray:
        """Whether their checksums fit, shape (n,)."""
        return checksums(self.data) == self._headers["check"]

    @property
    def pose_bytes(self) -> int:
        """Bytes of the poses and their twists, headers not counted."""
        return self.data.size - self.header_bytes

    @property
    def header_bytes(self) -> int:
        """Bytes of the headers."""
        return len(self) * HEADER.itemsize


def checksum(packet: bytes) -> int:
    """The checksum that a packet needs."""
    return zlib.crc32(packet[HEADER["check"].itemsize :], FORMAT)


def checksums(data: np.ndarray) -> np.ndarray:
    """The checksums that packets (n, bytes) need, uint32 of shape (n,)."""
    whole, size = np.ascontiguousarray(data).tobytes(), data.shape[1]
    return np.fromiter((checksum(whole[at : at + size]) for at in range(0, len(whole), size)), np.uint32, len(data))


def sealed(data: np.ndarray) -> np.ndarray:
    """Packets (n, bytes) with the checksums that they need."""
    data = np.ascontiguousarray(data).copy()
    data[:, : HEADER["check"].itemsize] = checksums(data).astype("<u4")[:, None].view(np.uint8)
    return data


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
