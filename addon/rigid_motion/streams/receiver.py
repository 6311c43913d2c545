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
from .paths import Path
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

    stream: Stream
    moment: float
    bodies: tuple[Body, ...]
    poses: dict[str, Poses]


@dataclass(frozen=True, eq=False)
class Keys:
    """What was sent, to be recorded: rising moments (k,) in seconds by the sender's clock, and poses (joints, k)."""

    stream: Stream
    bodies: tuple[Body, ...]
    moments: np.ndarray
    poses: dict[str, Poses]


class Playback:
    """A stream that is shown: its bodies, the path of what came, and the moment of that which is due.

    `heard` is when something new came, `begins` the first moment that can be shown, and `settled` that until which the
    path is not going to change any more.
    """

    def __init__(self, stream: Stream, delay: float, heard: float = -np.inf, forest: Forest | None = None) -> None:
        self.stream, self.heard, self.playing = stream, heard, Playing(delay)
        self.forest: Any = forest
        """The Forest of all bodies, None for as long as nothing is known of them."""
        self.path: Path | None = None
        self.begins, self.settled = -np.inf, np.inf
        self.fading = Fading()
        self.moment: float | None = None
        self.kept = -np.inf
        """Until this moment keys were handed out."""

    def put(self, path: Path) -> None:
        """Show a path from now on, of which the knots remain that are to be shown or handed out."""
        count = min(max(MOST_JOINT_KNOTS // len(self.forest), MOST_KNOTS), len(path.moments))
        shown = path.moments[0] if self.moment is None else self.moment
        self.path = path.since(max(min(self.kept, shown) - 1e-6, path.moments[-count]))

    def show(self, now: float) -> Shown | None:
        """Return what is shown now."""
        self.moment = self.playing.moment(now)
        if self.moment is None or self.path is None or self.moment < self.begins:
            return None
        poses = self.fading.show(self.path.pose(self.moment), now)
        return Shown(self.stream, self.moment, self.forest.bodies, self.forest.parted(poses))

    def keys(self) -> Keys | None:
        """Return the knots that are settled and were not handed out yet."""
        moments = self.path.moments if self.path else np.empty(0)
        rows = np.flatnonzero((moments > self.kept) & (moments <= self.settled))
        if self.path is None or not len(rows):
            return None
        self.kept = float(moments[rows[-1]])
        return Keys(self.stream, self.forest.bodies, moments[rows], self.forest.parted(self.path.poses[:, rows]))


class Streams:
    """Streams that are shown until they were silent for so many seconds."""

    def __init__(self, silent: float) -> None:
        self._silent = silent
        self._streams: dict[Stream, Any] = {}

    def show(self, now: float) -> dict[Stream, Shown]:
        """Return what every stream shows."""
        self._forget_silent(now)
        shown = {stream: it.show(now) for stream, it in self._streams.items()}
        return {stream: what for stream, what in shown.items() if what}

    @property
    def streams(self) -> list[Stream]:
        """Those that can be shown, or soon can."""
        return list(self._streams)

    def keys(self) -> list[Keys]:
        """Return what came since the last call and is not going to change any more."""
        return [keys for it in self._streams.values() if (keys := it.keys())]

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
                self._streams[stream] = _Coded(stream, *described, arrival)
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


class _Coded(Playback):
    """A stream with its description."""

    def __init__(self, stream: Stream, forest: Forest, terms: Terms, heard: float) -> None:
        super().__init__(stream, terms.delay / TICKS, heard, forest)
        self._codec = Codec(forest, terms)
        self._states: OrderedDict[int, State] = OrderedDict()
        self._windows: dict[int, Path] = {}
        """Of the newest messages, by their sequence numbers."""
        self._newest, self._needs = -1, NEEDS_REFRESH
        self.begins = np.inf

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

    def _put(self, sequence: int, window: Path, lost: int) -> None:
        """Let a window take part in what is shown; before it so many are lost, or it came late where that is < 0."""
        if self.path is None or (lost >= 0 and window.moments[0] < self.begins):
            # How the motion got to the first knot is not known.
            self.begins = float(window.moments[1])
        self._windows[sequence] = window
        numbers = sorted(self._windows)[-MOST_WINDOWS:]
        self._windows = {number: self._windows[number] for number in numbers}
        path, first = self.path, self._windows[numbers[0]]
        path = path.followed(first) if path and path.moments[0] < first.moments[0] else first
        for last, number in pairwise(numbers):
            path = path.followed(self._windows[number], number - last - 1)
        self.put(path)
        self.settled = float(self._windows[numbers[-1]].moments[0])
        if self.moment is not None and (lost or window.moments[0] < self.moment):
            self.fading.changed(path.pose(self.moment))

    def there(self) -> tuple[int, int, int]:
        """Return what an answer says: the newest message, which there are of those before it, and what is needed."""
        before = sum(1 << back for back in range(32) if self._newest - 1 - back in self._states)
        return max(self._newest, 0), before, self._needs
