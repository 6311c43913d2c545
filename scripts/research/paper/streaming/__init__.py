"""Poses on the way, as the paper has them: a sender, a link that delays and loses, and a receiver that shows a motion.

    packets = send(times, poses, rate=20.0, packing=PACKINGS["double"])
    arrivals = Link(latency=0.05, jitter=0.02, loss=0.1).carry(packets, np.random.default_rng(1))
    playback = receive(packets, arrivals, display_times, "dq_sclerp")

Seconds throughout; positions keep their unit. NumPy alone. What users run is `rigid_motion.streams`.
"""

from .events import Event, What
from .link import Link
from .packets import Packets, bandwidth
from .packing import PACKINGS, Packing, smallest_three
from .receiver import Playback, PlayOut, receive
from .sender import send
from .smooth import TWISTS

__all__ = [
    "PACKINGS",
    "TWISTS",
    "Event",
    "Link",
    "Packets",
    "Packing",
    "PlayOut",
    "Playback",
    "What",
    "bandwidth",
    "receive",
    "send",
    "smallest_three",
]
