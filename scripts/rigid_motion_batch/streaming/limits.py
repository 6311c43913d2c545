"""Limits on what strangers can do: so many datagrams a second, and nothing sent to who did not ask for it.

Seconds by a clock that does not run backwards.
"""

from __future__ import annotations

import hmac
import secrets
from collections import OrderedDict
from dataclasses import dataclass

from .wire import COOKIE

SILENCE = 10.0
"""Seconds after which who says nothing is forgotten."""

QUIET = 2.0
"""Seconds after which who says nothing makes room for others, where there is none."""

STREAMS = 16
"""That one receiver shows, and one relay carries."""

EACH = 400.0
"""Datagrams a second that one address may send, and as many at once."""

OVERALL = 2000.0
"""Datagrams a second of all addresses that are not known yet."""

ADDRESSES = 1024
"""Addresses that are counted each by itself: those that have been silent longest make room."""


@dataclass(slots=True)
class Bucket:
    """A bucket of tokens: it fills evenly, and every datagram takes one out."""

    rate: float
    """Tokens a second, and how many fit in."""

    tokens: float
    time: float

    def take(self, time: float) -> bool:
        """Take a token, and say whether there was one."""
        self.tokens = min(self.tokens + (time - self.time) * self.rate, self.rate)
        self.time = time
        if self.tokens < 1.0:
            return False
        self.tokens -= 1.0
        return True


class Gate:
    """Who may say how much: each address for itself, and all that are not known together."""

    def __init__(self, each: float = EACH, overall: float = OVERALL) -> None:
        self._each = each
        self._strangers = Bucket(overall, overall, 0.0)
        self._buckets: OrderedDict[tuple, Bucket] = OrderedDict()
        self.refused = 0
        """Datagrams that were too many."""

    def admits(self, address: tuple, time: float, known: bool) -> bool:
        """Whether a datagram is looked at that came from an address at a time."""
        bucket = self._buckets.pop(address, None) or Bucket(self._each, self._each, time)
        self._buckets[address] = bucket
        if len(self._buckets) > ADDRESSES:
            self._buckets.popitem(last=False)
        admitted = bucket.take(time) and (known or self._strangers.take(time))
        self.refused += not admitted
        return admitted


class Cookies:
    """What proves that somebody is where they say: only who gets datagrams at an address can know its cookie."""

    def __init__(self) -> None:
        self._secret = secrets.token_bytes(32)

    def of(self, address: tuple) -> bytes:
        """The cookie of an address."""
        return hmac.digest(self._secret, repr(address).encode(), "sha256")[:COOKIE]

    def fits(self, address: tuple, cookie: bytes) -> bool:
        """Whether this is its cookie."""
        return hmac.compare_digest(self.of(address), cookie)
