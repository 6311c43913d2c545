"""Motion over a network, live: bodies in rooms, each within a tolerance and for as few bytes as that takes.

`send` plays recordings into a room, `receive` writes what a display would have shown of all who are in it, or hands it
to Blender, `router` brings rooms of several machines together, and `measure` says what a recording costs.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from pathlib import Path

from rigid_motion.motion import MODES, rms
from rigid_motion.streams import Body, Sender
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.command_line import Parser, as_called, complain, number, path_line, program_of
from rigid_motion_batch.progress import Progress, Stage
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.arguments import add_reading_options, reading_options
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming import vmc
from rigid_motion_batch.streaming.measuring import straight
from rigid_motion_batch.streaming.receiving import Handing, Receiving, Tracks, errors
from rigid_motion_batch.streaming.rooms import (
    EVERYWHERE,
    HERE,
    MOTION,
    PORT,
    ROOM,
    USER,
    Room,
    RoomError,
    is_loopback,
    opened,
)
from rigid_motion_batch.streaming.sending import Sending, play, samples_of, sender_of, together
from rigid_motion_batch.streaming.transports import HEADERS
from rigid_motion_batch.streaming.written import Motion, write_motions
from rigid_motion_batch.supervising import report, stop_signals

from . import stream_measure

DELAY = 0.1
"""Seconds, unless they are given."""

ENDINGS = (".csv", ".bvh", ".tum")

LOOK = 0.2
"""Seconds after which a router looks up."""

FRAME = 0.01
"""Seconds after which what another program performs is looked at."""

SCRIPT = "stream.py"
PROGRAM = program_of(SCRIPT)

EPILOG = """
examples, in two terminals:
  python scripts/stream.py receive --room studio --output shown.bvh
  python scripts/stream.py send walk.bvh --room studio
and on several machines, of which one has the router:
  python scripts/stream.py router --network
  python scripts/stream.py receive --room studio --at studio.local --to-blender 127.0.0.1:39539
  python scripts/stream.py send walk.bvh --room studio --at studio.local

`python scripts/stream.py send --help`, `receive --help`, `router --help` and `measure --help` have the options.
Exit code: 0 done, 2 a wrong option or input, a room that cannot be reached, or nobody in it; 130 stopped by Ctrl-C, 143
by SIGTERM, with the statistics and the file of what was shown.
"""

SEND_EPILOG = """
examples:
  python scripts/stream.py send walk.bvh --room studio
  python scripts/stream.py send log.csv:left log.csv:right --room studio --user ada --tolerance 2mm --delay 0.2
  python scripts/stream.py send hand.csv --axes unity --room studio --at studio.local --rate 20
  python scripts/stream.py send --from-vmc 39539 --room studio   a performer and trackers of another program
  python scripts/stream.py send walk.bvh --to-vmc 127.0.0.1:39539

All recordings begin together, and take as long as they take, even if nobody listens.
"""

RECEIVE_EPILOG = """
examples:
  python scripts/stream.py receive --room studio --output shown.bvh --truth walk.bvh
  python scripts/stream.py receive --room studio --output shown.csv --mode motor_spline --seconds 20
  python scripts/stream.py receive --room studio --at studio.local --to-blender 127.0.0.1:39539
  python scripts/stream.py receive --room studio --to-vmc 127.0.0.1:39540

It ends when all who sent have gone, after --seconds, or at Ctrl-C. A .csv file has all bodies, in metres and Blender's
axes: device,t,x,y,z,qw,qx,qy,qz, where t is the moment of the sender's motion. Of .bvh and .tum there is one for each
body, in metres.
"""

ROUTER_EPILOG = """
examples:
  python scripts/stream.py router                                this machine alone
  python scripts/stream.py router --network                      all who reach this machine
  python scripts/stream.py router --config router.json5          with TLS, passwords and access rules

It runs until Ctrl-C, or for --seconds.
"""


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options; a wrong one ends the program with code 2 and a line that says what is wrong."""
    style = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = Parser(prog=PROGRAM, description=__doc__, epilog=as_called(EPILOG, SCRIPT), **style)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    sending = commands.add_parser("send", help="play recordings", epilog=as_called(SEND_EPILOG, SCRIPT), **style)
    sending.add_argument("recordings", nargs="*", metavar="RECORDING", help="FILE, or FILE:BODY for one of several")
    help = "send the performer and trackers that come by VMC to this port of this machine, instead of recordings"
    sending.add_argument("--from-vmc", type=_port, metavar="PORT", help=help)
    _add_room(sending, "to send")
    help = "play it to this program by VMC instead: Blender's panel Live, VSeeFace, Warudo, Unity"
    sending.add_argument("--to-vmc", type=_address, metavar="HOST:PORT", help=help)
    sending.add_argument("--tolerance", default="5mm", metavar="LENGTH", help="largest error: 5mm, 0.5cm (%(default)s)")
    sending.add_argument("--rate", type=_positive, metavar="HZ", help="send a key at each of so many ticks a second")
    help = f"seconds by which it is shown later ({DELAY}; with --rate one interval)"
    sending.add_argument("--delay", type=_delay, metavar="S", help=help)
    add_reading_options(sending)

    receiving = commands.add_parser(
        "receive", help="show what comes", epilog=as_called(RECEIVE_EPILOG, SCRIPT), **style
    )
    _add_room(receiving, "to listen")
    receiving.add_argument("--output", "-o", type=_file, metavar="FILE", help="what was shown, as .csv, .bvh or .tum")
    help = "write the keys that came with the in-betweens of this mode instead"
    receiving.add_argument("--mode", choices=MODES, metavar="MODE", help=help)
    help = "hand everything on to the panel Live of Blender, by UDP"
    receiving.add_argument("--to-blender", type=_address, metavar="HOST:PORT", help=help)
    help = "show it to another program by VMC: the first body there is, and rigid bodies as trackers"
    receiving.add_argument("--to-vmc", type=_address, metavar="HOST:PORT", help=help)
    receiving.add_argument("--seconds", type=_positive, metavar="N", help="stop after so many seconds")
    help = "frames a second of the display (%(default)g)"
    receiving.add_argument("--fps", type=_fps, default=72.0, metavar="N", help=help)
    help = "seconds that are waited longer for what is late (%(default)g)"
    receiving.add_argument("--margin", type=_margin, default=0.0, metavar="S", help=help)
    receiving.add_argument("--truth", metavar="RECORDING", help="what was sent: report how far off it was shown")
    add_reading_options(receiving)

    routing = commands.add_parser(
        "router", help="bring rooms together", epilog=as_called(ROUTER_EPILOG, SCRIPT), **style
    )
    _add_place(routing, "where to listen")
    routing.add_argument("--seconds", type=_positive, metavar="N", help="stop after so many seconds")

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
    chosen = {"send": sending, "receive": receiving, "router": routing, "measure": measuring}[options.command]
    try:
        _check(options)
    except ValueError as error:
        chosen.error(str(error))
    return options


def main(arguments: list[str]) -> int:
    """Do a command, and return the exit code."""
    options = parse(arguments)
    command = {"send": send, "receive": receive, "router": router, "measure": measure}[options.command]
    stopped: list[int] = []
    try:
        with stopping() if command is not measure else nullcontext([]) as stopped:
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
    """Play recordings. Raises what says why they could not be."""
    if options.from_vmc is not None:
        send_performer(options, stopped)
        return
    clips = _read(options.recordings, options)
    if options.to_vmc:
        with Progress() as progress, progress.stage("Playing", float(clips[0].times[-1] - clips[0].times[0])) as stage:
            _say(f"datagrams: {vmc.play(clips[0], options.to_vmc, stopped, stage.reach)}")
        return
    bodies, moments, poses = together(clips, options.rate)
    delay = options.delay or (1.0 / options.rate if options.rate else DELAY)
    sender = sender_of(bodies, moments, Tolerance(options.tolerance).tolerance(clips[0]), delay, options.rate)
    with _room(options) as room, Progress() as progress:
        sending = Sending(room, options.user, sender)
        _say(f"{options.user} sends {', '.join(body.name for body in bodies)} to {options.room}")
        with progress.stage("Sending", float(moments[-1] - moments[0])) as stage:
            seconds = play(
                sending,
                moments,
                poses,
                delay,
                stopped,
                lambda done: stage.reach(done, f"{sending.datagrams} datagrams"),
            )
            if stopped:
                stage.total = max(stage.done, 1e-9)
        a_second = 1.0 / max(seconds, 1e-9)
        headers = HEADERS * sending.datagrams
        _say(
            f"joined: {sending.joined}",
            f"datagrams: {sending.datagrams}",
            f"bytes: {sending.bytes} ({sending.bytes * a_second:.0f} a second)",
            f"bytes with headers: {sending.bytes + headers} ({(sending.bytes + headers) * a_second:.0f} a second)",
        )


def send_performer(options: argparse.Namespace, stopped: list[int]) -> None:
    """Send what another program performs until that is to end. Raises what says why it could not be."""
    tolerance, delay = Tolerance(options.tolerance).metres(1.0), options.delay or DELAY
    sending: Sending | None = None
    sent: tuple[Body, ...] = ()
    with _room(options) as room, vmc.Performers(options.from_vmc) as performers:
        _say(f"{options.user} listens to port {performers.port} and sends to {options.room}")
        while not stopped:
            for bodies, moments, poses in performers.samples():
                if sending is None:
                    sending = Sending(room, options.user, Sender(bodies, tolerance, delay))
                elif bodies is not sent:  # Bones or trackers came that were not there before.
                    sending.sender = Sender(bodies, tolerance, delay)
                    sending.say(sending.sender.join())
                sent = bodies
                for sample, moment in enumerate(moments.tolist()):
                    sending.say(sending.sender.add(moment, poses[:, sample]))
                ahead = float(moments[-1]) - time.monotonic()
            for came in room.come(FRAME):
                if sending:
                    sending.take(came, time.monotonic() + ahead)
        if sending is None:
            raise RoomError(f"nothing came by VMC at port {performers.port}; give the other program this port")
        room.leave(options.user, MOTION)
        _say(f"datagrams: {sending.datagrams}", f"bytes: {sending.bytes}")


def receive(options: argparse.Namespace, stopped: list[int]) -> None:
    """Show what comes. Raises what says why there is nothing."""
    truth = _read([options.truth], options)[0] if options.truth else None
    handing = Handing(*options.to_blender) if options.to_blender else None
    with (
        _room(options) as room,
        Progress() as progress,
        closing(handing) if handing else nullcontext(),
    ):
        keeps = bool(options.output or truth)
        receiving = Receiving(room, options.user, options.fps, options.margin, handing, keeps)
        if options.to_vmc:
            receiving.on_frame.append(vmc.ToVmc(receiving.receiver, options.to_vmc))
        _say(f"{options.user} listens in {options.room}")
        until = time.monotonic() + (options.seconds or float("inf"))
        with _stage(progress, "Receiving", options.seconds) as stage:
            if stage:
                receiving.on_frame.append(lambda _: stage.reach(options.seconds - (until - time.monotonic())))
            receiving.hear(until, stopped)
            if stage:
                stage.total = max(stage.done, 1e-9)
    for user, datagrams in receiving.datagrams.items():
        _say(f"{user}: {datagrams} datagrams, {receiving.bytes[user]} bytes")
    motions = _motions(receiving.shown)
    if not (motions if keeps else receiving.datagrams):
        came = "nothing that could be shown came" if receiving.datagrams else f"nobody sent anything in {options.room}"
        raise RoomError(f"{came}, so nothing is written; see --room and --at of the sender")
    if options.mode:
        motions = [motion.even(options.mode, options.fps) for motion in _motions(receiving.keys)]
    for motion in motions:
        _say(f"{motion.name}: {len(motion.times)} poses{_error(motion, truth)}")
    if options.output:
        _say(*map(path_line, write_motions(options.output, motions, options.fps)))


def router(options: argparse.Namespace, stopped: list[int]) -> None:
    """Bring together all who come."""
    session = opened("router", options.at, options.network, options.config)
    try:
        _say(f"Router at {options.at or options.config or (EVERYWHERE if options.network else HERE)}")
        until = time.monotonic() + (options.seconds or float("inf"))
        while not stopped and time.monotonic() < until:
            time.sleep(min(LOOK, max(until - time.monotonic(), 0.0)))
    finally:
        session.close()


def measure(options: argparse.Namespace, _: list[int]) -> None:
    """What a recording costs."""
    stream_measure.run(options)


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


def _room(options: argparse.Namespace) -> Room:
    return Room(opened("peer", options.at, options.network, options.config), options.room)


def _read(recordings: list[str], options: argparse.Namespace) -> list[Clip]:
    clips, notes = read_clips(recordings, options.axes, options.reading)
    for note in notes:
        complain(PROGRAM, note)
    return clips


def _motions(tracks: Tracks) -> list[Motion]:
    return [
        Motion(f"{track.user}-{track.body.name}", track.body, *track.samples())
        for track in tracks.values()
        if len(track.moments) > 1
    ]


def _error(motion: Motion, truth: Clip | None) -> str:
    """How far off a motion is, as text; nothing where the truth has other joints."""
    if truth is None:
        return ""
    times, poses = samples_of(truth)
    within = (motion.times >= times[0]) & (motion.times <= times[-1])
    if len(motion.body.joints) != len(poses) or not within.any():
        return ", which are not those of --truth"
    off = errors(motion.body, motion.poses[:, within], straight(times, poses).at(motion.times[within]))
    return f", error {1000.0 * rms(off):.2f} mm RMS, {1000.0 * float(off.max()):.2f} mm at most"


def _stage(progress: Progress, title: str, seconds: float | None) -> AbstractContextManager[Stage | None]:
    """A stage of so many seconds, where they are known."""
    return progress.stage(title, seconds) if seconds else nullcontext()


def _say(*lines: str) -> None:
    for line in lines:
        print(line, flush=True)


# Options


def _check(options: argparse.Namespace) -> None:
    """Look at what options mean together. Raises ValueError for those that do not go together."""
    if options.command == "router":
        return
    options.reading = reading_options(options)
    if options.command == "measure":
        return
    if options.command == "send":
        Tolerance(options.tolerance)
        if bool(options.recordings) == (options.from_vmc is not None):
            raise ValueError("give recordings, or --from-vmc PORT, and not both")
        if options.to_vmc and (options.room or len(options.recordings) != 1):
            raise ValueError("--to-vmc plays one recording to one program, without a room; leave the others out")
        if not (options.room or options.to_vmc):
            raise ValueError("give --room NAME, which receivers give as well, or --to-vmc HOST:PORT")
    elif not options.room:
        raise ValueError("give --room NAME, as the sender does")
    for name in ("to_vmc", "to_blender"):
        to = getattr(options, name, None)
        if to and not (options.network or is_loopback(to[0])):
            option = f"--{name.replace('_', '-')}"
            raise ValueError(f"{option} sends to another machine; give --network as well, if that is what you want")
    if options.command != "receive":
        return
    if (
        options.truth
        and options.output
        and options.output.exists()
        and options.output.resolve() == Path(options.truth).resolve()
    ):
        raise ValueError(f"--output {options.output} is the recording of --truth; choose another file")


def _add_room(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument("--room", type=_named(ROOM, "room"), metavar="NAME", help=f"where {what}")
    own = re.sub(r"[^\w.-]+", "_", os.environ.get("USER") or os.environ.get("USERNAME") or "user")
    help = "who you are in the room (%(default)s)"
    parser.add_argument("--user", type=_named(USER, "user"), default=own, metavar="NAME", help=help)
    _add_place(parser, "the router of the room, if it is not on this machine")


def _add_place(parser: argparse.ArgumentParser, what: str) -> None:
    help = f"{what}: HOST, HOST:PORT, or as Zenoh writes it, tls/HOST:PORT ({HERE}:{PORT})"
    parser.add_argument("--at", metavar="ADDRESS", help=help)
    help = "find others on the local network, and be found by them; without it nobody reaches this machine"
    parser.add_argument("--network", action="store_true", help=help)
    parser.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration of Zenoh: TLS, passwords, access rules"
    )


def _bounded(what: str, least: float, most: float, above: bool = False) -> Callable[[str], float]:
    def parse_number(text: str) -> float:
        value = number(text)
        if not least <= value <= most or (above and value == least):
            raise argparse.ArgumentTypeError(f"{text!r} is no {what}; give {'more than ' * above}{least:g} to {most:g}")
        return value

    return parse_number


_positive = _bounded("number above 0", 0.0, 1e6, above=True)
_delay = _bounded("number of seconds", 0.0, 4.0, above=True)
_margin = _bounded("number of seconds", 0.0, 60.0)
_fps = _bounded("number of frames a second", 1.0, 1000.0)


def _named(pattern: re.Pattern[str], what: str) -> Callable[[str], str]:
    def parse_name(text: str) -> str:
        if not pattern.fullmatch(text):
            raise argparse.ArgumentTypeError(f"{text!r} is no name of a {what}; letters, digits, _, - and . are")
        return text

    return parse_name


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not (host and port.isascii() and port.isdecimal() and 0 < int(port) <= 65535):
        raise argparse.ArgumentTypeError(f"{text!r} is no address; give one such as {HERE}:39539")
    return host.strip("[]"), int(port)


def _port(text: str) -> int:
    return _address(f"{HERE}:{text}")[1]


def _file(text: str) -> Path:
    path = Path(text)
    if not text.strip() or "\0" in text or path.is_dir() or path.suffix.lower() not in ENDINGS:
        raise argparse.ArgumentTypeError(f"{text!r} is no file to write; give one that ends in {', '.join(ENDINGS)}")
    return path
