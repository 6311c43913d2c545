"""From datagrams to what is shown. Whatever comes, from whomever: it is a message of a stream, or it changes nothing.

Streams are told apart by where they come from and by their senders' identities, and know nothing of one another. What
is remembered of each is bounded.
"""

from __future__ import annotations

import secrets
from collections import OrderedDict, deque
from collections.abc import Hashable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..motion import Poses
from . import wire
from .bodies import Body, Forest
from .coding import Coder
from .messages import Codec, State
from .paths import Path, transposed
from .playing import Fading, Playing
from .wire import NEEDS_DESCRIPTION, NEEDS_REFRESH, TICKS, Answer, Motion, Terms

MOST_STREAMS, MOST_ALL_JOINTS = 64, 4096
"""That are remembered, the streams without descriptions for a new one as well; and joints of all streams together."""

MOST_STATES, MOST_WINDOWS, MOST_WAITING = 40, 8, 4
"""Messages of a stream that others may build on, those that others built on last; windows that one that came late can
be put among; and messages that wait for the description."""

MOST_GONE = 256
"""Streams that are gone, and known again where somebody replays them."""

MOST_KNOTS, MOST_JOINT_KNOTS = 256, 1 << 14
"""Knots of a stream that wait for `keys`, or as many more as a body of few joints has in so many poses of joints."""

SILENT = 10.0
"""Seconds of silence after which a stream is forgotten."""


class Stream(NamedTuple):
    """What tells streams apart."""

    source: Hashable
    identity: bytes


@dataclass(frozen=True, eq=False)
class Shown:
    """What a stream shows: the moment in seconds by the sender's clock, and of each body by its name poses (joints,),
    each joint in its parent's space.
    """

    moment: float
    bodies: tuple[Body, ...]
    poses: dict[str, Poses]


@dataclass(frozen=True, eq=False)
class Keys:
    """What was sent, to be recorded: rising moments (k,) in seconds by the sender's clock, and poses (k, joints)."""

    stream: Stream
    bodies: tuple[Body, ...]
    moments: np.ndarray
    poses: dict[str, Poses]


class Streams:
    """Streams that are shown until they were silent for so many seconds: each has bodies and keys, and shows itself."""

    def __init__(self, silent: float) -> None:
        self._silent = silent
        self._streams: dict[Stream, Any] = {}

    def show(self, now: float) -> dict[Stream, Shown]:
        """Return what every stream shows."""
        self._forget_silent(now)
        shown = {stream: (it.bodies, it.show(now)) for stream, it in self._streams.items()}
        return {stream: Shown(what[0], bodies, what[1]) for stream, (bodies, what) in shown.items() if what}

    @property
    def streams(self) -> list[Stream]:
        """Those that can be shown, or soon can."""
        return list(self._streams)

    def keys(self) -> list[Keys]:
        """Return what came since the last call and is not going to change any more."""
        result = [Keys(stream, it.bodies, *it.keys()) for stream, it in self._streams.items()]
        return [keys for keys in result if len(keys.moments)]

    def _forget_silent(self, now: float) -> None:
        self._forget([own for own, it in self._streams.items() if not -self._silent < now - it.heard < self._silent])

    def _forget(self, streams: list[Stream]) -> None:
        for stream in streams:
            del self._streams[stream]


class Receiver(Streams):
    """Takes datagrams of any number of streams, and shows them."""

    def __init__(self) -> None:
        super().__init__(SILENT)
        self.own = secrets.token_bytes(3)
        """Who answers."""
        self._waiting: OrderedDict[Stream, deque[tuple[Motion, float]]] = OrderedDict()
        """Messages that came before the description, and when."""
        self._unanswered: set[Stream] = set()
        self._gone: deque[Stream] = deque(maxlen=MOST_GONE)

    def take(self, datagram: bytes, arrival: float, source: Hashable = None) -> None:
        """Take a datagram that came at a time, by the clock of `show`, from somewhere."""
        read = wire.read(datagram)
        if read is None or isinstance(read, Answer):
            return
        stream = Stream(source, read.identity)
        if isinstance(read, Motion):
            if stream in self._streams:
                is_new = self._streams[stream].take(read, arrival)
            else:
                is_new = True
                self._waiting.setdefault(stream, deque(maxlen=MOST_WAITING)).append((read, arrival))
                self._waiting.move_to_end(stream)
                if len(self._waiting) > MOST_STREAMS:
                    self._waiting.popitem(last=False)
            self._unanswered |= {stream} if is_new else set()
        elif stream not in self._streams and (described := wire.read_description(read.data)):
            waiting = self._waiting.pop(stream, ())
            if self._has_room_for(stream, described[0], arrival):
                self._streams[stream] = _Playback(*described, arrival)
                for motion, when in waiting:
                    self._streams[stream].take(motion, when)

    def due(self, moment: float) -> float:
        """When the first stream shows a moment of its sender's time, by our clock; never, where nothing came yet."""
        return min((playback.playing.due(moment) for playback in self._streams.values()), default=np.inf)

    def answers(self) -> list[tuple[Hashable, bytes]]:
        """Return what came since the last call, to be sent to where it came from."""
        nothing = 0, 0, NEEDS_DESCRIPTION | NEEDS_REFRESH
        known = dict.fromkeys(self._waiting, nothing) | {own: it.there() for own, it in self._streams.items()}
        asking = [own for own in known if own in self._unanswered]
        self._unanswered.clear()
        return [(own.source, wire.write(Answer(own.identity, self.own, *known[own]))) for own in asking]

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

    def _forget(self, streams: list[Stream]) -> None:
        super()._forget(streams)
        self._gone.extend(streams)


class _Playback:
    """A stream with its description, of which `heard` was the newest moment."""

    def __init__(self, forest: Forest, terms: Terms, heard: float) -> None:
        self.forest, self.bodies, self.heard = forest, forest.bodies, heard
        self._codec = Codec(forest, terms)
        self._states: OrderedDict[int, State] = OrderedDict()
        self._windows: dict[int, Path] = {}
        """Of the newest messages, by their sequence numbers."""
        self._path: Path | None = None
        self._newest, self._needs = -1, NEEDS_REFRESH
        self.playing, self._fading = Playing(terms.delay / TICKS), Fading()
        self._moment: float | None = None
        self._begins = np.inf
        """The first moment that can be shown."""
        self._kept = -np.inf
        """Until this moment keys were handed out."""

    def take(self, motion: Motion, arrival: float) -> bool:
        """Take a message, if it can be read, and say whether it is a new one."""
        sequence = motion.sequence
        if sequence in self._states or self._newest - sequence > MOST_STATES:
            return False
        read = self._codec.code(Coder(motion.data), lambda back: self._states.get(sequence - back))
        if read is None:
            self._needs = NEEDS_REFRESH
            return True
        said, self._states[sequence] = read
        if said.back:
            self._states.move_to_end(sequence - said.back)
        if len(self._states) > MOST_STATES:
            self._states.popitem(last=False)
        lost = sequence - self._newest - 1
        if lost >= 0:
            self._newest, self._needs = sequence, 0
            self.heard = max(self.heard, arrival)
        if not said.late or self.playing.longest is None:
            self.playing.heard(said.end / TICKS, arrival)
        self._put(sequence, read[1].path, lost)
        return True

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

    def show(self, now: float) -> tuple[float, dict[str, Poses]] | None:
        """Return the moment and the poses that are shown now."""
        self._moment = self.playing.moment(now)
        if self._moment is None or self._path is None or self._moment < self._begins:
            return None
        return self._moment, self.forest.parted(self._fading.show(self._path.pose(self._moment), now))

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

    def there(self) -> tuple[int, int, int]:
        """Return what an answer says: the newest message, which there are of those before it, and what is needed."""
        before = sum(1 << back for back in range(32) if self._newest - 1 - back in self._states)
        return max(self._newest, 0), before, self._needs
