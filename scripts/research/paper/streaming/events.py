"""Events: what a receiver had to deal with, and when. Times are seconds by the clock of the display."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class What(StrEnum):
    """What happened, and what the amount of it counts."""

    LATE = "late"
    """A packet came after the play-out could have used it, and serves from there on. Seconds too late."""

    TOO_LATE = "too late"
    """A packet came when the play-out had passed a later one, and was dropped. Seconds too late."""

    LOST = "lost"
    """Packets had not come when the play-out passed a later one, nor did they ever. How many, from this number on."""

    REORDERED = "reordered"
    """A packet came after others that were sent later. How many of them."""

    DUPLICATE = "duplicate"
    """A packet came again, and was dropped. 1."""

    DAMAGED = "damaged"
    """A packet held numbers that are no pose, or a time or number that contradicts the keys, and was put aside. It is
    used after all where more come that agree with it, and keys are withdrawn. 1."""

    WITHDRAWN = "withdrawn"
    """Packets in a row that agree among themselves contradicted keys, of which this was the first. These were withdrawn
    and those are believed. How many keys."""

    DELAYED = "delayed"
    """Packets in a row agreed on another latency than the one that was believed. Seconds by which the delay grew."""

    RAN_OUT = "ran out"
    """The play-out passed the newest key, this one, and the motion went on slower and slower. Seconds until a frame
    had a newer one, or until the last frame."""

    CAUGHT_UP = "caught up"
    """The path changed under what was shown, now that this key is known. The distance that began to fade."""


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened."""

    time: float

    what: What

    sequence: int
    """Of the packet."""

    amount: float
    """As `What` counts it."""
