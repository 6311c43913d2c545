"""The table once more for a live stream whose sender sends when it must: at a delay, and against what a delay costs.

The state of the art is `lerp_slerp` with its updates evenly in time, which is shown an interval late. The others may
take a multiple of that interval, and send what is needed to stay within a tolerance; the tolerance is found at which
they are as good by each of `YARDSTICKS`. What they show is what the receiver makes of the packets, at every sample.
Errors are in metres and m/s, times in seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import measure, rms
from rigid_motion_batch.analysis.metrics import NOTHING
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming import PACKINGS, TWISTS, receive
from rigid_motion_batch.streaming.needed import send_when_needed
from rigid_motion_batch.streaming.playing import HEARTBEAT
from rigid_motion_batch.streaming.wire import Layout

from . import claims
from .table import RADIUS, UNIFORM, UPDATES, YARDSTICKS, Point, lowest, mean_rates, point, rates_for, senders

DELAYS = (1.5, 2.0, 3.0, 4.0)
"""Intervals of the even stream."""

MODES_SENT = (REFERENCE, TWISTS)

TOLERANCES = (1.0, 1.6, 2.4, 3.6, 5.2)
"""Multiples of the RMS shell error of the even stream."""

AROUND_A_PACKET = 28
"""Bytes that UDP over IPv4 adds."""


@dataclass(frozen=True)
class Sent:
    """One stream. The fields are columns of `sent.csv`."""

    clip: str
    mode: str
    even: int
    """Updates a second of the even stream whose intervals count."""

    delay: float
    """In those intervals."""

    tolerance_m: float
    keys_per_s: float
    """Updates, heartbeats among them."""

    rms_shell_m: float
    p95_shell_m: float
    rms_velocity_m_s: float


@dataclass(frozen=True)
class SentNeeded:
    """A cell of the table. The fields are columns of `sending.csv`."""

    clips: str
    """The clip, or the set of clips that this is the geometric mean of."""

    updates: int
    """Of the state of the art."""

    mode: str
    delay: float
    """In intervals of the state of the art."""

    yardstick: str

    needed: float
    """Updates a second that are as good; infinite where none of the tolerances tried was."""

    saved: float
    """Of the updates, as a share."""

    saved_bytes: float
    """Of the bytes of packets with everything around them, in doubles: a packet with a twist is larger."""

    saved_small: float
    """The same in the smallest packing."""

    reached: int
    asked: int


def measure_sending(clip: Clip, advance: Callable[[], object] = lambda: None) -> tuple[list[Point], list[Sent]]:
    """All streams of a clip: the even ones, and those that are sent when needed.

    Parameters
    ----------
    clip : Clip
    advance : callable
        Called as often as there are `steps_of` the clip.
    """
    even, sent = [], []
    for rate in _even_rates(clip):
        reference = point(clip, REFERENCE, UNIFORM, rate, senders(clip, rate))
        even.append(reference)
        for delay in DELAYS:
            for mode in MODES_SENT:
                if reference.rms_shell_m > NOTHING:
                    sent += [stream(clip, mode, rate, delay, factor * reference.rms_shell_m) for factor in TOLERANCES]
                advance()
    return even, sent


def steps_of(clip: Clip) -> int:
    """How often `measure_sending` advances."""
    return len(_even_rates(clip)) * len(DELAYS) * len(MODES_SENT)


def _even_rates(clip: Clip) -> list[int]:
    """The rates of the paper's rows that the clip has samples enough for."""
    rates = rates_for(clip)
    return [rate for rate in UPDATES if rate in rates]


def stream(clip: Clip, mode: str, even: int, delay: float, tolerance: float) -> Sent:
    """A clip sent when needed, and what is shown of it over a link that takes no time."""
    truth, seconds = clip.in_metres(clip.poses), delay / even
    packets, play_out = send_when_needed(clip.times, truth, tolerance, seconds, mode, RADIUS)
    # In order: their ages are in single precision.
    arrivals = np.maximum.accumulate(packets.sent)
    shown = receive(packets, arrivals, clip.times + seconds, mode, play_out).poses
    errors = measure(clip.times, shown, truth, RADIUS)
    silences = np.diff(np.append(arrivals, max(clip.times[-1], arrivals[-1])))
    updates = len(packets) - 1 + int(np.floor(silences / HEARTBEAT).sum())
    return Sent(
        clip=clip.name,
        mode=mode,
        even=even,
        delay=delay,
        tolerance_m=tolerance,
        keys_per_s=updates / float(clip.times[-1] - clip.times[0]),
        rms_shell_m=rms(errors.shell),
        p95_shell_m=float(np.percentile(errors.shell, 95.0)),
        rms_velocity_m_s=rms(errors.velocity),
    )


def packet_bytes(packing: str, mode: str) -> int:
    """Bytes of an update with everything around it."""
    return AROUND_A_PACKET + Layout(PACKINGS[packing], mode == TWISTS).size


def sending_needed(even: Iterable[Point], sent: Iterable[Sent]) -> list[SentNeeded]:
    """The cells for every clip."""
    curves: dict[tuple[str, int, str, float], list[Sent]] = {}
    for one in sent:
        curves.setdefault((one.clip, one.even, one.mode, one.delay), []).append(one)
    references = {(one.clip, round(one.asked)): one for one in even}
    cells = []
    for (clip, rate, mode, delay), curve in curves.items():
        reference = references[clip, rate]
        for yardstick in YARDSTICKS:
            share = lowest(curve, yardstick, getattr(reference, yardstick)) / reference.keys_per_s
            there = int(np.isfinite(share))
            cells.append(_cell(clip, rate, mode, delay, yardstick, share, there, 1))
    return cells


def mean_sending(cells: Iterable[SentNeeded], name: str, clips: Iterable[str]) -> list[SentNeeded]:
    """Geometric means over some clips, of those on which the error was reached."""
    return [
        _cell(name, updates, mode, delay, yardstick, rate / updates, there, asked)
        for (updates, mode, delay, yardstick), rate, there, asked in mean_rates(
            cells, clips, lambda cell: (cell.updates, cell.mode, cell.delay, cell.yardstick)
        )
    ]


def _cell(
    clips: str, updates: int, mode: str, delay: float, yardstick: str, share: float, reached: int, asked: int
) -> SentNeeded:
    saved = [
        1.0 - share * packet_bytes(packing, mode) / packet_bytes(packing, REFERENCE)
        for packing in ("double", "smallest_three")
    ]
    return SentNeeded(clips, updates, mode, delay, yardstick, share * updates, 1.0 - share, *saved, reached, asked)


def at_delay(
    cells: Sequence[SentNeeded], clips: str, mode: str, delay: float, yardstick: str
) -> list[SentNeeded | None]:
    """A row of the table, in the order of the paper's; None where there is no cell."""
    row = {
        cell.updates: cell
        for cell in cells
        if (cell.clips, cell.mode, cell.delay, cell.yardstick) == (clips, mode, delay, yardstick)
    }
    return [row.get(one.state_of_the_art) for one in claims.TABLE]
