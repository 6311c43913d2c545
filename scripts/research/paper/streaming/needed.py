"""A sender that sends when it must: it knows every pose, and what each receiver shows of those it was sent.

The play-out is behind the sender by a delay. When it gets to a sample that would be shown further off than the
tolerance, everything up to the delay later is known here already: of the keys that could be sent now, the one that
carries furthest is. Until then nothing is sent, for the motion goes on at the receiver as it was going, and a hand at
rest costs nothing at all. Seconds, and the unit of the positions, throughout.

Source of the idea: dead reckoning, as in IEEE 1278.1 (Distributed Interactive Simulation); here with a look ahead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.quaternions import align_signs, normalise

from .fading import Jumps, fade
from .known_keys import NONE, KnownKeys
from .packets import Packets
from .packing import PACKINGS, Packing
from .receiver import PlayOut, fade_durations
from .smooth import LEAST, NO_POSES, TWISTS, fitted, joined, reach_of

INTERVALS = 2.0
"""Into so many intervals the delay is divided: by them the receiver counts how long differences fade."""

FADE = 0.5
"""Intervals in which a difference fades. It is never larger than the tolerance unless the body itself jumps, so there
is no need to be slow about it."""

AROUND = 0.25
"""A key is fitted to the samples within this part of the delay, its twist as well: see `smooth.fitted`."""

FIRST = 12
"""So many samples are tried first; then those between the furthest that will do and the next of them."""

LOOKED_AT = 64
"""Samples that are looked at together for the first that is off."""

SAME = 1e-9
"""Of a delay: clocks do not tell it apart."""


@dataclass(frozen=True, eq=False)
class Key:
    """A key to be sent."""

    stamp: float
    """The moment that it belongs to."""

    pose: Poses
    """Shape (1,)."""

    twist: np.ndarray | None
    """Shape (6,), where the mode is `TWISTS`."""

    sent: float
    """When it is sent."""


@dataclass(frozen=True, eq=False)
class _Choice:
    """A key that may be sent next."""

    sample: int
    """Whose moment it has."""

    pose: Poses
    """Shape (1,)."""

    twist: np.ndarray | None
    """Shape (1, 6)."""

    jump: Jumps
    """What fades at the receiver when it gets there: one."""


class NeededSender:
    """Samples in, and out come the keys that are needed, each as soon as it is.

    Parameters
    ----------
    tolerance : float
        How far off what is shown may be, as a shell error: the largest displacement of any point within `radius`.
    delay : float
        By which the play-out is behind, besides what the link takes.
    mode : str
        `TWISTS`, or one of `rigid_motion.motion.MODES` that takes no key after the segment.
    radius : float
    packing : Packing
        What the keys lose in it is reckoned with.

    Raises
    ------
    ValueError
        For a mode that looks ahead, and for numbers that are not positive.

    Notes
    -----
    Where nothing is lost or late, no sample is shown further off than the tolerance, as long as the body itself goes
    no further than that from one sample to the next. Frames of a display lie between the samples.
    """

    def __init__(
        self,
        tolerance: float,
        delay: float,
        mode: str = TWISTS,
        radius: float = 0.1,
        packing: Packing = PACKINGS["double"],
    ) -> None:
        for name, value in (("tolerance", tolerance), ("delay", delay), ("radius", radius)):
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"a {name} of {value} is not a positive number")
        if reach_of(mode).ahead:
            raise ValueError(
                f"{mode} takes a key after the segment, for which a sender that sends when it must does not wait; "
                f"give {TWISTS}, or a mode that looks at no later key"
            )
        self.interval = delay / INTERVALS
        """The interval that sender and receiver agree on."""
        self.play_out = PlayOut(wait=INTERVALS, fade=FADE, lead=0.0)
        """How the receiver deals with time."""
        self.next = np.inf
        """When the next key is due by all samples so far; infinite where none is needed yet."""
        self._tolerance, self._delay, self._mode, self._radius = tolerance, delay, mode, radius
        self._packing = packing
        self._times = np.empty(0)
        self._poses = NO_POSES
        self._shown = 0
        """So many of the samples are known to be shown within the tolerance."""
        self._known: KnownKeys | None = None
        """The newest keys that were sent, as many as have a say."""
        self._jumps = Jumps.between(np.empty(0), np.empty(0), self._poses, self._poses)
        """Differences that are fading at the receiver."""

    def push(self, times: np.ndarray, poses: Poses, now: float | None = None) -> list[Key]:
        """Take samples, and say which keys are to be sent by now.

        Parameters
        ----------
        times : array, shape (n,)
            Rising, from call to call as well. All of a recording come to the same keys as its samples one by one.
        poses : Poses, shape (n,)
        now : float, optional
            No sample before this moment is to come. The time of the last unless given.

        Raises
        ------
        ValueError
            For times that do not rise, and poses that the packing cannot say.
        """
        times = np.asarray(times, dtype=np.float64)
        whole = np.concatenate((self._times, times))
        if not np.isfinite(times).all() or np.any(np.diff(whole) <= 0.0):
            raise ValueError("the times of a stream need to be finite, and each later than the one before")
        self._packing.pack(poses)
        every = joined((self._poses, Poses(poses.positions, normalise(poses.quaternions))))
        self._times, self._poses = whole, Poses(every.positions, align_signs(every.quaternions))
        return self._due(float(whole[-1]) if now is None and len(whole) else now)

    def finish(self) -> list[Key]:
        """The keys that the samples so far need if no more are to come."""
        return self._due(np.inf)

    def _due(self, now: float | None) -> list[Key]:
        due, self.next = [], np.inf
        if self._known is None and len(self._times):
            pose, still = self._as_read(self._poses[:1], np.zeros((1, 6)))
            due.append(self._send(float(self._times[0]), pose, still, float(self._times[0])))
            self._shown = 1
        while self._shown < len(self._times) and not self._goes_on():
            here = self._shown - 1
            when = max(self._times[here] + self._delay, self._times[here + 1])
            if when > now:
                self.next = float(when)
                break
            due.append(self._needed(here, float(when)))
        self._forget()
        return due

    def _goes_on(self) -> bool:
        """Count the samples that are shown well without another key, and say whether those are all."""
        while self._shown < len(self._times):
            rows = np.arange(self._shown, min(self._shown + LOOKED_AT, len(self._times)))
            path = self._known.poses_at(self._times[rows], self._windows(len(rows)))
            off = self._errors(fade(self._times[rows], path, self._jumps), rows) > self._tolerance
            self._shown = int(rows[np.argmax(off)]) if off.any() else int(rows[-1]) + 1
            if off.any():
                return False
        return True

    def _needed(self, here: int, now: float) -> Key:
        """Send the key that carries furthest, now that the play-out is at a sample after which it is off."""
        last = int(np.searchsorted(self._times, now + SAME * self._delay, side="right")) - 1
        # The last sample that is shown without it, and the first that it may be at.
        before = max(here - 1, int(np.searchsorted(self._times, self._known.stamps[-1])), 0)
        first = here if before < here else here + 1
        apart = max((last - first) // FIRST, 1)
        few = np.arange(last, first - 1, -apart)[::-1]
        best = self._furthest(before, few, last)
        nearer, further = (best.sample + 1, best.sample + apart) if best else (first, int(few[0]))
        best = self._furthest(before, np.arange(nearer, min(further, last + 1)), last) or best
        # Where the body itself jumps none will do, and the nearest have to be as good as they are.
        best = best or self._furthest(before, np.arange(first, here + 2), last, at_any_rate=True)
        self._jumps = self._still_fading(before).then(best.jump)
        self._shown = best.sample + 1
        return self._send(float(self._times[best.sample]), best.pose, best.twist, now)

    def _furthest(self, before: int, choices: np.ndarray, last: int, at_any_rate: bool = False) -> _Choice | None:
        """Of samples (c,) that could be the next key, the last with which all after `before` are shown well enough.

        Where there is none, at any rate the one with which they are shown best.
        """
        if not len(choices):
            return None
        poses, twists = self._as_read(*fitted(self._times, self._poses, choices, last, AROUND * self._delay))
        # Of every choice the samples up to it, and the one before as what is shown goes on from there.
        counts = choices - before + 1
        choice = np.repeat(np.arange(len(choices)), counts)
        begins = np.cumsum(counts) - counts
        rows = before + np.arange(len(choice)) - begins[choice]
        path = self._with(self._times[choices], poses, twists).poses_at(
            self._times[rows], self._windows(len(rows), len(self._known.stamps) + choice)
        )
        jumps = self._jumps_to(before, path[begins])
        shown = _faded_each(self._times[rows], path, choice, jumps, self._still_fading(before))
        off = np.where(rows == before, 0.0, self._errors(shown, rows))
        worst = np.maximum.reduceat(off, begins)
        good = np.flatnonzero(worst <= self._tolerance)
        if not (len(good) or at_any_rate):
            return None
        best = [int(good[-1] if len(good) else np.argmin(worst))]
        return _Choice(int(choices[best[0]]), poses[best], None if twists is None else twists[best], jumps[best])

    def _send(self, stamp: float, pose: Poses, twist: np.ndarray | None, sent: float) -> Key:
        """Count a key among those that the receivers know."""
        known = self._with(np.array([stamp]), pose, twist)
        newest = slice(-reach_of(self._mode).before - 1, None)
        twists = None if known.twists is None else known.twists[newest]
        self._known = replace(known, stamps=known.stamps[newest], poses=known.poses[newest], twists=twists)
        return Key(stamp, pose, None if twist is None else twist[0], sent)

    def _with(self, stamps: np.ndarray, poses: Poses, twists: np.ndarray | None) -> KnownKeys:
        """The keys that were sent, and others after them, of which each may be the next: c of them."""
        known = self._known
        if known is not None:
            stamps = np.concatenate((known.stamps, stamps))
            poses = joined((known.poses, poses))
            twists = None if twists is None else np.concatenate((known.twists, twists))
        return KnownKeys(stamps, poses, np.zeros(len(stamps)), self._mode, self.interval, self.play_out.carry, twists)

    def _windows(self, count: int, following: np.ndarray | int = NONE) -> np.ndarray:
        """The windows of moments after the last key that was sent, with the key that follows (count,) or none."""
        reach, sent = reach_of(self._mode), len(self._known.stamps)
        behind = reach.before
        windows = np.full((count, behind + 2), NONE)
        windows[:, behind], windows[:, behind + 1] = sent - 1, following
        # Beyond the last key the one before says where the motion was going.
        wanted = min(reach.behind if following is not NONE else 1, sent - 1)
        for back in range(1, wanted + 1):
            windows[:, behind - back] = sent - 1 - back
        return windows

    def _jumps_to(self, here: int, new: Poses) -> Jumps:
        """What happens at a sample where the path that was known gives way to others (c,)."""
        time = self._times[[here]]
        old = self._known.poses_at(time, self._windows(1))[np.zeros(len(new), dtype=int)]
        duration = fade_durations(time - self._known.stamps[-1], self.interval, self.play_out.fade)
        return Jumps.between(np.repeat(time, len(new)), np.repeat(duration, len(new)), old, new)

    def _still_fading(self, here: int) -> Jumps:
        return self._jumps[self._jumps.times + self._jumps.durations > self._times[here]]

    def _as_read(self, poses: Poses, twists: np.ndarray) -> tuple[Poses, np.ndarray | None]:
        """Keys (c,) and their twists (c, 6) as the receiver reads them; twists where the mode has a use for them."""
        read = self._packing.unpack(self._packing.pack(poses))
        read = Poses(read.positions, normalise(read.quaternions))
        return read, self._packing.unpack_twists(self._packing.pack_twists(twists)) if self._mode == TWISTS else None

    def _errors(self, shown: Poses, rows: np.ndarray) -> np.ndarray:
        return shell_error(shown, self._poses[rows], self._radius)

    def _forget(self) -> None:
        """Let samples go that nothing depends on any more."""
        if self._shown:
            oldest = self._times[self._shown - 1] - AROUND * self._delay
            past = min(int(np.searchsorted(self._times, oldest)), self._shown - LEAST)
            if past > LOOKED_AT:
                self._times, self._poses, self._shown = self._times[past:], self._poses[past:], self._shown - past
                self._jumps = self._still_fading(self._shown - 1)


def send_when_needed(
    times: np.ndarray,
    poses: Poses,
    tolerance: float,
    delay: float,
    mode: str = TWISTS,
    radius: float = 0.1,
    packing: Packing = PACKINGS["double"],
) -> tuple[Packets, PlayOut]:
    """The packets of a whole recording, and how a receiver is to play them out; see `NeededSender`.

    Parameters
    ----------
    times : array, shape (n,)
    poses : Poses, shape (n,)
    tolerance, delay, mode, radius, packing
        As `NeededSender` takes them.

    Raises
    ------
    ValueError
        As `NeededSender` does.
    """
    sender = NeededSender(tolerance, delay, mode, radius, packing)
    keys = [*sender.push(times, poses), *sender.finish()]
    stamps, sent = np.array([key.stamp for key in keys]), np.array([key.sent for key in keys])
    packed = joined((NO_POSES, *(key.pose for key in keys)))
    twists = np.array([key.twist for key in keys]).reshape(-1, 6) if mode == TWISTS else None
    return Packets.of(stamps, packed, sender.interval, packing, twists=twists, ages=sent - stamps), sender.play_out


def _faded_each(times: np.ndarray, path: Poses, choice: np.ndarray, jumps: Jumps, earlier: Jumps) -> Poses:
    """Paths that jump at their beginnings, each in its own way, without their jumps and those before.

    Parameters
    ----------
    times : array, shape (n,)
    path : Poses, shape (n,)
    choice : array of int, shape (n,)
        Which of the c paths each is of, rising.
    jumps : Jumps, c of them
    earlier : Jumps
        Those that are still fading, whichever path it is.
    """
    every = earlier.then(jumps)
    begin, count, before = every.times[0], len(jumps.times), len(earlier.times)
    # One after the other, so far apart that nothing of one is left when the next begins.
    apart = 2.0 * (float(times.max()) - begin + float(every.durations.max()))
    order = np.concatenate((np.tile(np.arange(before), (count, 1)), before + np.arange(count)[:, None]), axis=1).ravel()
    line = every[order]
    line = replace(line, times=line.times - begin + apart * np.repeat(np.arange(count), before + 1))
    return fade(times - begin + apart * choice, path, line)
