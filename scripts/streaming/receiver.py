"""The receiver: what is on the screen at every display frame, from the packets that have arrived by then.

The play-out runs behind the sender by a fixed delay, and goes through the poses that arrived as any mode does. The
paper's receiver interpolates from the state it shows to the state that arrives; where updates come at even intervals
the two are one motion, since the state shown is then the update before. Where a packet is missing the motion goes on:
over the gap where a later one is there, and else the way it was going, slower and slower. Where a packet changes the
path that is already being shown, the difference fades, and the picture never jumps. Seconds throughout; the sender's
clock may be another than the receiver's.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from addon.motion import Poses
from addon.motion.quaternions import align_signs, normalise

from .admission import CLOCK, admit, is_sound, missing
from .events import Event, What
from .fading import Jumps, fade
from .known_keys import NONE, KnownKeys
from .packets import Packets
from .smooth import TWISTS, reach_of

LONGEST_FADE = 2.0
"""Seconds that a difference fades at the most: after a long silence the picture is not to lag behind for as long again.
Where packets are rare, `PlayOut.fade` of their intervals may be more."""

SETTLED = 1e-9
"""A difference, in radians and in the unit of the positions, that is rounding and no news."""


@dataclass(frozen=True)
class PlayOut:
    """How a receiver deals with time.

    Raises
    ------
    ValueError
        For numbers that are negative or not finite, and a fade of 0.

    Notes
    -----
    How long to carry on and to fade was found on ten recordings of hands, heads, cameras and feet, at 5, 10 and 20
    packets a second over links that lose 2 to 20 % of them and have 10 to 100 ms of jitter. To carry on for 0.3 s is
    best, or within 1.5 % of it, at every rate; to stop dead has 1.2 to 1.8 times its RMS shell error. A shorter fade is
    nearer to the truth and less even in its speed.
    """

    wait: float | None = None
    """Update intervals from a packet's arrival to its pose being shown. None: 1, and 1 more for each key that the mode
    looks ahead: as little as will do where nothing is ever late."""

    latency: float | None = None
    """Seconds from a packet being sent to its arrival that are counted on. None: what the first to arrive took."""

    carry: float = 0.3
    """Seconds within which a motion dies down that gets no more packets: how long a hand goes on as it goes, whatever
    the rate of the stream. 0 stops it dead."""

    fade: float = 3.0
    """Update intervals, at least, in which a difference fades. Where the path has been further than one interval from
    a key that was known, so many times as long, but not more than `LONGEST_FADE`."""

    lead: float | None = None
    """Update intervals before the play-out gets to a packet: what arrives later than this is late. None: 1, and 1 more
    for each key that the mode looks ahead. 0 where packets come when they are needed, and not at even intervals."""

    def __post_init__(self) -> None:
        for name in ("wait", "carry", "fade", "lead"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"play-out with a {name} of {value}: give a number from 0 on")
        if self.fade == 0.0:
            raise ValueError("play-out with a fade of 0 would jump: give a number above 0")
        if self.latency is not None and not np.isfinite(self.latency):
            raise ValueError(f"play-out with a latency of {self.latency}: give a number of seconds")


@dataclass(frozen=True, eq=False)
class Playback:
    """What a receiver showed: k of the m display frames, from the first on at which there was something to show."""

    times: np.ndarray
    """Of those frames, shape (k,)."""

    poses: Poses
    """Shape (k,), signs aligned. Until the play-out gets to the first pose that arrived, that pose, at rest."""

    delay: float
    """Seconds by which the play-out is behind the sender: the latency and the wait. Infinite where nothing arrived."""

    ran_out: np.ndarray
    """Whether a frame is beyond the newest key, bool of shape (k,)."""

    events: tuple[Event, ...]
    """In the order of their times."""

    @property
    def moments(self) -> np.ndarray:
        """The moments of the sender's motion that belong to the frames, shape (k,)."""
        return self.times - self.delay

    @property
    def counts(self) -> dict[What, int]:
        """How many packets were late, lost and so on, and how often the play-out ran out and caught up."""
        counted = Counter(dict.fromkeys(What, 0))
        for event in self.events:
            counted[event.what] += int(event.amount) if event.what is What.LOST else 1
        return dict(counted)


def receive(
    packets: Packets,
    arrivals: ArrayLike,
    display_times: ArrayLike,
    mode: str = "dq_sclerp",
    play_out: PlayOut | None = None,
) -> Playback:
    """What is shown at every display frame, each from the packets that have arrived by then and from no others.

    Parameters
    ----------
    packets : Packets, n of them
        In any order, and with some of them twice, if that is how it was.
    arrivals : array-like, shape (n,)
        When each arrives, infinite for never.
    display_times : array-like, shape (m,)
        Of the frames, not falling.
    mode : str
        A key of `addon.motion.MODES`: any, for only how far it looks behind and ahead makes a difference here. `TWISTS`
        where the packets have twists.
    play_out : PlayOut

    Returns
    -------
    Playback
        Where nothing is lost or late, its poses are those of `interpolate(stamps, poses, playback.moments, mode)`, up
        to the last packet's.

    Raises
    ------
    ValueError
        For an unknown mode, shapes that do not fit, and times that are no numbers or fall.
    """
    play_out, ahead = play_out or PlayOut(), reach_of(mode).ahead
    arrivals, display_times = np.asarray(arrivals, np.float64), np.asarray(display_times, np.float64)
    _check(packets, arrivals, display_times, mode)
    # What arrives after the last frame has no say in any.
    end = display_times.max(initial=-np.inf) + CLOCK
    order = np.argsort(arrivals, kind="stable")
    order = order[arrivals[order] <= end]
    packets, arrivals, sound = packets[order], arrivals[order], is_sound(packets[order])
    lead = (1.0 + ahead) * packets.interval
    delay = _delay(packets, arrivals, sound, lead, play_out)
    late = lead if play_out.lead is None else play_out.lead * packets.interval
    rows, events = admit(packets, arrivals, sound, delay, late)
    if not len(rows):
        empty = Poses(np.empty((0, 3)), np.empty((0, 4)))
        return Playback(display_times[:0], empty, delay, np.empty(0, dtype=bool), tuple(events))

    keys = KnownKeys(
        packets.stamps[rows],
        Poses(packets.poses.positions[rows], normalise(packets.poses.quaternions[rows])),
        arrivals[rows] - CLOCK,
        mode,
        packets.interval,
        play_out.carry,
        packets.twists[rows] if packets.twisted else None,
    )
    times = display_times[np.searchsorted(display_times, keys.known_from.min()) :]
    moments = times - delay
    windows = keys.windows(moments, times)
    poses, caught_up = _without_jumps(keys, times, moments, windows, play_out.fade)
    last, following = keys.segments(windows)
    ran_out = (following == NONE) & (moments > keys.stamps[last] + CLOCK)

    sequences = packets.sequences[rows]
    events += missing(packets.sequences, sequences, keys.stamps + delay)
    events += [Event(time, What.CAUGHT_UP, int(sequences[key]), distance) for time, key, distance in caught_up]
    events += [
        Event(time, What.RAN_OUT, int(sequences[last[frame]]), long) for time, frame, long in _runs(times, ran_out)
    ]
    events = sorted((event for event in events if event.time <= end), key=lambda event: event.time)
    return Playback(times, Poses(poses.positions, align_signs(poses.quaternions)), delay, ran_out, tuple(events))


def _check(packets: Packets, arrivals: np.ndarray, display_times: np.ndarray, mode: str) -> None:
    """Raise a ValueError that says what is wrong with what `receive` was given."""
    if packets.twisted != (mode == TWISTS):
        has = "have" if packets.twisted else "have no"
        raise ValueError(f"these packets {has} twists, for which {mode} is not meant; {TWISTS} is what twists take")
    if arrivals.shape != (len(packets),):
        raise ValueError(f"arrivals of shape {arrivals.shape} do not fit {len(packets)} packets")
    if not (arrivals > -np.inf).all():
        raise ValueError(f"packet {np.flatnonzero(~(arrivals > -np.inf))[0]} has no moment of arrival")
    if display_times.ndim != 1 or not np.isfinite(display_times).all() or np.any(np.diff(display_times) < 0.0):
        raise ValueError("the times of display frames need to be a row of finite numbers that do not fall")


def _delay(packets: Packets, arrivals: np.ndarray, sound: np.ndarray, lead: float, play_out: PlayOut) -> float:
    """Seconds by which the play-out is behind the sender; infinite where no packet is any good."""
    if not sound.any():
        return np.inf
    first = np.argmax(sound)
    latency = float(arrivals[first] - packets.sent[first]) if play_out.latency is None else play_out.latency
    return latency + (lead if play_out.wait is None else play_out.wait * packets.interval)


def _without_jumps(
    keys: KnownKeys, times: np.ndarray, moments: np.ndarray, windows: np.ndarray, intervals: float
) -> tuple[Poses, list[tuple[float, int, float]]]:
    """The poses at k frames, and of every jump that was avoided the time, the key that is now aimed at, the distance.

    A jump is where what is known at a frame makes another motion at the moment of the frame before than what was known
    then.
    """
    path = keys.poses_at(moments, windows)
    known_next = keys.windows(moments[:-1], times[1:])
    before = np.flatnonzero((known_next != windows[:-1]).any(axis=1))
    old, new = path[before], keys.poses_at(moments[before], known_next[before])
    durations = fade_durations(keys.nearest(moments[before], windows[before]), keys.interval, intervals)
    jumps = Jumps.between(times[before], durations, old, new)
    distances = np.linalg.norm(jumps.offsets, axis=-1)
    news = np.maximum(distances, jumps.half_angles) > SETTLED
    notes = (times[before + 1], np.max(keys.segments(windows[before + 1]), axis=0), distances)
    return fade(times, path, jumps), list(zip(*(note[news].tolist() for note in notes), strict=True))


def fade_durations(nearest: np.ndarray, interval: float, intervals: float) -> np.ndarray:
    """How long differences fade (c,), of a path that was so far from a key (c,): see `PlayOut.fade`."""
    return np.minimum(intervals * np.maximum(nearest, interval), max(LONGEST_FADE, intervals * interval))


def _runs(times: np.ndarray, flags: np.ndarray) -> list[tuple[float, int, float]]:
    """Of every run of frames (k,) that are flagged the time, its first frame, and how long until the next without."""
    begin, end = np.flatnonzero(np.diff(flags, prepend=False, append=False)).reshape(-1, 2).T
    until = times[np.minimum(end, len(times) - 1)]
    return list(zip(times[begin].tolist(), begin.tolist(), (until - times[begin]).tolist(), strict=True))
