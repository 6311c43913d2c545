"""Motion over a network, live: `stream send`, `receive`, `router` and `measure`."""

from __future__ import annotations

import argparse
import signal
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext

from rigid_motion.live.sockets import Port
from rigid_motion.motion import rms
from rigid_motion.streams import Receiver, Sender, StreamBody
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.paths import KnotPath
from rigid_motion.streams.sender import KEEPALIVE_S
from rigid_motion_batch.command_line import complain, path_line
from rigid_motion_batch.progress import Progress
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming import vmc
from rigid_motion_batch.streaming.measuring import HEADER_BYTES
from rigid_motion_batch.streaming.receiving import Receiving
from rigid_motion_batch.streaming.rooms import ANY_ADDRESS, LOOPBACK_ADDRESS, MOTION, Room, opened
from rigid_motion_batch.streaming.sending import (
    RoomSending,
    even_rate,
    found_held,
    hand_of,
    samples_of,
    starting_together,
)
from rigid_motion_batch.streaming.written import ReceivedMotion, Tracks, write_motions
from rigid_motion_batch.supervising import report, stop_signals

from . import stream_measure
from .stream_options import DEFAULT_DELAY_S, PROGRAM, parse

ROUTER_LOOK_S = 0.2
"""Seconds between two checks of a router whether to end."""

PERFORMER_LOOK_S = 0.01
"""Seconds between two looks at motion from another program."""

DUE_INTERVAL_RATIO = 0.9
"""Fraction of the interval of an even stream after which a key is due."""


def main(arguments: list[str]) -> int:
    """Run a command, and return the exit code."""
    options = parse(arguments)
    command = {"send": send, "receive": receive, "router": router, "measure": stream_measure.run}[options.command]
    stopped: list[int] = []
    try:
        with stopping() if options.command != "measure" else nullcontext(stopped) as stopped:
            command(options, stopped)
        report(ended=True)
        return 128 + stopped[0] if stopped else 0
    except (TrajectoryError, RuntimeError, ValueError) as error:
        complain(PROGRAM, error)
    except OSError as error:
        complain(PROGRAM, error, getattr(options, "output", None) or options.command)
    return 128 + stopped[0] if stopped else 2


# The commands


def send(options: argparse.Namespace, stopped: list[int]) -> None:
    """Play recordings. Raises an exception that says why they cannot be played."""
    if options.from_vmc is not None:
        send_performer(options, stopped)
        return
    clips = _read(options.recordings, options)
    rate = options.rate
    if options.to_vmc and not rate and clips[0].samples_a_second > vmc.MAX_FRAMES_PER_S:
        rate = vmc.MAX_FRAMES_PER_S
    bodies, moments, poses = starting_together(clips, rate)
    if options.to_vmc:
        with Progress() as progress, progress.stage("Playing", float(moments[-1] - moments[0])) as stage:
            _say(f"datagrams: {vmc.play(bodies[0], moments, poses, options.to_vmc, stopped, stage.reach)}")
        return
    delay = options.delay or (1.0 / options.rate if options.rate else DEFAULT_DELAY_S)
    keepalive = DUE_INTERVAL_RATIO / options.rate if options.rate else KEEPALIVE_S
    tolerance, rate = options.tolerance.tolerance(clips[0]), options.rate or even_rate(moments)
    sender = Sender(bodies, tolerance, delay, rate, keepalive)
    held = [(tool, hand_of(hand)) for tool, hand in options.held or ()] or found_held(clips)
    for tool, hand in held:
        sender.hold(tool, *hand)
    with _room(options) as room, Progress() as progress:
        _say(f"{options.user} sends {', '.join(body.name for body in bodies)} to {options.room}")
        _say(*(f"{', '.join(filter(None, hand))} holds {tool}" for tool, hand in held))
        with progress.stage("Sending", float(moments[-1] - moments[0])) as stage:
            sending = RoomSending(room, options.user, sender)

            def reach(done: float) -> None:
                stage.reach(done, f"{sending.datagrams} datagrams")

            seconds = sending.play(moments, poses, delay, stopped, reach)
            if stopped:
                stage.total = max(stage.done, 1e-9)
        a_second = 1.0 / max(seconds, 1e-9)
        headers = HEADER_BYTES * sending.datagrams
        _say(
            f"joined: {sending.joined}",
            f"datagrams: {sending.datagrams}",
            f"bytes: {sending.bytes} ({sending.bytes * a_second:.0f} a second)",
            f"bytes with headers: {sending.bytes + headers} ({(sending.bytes + headers) * a_second:.0f} a second)",
        )


def send_performer(options: argparse.Namespace, stopped: list[int]) -> None:
    """Send the motion of another program until stopped. Raises an exception that says why it cannot be sent."""
    tolerance, delay = options.tolerance.metres(1.0), options.delay or DEFAULT_DELAY_S
    sending: RoomSending | None = None
    receiver = Receiver()
    sent: tuple[StreamBody, ...] = ()
    with _room(options) as room, Port(port=options.from_vmc) as port:
        _say(f"{options.user} listens to port {port.number} and sends to {options.room}")
        while not stopped:
            for keys in vmc.performed(port, receiver):
                ahead = float(keys.moments[-1]) - time.monotonic()
                if sending is None:
                    sending = RoomSending(room, options.user, Sender(keys.bodies, tolerance, delay), ahead)
                elif keys.bodies is not sent:  # New bones or trackers appeared.
                    sending.sender = Sender(keys.bodies, tolerance, delay)
                    sending.say(sending.sender.join())
                sent, sending.ahead = keys.bodies, ahead
                for sample, moment in enumerate(keys.moments.tolist()):
                    poses = {name: poses[:, sample] for name, poses in keys.poses.items()}
                    sending.say(sending.sender.add(moment, poses))
            if sending:
                sending.answer(PERFORMER_LOOK_S)
            else:
                time.sleep(PERFORMER_LOOK_S)
        if sending is None:
            raise ValueError(f"nothing arrived by VMC at port {port.number}; give the other program this port")
        room.send(options.user, MOTION, None)
        _say(f"datagrams: {sending.datagrams}", f"bytes: {sending.bytes}")


def receive(options: argparse.Namespace, stopped: list[int]) -> None:
    """Show the received motion. Raises an exception that says why there is none."""
    truth = _read([options.truth], options)[0] if options.truth else None
    tracks = Tracks()
    with (
        _room(options) as room,
        Progress() as progress,
        closing(
            Receiving(room, options.user, options.fps, options.margin, options.to_blender, options.clean)
        ) as receiving,
    ):
        if options.to_vmc:
            to_vmc = vmc.ToVmc(options.to_vmc)
            receiving.on_frame.append(
                lambda shown: to_vmc.show((body, what.poses[body.name]) for what in shown for body in what.bodies)
            )
        if options.mode:
            receiving.on_frame.append(lambda _: tracks.add_keys(receiving.receiver.keys()))
        elif options.output or truth:
            receiving.on_frame.append(tracks.add_shown)
        receiving.on_frame.append(lambda _: _complain(receiving.receiver))
        _say(f"{options.user} listens in {options.room}")
        until = time.monotonic() + (options.seconds or float("inf"))
        with progress.stage("Receiving", options.seconds) if options.seconds else nullcontext() as stage:
            if stage:
                receiving.on_frame.append(lambda _: stage.reach(options.seconds - (until - time.monotonic())))
            receiving.listen_until(until, stopped)
            if stage:
                stage.total = max(stage.done, 1e-9)
    for user, datagrams in receiving.datagrams.items():
        _say(f"{user}: {datagrams} datagrams, {receiving.bytes[user]} bytes")
    motions, is_kept = tracks.motions(), options.mode or options.output or truth
    if not (motions if is_kept else receiving.datagrams):
        came = "nothing that can be shown arrived" if receiving.datagrams else f"no one sent anything in {options.room}"
        raise ValueError(f"{came}, so nothing is written; see --room and --at of the sender")
    if options.mode:
        motions = [motion.even(options.mode, options.fps) for motion in motions]
    for motion in motions:
        _say(f"{motion.name}: {len(motion.times)} poses{_error(motion, truth)}")
    if options.output:
        _say(*map(path_line, write_motions(options.output, motions, options.fps)))


def router(options: argparse.Namespace, stopped: list[int]) -> None:
    """Run a router that connects all participants."""
    session = opened("router", options.at, options.network, options.config)
    try:
        _say(f"Router at {options.at or options.config or (ANY_ADDRESS if options.network else LOOPBACK_ADDRESS)}")
        until = time.monotonic() + (options.seconds or float("inf"))
        while not stopped and time.monotonic() < until:
            time.sleep(min(ROUTER_LOOK_S, max(until - time.monotonic(), 0.0)))
    finally:
        session.close()


# Shared helpers


@contextmanager
def stopping() -> Iterator[list[int]]:
    """Yield a list that collects the signals to stop; after the first, a second signal ends the program as usual."""
    received: list[int] = []

    def handle(which: int, _: object) -> None:
        received.append(which)
        restore()

    before = {which: signal.signal(which, handle) for which in stop_signals()}

    def restore() -> None:
        for which, handler in before.items():
            signal.signal(which, signal.default_int_handler if handler in (None, signal.SIG_IGN) else handler)

    try:
        yield received
    finally:
        restore()


def _room(options: argparse.Namespace) -> Room:
    return Room(opened("peer", options.at, options.network, options.config), options.room)


def _read(recordings: list[str], options: argparse.Namespace) -> list[Clip]:
    clips, notes = read_clips(recordings, options.axes, options.reading)
    for note in notes:
        complain(PROGRAM, note)
    return clips


def _error(motion: ReceivedMotion, truth: Clip | None) -> str:
    """Return the error of a motion as text; "" without a truth, and a remark if the truth does not fit."""
    if truth is None:
        return ""
    times, poses = samples_of(truth)
    within = (motion.times >= times[0]) & (motion.times <= times[-1])
    if len(motion.body.joints) != len(poses) or not within.any():
        return ", which are not those of --truth"
    off = (
        Forest([motion.body])
        .errors(motion.poses[:, within], KnotPath(times, poses).at(motion.times[within]))
        .max(axis=0)
    )
    return f", error {1000.0 * rms(off):.2f} mm RMS, {1000.0 * float(off.max()):.2f} mm at most"


def _complain(receiver: Receiver) -> None:
    for line in receiver.complaints():
        complain(PROGRAM, line)


def _say(*lines: str) -> None:
    for line in lines:
        print(line, flush=True)
