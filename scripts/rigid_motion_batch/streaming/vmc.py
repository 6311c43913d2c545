"""VMC for commands: plays recordings and streams to other programs as performers, and reads performers from them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache

import numpy as np

from rigid_motion.live.sockets import Address, Outlet, Port
from rigid_motion.motion import Poses
from rigid_motion.streams import ReceivedKeys, Receiver, StreamBody
from rigid_motion.streams.vmc import Performer, write, write_trackers

MAX_FRAMES_PER_S = 90.0
"""The most frames per second: programs draw no faster."""


@lru_cache(maxsize=16)
def performer_of(body: StreamBody) -> Performer | None:
    """Return the VMC performer of a skeleton; None if it is not a person."""
    performer = Performer(body.joints, body.in_root_space(body.rest))
    return performer if "Hips" in performer.bones else None


class ToVmc(Outlet):
    """An outlet that shows bodies to another program: the first skeleton of a person as its performer, because VMC has
    one per port, and all rigid bodies as trackers. Raises OSError if the address does not exist.
    """

    def __init__(self, to: Address) -> None:
        super().__init__(*to)
        self.datagrams = 0
        self._began = time.monotonic()

    def show(self, bodies: Iterable[tuple[StreamBody, Poses]], moment: float | None = None) -> None:
        """Show bodies at poses (joints,), each joint in its parent's space, at a moment; None means now."""
        trackers, datagrams = {}, list[bytes]()
        moment = time.monotonic() - self._began if moment is None else moment
        for body, poses in bodies:
            if len(body.joints) == 1:
                trackers[body.name] = poses[0]
            elif not datagrams and (performer := performer_of(body)):
                datagrams = write(moment, performer(body.in_root_space(poses)))
        for datagram in datagrams + write_trackers(trackers):
            self.say(datagram)
            self.datagrams += 1


def play(
    body: StreamBody,
    moments: np.ndarray,
    poses: Poses,
    to: Address,
    stopped: Sequence[int] = (),
    reach: Callable[[float], None] = lambda _: None,
) -> int:
    """Play samples (n,) of a body's poses (joints, n) in real time, and return the number of datagrams sent.

    Playing ends as soon as `stopped` has an item; `reach` is called with the seconds played. Raises OSError if `to` is
    not an address, and ValueError if no bone of a body is a person's.
    """
    with ToVmc(to) as outlet:
        if len(body.joints) > 1 and not performer_of(body):
            raise ValueError(f"{body.name}: none of its joints is named as the hips of a person, which VMC begins with")
        began = time.monotonic()
        for row, moment in enumerate((moments - moments[0]).tolist()):
            while not stopped and (wait := began + moment - time.monotonic()) > 0.0:
                time.sleep(min(wait, 0.1))
            if stopped:
                break
            outlet.show([(body, poses[:, row])], moment)
            reach(moment)
        return outlet.datagrams


def performed(port: Port, receiver: Receiver) -> list[ReceivedKeys]:
    """Return the keys that another program sent to a port since the last call. Of several programs only the first
    counts, until it has left. New bones or devices make new bodies.
    """
    now = time.monotonic()
    for datagram, source in port.received():
        receiver.take(datagram, now, source)
    receiver.show(now)
    came, first = receiver.keys(), receiver.streams[:1]
    return [keys for keys in came if keys.stream in first]
