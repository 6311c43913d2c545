"""Receiver of streams: from datagrams to shown poses. Invalid data is ignored.

Streams are told apart by source and by the identity of their senders, and do not affect one another. The memory of each
stream is bounded.
"""

from __future__ import annotations

import secrets
from collections import OrderedDict, deque
from collections.abc import Hashable
from itertools import pairwise
from typing import Any

import numpy as np

from . import wire
from .bodies import Forest
from .coding import Coder
from .messages import Codec, Message
from .osc import is_osc
from .paths import KnotPath
from .playing import CLOCK_AHEAD_S, Playback, ReceivedKeys, Shown, Stream
from .vmc import VMC, Performance
from .wire import NEEDS_DESCRIPTION, NEEDS_REFRESH, TICKS_PER_S, Answer, EncodedMotion, Terms

MOST_STREAMS, MOST_ALL_JOINTS = 64, 4096
"""Most remembered streams, also of streams still without a description; and most joints of all streams together."""

MOST_MESSAGES, MOST_WINDOWS, MOST_WAITING = 40, 8, 4
"""Messages of a stream kept for others to build on, least recently used ones dropped first; windows among which a late
one can be inserted; and messages that wait for the description."""

MOST_GONE = 256
"""Ended streams that are remembered, to recognise replayed data."""


class Receiver:
    """Receives datagrams of any number of streams, and shows each until it has been silent for long.

    VMC from other programs is accepted as well: it has no delay of its own, and is shown `delay` seconds later. With
    `steady`, jitter is removed without additional delay.
    """

    def __init__(self, delay: float = 0.1, steady: bool = False) -> None:
        self.delay, self.steady = delay, steady
        self.own = secrets.token_bytes(3)
        """Identity of this receiver in answers."""
        self._streams: dict[Stream, Any] = {}
        self._gone: deque[Stream] = deque(maxlen=MOST_GONE)
        self._waiting: OrderedDict[Stream, deque[tuple[EncodedMotion, float]]] = OrderedDict()
        """Messages that arrived before the description, with arrival times."""
        self._complained: dict[Hashable, int] = {}
        """Sources with another version of the wire format, and their versions."""
        self._complaints: list[str] = []
        self._unanswered: dict[Stream, None] = {}
        """Streams with new data since the last answers, in order."""

    @property
    def streams(self) -> list[Stream]:
        """The streams that can be shown now or soon."""
        return list(self._streams)

    def take(self, datagram: bytes, arrival: float, source: Hashable = None) -> None:
        """Process a datagram from a source, with its arrival time by the clock of `show`."""
        if is_osc(datagram):
            known = self._streams.get(stream := Stream(source, VMC))
            if not known and len(self._streams) < MOST_STREAMS:
                known = self._streams[stream] = Performance(stream, self.delay, arrival)
            if known:
                known.take(datagram, arrival)
            return
        read = wire.read(datagram)
        if read is None:
            self._add_complaint(wire.other_version(datagram), source)
        if read is None or isinstance(read, Answer):
            return
        known = self._streams.get(stream := Stream(source, read.identity))
        if isinstance(read, EncodedMotion):
            if not known:
                self._waiting.setdefault(stream, deque(maxlen=MOST_WAITING)).append((read, arrival))
                self._waiting.move_to_end(stream)
                if len(self._waiting) > MOST_STREAMS:
                    self._unanswered.pop(self._waiting.popitem(last=False)[0], None)
            if not known or known.take(read, arrival):
                self._unanswered[stream] = None
        elif not known and (described := wire.read_description(read.data)):
            waiting = self._waiting.pop(stream, ())
            if self._has_room_for(stream, described[0], arrival):
                self._streams[stream] = _Coded(stream, *described, arrival)
                for motion, when in waiting:
                    self._streams[stream].take(motion, when)

    def _add_complaint(self, version: int | None, source: Hashable) -> None:
        """Add a complaint, once for each source, that it sends another version of the wire format."""
        if version and source not in self._complained and len(self._complained) < MOST_STREAMS:
            self._complained[source] = version
            own, older = wire.WIRE_VERSION, "this program" if version > wire.WIRE_VERSION else "the sender"
            who = ":".join(map(str, source)) if isinstance(source, tuple) else source
            self._complaints.append(f"{who} sends version {version} of the wire, not {own}: update {older}")

    def complaints(self) -> list[str]:
        """Return lines about senders that cannot be understood, and the remedy, since the last call."""
        complaints, self._complaints = self._complaints, []
        return complaints

    def answers(self) -> list[tuple[Hashable, bytes]]:
        """Return answers for data received since the last call, each with the source to send it to."""
        nothing = 0, 0, NEEDS_DESCRIPTION | NEEDS_REFRESH
        there = {own: self._streams[own].there() if own in self._streams else nothing for own in self._unanswered}
        self._unanswered.clear()
        return [(own.source, wire.write(Answer(own.identity, self.own, *said))) for own, said in there.items()]

    def show(self, now: float) -> dict[Stream, Shown]:
        """Return the shown poses of every stream."""
        self._forget_silent(now)
        shown = {stream: it.show(now, self.steady) for stream, it in self._streams.items()}
        return {stream: what for stream, what in shown.items() if what}

    def leave(self, source: Hashable) -> None:
        """Show nothing of a source after its last message, because it has left."""
        for stream, it in self._streams.items():
            if stream.source == source:
                it.end()

    def keys(self) -> list[ReceivedKeys]:
        """Return the settled keys received since the last call."""
        return [keys for it in self._streams.values() if (keys := it.keys())]

    def _has_room_for(self, stream: Stream, forest: Forest, now: float) -> bool:
        """Forget streams that a new one replaces, and return whether there is room for it."""
        self._forget_silent(now)
        described = {other: it.forest for other, it in self._streams.items() if it.forest}
        same = [other for other, it in described.items() if other.source == stream.source and it.names == forest.names]
        if same and stream in self._gone:
            return False  # A replay of data from before the sender restarted.
        self._forget(same)
        joints = sum(len(it) for other, it in described.items() if other not in same)
        return len(self._streams) < MOST_STREAMS and joints + len(forest) <= MOST_ALL_JOINTS

    def _forget_silent(self, now: float) -> None:
        self._forget([own for own, it in self._streams.items() if not -it.silent < now - it.heard < it.silent])

    def _forget(self, streams: list[Stream]) -> None:
        for stream in streams:
            del self._streams[stream]
        self._gone.extend(streams)


class _Coded(Playback):
    """A stream with a description, in our wire format."""

    def __init__(self, stream: Stream, forest: Forest, terms: Terms, heard: float) -> None:
        super().__init__(stream, terms.delay / TICKS_PER_S, heard, forest)
        self._codec = Codec(forest, terms)
        self._messages: OrderedDict[int, Message] = OrderedDict()
        """Messages by sequence number; messages that others built on recently come last."""
        self._newest, self._needs = -1, NEEDS_REFRESH
        self._end, self._transit = -np.inf, np.inf
        """Seconds: end of the newest message, and its transit time."""
        self.begins = np.inf

    def take(self, motion: EncodedMotion, arrival: float) -> bool:
        """Read a message if possible, and return whether it is new."""
        sequence = motion.sequence
        if sequence in self._messages or self._newest - sequence > MOST_MESSAGES:
            return False
        read = self._codec.code(Coder(motion.data), lambda back: self._messages.get(sequence - back))
        if read is None:
            self._needs = NEEDS_REFRESH
            return True
        self._messages[sequence] = read
        if read.back:
            self._messages.move_to_end(sequence - read.back)
        if len(self._messages) > MOST_MESSAGES:
            self._messages.popitem(last=False)
        lost, end = sequence - self._newest - 1, read.end / TICKS_PER_S
        if (
            lost == 0
            and self._transit - (arrival - end) > CLOCK_AHEAD_S
            and (step := self.playing.set_ahead(end, arrival))
        ):
            self.playing.skip(self._end, step)
        if lost >= 0:
            self._newest, self._needs, self._end, self._transit = sequence, 0, end, arrival - end
            self.heard = max(self.heard, arrival)
        # A message without a base may be the copy, which is sent later.
        if read.back or self.playing.longest is None:
            self.playing.heard(end, arrival)
        self._add_window(read.path, lost)
        return True

    def _add_window(self, window: KnotPath, lost: int) -> None:
        """Add a window to the path; `lost` windows before it are missing, or it is late if `lost` is negative."""
        if self.path is None or (lost >= 0 and window.moments[0] < self.begins):
            # The motion before the first knot is unknown.
            self.begins = float(window.moments[1])
        windows = {number: self._messages[number].path for number in sorted(self._messages)[-MOST_WINDOWS:]}
        path, first = self.path, next(iter(windows.values()))
        path = path.followed(first) if path and path.moments[0] < first.moments[0] else first
        for last, number in pairwise(windows):
            path = path.followed(windows[number], number - last - 1)
        self.put(path)
        self.settled = float(windows[max(windows)].moments[0])
        if self.moment is not None and (lost or window.moments[0] < self.moment):
            self.fading.changed(path.pose(self.moment), path.held_at(self.moment))

    def there(self) -> tuple[int, int, int]:
        """Return the fields of an answer: newest message, received messages before it, and needs."""
        before = sum(1 << back for back in range(32) if self._newest - 1 - back in self._messages)
        return max(self._newest, 0), before, self._needs
