"""The options of `stream`, and checks of their combinations."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rigid_motion.live.sockets import is_loopback
from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.command_line import Parser, as_called, bounded, program_of
from rigid_motion_batch.recordings.options import add_reading_options, reading_options
from rigid_motion_batch.streaming.rooms import LOOPBACK_ADDRESS, ROOM, ROUTER_PORT, USER

from . import stream_measure

DEFAULT_DELAY_S = 0.1
"""Delay in seconds, by default."""

ENDINGS = (".csv", ".bvh")

DESCRIPTION = """Motion over a network, live: bodies in rooms, each within a tolerance, in as few bytes as possible.

`send` plays recordings into a room, `receive` writes what a display would have shown of all users in it, or forwards it
to Blender, `router` connects rooms of several machines, and `measure` reports the cost of a recording.
"""

SCRIPT = "stream.py"
PROGRAM = program_of(SCRIPT)

EPILOG = """
examples, in two terminals:
  python scripts/stream.py receive --room studio --output shown.bvh
  python scripts/stream.py send walk.bvh --room studio
and on several machines, one with the router:
  python scripts/stream.py router --network
  python scripts/stream.py receive --room studio --at studio.local --to-blender 127.0.0.1:39539
  python scripts/stream.py send walk.bvh --room studio --at studio.local

`python scripts/stream.py send --help`, `receive --help`, `router --help` and `measure --help` have the options.
Exit code: 0 done, 2 a wrong option or input, or a room that is empty or cannot be reached; 130 stopped by Ctrl-C, 143
by SIGTERM, with the statistics and the file of what was shown.
"""

SEND_EPILOG = """
examples:
  python scripts/stream.py send walk.bvh --room studio
  python scripts/stream.py send log.csv:left log.csv:right --room studio --user ada --tolerance 2mm --delay 0.2
  python scripts/stream.py send hand.csv --axes unity --room studio --at studio.local --rate 20
  python scripts/stream.py send dancer.bvh sword.csv --held sword dancer:RightHand --room studio
  python scripts/stream.py send --from-vmc 39539 --room studio   a performer and trackers of another program
  python scripts/stream.py send walk.bvh --to-vmc 127.0.0.1:39539

All recordings start together and play to their end, even without listeners. Held bodies do not slip in the hand,
whatever the network loses: bodies that never move relative to another are found, --held names any other.
"""

RECEIVE_EPILOG = """
examples:
  python scripts/stream.py receive --room studio --output shown.bvh --truth walk.bvh
  python scripts/stream.py receive --room studio --output shown.csv --mode motor_spline --seconds 20
  python scripts/stream.py receive --room studio --at studio.local --to-blender 127.0.0.1:39539
  python scripts/stream.py receive --room studio --to-vmc 127.0.0.1:39540

It ends when all senders have gone, after --seconds, or at Ctrl-C. A .csv file has all bodies, in metres and Blender's
axes: device,t,x,y,z,qw,qx,qy,qz, where t is the moment of the sender's motion. A .bvh file is written
for each body, in metres.
"""

ROUTER_EPILOG = """
examples:
  python scripts/stream.py router                                this machine only
  python scripts/stream.py router --network                      all who reach this machine
  python scripts/stream.py router --config router.json5          with TLS, passwords and access rules

It runs until Ctrl-C, or for --seconds.
"""


def parse(arguments: list[str]) -> argparse.Namespace:
    """Return the options; a wrong option ends the program with exit code 2 and one line of explanation."""
    style: dict[str, Any] = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = Parser(prog=PROGRAM, description=DESCRIPTION, epilog=as_called(EPILOG, SCRIPT), **style)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    sending = commands.add_parser("send", help="play recordings", epilog=as_called(SEND_EPILOG, SCRIPT), **style)
    sending.add_argument("recordings", nargs="*", metavar="RECORDING", help="FILE, or FILE:BODY for one of several")
    help = "send the performer and trackers that arrive by VMC at this port of this machine, instead of recordings"
    sending.add_argument("--from-vmc", type=_port, metavar="PORT", help=help)
    _add_room(sending, "to send")
    help = "play it to this program by VMC instead: Blender's panel Live, VSeeFace, Warudo, Unity"
    sending.add_argument("--to-vmc", type=_address, metavar="HOST:PORT", help=help)
    help = "largest error: 5mm, 0.5cm (%(default)s)"
    sending.add_argument("--tolerance", type=Tolerance, default="5mm", metavar="LENGTH", help=help)
    sending.add_argument("--rate", type=_positive, metavar="HZ", help="send a key this many times a second")
    help = f"seconds by which it is shown later ({DEFAULT_DELAY_S}; with --rate one interval)"
    sending.add_argument("--delay", type=_delay, metavar="S", help=help)
    help = "a body held by another, or by its joint HAND:JOINT, by their names (pairs found in the recordings)"
    sending.add_argument("--held", nargs=2, action="append", metavar=("TOOL", "HAND"), help=help)
    add_reading_options(sending)

    receiving = commands.add_parser(
        "receive", help="show what comes", epilog=as_called(RECEIVE_EPILOG, SCRIPT), **style
    )
    _add_room(receiving, "to listen")
    receiving.add_argument("--output", "-o", type=_file, metavar="FILE", help="what was shown, as .csv or .bvh")
    help = "instead write the received keys with the in-betweens of this mode"
    receiving.add_argument("--mode", choices=MODES, metavar="MODE", help=help)
    help = "remove jitter from motion with all frames, without extra delay"
    receiving.add_argument("--clean", action="store_true", help=help)
    help = "forward everything to Blender's panel Live, by UDP"
    receiving.add_argument("--to-blender", type=_address, metavar="HOST:PORT", help=help)
    help = "show it to another program by VMC: the first body, and rigid bodies as trackers"
    receiving.add_argument("--to-vmc", type=_address, metavar="HOST:PORT", help=help)
    receiving.add_argument("--seconds", type=_positive, metavar="N", help="stop after this many seconds")
    help = "frames a second of the display (%(default)g)"
    receiving.add_argument("--fps", type=_fps, default=72.0, metavar="N", help=help)
    help = "extra seconds to wait for late data (%(default)g)"
    receiving.add_argument("--margin", type=_margin, default=0.0, metavar="S", help=help)
    receiving.add_argument(
        "--truth", metavar="RECORDING", help="the recording that was sent: report the error of what was shown"
    )
    add_reading_options(receiving)

    routing = commands.add_parser(
        "router", help="bring rooms together", epilog=as_called(ROUTER_EPILOG, SCRIPT), **style
    )
    _add_place(routing, "where to listen")
    routing.add_argument("--seconds", type=_positive, metavar="N", help="stop after this many seconds")

    measuring = commands.add_parser(
        "measure",
        help="measure the cost of a recording as a stream",
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


def _check(options: argparse.Namespace) -> None:
    """Check combinations of options. Raises ValueError for options that do not go together."""
    if options.command == "router":
        return
    options.reading = reading_options(options)
    if options.command == "measure":
        return
    if options.command == "send":
        if bool(options.recordings) == (options.from_vmc is not None):
            raise ValueError("give recordings, or --from-vmc PORT, and not both")
        if options.to_vmc and (options.room or len(options.recordings) != 1):
            raise ValueError("--to-vmc plays one recording to one program, without a room; leave the others out")
        if options.held and not (options.recordings and options.room):
            raise ValueError("--held is of recordings that are sent to a room; leave it out")
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
    if options.clean and options.mode:
        raise ValueError("--mode writes the keys as they came; give --clean without it")
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
    help = f"{what}: HOST, HOST:PORT, or as Zenoh writes it, tls/HOST:PORT ({LOOPBACK_ADDRESS}:{ROUTER_PORT})"
    parser.add_argument("--at", metavar="ADDRESS", help=help)
    help = "find others on the local network, and be found by them; without it this machine cannot be reached"
    parser.add_argument("--network", action="store_true", help=help)
    parser.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration of Zenoh: TLS, passwords, access rules"
    )


_positive = bounded("number above 0", 0.0, 1e6, above=True)
_delay = bounded("number of seconds", 0.0, 4.0, above=True)
_margin = bounded("number of seconds", 0.0, 60.0)
_fps = bounded("number of frames a second", 1.0, 1000.0)


def _named(pattern: re.Pattern[str], what: str) -> Callable[[str], str]:
    def parse_name(text: str) -> str:
        if not pattern.fullmatch(text):
            raise ValueError(f"{text!r} is not a name for a {what}; letters, digits, _, - and . are")
        return text

    return parse_name


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not (host and port.isascii() and port.isdecimal() and 0 < int(port) <= 65535):
        raise ValueError(f"{text!r} is not an address; give one such as {LOOPBACK_ADDRESS}:39539")
    return host.strip("[]"), int(port)


def _port(text: str) -> int:
    return _address(f"{LOOPBACK_ADDRESS}:{text}")[1]


def _file(text: str) -> Path:
    path = Path(text)
    if not text.strip() or "\0" in text or path.is_dir() or path.suffix.lower() not in ENDINGS:
        raise ValueError(f"{text!r} is not a file to write; give one that ends in {', '.join(ENDINGS)}")
    return path
