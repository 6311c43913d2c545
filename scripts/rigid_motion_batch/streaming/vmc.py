"""VMC for commands: recordings and streams as performers of other programs, and performers as streams.

play(clip, ("127.0.0.1", 39539), stopped)         `send RECORDING --to-vmc HOST:PORT`
with Performers(port) as performers:              `send --from-vmc PORT`: what comes, for a sender of a room
    for bodies, moments, poses in performers.samples(): ...
show = ToVmc(receiver, address)                   `receive --to-vmc HOST:PORT`: called with what each frame shows
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from rigid_motion.live.sockets import Address, Outlet, Port
from rigid_motion.motion import Poses, Skeleton
from rigid_motion.motion.poses import joined
from rigid_motion.streams import Body, Receiver, Shown
from rigid_motion.streams.paths import transposed
from rigid_motion.streams.receiver import Stream
from rigid_motion.streams.vmc import SILENT, Performer, VmcReceiver, write, write_trackers
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.clips import Clip

RATE = 90.0
"""Frames a second at most: programs draw no faster."""


def play(
    clip: Clip,
    to: Address,
    stopped: Sequence[int] = (),
    reach: Callable[[float], None] = lambda _: None,
) -> int:
    """Play a recording in real time, and return how many datagrams were sent.

    `stopped` ends it as soon as something is in it; `reach` is given the seconds that were played.
    Raises OSError where `to` is no address, and ValueError where no bone of a body is a person's.
    """
    poses, performer = to_blender(clip.in_metres(clip.poses), clip.axes), None
    if clip.rest_body is not None:
        performer = Performer(clip.rest_body.joints, to_blender(clip.in_metres(clip.rest_body.rest), clip.axes))
        if "Hips" not in performer.bones:
            raise ValueError(f"{clip.name}: none of its joints is named as the hips of a person, which VMC begins with")
        poses = Skeleton(clip.whole_body.parents).in_root_space(poses)
    moments, count = clip.times - clip.times[0], 0
    with Outlet(*to) as outlet:
        began, last = time.monotonic(), -np.inf
        for row, moment in enumerate(moments.tolist()):
            if moment - last < 0.99 / RATE and row < len(moments) - 1:
                continue
            while not stopped and (wait := began + moment - time.monotonic()) > 0.0:
                time.sleep(min(wait, 0.1))
            if stopped:
                break
            now = poses[..., row]
            for datagram in write_trackers({clip.name: now}) if performer is None else write(moment, performer(now)):
                outlet.say(datagram)
                count += 1
            last = moment
            reach(moment)
    return count


class Performers(Port):
    """What another program performs to a port of this machine. Raises OSError where it is taken.

    Of several programs that is the first, until it has gone.
    """

    def __init__(self, port: int) -> None:
        super().__init__(port=port)
        self._receiver = VmcReceiver()
        self._stream: Stream | None = None
        self._heard = -math.inf

    def samples(self) -> list[tuple[tuple[Body, ...], np.ndarray, Poses]]:
        """Return what came since the last call: bodies, moments (n,) of their clock, and poses (joints, n) of all.

        They are others as soon as bones or devices come that were not there before.
        """
        now, result = time.monotonic(), []
        for datagram, source in self.received():
            self._receiver.take(datagram, now, source)
        self._receiver.show(now)
        came = self._receiver.keys()
        for keys in came:
            if now - self._heard > SILENT:
                self._stream = keys.stream
            if keys.stream == self._stream:
                self._heard = now
                bodies = self._receiver.bodies(keys.stream)
                poses = joined([keys.poses[body.name] for body in bodies], axis=1)
                result.append((bodies, keys.moments, transposed(poses)))
        return result


class ToVmc(Outlet):
    """What a receiver shows, frame by frame, to another program: the first skeleton as its performer, for VMC has one
    to a port, and all rigid bodies as trackers.
    """

    def __init__(self, receiver: Receiver, to: Address) -> None:
        super().__init__(*to)
        self._receiver, self._began = receiver, time.monotonic()
        self._performer: tuple[Body, Performer] | None = None

    def __call__(self, shown: Mapping[Stream, Shown]) -> None:
        trackers, datagrams = {}, list[bytes]()
        for stream, what in shown.items():
            for body in self._receiver.bodies(stream):
                if len(body.joints) == 1:
                    trackers[body.name] = what.poses[body.name][0]
                else:
                    datagrams = datagrams or self._performed(body, what.poses[body.name])
        for datagram in datagrams + write_trackers(trackers):
            self.say(datagram)

    def _performed(self, body: Body, poses: Poses) -> list[bytes]:
        """Return the datagrams of a skeleton; none of one that is no person."""
        skeleton = Skeleton(body.parents)
        if self._performer is None or self._performer[0] is not body:
            self._performer = body, Performer(body.joints, skeleton.in_root_space(body.rest[:, None])[:, 0])
        performer = self._performer[1]
        if "Hips" not in performer.bones:
            return []
        return write(time.monotonic() - self._began, performer(skeleton.in_root_space(poses[:, None])[:, 0]))
