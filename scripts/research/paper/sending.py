"""What a live stream costs that is sent when needed, beside even streams of the state of the art that are as good.

The even streams are those of the paper, `lerp_slerp` at its rates; the other is the codec of `rigid_motion.streams`,
over a link that takes no time. It has a tolerance, which is searched for: the one at which the RMS shell error is that
of the even stream. Bytes are a second's, those of UDP and IPv4 around each datagram among them, and
what somebody who joins is told once is not. Of each recording the first `SECONDS` are sent. Seconds and metres.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from rigid_motion.motion import Poses, rms, shell_error
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import normalise
from rigid_motion.streams import Receiver, Sender
from rigid_motion.streams.paths import Path
from rigid_motion.streams.wire import Description, read
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.analysis.needed import part_of
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming.measuring import HEADERS
from rigid_motion_batch.streaming.packed import CUBE, PLACE_BITS, STAMP, smallest_three
from rigid_motion_batch.streaming.sending import body_of, even_rate, samples_of

from .table import RADIUS, UPDATES, even_points, lowest

DELAYS = (0.1, 0.2)  # by which the picture is behind
SECONDS = 10.0

TOLERANCES = 1.0, 5.0, 4
"""From this multiple of the smallest error wanted to this multiple of the largest, so many."""

TURN_BITS = 10  # of each of the smallest three components of a quaternion

PACKINGS = {
    "7 doubles": 56,
    "7 singles": 28,
    f"places of {PLACE_BITS} bits, smallest three of {TURN_BITS}": (3 * PLACE_BITS + 2 + 3 * TURN_BITS) // 8,
}
"""Bytes of a pose."""


def sent(clip: Clip, tolerance: float, delay: float) -> tuple[float, float, float]:
    """Send a clip, show it, and return datagrams and bytes a second, and the RMS shell error of what was shown."""
    times, poses = samples_of(clip)
    body = body_of(clip, poses, RADIUS)
    sender, receiver = Sender([body], tolerance, delay, even_rate(times)), Receiver()
    frames, shown, sizes = deque((times + delay).tolist()), [], []

    def draw(until: float) -> None:
        while frames and frames[0] < until:
            shown.extend(receiver.show(frames.popleft()).values())

    def post(datagrams: list[bytes], now: float) -> None:
        draw(now)
        for datagram in datagrams:
            receiver.take(datagram, now)
            if not isinstance(read(datagram), Description):
                sizes.append(len(datagram) + HEADERS)
            for _, answer in receiver.answers():
                post(sender.hear(answer, now), now)

    for sample, moment in enumerate(times.tolist()):
        while (due := sender.next) < moment:
            post(sender.poll(due), due)
        post(sender.add(moment, poses[:, sample]), moment)
    post(sender.finish(), float(times[-1]))
    draw(np.inf)
    truth = Path(times, poses).at(np.array([it.moment for it in shown]))[0]
    error = rms(shell_error(joined([it.poses[body.name] for it in shown]), truth, RADIUS))
    seconds = float(times[-1] - times[0])
    return len(sizes) / seconds, sum(sizes) / seconds, error


def costs_of(clip: Clip) -> dict[float, dict[int, tuple[float, float]]]:
    """Return by delay and rate of the state of the art the datagrams and the bytes a second that are as good."""
    clip = part_of(clip, 0, int(np.searchsorted(clip.times, clip.times[0] + SECONDS, side="right")) - 1)
    requested = {rate: row[1] for rate, row in even_points(clip).items()}
    low, high, count = TOLERANCES
    tolerances = np.geomspace(low * min(requested.values()), high * max(requested.values()), count)
    result: dict[float, dict[int, tuple[float, float]]] = {}
    for delay in DELAYS:
        datagrams, size, errors = np.array([sent(clip, float(tolerance), delay) for tolerance in tolerances]).T
        result[delay] = {
            rate: (lowest(datagrams, errors, error), lowest(size, errors, error)) for rate, error in requested.items()
        }
    return result


def costs(clips: list[Clip]) -> dict[str, Any]:
    """Return the geometric means over clips, and the bytes of even streams, for each of the paper's rates."""
    of_clips = {clip.name: costs_of(clip) for clip in clips}
    even = {name: [rate * (size + STAMP + HEADERS) for rate in UPDATES] for name, size in PACKINGS.items()}
    missing = (np.nan, np.nan)
    needed = {}
    for delay in DELAYS:
        table = np.array([[costs[delay].get(rate, missing) for rate in UPDATES] for costs in of_clips.values()])
        datagrams, size = geometric_mean(table).T
        needed[f"{1e3 * delay:.0f}"] = {
            "datagrams": datagrams,
            "bytes": size,
            "saved_datagrams": 1.0 - datagrams / UPDATES,
            "saved_bytes": {name: 1.0 - size / of_even for name, of_even in even.items()},
        }
    return {"seconds": SECONDS, "clips": list(of_clips), "even": even, "needed": needed}


def packings(clip: Clip) -> dict[str, dict[str, float]]:
    """Return the bytes of a pose in each packing, and the largest shell error that it makes on a clip, in metres."""
    poses = clip.in_metres(clip.poses)
    step = CUBE / (2**PLACE_BITS - 1)
    packed = (
        poses,
        Poses(poses.positions.astype(np.float32), normalise(poses.quaternions.astype(np.float32))),
        Poses(np.rint(poses.positions / step) * step, smallest_three(poses.quaternions, TURN_BITS)),
    )
    return {
        name: {"bytes": size, "error": float(shell_error(shown, poses, RADIUS).max())}
        for (name, size), shown in zip(PACKINGS.items(), packed, strict=True)
    }
