"""A receiver that runs for as long as it likes: datagrams in as they come, and out what is shown at every frame.

It keeps the packets and the frames of the last few seconds, as far back as a fade may reach, and has `receive` work on
those. What it shows is what one `receive` over all of the run would show. Seconds throughout, by the receiver's clock.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import align_signs

from .admission import CLOCK
from .events import What
from .packets import KEY, Packets
from .receiver import LONGEST_FADE, Playback, PlayOut, receive
from .smooth import NO_POSES, joined, reach_of
from .wire import BEAT, Layout, Message, Terms, key_of, pose_bytes, read

MOST_PACKETS = 4096
"""That are remembered: the oldest make room."""

AT_ONCE = 512
"""Frames that are worked out together."""

FASTER = 1.0
"""Seconds by which a packet may have been faster than the first. One that claims more lies."""

REJECTED = {What.DUPLICATE, What.DAMAGED, What.TOO_LATE}
"""What happens to packets that become no keys."""


@dataclass(frozen=True, slots=True)
class _Packet:
    arrival: float
    sent: float
    sequence: int
    stamp: float
    data: bytes
    of_beat: bool
    """Whether a heartbeat brought it: its key may still come by itself, and is then no duplicate."""


class LiveReceiver:
    """The receiver of one stream.

    Parameters
    ----------
    fps : float
        Frames a second: the display shows one at every whole multiple of 1 / fps.
    margin : float
        Seconds by which packets may take longer than the first one took, and still be in time. Those that come sooner
        are held back until then: a sender that sends when it must counts on a key not being known before.
    """

    def __init__(self, fps: float = 72.0, margin: float = 0.0) -> None:
        self.fps, self.margin = fps, margin
        self.terms: Terms | None = None
        """Known from the first heartbeat on; until then nothing can be shown."""
        self.stream: int | None = None
        self.delay = math.inf
        """Seconds by which the play-out is behind the sender, fixed by the first packet that is any good."""
        self.updates = 0
        """Keys that came, each counted once."""
        self.heartbeats = 0
        """Those that brought no key that had not come yet."""
        self.bytes = 0
        """Of all datagrams of the stream."""
        self.pose_bytes = 0
        """Of poses and twists among these."""
        self._layout: Layout | None = None
        self._packets: deque[_Packet] = deque()
        self._held: dict[int, bool] = {}
        """The numbers of the packets that are remembered, and whether a heartbeat brought them."""
        self._frames = np.empty(0)
        """Those that were shown last."""
        self._next = 0
        """The number of the next frame."""
        self._shown: np.ndarray | None = None
        """The last quaternion that was shown, shape (1, 4)."""
        self._told = -math.inf
        """Events up to then have been told."""

    @property
    def remembered(self) -> int:
        """How many packets are kept."""
        return len(self._packets)

    @property
    def reach(self) -> float:
        """Seconds that a frame may go back, by differences that are still fading."""
        return max(LONGEST_FADE, self.terms.fade * self.terms.interval) if self.terms else 0.0

    def accept(self, datagram: bytes, time: float) -> bool:
        """Take a datagram that arrived at a time, and say whether it is one of this stream.

        The first heartbeat decides which stream that is. What arrives at a time that `show` has passed serves from the
        next frame on.
        """
        message = read(datagram)
        if message is None or message.kind not in (KEY, BEAT) or not self._is_ours(message, time):
            return False
        self.bytes += len(datagram)
        self.pose_bytes += pose_bytes(message)
        of_beat, sequence = message.kind == BEAT, message.sequence
        if of_beat and sequence in self._held:
            self.heartbeats += 1
            return True
        if sequence not in self._held:
            self.updates += 1
        elif self._held[sequence]:
            self._held[sequence] = False
            return True
        data = key_of(datagram) if of_beat else datagram
        packet = _Packet(time, message.stamp + message.age, sequence, message.stamp, data, of_beat)
        self._packets.append(self._held_back(packet) if math.isfinite(self.delay) else packet)
        self._held[sequence] = of_beat
        if len(self._packets) > MOST_PACKETS:
            self._remember(list(self._packets)[-MOST_PACKETS * 3 // 4 :])
        return True

    def show(self, until: float) -> Playback:
        """The frames since the last call up to a time, of which the last may be, with the events that are settled.

        Until the first packet is there that is any good, there are none. Events are told when nothing can come that
        would make others of them, and so some seconds later.
        """
        return self._show(until, last=False)

    def finish(self, until: float) -> Playback:
        """The same, with all events: no more frames are to come."""
        return self._show(until, last=True)

    def _is_ours(self, message: Message, time: float) -> bool:
        if self.terms is None and message.kind == BEAT:
            self.terms, self.stream, self._layout = message.terms, message.stream, message.layout
            self._next = math.ceil((time - CLOCK) * self.fps)
        same = message.stream == self.stream and message.layout == self._layout
        return same and message.terms in (None, self.terms)

    def _show(self, until: float, last: bool) -> Playback:
        end = math.floor(until * self.fps + CLOCK) + 1 if self.terms else self._next
        parts = [self._part(first, min(first + AT_ONCE, end)) for first in range(self._next, end, AT_ONCE)]
        if last and self.terms and np.isfinite(self.delay):
            parts.append(self._part(self._next, self._next, last=True))
        return _joined(parts)

    def _part(self, first: int, end: int, last: bool = False) -> Playback:
        """Show the frames from one number to before another."""
        new = np.arange(first, end) / self.fps
        self._next = end
        times = np.concatenate((self._frames, new))
        if not np.isfinite(self.delay) and len(new):
            self._fix_delay(new[-1])
        if not (np.isfinite(self.delay) and len(times)):
            return NOTHING
        playback = self._receive(times, self.terms.play_out(self.delay - self.terms.delay))
        settled = math.inf if last else times[-1] - self.reach
        events = tuple(event for event in playback.events if self._told < event.time <= settled)
        self._told = max(self._told, settled)
        self._forget(playback, times)
        begin = max(len(playback.times) - len(new), 0) if len(new) else len(playback.times)
        quaternions = playback.poses.quaternions[begin:]
        if self._shown is not None:
            quaternions = align_signs(np.concatenate((self._shown, quaternions)))[1:]
        self._shown = quaternions[-1:] if len(quaternions) else self._shown
        poses = Poses(playback.poses.positions[begin:], quaternions)
        return Playback(playback.times[begin:], poses, playback.delays[begin:], playback.ran_out[begin:], events)

    def _receive(self, times: np.ndarray, play_out: PlayOut) -> Playback:
        """What the packets that are remembered make of the frames at these times."""
        rows = np.frombuffer(b"".join(packet.data for packet in self._packets), np.uint8)
        packets = Packets(
            rows.reshape(-1, self._layout.size), self._layout.packing, self.terms.interval, self._layout.twisted
        )
        return receive(packets, [packet.arrival for packet in self._packets], times, self.terms.mode, play_out)

    def _fix_delay(self, now: float) -> None:
        """Count on what the first packet took that is any good, if there is one by now, and on the margin."""
        self.delay = self._receive(np.array([now]), self.terms.play_out(None)).delay + self.margin
        self._packets = deque(map(self._held_back, self._packets))

    def _held_back(self, packet: _Packet) -> _Packet:
        """A packet as if it had taken as long as is counted on, where there is a margin and it took less."""
        supposed = packet.sent + self.delay - self.terms.delay
        if not (self.margin and packet.arrival < supposed < packet.arrival + self.margin + FASTER):
            return packet
        return replace(packet, arrival=supposed)

    def _forget(self, playback: Playback, times: np.ndarray) -> None:
        """Keep the frames that the next ones may go back to, and the packets that have a say in those."""
        begin = max(int(np.searchsorted(times, times[-1] - self.reach)) - 2, 0)
        self._frames = times[begin:]
        oldest = self._frames[0]
        rejected = Counter((event.time, event.sequence) for event in playback.events if event.what in REJECTED)
        kept, passed = [], []
        for place in sorted(range(len(self._packets)), key=lambda place: self._packets[place].arrival)[::-1]:
            packet = self._packets[place]
            name = packet.arrival, packet.sequence
            if rejected[name]:
                rejected[name] -= 1
                if packet.arrival > oldest - self.terms.delay:
                    kept.append(place)
            elif packet.arrival > oldest:
                kept.append(place)
            elif packet.stamp <= oldest - self.delay:
                passed.append(place)
            elif packet.arrival > oldest - self.terms.delay - self.margin - self.reach:
                kept.append(place)  # It is still to be shown. If that takes longer, its stamp lies.
        # Of keys that have been shown, and were known then, those that a segment may look back to.
        few = reach_of(self.terms.mode).before + 2
        kept += sorted(passed, key=lambda place: self._packets[place].stamp)[-few:]
        if len(kept) < len(self._packets):
            self._remember([self._packets[place] for place in sorted(kept)])

    def _remember(self, packets: Iterable[_Packet]) -> None:
        self._packets = deque(packets)
        self._held = {packet.sequence: self._held[packet.sequence] for packet in self._packets}


NOTHING = Playback(np.empty(0), NO_POSES, np.empty(0), np.empty(0, dtype=bool), ())


def _joined(parts: list[Playback]) -> Playback:
    """Frames that follow one another."""
    parts = [NOTHING, *parts]
    times, delays, ran_out = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("times", "delays", "ran_out")
    )
    events = tuple(event for part in parts for event in part.events)
    return Playback(times, joined(part.poses for part in parts), delays, ran_out, events)
