"""Admission: which of the packets that arrive become keys, and what there is to say of the others.

Seconds throughout. Whatever a packet holds, there is no error: damage is an event like loss.
"""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from addon.motion.repair import LARGEST

from .events import Event, What
from .packets import Packets

CLOCK = 1e-6
"""Seconds that clocks do not tell apart, least of all where they count from 1970."""

SOONEST = 1e-3
"""Of an interval: packets of one stream are further apart than that, or one of them is damaged."""


def is_sound(packets: Packets) -> np.ndarray:
    """Which of n packets are whole, and hold numbers that can be a time and a pose, shape (n,)."""
    poses, lengths = packets.poses, np.abs(packets.poses.quaternions).max(axis=-1, initial=0.0)
    numbers = [np.abs(packets.sent), np.abs(poses.positions).max(axis=-1, initial=0.0), lengths]
    if packets.twists is not None:
        numbers.append(np.abs(packets.twists).max(axis=-1, initial=0.0))
    return packets.are_whole & (np.stack(numbers) < LARGEST).all(axis=0) & (lengths > 1.0 / LARGEST)


def admit(
    packets: Packets, arrivals: np.ndarray, sound: np.ndarray, delay: float, lead: float
) -> tuple[np.ndarray, list[Event]]:
    """Choose the keys among n packets.

    Parameters
    ----------
    packets : Packets, n of them
        In the order of their arrival.
    arrivals : array, shape (n,)
        Rising.
    sound : array of bool, shape (n,)
        At least one.
    delay : float
        By which the play-out is behind the sender.
    lead : float
        A key is late that arrives less than this before the play-out gets to it.

    Returns
    -------
    rows : array of int, shape (k,)
        The packets that are keys, in the order of their sequence numbers, which is that of their stamps.
    events : list of Event
    """
    events: list[Event] = []
    sequences: list[int] = []
    stamps: list[float] = []
    rows: list[int] = []
    apart = SOONEST * packets.interval
    numbers = (packets.sequences.tolist(), packets.stamps.tolist(), arrivals.tolist(), sound.tolist())
    for row, (sequence, stamp, time, good) in enumerate(zip(*numbers, strict=True)):
        place = bisect_left(sequences, sequence)
        later = len(sequences) - place
        if later and sequences[place] == sequence:
            events.append(Event(time, What.DUPLICATE, sequence, 1.0))
            continue
        fits = (not place or stamps[place - 1] + apart < stamp) and (not later or stamp < stamps[place] - apart)
        if not (good and fits):
            events.append(Event(time, What.DAMAGED, sequence, 1.0))
            continue
        if later:
            events.append(Event(time, What.REORDERED, sequence, float(later)))
        moment = time - delay
        too_late = moment - (stamp - lead)
        if later and stamps[place] <= moment:
            events.append(Event(time, What.TOO_LATE, sequence, too_late))
            continue
        if too_late > CLOCK:
            events.append(Event(time, What.LATE, sequence, too_late))
        sequences.insert(place, sequence)
        stamps.insert(place, stamp)
        rows.insert(place, row)
    return np.array(rows), events


def missing(arrived: np.ndarray, keys: np.ndarray, shown: np.ndarray) -> list[Event]:
    """The sequence numbers that never arrived, each run of them at the moment when the key after it is shown.

    Of packets before the first that arrived, and after the last, a receiver never hears.

    Parameters
    ----------
    arrived : array of int, shape (n,)
        The numbers of all packets that arrived, in any order.
    keys : array of int, shape (k,)
        The numbers of the keys, rising.
    shown : array, shape (k,)
        When the play-out gets to them.
    """
    seen = np.unique(arrived)
    gaps = np.flatnonzero(np.diff(seen) > 1)
    after = np.searchsorted(keys, seen[gaps + 1])
    return [
        Event(float(shown[key]), What.LOST, int(seen[gap]) + 1, float(seen[gap + 1] - seen[gap] - 1))
        for gap, key in zip(gaps.tolist(), after.tolist(), strict=True)
        if key < len(shown)
    ]
