"""The receiver: what is on the screen at every display frame, from the packets that have arrived by then.

The play-out runs behind the sender by a fixed delay, and goes through the poses that arrived as any mode does. The
paper's receiver interpolates from the state it shows to the state that arrives; where updates come at even intervals
the two are one motion, since the state shown is then the update before. Where a packet is missing the motion goes on:
over the gap where a later one is there, and else the way it was going, slower and slower. Where a packet changes the
path that is already being shown, the difference fades, and the picture never jumps; so it does where packets turn out
to have lied, and keys are withdrawn. Seconds throughout; the sender's clock may be another than the receiver's.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import align_signs, normalise

from .admission import CLOCK, ENOUGH, Admitted, admit, is_sound
from .events import Event, What
from .fading import Jumps, fade
from .known_keys import NONE, KnownKeys
from .packets import Packets
from .smooth import NO_POSES, TWISTS, reach_of

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
    """Seconds from a packet being sent to its arrival that are counted on, whatever packets say. None: what the first
    to arrive took, until `admission.ENOUGH` in a row agree on another."""

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

    delays: np.ndarray
    """Seconds by which the play-out is behind the sender at each frame, the latency and the wait, shape (k,)."""

    ran_out: np.ndarray
    """Whether a frame is beyond the newest key, bool of shape (k,)."""

    events: tuple[Event, ...]
    """In the order of their times."""

    @property
    def moments(self) -> np.ndarray:
        """The moments of the sender's motion that belong to the frames, shape (k,)."""
        return self.times - self.delays

    @property
    def delay(self) -> float:
        """The delay at the last frame, which is that at all of them unless packets lied. Infinite: nothing arrived."""
        return float(self.delays[-1]) if len(self.delays) else np.inf

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
        A key of `MODES`: any, for only how far it looks behind and ahead makes a difference here. `TWISTS`
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
    play_out, reach = play_out or PlayOut(), reach_of(mode)
    arrivals, display_times = np.asarray(arrivals, np.float64), np.asarray(display_times, np.float64)
    _check(packets, arrivals, display_times, mode)
    # What arrives after the last frame has no say in any.
    end = display_times.max(initial=-np.inf) + CLOCK
    order = np.argsort(arrivals, kind="stable")
    order = order[arrivals[order] <= end]
    packets, arrivals, sound = packets[order], arrivals[order], is_sound(packets[order])
    lead = reach.lead * packets.interval
    wait = lead if play_out.wait is None else play_out.wait * packets.interval
    late = lead if play_out.lead is None else play_out.lead * packets.interval
    admitted, events = admit(packets, arrivals, sound, wait, late, play_out.latency)
    if not len(admitted.rows):
        nothing = np.empty(0)
        return Playback(nothing, NO_POSES, nothing, nothing > 0.0, tuple(events))

    times = display_times[np.searchsorted(display_times, admitted.known_from[0] - CLOCK) :]
    path = _path(packets, admitted, times, mode, play_out)
    sequences = packets.sequences
    events += [Event(time, What.CAUGHT_UP, int(sequences[row]), distance) for time, row, distance in path.news()]
    events += [
        Event(time, What.RAN_OUT, int(sequences[path.newest[frame]]), long)
        for time, frame, long in _runs(times, path.ran_out)
    ]
    events = sorted((event for event in events if event.time <= end), key=lambda event: event.time)
    poses = fade(times, path.poses, path.jumps)
    return Playback(
        times, Poses(poses.positions, align_signs(poses.quaternions)), path.delays, path.ran_out, tuple(events)
    )


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


@dataclass(frozen=True, eq=False)
class _Path:
    """What the keys that are known make of k frames, jumps and all."""

    poses: Poses
    """Shape (k,)."""

    delays: np.ndarray
    """Shape (k,)."""

    newest: np.ndarray
    """The packet of the last key at or before each frame, where there is one, int of shape (k,)."""

    ran_out: np.ndarray
    """Whether a frame is beyond the newest key, bool of shape (k,)."""

    jumps: Jumps
    """From each frame to the next, where what is known at the next makes another motion at the moment of the one
    before, c of them."""

    after: np.ndarray
    """The times of the frames after the jumps, shape (c,)."""

    aimed_at: np.ndarray
    """The packets of the keys that are aimed at then, int of shape (c,)."""

    def news(self) -> list[tuple[float, int, float]]:
        """Of every jump that is no rounding the time, the packet that is now aimed at, and the distance."""
        distances = np.linalg.norm(self.jumps.offsets, axis=-1)
        news = np.maximum(distances, self.jumps.half_angles) > SETTLED
        return list(zip(*(note[news].tolist() for note in (self.after, self.aimed_at, distances)), strict=True))


def _path(packets: Packets, admitted: Admitted, times: np.ndarray, mode: str, play_out: PlayOut) -> _Path:
    """The path at frames (k,), epoch by epoch."""
    count = len(times)
    positions, quaternions, delays = np.empty((count, 3)), np.empty((count, 4)), np.empty(count)
    newest, ran_out, nearest = np.empty(count, np.int64), np.empty(count, bool), np.empty(count)
    changes: list[tuple[np.ndarray, ...]] = []
    for begin, end, delay, rows, known_from in _epochs(packets, admitted, times, reach_of(mode).behind):
        keys = _known(packets, rows, known_from, mode, play_out.carry)
        now, frames = times[begin:end], slice(begin, end)
        moments = now - delay
        windows = keys.windows(moments, now)
        path = keys.poses_at(moments, windows)
        positions[frames], quaternions[frames], delays[frames] = path.positions, path.quaternions, delay
        last, following = keys.segments(windows)
        newest[frames] = rows[last]
        ran_out[frames] = (following == NONE) & (moments > keys.stamps[last] + CLOCK)
        nearest[frames] = keys.nearest(moments, windows)
        # At the moment of the frame before, which in the epoch's first frame was in another epoch.
        start = max(begin, 1)
        before = times[start - 1 : end - 1] - delay
        known_next = keys.windows(before, times[start:end])
        changed = np.ones(len(before), dtype=bool)
        changed[begin + 1 - start :] = (known_next[begin + 1 - start :] != windows[:-1]).any(axis=1)
        after = np.flatnonzero(changed) + start
        aimed_at = rows[np.max(keys.segments(windows[after - begin]), axis=0)]
        new = keys.poses_at(before[changed], known_next[changed])
        changes.append((after, aimed_at, new.positions, new.quaternions))
    after, aimed_at, *new = (np.concatenate(column) for column in zip(*changes, strict=True))
    poses = Poses(positions, quaternions)
    durations = fade_durations(nearest[after - 1], packets.interval, play_out.fade)
    jumps = Jumps.between(times[after - 1], durations, poses[after - 1], Poses(*new))
    return _Path(poses, delays, newest, ran_out, jumps, times[after], aimed_at)


def _epochs(
    packets: Packets, admitted: Admitted, times: np.ndarray, behind: int
) -> Iterator[tuple[int, int, float, np.ndarray, np.ndarray]]:
    """Of each epoch that has frames, the first of them, the one after the last, the delay, and its keys.

    Those are packets in the order of their stamps, and when each is known. Not those that no frame can come to any
    more: otherwise many epochs of a long stream would take the square of its length.
    """
    spare = behind + 3 + ENOUGH
    epochs = np.searchsorted(admitted.begins - CLOCK, times, side="right")
    # The earliest moment that is asked for from each frame on, by any delay that is yet to come.
    moments = times - admitted.delays[epochs]
    moments[1:] = np.minimum(moments[1:], times[:-1] - admitted.delays[epochs[1:]])
    earliest = np.minimum.accumulate(moments[::-1])[::-1]
    stamps, known_from = packets.stamps[admitted.rows], admitted.known_from - CLOCK
    keys, entered = np.empty(0, dtype=np.int64), 0
    for begin in np.flatnonzero(np.diff(epochs, prepend=-1)).tolist():
        epoch, end = epochs[begin], int(np.searchsorted(epochs, epochs[begin], side="right"))
        until = int(np.searchsorted(admitted.entered, epoch, side="right"))
        keys = np.concatenate((keys, np.arange(entered, until)))
        entered = until
        keys = keys[admitted.left[keys] > epoch]
        keys = keys[np.argsort(stamps[keys], kind="stable")]
        passed = np.flatnonzero((known_from[keys] <= times[begin]) & (stamps[keys] <= earliest[begin]))
        if len(passed) > spare:
            keys = keys[passed[-spare] :]
        yield begin, end, float(admitted.delays[epoch]), admitted.rows[keys], known_from[keys]


def _known(packets: Packets, rows: np.ndarray, known_from: np.ndarray, mode: str, carry: float) -> KnownKeys:
    """The keys of some packets."""
    packets = packets[rows]
    poses = Poses(packets.poses.positions, normalise(packets.poses.quaternions))
    return KnownKeys(packets.stamps, poses, known_from, mode, packets.interval, carry, packets.twists)


def fade_durations(nearest: np.ndarray, interval: float, intervals: float) -> np.ndarray:
    """How long differences fade (c,), of a path that was so far from a key (c,): see `PlayOut.fade`."""
    return np.minimum(intervals * np.maximum(nearest, interval), max(LONGEST_FADE, intervals * interval))


def _runs(times: np.ndarray, flags: np.ndarray) -> list[tuple[float, int, float]]:
    """Of every run of frames (k,) that are flagged the time, its first frame, and how long until the next without."""
    begin, end = np.flatnonzero(np.diff(flags, prepend=False, append=False)).reshape(-1, 2).T
    until = times[np.minimum(end, len(times) - 1)]
    return list(zip(times[begin].tolist(), begin.tolist(), (until - times[begin]).tolist(), strict=True))
