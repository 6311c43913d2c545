"""VMC for commands: recordings and streams as performers of other programs, and performers as streams."""

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
"""Frames a second at most: programs draw no faster."""


@lru_cache(maxsize=16)
def performer_of(body: StreamBody) -> Performer | None:
    """Return what a skeleton is to VMC; None where it is no person."""
    performer = Performer(body.joints, body.in_root_space(body.rest))
    return performer if "Hips" in performer.bones else None


class ToVmc(Outlet):
    """Another program, which is shown bodies: the first skeleton of a person as its performer, for VMC has one to a
    port, and all rigid bodies as trackers. Raises OSError where there is no such address.
    """

    def __init__(self, to: Address) -> None:
        super().__init__(*to)
        self.datagrams = 0
        self._began = time.monotonic()

    def show(self, bodies: Iterable[tuple[StreamBody, Poses]], moment: float | None = None) -> None:
        """Show bodies at poses (joints,), each joint in its parent's space, at a moment, or else now."""
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
    """Play samples (n,) of a body's poses (joints, n) in real time, and return how many datagrams were sent.

    `stopped` ends it as soon as something is in it; `reach` is given the seconds that were played.
    Raises OSError where `to` is no address, and ValueError where no bone of a body is a person's.
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
    """Return what another program performed to a port since the last call. Of several that is the first, until it has
    gone. Bodies are others as soon as bones or devices come that are new.
    """
    now = time.monotonic()
    for datagram, source in port.received():
        receiver.take(datagram, now, source)
    receiver.show(now)
    came, first = receiver.keys(), receiver.streams[:1]
    return [keys for keys in came if keys.stream in first]
