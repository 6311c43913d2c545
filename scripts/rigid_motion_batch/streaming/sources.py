"""Sources: the keys of a recording that is played, as they become due.

Seconds by the recording's own clock, metres.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rigid_motion.motion import Poses

from .needed import NeededSender
from .packets import Packets
from .packing import Packing
from .receiver import PlayOut
from .sender import send
from .smooth import TWISTS, reach_of
from .wire import Terms, changed


class Source(Protocol):
    """What can be played."""

    terms: Terms

    def due(self, until: float) -> list[bytes]:
        """The keys that are due by then, and have not been asked for: datagrams, numbered from 0.

        Their age is what they have when they are due, and not when they are asked for: receivers count on that.
        """

    def next(self) -> float:
        """When there may be more; infinite where there are no more."""


class EvenSource:
    """So many keys a second, as `send` makes them.

    Parameters
    ----------
    times : array, shape (n,)
    poses : Poses, shape (n,)
    rate : float
    packing : Packing
    stream : int
    mode : str
        One of `rigid_motion.motion.MODES`.
    delay : float, optional
        As little as will do unless given.

    Raises
    ------
    ValueError
        For a rate, a mode, a delay or poses that make no stream.
    """

    def __init__(
        self,
        times: np.ndarray,
        poses: Poses,
        rate: float,
        packing: Packing,
        stream: int,
        mode: str = "dq_sclerp",
        delay: float | None = None,
    ) -> None:
        if mode == TWISTS:
            raise ValueError(f"an even stream has no twists, which {TWISTS} takes; choose another mode, or a tolerance")
        packets = send(times, poses, rate, packing)
        least = reach_of(mode).lead * packets.interval
        if delay is not None and delay < least * (1.0 - 1e-9):
            raise ValueError(f"a delay of {delay:g} s is too short: at this rate {mode} needs {least:g} s")
        wait = (least if delay is None else delay) / packets.interval
        self.terms = Terms.of(mode, packets.interval, PlayOut(wait=wait))
        self._stamps = packets.stamps
        self._keys = [changed(row.tobytes(), stream=stream) for row in packets.data]
        self._count = 0

    def due(self, until: float) -> list[bytes]:
        first, self._count = self._count, max(self._count, int(np.searchsorted(self._stamps, until, side="right")))
        return self._keys[first : self._count]

    def next(self) -> float:
        return float(self._stamps[self._count]) if self._count < len(self._stamps) else np.inf


class NeededSource:
    """The keys that keep what is shown within a tolerance, each as soon as the samples say that it is needed.

    Parameters
    ----------
    times : array, shape (n,)
    poses : Poses, shape (n,)
    sender : NeededSender
    packing : Packing
    stream : int
    mode : str
        That of the sender.

    Raises
    ------
    ValueError
        For times of the sender that the wire does not take.
    """

    def __init__(
        self, times: np.ndarray, poses: Poses, sender: NeededSender, packing: Packing, stream: int, mode: str = TWISTS
    ) -> None:
        self.terms = Terms.of(mode, sender.interval, sender.play_out)
        self._times, self._poses, self._sender, self._packing, self._stream = times, poses, sender, packing, stream
        self._samples = self._count = 0

    def due(self, until: float) -> list[bytes]:
        first = self._samples
        self._samples = end = max(first, int(np.searchsorted(self._times, until, side="right")))
        keys = self._sender.push(self._times[first:end], self._poses[first:end], until)
        if first < end == len(self._times):
            keys = [*keys, *self._sender.finish()]
        datagrams = []
        for key in keys:
            twists = None if key.twist is None else np.asarray(key.twist)[None]
            packet = Packets.of(
                np.array([key.stamp]),
                key.pose,
                self._sender.interval,
                self._packing,
                twists=twists,
                ages=key.sent - key.stamp,
                first=self._count,
                stream=self._stream,
            )
            datagrams.append(packet.data[0].tobytes())
            self._count += 1
        return datagrams

    def next(self) -> float:
        sample = float(self._times[self._samples]) if self._samples < len(self._times) else np.inf
        return min(sample, self._sender.next)
