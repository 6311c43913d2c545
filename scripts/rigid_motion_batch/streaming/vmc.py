"""VMC for commands: recordings and streams as performers of other programs, and performers as streams.

play(clip, ("127.0.0.1", 39539), stopped)         `send RECORDING --to-vmc HOST:PORT`
with Performers(port) as performers:              `send --from-vmc PORT`: what comes, for a sender of a room
    for bodies, moments, poses in performers.samples(): ...
show = ToVmc(receiver, address)                   `receive --to-vmc HOST:PORT`: called with what each frame shows
"""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Self

import numpy as np

from rigid_motion.motion import Poses, Skeleton
from rigid_motion.motion.poses import joined
from rigid_motion.streams import Body, Receiver, Shown
from rigid_motion.streams.paths import transposed
from rigid_motion.streams.receiver import Stream
from rigid_motion.streams.vmc import PORT, Performer, VmcReceiver, write, write_trackers
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.clips import Clip

LONGEST = 65535
LOOPBACK = "127.0.0.1"
RATE = 90.0
"""Frames a second at most: programs draw no faster."""

GONE = 2.0
"""Seconds of silence after which a program has gone."""

Address = tuple[str, int]


def performer_of(clip: Clip) -> Performer | None:
    """Return what a clip of a body is to VMC; None for a single rigid body.
    Raises ValueError where no bone is a person's.
    """
    if clip.rest_body is None:
        return None
    performer = Performer(clip.rest_body.joints, to_blender(clip.in_metres(clip.rest_body.rest), clip.axes))
    if "Hips" not in performer.bones:
        raise ValueError(f"{clip.name}: none of its joints is named as the hips of a person, which VMC begins with")
    return performer


class Outlet:
    """What sends datagrams to an address. Raises OSError where that is none."""

    def __init__(self, to: Address) -> None:
        family, kind, *_, address = socket.getaddrinfo(*to, type=socket.SOCK_DGRAM)[0]
        self._socket, self._to = socket.socket(family, kind), address
        self.datagrams = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, datagrams: Sequence[bytes]) -> None:
        for datagram in datagrams:
            try:
                self._socket.sendto(datagram, self._to)
            except OSError:
                continue  # As if it had been lost.
            self.datagrams += 1


def play(
    clip: Clip,
    to: Address,
    stopped: Sequence[int] = (),
    reach: Callable[[float], None] = lambda _: None,
) -> int:
    """Play a recording in real time, and return how many datagrams were sent.

    `stopped` ends it as soon as something is in it; `reach` is given the seconds that were played.
    """
    performer = performer_of(clip)
    poses = to_blender(clip.in_metres(clip.poses), clip.axes)
    if performer is not None:
        poses = Skeleton(clip.whole_body.parents).in_root_space(poses)
    moments = clip.times - clip.times[0]
    with Outlet(to) as outlet:
        began, last = time.monotonic(), -np.inf
        for row, moment in enumerate(moments.tolist()):
            if moment - last < 0.99 / RATE and row < len(moments) - 1:
                continue
            while not stopped and (wait := began + moment - time.monotonic()) > 0.0:
                time.sleep(min(wait, 0.1))
            if stopped:
                break
            now = poses[..., row]
            outlet.send(write_trackers({clip.name: now}) if performer is None else write(moment, performer(now)))
            last = moment
            reach(moment)
        return outlet.datagrams


class Performers:
    """What another program performs to a port of this machine. Raises OSError where it is taken.

    Of several programs that is the first, until it has gone.
    """

    def __init__(self, port: int = PORT, host: str = LOOPBACK) -> None:
        self._receiver = VmcReceiver()
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host, port))
        self._socket.setblocking(False)
        self.port = self._socket.getsockname()[1]
        self._stream: Stream | None = None
        self._heard = -math.inf

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def samples(self) -> list[tuple[tuple[Body, ...], np.ndarray, Poses]]:
        """Return what came since the last call: bodies, moments (n,) of their clock, and poses (joints, n) of all.

        They are others as soon as bones or devices come that were not there before.
        """
        now = time.monotonic()
        while True:
            try:
                datagram, source = self._socket.recvfrom(LONGEST)
            except BlockingIOError:
                break
            except OSError:
                continue  # What Windows says of somebody who is not there any more.
            self._receiver.take(datagram, now, source)
        self._receiver.show(now)
        result = []
        came = self._receiver.keys()
        for keys in came:
            if now - self._heard > GONE:
                self._stream = keys.stream
            if keys.stream != self._stream:
                continue
            self._heard = now
            bodies = self._receiver.bodies(keys.stream)
            poses = joined([keys.poses[body.name] for body in bodies], axis=1)
            result.append((bodies, keys.moments, transposed(poses)))
        return result


class ToVmc:
    """What a receiver shows, frame by frame, to another program: the first skeleton as its performer, for VMC has one
    to a port, and all rigid bodies as trackers.
    """

    def __init__(self, receiver: Receiver, to: Address) -> None:
        self._receiver, self._outlet = receiver, Outlet(to)
        self._performers: dict[Body, Performer] = {}
        self._began = time.monotonic()

    def __call__(self, shown: Mapping[Stream, Shown]) -> None:
        trackers, performs = {}, False
        for stream, what in shown.items():
            for body in self._receiver.bodies(stream):
                poses = what.poses[body.name]
                if len(body.joints) == 1:
                    trackers[body.name] = poses[0]
                elif not performs and self._perform(body, poses):
                    performs = True
        self._outlet.send(write_trackers(trackers))

    def _perform(self, body: Body, poses: Poses) -> bool:
        skeleton = Skeleton(body.parents)
        if body not in self._performers:
            rest = skeleton.in_root_space(body.rest[:, None])[:, 0]
            self._performers = {body: Performer(body.joints, rest)}
        performer = self._performers[body]
        if "Hips" not in performer.bones:
            return False
        world = skeleton.in_root_space(poses[:, None])[:, 0]
        self._outlet.send(write(time.monotonic() - self._began, performer(world)))
        return True

    def close(self) -> None:
        self._outlet.__exit__()
