"""Admission: which of the packets that arrive become keys, and what there is to say of the others.

A packet whose checksum fits may still lie: its sender has a fault, its clock jumped, or it began again and counts from
0. So a key is believed until `ENOUGH` packets in a row that agree among themselves contradict it. Seconds throughout.
Whatever a packet holds, there is no error: damage is an event like loss.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion.repair import LARGEST

from .events import Event, What
from .packets import HEADER, Packets

CLOCK = 1e-6
"""Seconds that clocks do not tell apart, least of all where they count from 1970."""

SOONEST = 1e-3
"""Of an interval: packets of one stream are further apart than that, or one of them is damaged."""

ENOUGH = 3
"""Packets in a row that agree among themselves are believed, whatever was believed before."""

FAR = 2.0
"""Seconds, besides the wait, by which one packet's journey may be longer than another's. Beyond that, a clock lies."""

NEAR = 0.25
"""The same while no later packet has agreed with the first, whose journey says when everything is shown."""

DEEPEST = 4096
"""Of the packets that came before, so many at the most were sent later: beyond that, a number lies."""

CADENCE = 0.5
"""Of the time between their stamps, packets that are sent as they are made arrive so far apart at least. Those of a
queue that is let go arrive all at once, and say nothing of how long the next will take."""

NUMBERS = 2**32
"""Sequence numbers that there are."""

NOWHERE = -1
"""In place of the place of a packet that contradicts others."""


def is_sound(packets: Packets) -> np.ndarray:
    """Which of n packets are whole, and hold numbers that can be a time and a pose, shape (n,)."""
    poses, lengths = packets.poses, np.abs(packets.poses.quaternions).max(axis=-1, initial=0.0)
    numbers = [np.abs(packets.stamps), np.abs(packets.sent), np.abs(poses.positions).max(axis=-1, initial=0.0), lengths]
    if packets.twists is not None:
        numbers.append(np.abs(packets.twists).max(axis=-1, initial=0.0))
    return packets.are_whole & (np.stack(numbers) < LARGEST).all(axis=0) & (lengths > 1.0 / LARGEST)


@dataclass(frozen=True, eq=False)
class Admitted:
    """The k keys among n packets, in the order in which they were admitted, and e + 1 epochs.

    A new epoch begins where keys are withdrawn or the delay changes. Within one, keys are only added, and the numbers
    and stamps of those that are in it rise together.
    """

    rows: np.ndarray
    """The packets that are keys, int of shape (k,)."""

    entered: np.ndarray
    """The epoch in which each became one, rising, int of shape (k,)."""

    left: np.ndarray
    """The epoch from which on each is withdrawn, e + 1 for never, int of shape (k,)."""

    known_from: np.ndarray
    """When each became one, rising, shape (k,)."""

    begins: np.ndarray
    """Of the epochs besides the first, rising, shape (e,)."""

    delays: np.ndarray
    """By which the play-out is behind the sender, of each epoch, shape (e + 1,)."""


def admit(
    packets: Packets, arrivals: np.ndarray, sound: np.ndarray, wait: float, lead: float, latency: float | None = None
) -> tuple[Admitted, list[Event]]:
    """Choose the keys among n packets.

    A packet becomes a key that fits the keys so far: numbers and stamps rise together, and no packet is ahead of the
    clock that the first of them had. What does not fit is put aside until `ENOUGH` in a row that fit one another have
    come; then these are keys, and those that they contradict are withdrawn. Where they contradict fewer than `ENOUGH`,
    those were liars. Where they contradict as many or all, or have another clock, the sender has begun again: all keys
    so far are withdrawn, and the latency is taken anew.

    So a liar is found out when the stream gets to the number or the moment that it claims, which is no more than `FAR`
    and the wait ahead, or it would not have been believed. Less than that is what links do as well: of a first packet
    the latency stays, if its lie is less than `NEAR`, or less than `FAR` where it makes the delay longer.

    The work for each packet is that of a search among the keys, and of moving `DEEPEST` of them.

    Parameters
    ----------
    packets : Packets, n of them
        In the order of their arrival.
    arrivals : array, shape (n,)
        Rising.
    sound : array of bool, shape (n,)
    wait : float
        Between a packet's arrival and its moment, where it took the latency.
    lead : float
        A key is late that arrives less than this before the play-out gets to it.
    latency : float, optional
        Where it is known, and then it never changes. Else it is that of the first packet, until `ENOUGH` others agree
        on another one.

    Returns
    -------
    Admitted
    events : list of Event
    """
    believer = _Believer(packets, wait, lead, latency)
    # Nobody sends what is yet to come.
    sent = np.where(sound, np.maximum(packets.stamps, packets.sent), 0.0)
    numbers = (packets.sequences, packets.stamps, arrivals - sent, arrivals, sound)
    for row, (sequence, stamp, transit, time, good) in enumerate(
        zip(*(column.tolist() for column in numbers), strict=True)
    ):
        if good:
            believer.take(row, sequence, stamp, transit, time)
        else:
            believer.note(time, What.DAMAGED, sequence, 1.0)
    return believer.admitted(), believer.events + believer.missing()


class _Line:
    """Packets that agree with one another, in the order of their numbers, which is that of their stamps."""

    def __init__(self, apart: float, far: float) -> None:
        self.apart, self.far = apart, far
        self.sequences: list[int] = []
        self.stamps: list[float] = []
        self.rows: list[int] = []
        self.transit = 0.0
        """What the first of them to arrive took, by the two clocks."""
        self.quickest = 0.0
        """What the quickest of them took."""

    def place_of(self, sequence: int, stamp: float, transit: float) -> int:
        """Where a packet belongs among these, or `NOWHERE`.

        One that took much longer contradicts nothing, since queues happen; but where it comes before all others as
        well, it is of another clock.
        """
        sequences, stamps = self.sequences, self.stamps
        if not sequences:
            return 0
        place = bisect_left(sequences, sequence)
        if transit < self.quickest - self.far or (not place and transit > self.transit + self.far):
            return NOWHERE
        if len(sequences) - place > DEEPEST:
            return NOWHERE
        if place and stamps[place - 1] + self.apart >= stamp:
            return NOWHERE
        if place < len(sequences) and (sequences[place] == sequence or stamp >= stamps[place] - self.apart):
            return NOWHERE
        return place

    def insert(self, place: int, row: int, sequence: int, stamp: float, transit: float) -> None:
        """Add a packet at its place."""
        if not self.rows:
            self.transit = self.quickest = transit
        self.quickest = min(self.quickest, transit)
        self.sequences.insert(place, sequence)
        self.stamps.insert(place, stamp)
        self.rows.insert(place, row)

    def row_of(self, sequence: int, stamp: float) -> int:
        """The packet that has this number and stamp, or `NOWHERE`."""
        place = bisect_left(self.sequences, sequence)
        there = place < len(self.rows) and self.sequences[place] == sequence and self.stamps[place] == stamp
        return self.rows[place] if there else NOWHERE

    def before(self, other: _Line) -> int:
        """How many come before all of another line, by number and by stamp."""
        by_stamp = bisect_left(self.stamps, other.stamps[0] - self.apart)
        return min(bisect_left(self.sequences, other.sequences[0]), by_stamp)

    def go_on_with(self, other: _Line, kept: int) -> None:
        """Keep so many, and put another line in the place of the rest."""
        self.sequences[kept:], self.stamps[kept:], self.rows[kept:] = other.sequences, other.stamps, other.rows


class _Believer:
    """What is believed after each packet, and what was."""

    def __init__(self, packets: Packets, wait: float, lead: float, latency: float | None) -> None:
        self.bodies = packets.data[:, HEADER.itemsize :]
        self.apart, self.far = SOONEST * packets.interval, FAR + wait
        self.wait, self.lead, self.latency = wait, lead, latency
        self.believed, self.doubted = self.line(), self.line()
        self.slow: tuple[int, float, float, float] | None = None
        """How many of the newest in a row took much longer, and the stamp, transit and arrival of the first."""
        self.longer = NEAR + wait
        """Than the believed latency, what is much."""
        self.events: list[Event] = []
        self.keys: list[tuple[int, float, int]] = []
        """Row, time and epoch of every admission."""
        self.left: dict[int, int] = {}
        self.begins: list[float] = []
        self.delays: list[float] = [np.inf]
        self.session = 0
        """Rises where the sender begins again. A packet of a session is `session * NUMBERS + sequence`."""
        self.heard: list[int] = []
        self.shown: list[tuple[int, float, float]] = []
        """Of the keys of former sessions the packet, when the play-out would get to it, and the end of the session."""

    def line(self) -> _Line:
        return _Line(self.apart, self.far)

    def note(self, time: float, what: What, sequence: int, amount: float) -> None:
        self.events.append(Event(time, what, sequence, amount))

    def take(self, row: int, sequence: int, stamp: float, transit: float, time: float) -> None:
        """Believe, doubt or drop a packet."""
        place = self.believed.place_of(sequence, stamp, transit)
        if place != NOWHERE:
            # One that comes before all that are doubted says nothing of them; any other speaks against them.
            if self.doubted.rows and self.doubted.place_of(sequence, stamp, transit):
                self.doubted = self.line()
            self.believe(place, row, sequence, stamp, transit, time)
        elif self.is_again(row, sequence, stamp):
            self.note(time, What.DUPLICATE, sequence, 1.0)
        else:
            self.note(time, What.DAMAGED, sequence, 1.0)
            self.doubt(row, sequence, stamp, transit, time)

    def is_again(self, row: int, sequence: int, stamp: float) -> bool:
        """Whether a packet with the same in it is there."""
        others = (line.row_of(sequence, stamp) for line in (self.believed, self.doubted))
        return any(other != NOWHERE and np.array_equal(self.bodies[row], self.bodies[other]) for other in others)

    def believe(self, place: int, row: int, sequence: int, stamp: float, transit: float, time: float) -> None:
        """Admit a packet that contradicts none, if it is of use still."""
        believed = self.believed
        if not believed.rows:
            self.delays[-1] = self.delay_of(transit)
        later = len(believed.rows) - place
        self.heard.append(self.session * NUMBERS + sequence)
        if later:
            self.note(time, What.REORDERED, sequence, float(later))
            if believed.stamps[place] <= time - self.delays[-1]:
                self.note(time, What.TOO_LATE, sequence, self.lateness(stamp, time))
                return
        first = not believed.rows
        believed.insert(place, row, sequence, stamp, transit)
        self.enter(row, sequence, stamp, time)
        if transit - believed.transit > self.longer:
            if not later:
                self.wait_longer(sequence, stamp, transit, time)
        elif not first:
            self.slow, self.longer = None, self.far

    def enter(self, row: int, sequence: int, stamp: float, time: float) -> None:
        """Make a packet a key."""
        self.keys.append((row, time, len(self.begins)))
        if (lateness := self.lateness(stamp, time)) > CLOCK:
            self.note(time, What.LATE, sequence, lateness)

    def lateness(self, stamp: float, time: float) -> float:
        return time - self.delays[-1] - (stamp - self.lead)

    def delay_of(self, transit: float) -> float:
        return (transit if self.latency is None else self.latency) + self.wait

    def begin_epoch(self, time: float, delay: float) -> None:
        self.begins.append(time)
        self.delays.append(delay)

    def wait_longer(self, sequence: int, stamp: float, transit: float, time: float) -> None:
        """Take the latency of the newest packets, where `ENOUGH` in a row took as much longer, at their cadence."""
        if self.slow is None or abs(transit - self.slow[2]) > self.far:
            self.slow = (0, stamp, transit, time)
        count, first_stamp, first_transit, first_time = self.slow
        self.slow = (count + 1, first_stamp, first_transit, first_time)
        if count + 1 < ENOUGH or time - first_time < CADENCE * (stamp - first_stamp):
            return
        self.slow, self.longer = None, self.far
        self.believed.transit = self.believed.quickest = first_transit
        delay, before = self.delay_of(first_transit), self.delays[-1]
        if delay != before:
            self.begin_epoch(time, delay)
            self.note(time, What.DELAYED, sequence, delay - before)

    def doubt(self, row: int, sequence: int, stamp: float, transit: float, time: float) -> None:
        """Put a packet aside, until enough others agree with it."""
        place = self.doubted.place_of(sequence, stamp, transit)
        if place == NOWHERE:
            self.doubted, place = self.line(), 0
        self.doubted.insert(place, row, sequence, stamp, transit)
        if len(self.doubted.rows) == ENOUGH:
            self.believe_the_doubted(time)

    def believe_the_doubted(self, time: float) -> None:
        """Withdraw the keys that they contradict, or all where the sender has begun again, and admit them."""
        doubted, self.doubted, self.slow, self.longer = self.doubted, self.line(), None, self.far
        kept = self.believed.before(doubted)
        another_clock = abs(doubted.transit - self.believed.transit) > self.far
        begun_again = another_clock or not kept or len(self.believed.rows) - kept >= ENOUGH
        kept = 0 if begun_again else kept
        withdrawn, sequence = self.believed.rows[kept:], self.believed.sequences[kept]
        before = self.delays[-1]
        if begun_again:
            self.end_session(time)
            self.believed = doubted
        else:
            self.believed.go_on_with(doubted, kept)
        self.begin_epoch(time, self.delay_of(doubted.transit) if begun_again else before)
        self.left.update(dict.fromkeys(withdrawn, len(self.begins)))
        self.note(time, What.WITHDRAWN, sequence, float(len(withdrawn)))
        if self.delays[-1] != before:
            self.note(time, What.DELAYED, doubted.sequences[0], self.delays[-1] - before)
        for packet in zip(doubted.rows, doubted.sequences, doubted.stamps, strict=True):
            self.heard.append(self.session * NUMBERS + packet[1])
            self.enter(*packet, time)

    def end_session(self, time: float) -> None:
        """Keep what `missing` needs of the keys so far."""
        first, delay = self.session * NUMBERS, self.delays[-1]
        keys = zip(self.believed.sequences, self.believed.stamps, strict=True)
        self.shown += [(first + sequence, stamp + delay, time) for sequence, stamp in keys]
        self.session += 1

    def admitted(self) -> Admitted:
        rows, times, entered = zip(*self.keys, strict=True) if self.keys else ((), (), ())
        left = [self.left.get(row, len(self.delays)) for row in rows]
        whole = (np.array(column, dtype=np.int64) for column in (rows, entered, left))
        return Admitted(*whole, np.array(times), np.array(self.begins), np.array(self.delays))

    def missing(self) -> list[Event]:
        """The sequence numbers that never arrived, each run of them at the moment when the key after it is shown.

        Of packets before the first that arrived, and after the last, a receiver never hears.
        """
        self.end_session(np.inf)
        if not self.shown:
            return []
        keys, shown, ends = (np.array(column) for column in zip(*self.shown, strict=True))
        heard = np.unique(np.array(self.heard, dtype=np.int64))
        gaps = np.flatnonzero((np.diff(heard) > 1) & (np.diff(heard // NUMBERS) == 0))
        after = np.searchsorted(keys, heard[gaps + 1])
        known = after < len(keys)
        gaps, after = gaps[known], after[known]
        got_to = (shown[after] < ends[after]) & (keys[after] // NUMBERS == heard[gaps] // NUMBERS)
        lost = (shown[after], heard[gaps] % NUMBERS + 1, np.diff(heard)[gaps] - 1.0)
        return [
            Event(time, What.LOST, sequence, amount)
            for time, sequence, amount in zip(*(column[got_to].tolist() for column in lost), strict=True)
        ]
