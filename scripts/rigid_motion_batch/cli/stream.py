"""Send a recorded motion over a network in real time, show what arrives, or pass on what many send.

Over UDP, between processes or machines: `send` plays a recording, `receive` writes down what a display would show at
every frame, and `relay` is a room where everybody hears all others. docs/streaming.md says what goes over the wire.
`measure` says what a recording costs by the codec of docs/wire.md.
"""

from __future__ import annotations

import argparse
import secrets
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TextIO

from rigid_motion.motion import MODES, Poses
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.analysis.metrics import lines_of_poses
from rigid_motion_batch.axes import AXES, to_blender
from rigid_motion_batch.command_line import Parser, as_called, complain, number, path_line, program_of
from rigid_motion_batch.files import replacing
from rigid_motion_batch.live import vmc
from rigid_motion_batch.progress import Progress, Stage
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.arguments import add_reading_options, reading_options
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming import PACKINGS, TWISTS, Playback
from rigid_motion_batch.streaming.endpoints import (
    LOOPBACK,
    Address,
    Endpoint,
    EndpointError,
    address_of,
    is_loopback,
    shown,
)
from rigid_motion_batch.streaming.hearing import Heard, Hearing, Truth, lines_of, lines_of_bytes
from rigid_motion_batch.streaming.needed import NeededSender
from rigid_motion_batch.streaming.playing import HEARTBEAT, Playing
from rigid_motion_batch.streaming.relay import Outgoing, Relay
from rigid_motion_batch.streaming.sources import EvenSource, NeededSource, Source
from rigid_motion_batch.supervising import report, stop_signals

from . import stream_measure

TOLERANCE, DELAY = "5mm", 0.1
"""Of a sender that sends when it must, unless they are given."""

MARGIN = 0.02
"""Seconds by which packets may take longer than the first, unless given: a frame and a half of a display."""

LOOK = 0.02
"""Seconds after which a loop looks up, whatever comes or does not."""

SHOW = 0.2
"""Seconds of frames that are worked out together: what they show does not depend on it."""

GOODBYES = (0.0, 0.05, 0.1)
"""Seconds after the end at which a sender says so: one of them may be lost."""

SCRIPT = "stream.py"
PROGRAM = program_of(SCRIPT)

EPILOG = """
examples, in two terminals:
  python scripts/stream.py receive --port 9000 --output shown.csv
  python scripts/stream.py send hand.csv --to 127.0.0.1:9000
and for many users, each with a sender and a receiver:
  python scripts/stream.py relay --port 9000
  python scripts/stream.py receive --from 127.0.0.1:9000 --output room.csv
  python scripts/stream.py send hand.csv --to 127.0.0.1:9000

`python scripts/stream.py send --help`, `receive --help`, `relay --help` and `measure --help` have the options, and more
examples.
Exit code: 0 done, 2 a wrong option or input, an address that is not available, or no sender to hear; 130 stopped by
Ctrl-C, 143 by SIGTERM, with the statistics and the file of what was shown.
"""

SEND_EPILOG = """
examples:
  python scripts/stream.py send hand.csv --to 127.0.0.1:9000
  python scripts/stream.py send log.csv:left --to [::1]:9000 --to studio.local:9000 --tolerance 2mm --delay 0.05
  python scripts/stream.py send hand.csv --axes unity --to 10.0.0.7:9000 --packing smallest_three
  python scripts/stream.py send hand.csv --to 127.0.0.1:9000 --rate 20 --mode motor_spline_causal
  python scripts/stream.py send hand.csv --port 9001            for receivers that ask for it: receive --from
  python scripts/stream.py send walk.bvh --to-vmc 127.0.0.1:39539

With --tolerance it sends a key only when the picture would otherwise be off by more than that; with --rate, so many
keys a second. Poses go over the wire in metres and in Blender's axes. It begins at once, even if nobody listens, and
takes as long as the recording.
"""

RECEIVE_EPILOG = """
examples:
  python scripts/stream.py receive --port 9000 --output shown.csv
  python scripts/stream.py receive --port 9000 --output shown.csv --truth hand.csv --seconds 20
  python scripts/stream.py receive --port 9000 --bind 0.0.0.0 --output shown.csv     from other machines
  python scripts/stream.py receive --from relay.studio:9000 --output room.csv

FILE has a row for every display frame and stream: device,t,x,y,z,qw,qx,qy,qz, in metres and Blender's axes. t is the
moment that the frame shows, by the sender's clock. compare.py reads the file: FILE:* takes all streams. It appears
when the streams have ended (the senders say so, or are silent for 10 s), after --seconds, or at Ctrl-C. The last line
printed is its path.
"""

RELAY_EPILOG = """
examples:
  python scripts/stream.py relay --port 9000
  python scripts/stream.py relay --port 9000 --bind 0.0.0.0      for other machines
  python scripts/stream.py relay --port 9000 --bind ::1          IPv6

It runs until Ctrl-C, or for --seconds, and then reports how much came from each user and went to them.
"""


class StreamError(ValueError):
    """What ends a command, with the way out."""


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options; a wrong one ends the program with code 2 and a line that says what is wrong."""
    style = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = Parser(prog=PROGRAM, description=__doc__, epilog=as_called(EPILOG, SCRIPT), **style)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    sending = commands.add_parser("send", help="play a recording", epilog=as_called(SEND_EPILOG, SCRIPT), **style)
    sending.add_argument(
        "recording", metavar="RECORDING", help="a recording of one body; FILE:BODY takes one of several"
    )
    sending.add_argument(
        "--to", action="append", default=[], metavar="HOST:PORT", help="where to send it; may be given several times"
    )
    sending.add_argument(
        "--to-vmc",
        metavar="HOST:PORT",
        help="play it as VMC instead, for a program that shows performers: Blender's "
        "panel Live, VSeeFace, Warudo, Unity",
    )
    sending.add_argument("--tolerance", metavar="LENGTH", help=f"largest shell error: 5mm, 0.5cm ({TOLERANCE})")
    sending.add_argument("--rate", type=_positive, metavar="HZ", help="send so many keys a second instead")
    sending.add_argument(
        "--delay",
        type=_positive,
        metavar="S",
        help=f"seconds by which the receiver shows it later ({DELAY}; with --rate as short as the mode allows)",
    )
    sending.add_argument(
        "--mode",
        choices=(TWISTS, *MODES),
        metavar="MODE",
        help=f"mode of the in-betweens: {TWISTS} (the default), or with --rate dq_sclerp (the default) or another "
        f"of {', '.join(MODES)}",
    )
    sending.add_argument(
        "--packing", choices=PACKINGS, default="double", help="how poses are written as bytes (%(default)s)"
    )
    sending.add_argument(
        "--heartbeat",
        type=_heartbeat,
        default=HEARTBEAT,
        metavar="S",
        help="repeat the newest key after so many seconds of silence (%(default)s)",
    )
    sending.add_argument("--port", type=_port, default=0, help="its own port, for receive --from (one that is free)")
    _add_bind(sending, "to send from (loopback if all receivers are on this machine)")
    _add_axes(sending, "of the recording")
    add_reading_options(sending)

    receiving = commands.add_parser(
        "receive", help="write what is shown", epilog=as_called(RECEIVE_EPILOG, SCRIPT), **style
    )
    receiving.add_argument("--port", type=_port, help="port that senders send to; 0 for one that is free")
    receiving.add_argument("--output", "-o", type=_file, required=True, metavar="FILE.csv", help="file to write")
    receiving.add_argument(
        "--from", dest="asked", metavar="HOST:PORT", help="ask this relay or sender, and listen to nobody else"
    )
    receiving.add_argument("--seconds", type=_positive, metavar="N", help="stop after so many seconds")
    receiving.add_argument(
        "--fps", type=_fps, default=72.0, metavar="N", help="frames a second of the display (%(default)g)"
    )
    receiving.add_argument(
        "--margin",
        type=_not_negative,
        default=MARGIN,
        metavar="S",
        help="how many seconds longer than the first a packet may take and be in time (%(default)g)",
    )
    receiving.add_argument(
        "--truth", metavar="RECORDING", help="the recording that was sent: report how far off it was shown"
    )
    _add_bind(receiving, "to listen at (loopback, or the one that reaches --from)")
    _add_axes(receiving, "of --truth")
    add_reading_options(receiving)

    relaying = commands.add_parser(
        "relay", help="pass on what everybody sends", epilog=as_called(RELAY_EPILOG, SCRIPT), **style
    )
    relaying.add_argument("--port", type=_port, required=True, help="port to listen at; 0 for one that is free")
    relaying.add_argument("--seconds", type=_positive, metavar="N", help="stop after so many seconds")
    _add_bind(relaying, "to listen at (loopback)")

    measuring = commands.add_parser(
        "measure",
        help="what a recording costs as a stream",
        description=stream_measure.__doc__,
        epilog=as_called(stream_measure.EPILOG, SCRIPT),
        **style,
    )
    stream_measure.add_options(measuring)
    add_reading_options(measuring)

    options = parser.parse_args(arguments)
    chosen = {"send": sending, "receive": receiving, "relay": relaying, "measure": measuring}[options.command]
    try:
        _check(options)
    except ValueError as error:
        chosen.error(str(error))
    return options


def main(arguments: list[str]) -> int:
    """Send, receive or relay, and return the exit code."""
    options = parse(arguments)
    if options.command == "measure":
        return _measure(options)
    command = {"send": send, "receive": receive, "relay": relay}[options.command]
    try:
        with stopping() as stopped:
            command(options, stopped)
        report(ended=True)
        return 128 + stopped[0] if stopped else 0
    except (StreamError, EndpointError, TrajectoryError) as error:
        complain(PROGRAM, error)
    except OSError as error:
        complain(PROGRAM, error, getattr(options, "output", None) or options.command)
    return 128 + stopped[0] if stopped else 2


def _measure(options: argparse.Namespace) -> int:
    try:
        stream_measure.run(options)
        report(ended=True)
        return 0
    except (TrajectoryError, RuntimeError, ValueError) as error:
        complain(PROGRAM, error)
    except OSError as error:
        complain(PROGRAM, error, options.output or options.command)
    return 2


# The commands


def send(options: argparse.Namespace, stopped: list[int]) -> None:
    """Play a recording. Raises what says why it could not be."""
    clip = read_one(options.recording, options)
    if options.to_vmc:
        send_vmc(clip, address_of(options.to_vmc), stopped)
        return
    receivers = [address_of(text) for text in options.to]
    stream = secrets.randbelow(2**32 - 1) + 1
    try:
        playing = Playing(source_of(clip, options, stream), stream, options.heartbeat, receivers)
    except ValueError as error:
        raise StreamError(f"{options.recording}: {error}") from None
    begin, end = float(clip.times[0]), float(clip.times[-1])
    with Endpoint(_hosts(options.bind, receivers), options.port) as endpoint, Progress() as progress:
        _say(f"Stream {stream:08x} from {', '.join(map(shown, endpoint.addresses))}")
        # A sender may sleep for very long, but a clock that begins anew keeps all its digits.
        started = time.monotonic()

        def now() -> float:
            return begin + time.monotonic() - started

        with progress.stage("Sending", end - begin) as stage:
            _first(endpoint, playing.due(now()))
            while not stopped and (moment := now()) < end:
                _send_all(endpoint, playing.due(moment))
                stage.reach(moment - begin, f"{playing.updates} updates")
                for datagram, address in endpoint.receive(min(playing.next() - now(), end - now(), LOOK)):
                    _send_all(endpoint, playing.accept(datagram, address, now()))
            if not stopped:
                _send_all(endpoint, playing.due(max(end, now())))
            seconds = now() - begin
            _send_all(endpoint, playing.last_beat(now()))
            stop = now()
            for after in GOODBYES:
                while now() < stop + after:
                    for _ in endpoint.receive(stop + after - now()):
                        pass
                _send_all(endpoint, playing.goodbye(min(stop, end)))
            if stopped:
                stage.total = max(stage.done, 1e-9)
        count = len(playing.receivers)
        _say(
            f"updates: {playing.updates}",
            f"heartbeats: {playing.heartbeats}",
            f"datagrams: {playing.datagrams}, to {count} receiver{'s' * (count != 1)}",
            *lines_of_bytes(playing.bytes, playing.pose_bytes, max(seconds, 1e-9)),
        )
        if endpoint.unsent:
            _say(f"not taken by the system: {endpoint.unsent}")


def send_vmc(clip: Clip, to: Address, stopped: list[int]) -> None:
    """Play a recording as VMC. Raises what says why it could not be."""
    try:
        with Progress() as progress, progress.stage("Playing", float(clip.times[-1] - clip.times[0])) as stage:
            _say(f"datagrams: {vmc.play(clip, to, stopped, stage.reach)}")
    except ValueError as error:
        raise StreamError(str(error)) from None


def receive(options: argparse.Namespace, stopped: list[int]) -> None:
    """Write what is shown. Raises what says why there is nothing."""
    truth = None
    if options.truth:
        clip = read_one(options.truth, options)
        truth = Truth(clip.times, poses_of(clip))
    asked = address_of(options.asked) if options.asked else None
    hosts = _hosts(options.bind, [asked] if asked else [])
    with Endpoint(hosts, options.port or 0) as endpoint, Progress() as progress:
        _say(f"Listening on {', '.join(map(shown, endpoint.addresses))}")
        with replacing(options.output) as file:
            file.write("device,t,x,y,z,qw,qx,qy,qz\n")
            hearing = Hearing(
                partial(_write, file), partial(_left, options.margin), options.fps, options.margin, truth, asked
            )
            with _stage(progress, "Receiving", options.seconds) as stage:
                _hear(hearing, endpoint, asked, options.seconds, stopped, stage)
            if hearing.damaged or hearing.refused:
                _say(f"damaged: {hearing.damaged} datagrams", f"refused: {hearing.refused} datagrams")
            if not hearing.shown:
                raise StreamError(_nobody(options, hearing))
    _say(path_line(options.output))


def relay(options: argparse.Namespace, stopped: list[int]) -> None:
    """Pass on what everybody sends."""
    room = Relay()
    with Endpoint(_hosts(options.bind, []), options.port) as endpoint, Progress() as progress:
        _say(f"Relaying on {', '.join(map(shown, endpoint.addresses))}")
        started, there = time.monotonic(), set()
        with _stage(progress, "Relaying", options.seconds) as stage:
            while not stopped and (now := time.monotonic() - started) < (options.seconds or float("inf")):
                for datagram, address in endpoint.receive(LOOK):
                    _send_all(endpoint, room.accept(datagram, address, time.monotonic() - started))
                room.forget(now)
                if (users := set(room.users)) != there:
                    _say(*(f"{shown(user)} is in the room" for user in users - there))
                    _say(*(f"{shown(user)} has left" for user in there - users))
                    there = users
                if stage:
                    stage.reach(now, f"{len(room.users)} users, {room.streams} streams")
            if stage and stopped:
                stage.total = max(stage.done, 1e-9)
        users = [*room.gone, *room.users.values()]
        for user in users:
            _say(
                f"{shown(user.address)}: in {user.bytes_in} bytes ({user.datagrams_in} datagrams), "
                f"out {user.bytes_out} bytes ({user.datagrams_out} datagrams)"
            )
        _say(
            f"users: {len(users)}",
            f"in: {sum(user.bytes_in for user in users)} bytes",
            f"out: {sum(user.bytes_out for user in users)} bytes",
            f"refused: {room.refused} datagrams",
        )


# What they have in common


@contextmanager
def stopping() -> Iterator[list[int]]:
    """The signals that ask for an end come into this list; the second of them ends the program as ever."""
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


def read_one(recording: str, options: argparse.Namespace) -> Clip:
    """The one body of a recording. Raises TrajectoryError and StreamError."""
    clips, notes = read_clips([recording], options.axes, options.reading)
    for note in notes:
        complain(PROGRAM, note)
    if len(clips) > 1:
        names = ", ".join(clip.name for clip in clips[:12])
        raise StreamError(
            f"{recording}: {len(clips)} bodies, and a stream is of one: {names}; name it, as {recording}:NAME"
        )
    if clips[0].figure is not None and not getattr(options, "to_vmc", None):
        raise StreamError(f"{recording}: a whole body, and a stream is of one joint; name it, as FILE:LeftHand")
    return clips[0]


def poses_of(clip: Clip) -> Poses:
    """The poses of a clip as the wire has them: in metres and in Blender's axes, without scales."""
    poses = to_blender(clip.in_metres(clip.poses), clip.axes)
    return Poses(poses.positions, poses.quaternions)


def source_of(clip: Clip, options: argparse.Namespace, stream: int) -> Source:
    """What plays a clip as the options want it. Raises ValueError for what cannot be."""
    poses, packing = poses_of(clip), PACKINGS[options.packing]
    packing.pack(poses)
    if options.rate:
        return EvenSource(clip.times, poses, options.rate, packing, stream, options.mode or "dq_sclerp", options.delay)
    mode = options.mode or TWISTS
    sender = NeededSender(options.tolerance.tolerance(clip), options.delay or DELAY, mode, packing=packing)
    return NeededSource(clip.times, poses, sender, packing, stream, mode)


def _hear(
    hearing: Hearing,
    endpoint: Endpoint,
    asked: Address | None,
    seconds: float | None,
    stopped: list[int],
    stage: Stage | None,
) -> None:
    """Hear what comes, until there is an end of it."""
    started = time.monotonic()

    def now() -> float:
        return time.monotonic() - started

    end, next_show = seconds or float("inf"), SHOW
    while not stopped and not hearing.over and now() < end:
        if asked and (hello := hearing.ask(now())):
            endpoint.send(hello, asked)
        for datagram, address in endpoint.receive(min(LOOK, end - now())):
            hearing.accept(datagram, address, now())
        if (moment := now()) >= next_show:
            hearing.show(min(moment, end))
            next_show = moment + SHOW
            if stage:
                stage.reach(moment, f"{hearing.streams} streams")
    if stage and (stopped or hearing.over):
        stage.total = max(stage.done, 1e-9)
    hearing.finish(min(now(), end))
    if asked:
        endpoint.send(hearing.goodbye(), asked)


def _write(file: TextIO, number: int, frames: Playback) -> None:
    columns = [frames.moments, *frames.poses.positions.T, *frames.poses.quaternions.T]
    for _, lines in lines_of_poses(columns):
        file.write("".join(f"stream-{number:08x},{line}\n" for line in lines))


def _left(margin: float, stream: Heard) -> None:
    name = f"stream-{stream.receiver.stream:08x}"
    _say(f"{name} from {shown(stream.address)}", *(f"  {line}" for line in lines_of(stream, margin)))


def _nobody(options: argparse.Namespace, hearing: Hearing) -> str:
    """What there is to say where nothing was shown."""
    if hearing.heard:
        return "nothing that could be shown came before the end, so no file was written"
    within = f" within {options.seconds:g} s" if options.seconds else ""
    advice = (
        f"see that it runs at {options.asked}"
        if options.asked
        else "start it after the receiver, with --to this address"
    )
    return f"no sender came{within}, so no file was written; {advice}"


def _stage(progress: Progress, title: str, seconds: float | None) -> AbstractContextManager[Stage | None]:
    """A stage of so many seconds, where they are known."""
    return progress.stage(title, seconds) if seconds else nullcontext()


def _first(endpoint: Endpoint, outgoing: Outgoing) -> None:
    """Send the first datagrams, of which none may fail: the address would be wrong, and not the moment."""
    for datagram, address in outgoing:
        if not endpoint.send(datagram, address):
            raise StreamError(f"there is no way to {shown(address)} from here; see --to, and --bind if it is given")


def _send_all(endpoint: Endpoint, outgoing: Outgoing) -> None:
    for datagram, address in outgoing:
        endpoint.send(datagram, address)


def _hosts(bind: str | None, others: list[Address]) -> list[str]:
    """The addresses to bind to: what was asked for, or else in each family of the others loopback where it will do."""
    if bind:
        return [bind]
    if not others:
        return [LOOPBACK]
    hosts = []
    for size, loopback, everywhere in ((2, LOOPBACK, "0.0.0.0"), (4, "::1", "::")):
        family = [address for address in others if len(address) == size]
        if family:
            hosts.append(loopback if all(map(is_loopback, family)) else everywhere)
    return hosts


def _say(*lines: str) -> None:
    for line in lines:
        print(line, flush=True)


# Options


def _check(options: argparse.Namespace) -> None:
    """Look at what options mean together. Raises ValueError for those that do not go together."""
    if options.command == "relay":
        return
    options.reading = reading_options(options)
    if options.command == "measure":
        return
    if options.command == "receive":
        if options.port is None and not options.asked:
            raise ValueError("nobody knows where to send to: give --port P, or ask somebody with --from HOST:PORT")
        if options.truth and options.output.exists() and options.output.resolve() == Path(options.truth).resolve():
            raise ValueError(f"--output {options.output} is the recording of --truth; choose another file")
        return
    if options.rate and options.tolerance:
        raise ValueError("--rate and --tolerance exclude one another: keys come evenly, or when they are needed")
    if not options.to and not options.port and not options.to_vmc:
        raise ValueError("nobody would hear it: give --to HOST:PORT, or a --port where others can ask for it")
    options.tolerance = Tolerance(options.tolerance or TOLERANCE)


def _add_bind(parser: argparse.ArgumentParser, of: str) -> None:
    parser.add_argument("--bind", metavar="ADDRESS", help=f"address {of}")


def _add_axes(parser: argparse.ArgumentParser, of: str) -> None:
    parser.add_argument("--axes", type=str.lower, choices=AXES, help=f"axes {of} (opengl for BVH, blender for others)")


def _bounded(what: str, least: float, most: float, above: bool = False) -> Callable[[str], float]:
    def parse_number(text: str) -> float:
        value = number(text)
        if not least <= value <= most or (above and value == least):
            raise argparse.ArgumentTypeError(f"{text!r} is no {what}; give {'more than ' * above}{least:g} to {most:g}")
        return value

    return parse_number


_positive = _bounded("number above 0", 0.0, 1e6, above=True)
_not_negative = _bounded("number of seconds", 0.0, 60.0)
_heartbeat = _bounded("number of seconds between heartbeats", 0.05, 5.0)
_fps = _bounded("number of frames a second", 1.0, 1000.0)


def _port(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"{text!r} is no port; give one from 1024 to 65535, or 0 for one that is free")
    return int(text)


def _file(text: str) -> Path:
    path = Path(text)
    if not text.strip() or "\0" in text or path.is_dir() or path.suffix.lower() != ".csv":
        raise argparse.ArgumentTypeError(f"{text!r} is no file to write; give one such as shown.csv")
    return path
