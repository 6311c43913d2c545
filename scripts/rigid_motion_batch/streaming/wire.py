"""The wire: every datagram of a stream, from the first hello to the goodbye, and what is no datagram of one.

All begin with the header of `packets`, whose checksum seals them. After it comes, little-endian throughout,

- of a KEY the pose, and in some streams its twist;
- of a BEAT, a heartbeat, the newest key again, with the age that it has by now, and then the terms of the stream;
- of a HELLO, by which one asks to hear what there is, and of a CHALLENGE, which it is answered with, a cookie;
- of a BYE nothing. Its number is that of the last key, its stamp the end of the motion.

A BEAT mends the loss of the newest key, serves who comes later, and tells a silent link from a still hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import MODES

from .packets import HEADER, KEY, TWISTED, checksum
from .packing import PACKINGS, Packing
from .receiver import PlayOut
from .smooth import TWISTS, reach_of

BEAT, HELLO, CHALLENGE, BYE = 2, 3, 4, 5
"""Kinds of datagrams, beside `KEY`."""

COOKIE = 8
"""Bytes of a cookie."""

NO_COOKIE = bytes(COOKIE)
"""What somebody says hello with who has not been given one."""

TERMS = np.dtype(
    [("mode", "u1"), ("delay", "<f4"), ("interval", "<f4"), ("carry", "<f4"), ("fade", "<f4"), ("lead", "<f4")]
)
"""What goes after the key in a heartbeat."""

NUMBERS = {name: mode.number for name, mode in MODES.items()} | {TWISTS: 255}
"""What the terms call a mode."""

LONGEST = 60.0
"""Seconds that a delay, an interval and a carry may have at the most."""

LONGEST_FADE = 30.0
"""Seconds of the shortest fades: what a receiver has to remember goes by it."""


@dataclass(frozen=True)
class Terms:
    """What a receiver has to know of a stream before it can show anything of it.

    Raises
    ------
    ValueError
        For a mode that there is not, and for times that nobody could mean.
    """

    mode: str
    """One of `rigid_motion.motion.MODES`, or `TWISTS`."""

    delay: float
    """Seconds by which the play-out is behind, besides what the link takes."""

    interval: float
    """Seconds from one packet to the next, or what takes its place."""

    carry: float
    """As `PlayOut` has it."""

    fade: float
    """As `PlayOut` has it."""

    lead: float
    """As `PlayOut` has it."""

    def __post_init__(self) -> None:
        reach_of(self.mode)
        for name, least in (("delay", 0.0), ("interval", 1e-4), ("carry", 0.0)):
            if not least <= getattr(self, name) <= LONGEST:
                raise ValueError(f"a {name} of {getattr(self, name):g} s is not within {least:g} and {LONGEST:g} s")
        if not 0.0 <= self.lead <= LONGEST:
            raise ValueError(f"a lead of {self.lead:g} is not within 0 and {LONGEST:g} intervals")
        if not 0.0 < self.fade * self.interval <= LONGEST_FADE:
            raise ValueError(f"differences would fade in {self.fade * self.interval:g} s, not in 0 to {LONGEST_FADE} s")

    @classmethod
    def of(cls, mode: str, interval: float, play_out: PlayOut) -> Terms:
        """Those of a play-out whose wait is known, in the numbers that the wire has for them."""
        lead = reach_of(mode).lead if play_out.lead is None else play_out.lead
        numbers = (play_out.wait * interval, interval, play_out.carry, play_out.fade, lead)
        return cls(mode, *(float(np.float32(number)) for number in numbers))

    @classmethod
    def read(cls, data: bytes) -> Terms:
        """From the bytes. Raises ValueError for those that nobody wrote."""
        mode, *numbers = np.frombuffer(data, TERMS)[0].item()
        names = [name for name, number in NUMBERS.items() if number == mode]
        return cls(*(names or [str(mode)]), *numbers)

    @property
    def data(self) -> bytes:
        """The bytes."""
        numbers = (NUMBERS[self.mode], self.delay, self.interval, self.carry, self.fade, self.lead)
        return np.array([numbers], TERMS).tobytes()

    def play_out(self, latency: float | None) -> PlayOut:
        """How a receiver deals with time, on a link of that latency in seconds; None: what the first packet took."""
        return PlayOut(self.delay / self.interval, latency, self.carry, self.fade, self.lead)


@dataclass(frozen=True)
class Layout:
    """How poses are written in a stream."""

    packing: Packing
    twisted: bool

    @property
    def size(self) -> int:
        """Bytes of a key, with its header."""
        return HEADER.itemsize + self.packing.size + (self.packing.twist_size if self.twisted else 0)


LAYOUTS = {
    number | (TWISTED if twisted else 0): Layout(packing, twisted)
    for number, packing in enumerate(PACKINGS.values())
    for twisted in (False, True)
}
"""What a header may say of it."""

LARGEST = max(layout.size for layout in LAYOUTS.values()) + TERMS.itemsize
"""Bytes of the largest datagram that there is."""


@dataclass(frozen=True, slots=True)
class Message:
    """What a datagram says."""

    kind: int
    stream: int
    sequence: int
    stamp: float
    age: float

    layout: Layout | None = None
    """Of a KEY and a BEAT."""

    terms: Terms | None = None
    """Of a BEAT."""

    cookie: bytes = NO_COOKIE
    """Of a HELLO and a CHALLENGE."""


def read(datagram: bytes) -> Message | None:
    """What a datagram says; None for one that is damaged, or none of these."""
    if not HEADER.itemsize <= len(datagram) <= LARGEST:
        return None
    check, stream, sequence, stamp, age, kind, packing = np.frombuffer(datagram, HEADER, 1)[0].item()
    if check != checksum(datagram) or not (math.isfinite(stamp) and math.isfinite(age)):
        return None
    said = (kind, stream, sequence, stamp, age)
    body = len(datagram) - HEADER.itemsize
    if kind == BYE:
        return Message(*said) if body == 0 else None
    if kind in (HELLO, CHALLENGE):
        return Message(*said, cookie=datagram[HEADER.itemsize :]) if body == COOKIE else None
    layout = LAYOUTS.get(packing)
    terms_size = {KEY: 0, BEAT: TERMS.itemsize}.get(kind)
    if layout is None or terms_size is None or len(datagram) != layout.size + terms_size:
        return None
    if kind == KEY:
        return Message(*said, layout)
    try:
        terms = Terms.read(datagram[layout.size :])
    except ValueError:
        return None
    return Message(*said, layout, terms) if (terms.mode == TWISTS) == layout.twisted else None


def beat(key: bytes, terms: Terms, age: float) -> bytes:
    """A heartbeat: a key that was sent before, so many seconds after its stamp, with the terms of its stream."""
    return changed(key + terms.data, kind=BEAT, age=age)


def key_of(beat: bytes) -> bytes:
    """The key in a heartbeat, as if it had come by itself."""
    return changed(beat[: -TERMS.itemsize], kind=KEY)


def hello(cookie: bytes = NO_COOKIE) -> bytes:
    """What asks for everything from now on, and what is newest at once."""
    return _made(HELLO, body=cookie)


def challenge(cookie: bytes) -> bytes:
    """What a hello is answered with: whoever gets it can say hello with this cookie. No longer than the hello."""
    return _made(CHALLENGE, body=cookie)


def bye(stream: int = 0, last: int = 0, stamp: float = 0.0) -> bytes:
    """The end of a stream, of which the last key has the number `last`; of stream 0, that of who only listens."""
    return _made(BYE, stream, last, stamp)


def changed(datagram: bytes, **fields: float) -> bytes:
    """A datagram with other numbers in its header: `age` for one that is sent again later."""
    header = np.frombuffer(datagram, HEADER, 1).copy()
    for name, value in fields.items():
        header[name] = value
    return _sealed(header.tobytes() + datagram[HEADER.itemsize :])


def pose_bytes(message: Message) -> int:
    """Of a message the bytes of its pose and twist, header and terms not counted."""
    return message.layout.size - HEADER.itemsize if message.layout else 0


def _made(kind: int, stream: int = 0, sequence: int = 0, stamp: float = 0.0, body: bytes = b"") -> bytes:
    return _sealed(np.array([(0, stream, sequence, stamp, 0.0, kind, 0)], HEADER).tobytes() + body)


def _sealed(datagram: bytes) -> bytes:
    size = HEADER["check"].itemsize
    return checksum(datagram).to_bytes(size, "little") + datagram[size:]
