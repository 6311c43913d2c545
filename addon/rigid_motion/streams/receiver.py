"""From datagrams to what is shown. Whatever comes, from whomever: it is a message of a stream, or it changes nothing.

Streams are told apart by where they come from and by their senders' identities, and know nothing of one another. What
is remembered of each is bounded.
"""

from __future__ import annotations

import secrets
from collections import OrderedDict, deque
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..motion import Poses
from . import wire
from .bodies import Body, Forest
from .messages import Codec, State
from .paths import Path, transposed
from .playing import Fading, Playing
from .wire import DESCRIPTION, HEAD, LATE, MOST_ENTRIES, MOTION, NEXT, TICKS, Entry, Motion, Piece, Terms

MOST_STREAMS, MOST_ALL_JOINTS = 64, 4096
"""That are remembered, the streams without descriptions for a new one as well; and joints of all streams together."""

MOST_STATES = 40
"""Messages of a stream that others may build on."""

MOST_GONE = 256
"""Streams that are gone, and known again where somebody replays them."""

MOST_KNOTS, MOST_JOINT_KNOTS = 256, 1 << 14
"""Knots of a stream that wait for `keys`, or as many more as a body of few joints has in so many poses of joints."""

MOST_WINDOWS, MOST_WAITING = 8, 4
"""Windows of a stream that one that came late can be put among; and messages that wait for its description."""

SILENT, MOST_SILENCE = 10.0, 7.0
"""Seconds of silence after which a stream is forgotten, and in which its ticks still go on for sure."""


class Stream(NamedTuple):
    """What tells streams apart."""

    source: Hashable
    identity: bytes


@dataclass(frozen=True, eq=False)
class Shown:
    """What a stream shows."""

    moment: float
    """Seconds, by the sender's clock."""

    poses: dict[str, Poses]
    """Of each body, shape (joints,), each joint in its parent's space."""


@dataclass(frozen=True, eq=False)
class Keys:
    """What was sent, to be recorded."""

    stream: Stream

    moments: np.ndarray
    """Seconds by the sender's clock, rising, shape (k,)."""

    poses: dict[str, Poses]
    """Of each body, shape (k, joints)."""


class Streams:
    """Streams that are shown until they were silent for so many seconds: each shows itself, and has bodies and keys."""

    def __init__(self, silent: float) -> None:
        self._silent = silent
        self._streams: dict[Stream, Any] = {}

    def show(self, now: float) -> dict[Stream, Shown]:
        """Return what every stream shows."""
        self._forget_silent(now)
        shown = {stream: playback.show(now) for stream, playback in self._streams.items()}
        return {stream: what for stream, what in shown.items() if what is not None}

    @property
    def streams(self) -> list[Stream]:
        """Those that can be shown, or soon can."""
        return list(self._streams)

    def bodies(self, stream: Stream) -> tuple[Body, ...]:
        """All bodies of a stream, with their names, parents and rest poses."""
        return self._streams[stream].bodies if stream in self._streams else ()

    def keys(self) -> list[Keys]:
        """Return what came since the last call and is not going to change any more."""
        result = [Keys(stream, *playback.keys()) for stream, playback in self._streams.items()]
        return [keys for keys in result if len(keys.moments)]

    def _forget_silent(self, now: float) -> None:
        silent = [stream for stream, it in self._streams.items() if not -self._silent < now - it.heard < self._silent]
        self._forget(silent)

    def _forget(self, streams: Sequence[Stream]) -> None:
        for stream in streams:
            del self._streams[stream]


class Receiver(Streams):
    """Takes datagrams of any number of streams, and shows them."""

    def __init__(self) -> None:
        super().__init__(SILENT)
        self.own = secrets.token_bytes(3)
        """Who answers."""
        self._begun: OrderedDict[Stream, _Begun] = OrderedDict()
        """Streams whose description is not complete."""
        self._gone: deque[Stream] = deque(maxlen=MOST_GONE)

    def take(self, datagram: bytes, arrival: float, source: Hashable = None) -> None:
        """Take a datagram that came at a time, by the clock of `show`, from somewhere."""
        kind, stream = wire.kind_of(datagram), Stream(source, datagram[1 : HEAD.size])
        if kind not in (DESCRIPTION, MOTION, LATE, NEXT):
            return
        read = wire.read_piece(datagram) if kind == DESCRIPTION else wire.read_motion(datagram)
        if isinstance(read, Motion) and stream in self._streams:
            self._streams[stream].take(read, arrival)
        elif read is not None and stream not in self._streams:
            self._begin(stream, read, arrival)

    def due(self, moment: float) -> float:
        """When the first stream shows a moment of its sender's time, by our clock; never, where nothing came yet."""
        return min((playback.playing.due(moment) for playback in self._streams.values()), default=np.inf)

    def answers(self) -> list[tuple[Hashable, bytes]]:
        """Return what came since the last call, to be sent to where it came from."""
        entries: dict[Hashable, list[Entry]] = {}
        streams: list[tuple[Stream, _Playback | _Begun]] = [*self._streams.items(), *self._begun.items()]
        for stream, known in streams:
            if known.unanswered:
                known.unanswered = False
                entries.setdefault(stream.source, []).append(known.entry(stream.identity))
        return [
            (source, wire.answer(self.own, few[first : first + MOST_ENTRIES]))
            for source, few in entries.items()
            for first in range(0, len(few), MOST_ENTRIES)
        ]

    def _begin(self, stream: Stream, read: Motion | Piece, arrival: float) -> None:
        """Collect what a stream needs before it can be shown."""
        begun = self._begun.setdefault(stream, _Begun())
        self._begun.move_to_end(stream)
        if len(self._begun) > MOST_STREAMS:
            self._begun.popitem(last=False)
        if isinstance(read, Motion):
            begun.unanswered = True
            begun.motions.append((read, arrival))
            return
        if len(begun.pieces) != read.pieces:
            begun.pieces = [b""] * read.pieces
        begun.pieces[read.number] = read.data
        if not all(begun.pieces):
            return
        del self._begun[stream]
        described = wire.read_description(b"".join(begun.pieces))
        if described and self._has_room_for(stream, described[0], arrival):
            playback = self._streams[stream] = _Playback(*described, read.ticks, arrival)
            for motion, when in begun.motions:
                playback.take(motion, when)

    def _has_room_for(self, stream: Stream, forest: Forest, now: float) -> bool:
        """Forget a stream that this one is instead of, and say whether there is room for it."""
        self._forget_silent(now)
        names = {body.name for body in forest.bodies}
        same = [
            other
            for other, it in self._streams.items()
            if other.source == stream.source and {body.name for body in it.forest.bodies} == names
        ]
        if same and stream in self._gone:
            return False  # Somebody replays what was sent before the sender began again.
        self._forget(same)
        joints = sum(len(playback.forest) for playback in self._streams.values())
        return len(self._streams) < MOST_STREAMS and joints + len(forest) <= MOST_ALL_JOINTS

    def _forget(self, streams: Sequence[Stream]) -> None:
        super()._forget(streams)
        self._gone.extend(streams)


class _Begun:
    """A stream without its description."""

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        """Of the description, empty where they are missing."""
        self.motions: deque[tuple[Motion, float]] = deque(maxlen=MOST_WAITING)
        self.unanswered = False

    def entry(self, identity: bytes) -> Entry:
        return Entry(identity, 0, 0, wire.NEEDS_DESCRIPTION | wire.NEEDS_REFRESH)


class _Playback:
    """A stream with its description, of which `heard` was the newest moment."""

    def __init__(self, forest: Forest, terms: Terms, ticks: int, heard: float) -> None:
        self.forest, self.bodies, self.heard, self.unanswered = forest, forest.bodies, heard, False
        self._codec = Codec(forest, terms)
        self._states: dict[int, State] = {}
        self._windows: dict[int, Path] = {}
        """Of the newest messages, by their sequence numbers."""
        self._path: Path | None = None
        self._newest, self._ticks, self._came = -1, float(ticks), 0.0
        self.playing, self._fading = Playing(terms.delay / TICKS), Fading()
        self._moment: float | None = None
        self._begins = np.inf
        """The first moment that can be shown."""
        self._kept = -np.inf
        """Until this moment keys were handed out."""
        self._needs = wire.NEEDS_REFRESH

    def take(self, motion: Motion, arrival: float) -> None:
        """Take a message, if it is a new one that can be read."""
        if motion.sequence in self._states or self._newest - motion.sequence > MOST_STATES:
            return
        state = self._states.get(motion.sequence - motion.back) if motion.back else self._codec.rest
        self.unanswered = True
        if state is None:
            self._needs = wire.NEEDS_REFRESH
            return
        elapsed = min(max(arrival - self._came, 0.0), MOST_SILENCE) * TICKS if self._came else 0.0
        end = wire.expanded(motion.ticks, self._ticks + elapsed)
        kind = state.kind(end, motion.back)
        read = self._codec.read(motion.payload, kind, state, motion.late)
        path = self._codec.path(read[0], state, kind, end) if read else None
        if read is None or path is None:
            return
        self._states[motion.sequence] = State(path, read[1], end)
        if len(self._states) > MOST_STATES:
            self._states.pop(min(self._states))
        lost = motion.sequence - self._newest - 1
        if lost >= 0:
            self._newest, self._ticks, self._came, self._needs = motion.sequence, float(end), arrival, 0
            self.heard = max(self.heard, arrival)
        if not motion.late or self.playing.longest is None:
            self.playing.heard(end / TICKS, arrival)
        self._put(motion.sequence, path, lost)

    def _put(self, sequence: int, path: Path, lost: int) -> None:
        """Let a window take part in what is shown; before it so many are lost, or it came late where that is < 0."""
        before = self._path
        self._windows[sequence] = path
        for old in sorted(self._windows)[:-MOST_WINDOWS]:
            del self._windows[old]
        if before is None:
            # How the motion got to the first knot is not known.
            self._path, self._begins = path, float(path.moments[1])
        elif lost >= 0:
            self._path = before.followed(path, lost)
            if path.moments[0] < self._begins:
                self._begins = float(path.moments[1])
            count = min(max(MOST_JOINT_KNOTS // len(self.forest), MOST_KNOTS), len(self._path.moments))
            shown = path.moments[0] if self._moment is None else self._moment
            self._path = self._path.since(max(min(self._kept, shown) - 1e-6, self._path.moments[-count]))
        else:
            numbers = sorted(self._windows)
            first = self._windows[numbers[0]]
            self._path = before.followed(first) if before.moments[0] < first.moments[0] else first
            for last, number in pairwise(numbers):
                self._path = self._path.followed(self._windows[number], number - last - 1)
        if self._moment is not None and (lost or path.moments[0] < self._moment):
            self._fading.changed(self._path.pose(self._moment))

    def show(self, now: float) -> Shown | None:
        """Return what is shown now."""
        self._moment = self.playing.moment(now)
        if self._moment is None or self._path is None or self._moment < self._begins:
            return None
        poses = self._fading.show(self._path.pose(self._moment), now)
        return Shown(self._moment, self.forest.parted(poses))

    def keys(self) -> tuple[np.ndarray, dict[str, Poses]]:
        """Return the knots until the start of the newest window that were not handed out yet."""
        path = self._path
        if path is None:
            return np.empty(0), {}
        until = self._windows[max(self._windows)].moments[0]
        rows = np.flatnonzero((path.moments > self._kept) & (path.moments <= until))
        if len(rows):
            self._kept = float(path.moments[rows[-1]])
        poses = self.forest.parted(path.poses[:, rows])
        return path.moments[rows], {name: transposed(own) for name, own in poses.items()}

    def entry(self, identity: bytes) -> Entry:
        """Return what is answered."""
        there = sum(1 << back for back in range(32) if self._newest - 1 - back in self._states)
        return Entry(identity, max(self._newest, 0), there, self._needs)
