"""The link: when packets arrive, if they do.

A packet waits until the line is free, takes its bytes' time on the line, and then travels for the latency and a random
time besides. Seconds and bytes throughout. Randomness comes from the generator that is given, and from nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .packets import Packets


@dataclass(frozen=True)
class Link:
    """A way through a network.

    Raises
    ------
    ValueError
        For a loss that is no probability, a rate limit that is not positive, and times that are negative.
    """

    latency: float = 0.0
    """Seconds that every packet travels at least."""

    jitter: float = 0.0
    """Mean of the seconds that are added, for each packet by itself: exponentially distributed, so that half of the
    packets take less than 0.69 of it, and one in twenty more than three times as much. No packet waits for another:
    where the jitter is not small beside the interval, they overtake one another."""

    loss: float = 0.0
    """The share of packets that never arrive, each by itself. They do take their time on the line."""

    rate_limit: float = np.inf
    """Bytes a second that the line takes, headers counted. Packets queue for it, and none is turned away."""

    def __post_init__(self) -> None:
        for name in ("latency", "jitter"):
            if not (np.isfinite(value := getattr(self, name)) and value >= 0.0):
                raise ValueError(f"a {name} of {value} s is not a number of seconds from 0 on")
        if not 0.0 <= self.loss <= 1.0:
            raise ValueError(f"a loss of {self.loss} is no share from 0 to 1")
        if not self.rate_limit > 0.0:
            raise ValueError(f"a rate limit of {self.rate_limit} bytes a second is not positive")

    def carry(self, packets: Packets, generator: np.random.Generator) -> np.ndarray:
        """When packets arrive that leave at their stamps: seconds by the sender's clock, (n,); infinite: never."""
        return self.arrivals(packets.stamps, np.full(len(packets), packets.data.shape[1]), generator)

    def arrivals(self, sent: ArrayLike, sizes: ArrayLike, generator: np.random.Generator) -> np.ndarray:
        """The same for anything: sent at these rising moments (n,), of these sizes in bytes (n,)."""
        sent = np.asarray(sent, dtype=np.float64)
        waits = generator.exponential(self.jitter, len(sent))
        lost = generator.random(len(sent)) < self.loss
        # Each leaves the line when all that were in the queue with it have: the latest start plus all sizes since.
        line = np.cumsum(np.asarray(sizes, dtype=np.float64)) / self.rate_limit
        before = np.concatenate(((0.0,), line[:-1]))[: len(line)]
        left = np.maximum.accumulate(sent - before) + line if np.isfinite(self.rate_limit) else sent
        return np.where(lost, np.inf, left + self.latency + waits)
