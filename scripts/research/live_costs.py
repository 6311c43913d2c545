"""What bodies cost live, beside packed poses at even rates, beside game engines, and in a room of many.

    python scripts/research live_costs ../shared/data/rigs ../shared/data/recordings --output docs/live_costs.md
    python scripts/research live_costs ../shared/data/rigs --only bodies

Whole bodies and single hands are sent by the codec of [the wire](wire.md) over UDP on loopback; a receiver in another
process shows them, and goes by the recording's clock, however busy the machine is. Bytes are those of datagrams with
the 28 bytes of UDP and IPv4 around each, without what somebody who joins is told once. Errors are the largest of any
joint's ball of 3 cm, in the root's space, at every sample.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import numpy as np

from research.live_streams.engines import ENGINES, FPS, RATE, Seen, Way, by_codec, by_engine, seen, truth_of
from research.live_streams.room import Room, figures
from research.publishing import opening
from rigid_motion_batch.cli.stream_measure import packed
from rigid_motion_batch.command_line import parser_of
from rigid_motion_batch.files import write_text
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.streaming.measuring import Cost, measure
from rigid_motion_batch.streaming.sending import body_of, samples_of

RADIUS, TOLERANCE, DELAYS = 0.03, 0.005, (0.1, 0.2)

FLOATS = "float32 at 30 Hz"
"""In the paper's words the state of the art: position and rotation of every joint at an even rate."""

WAYS = {
    "20 ms": Way(0.02, 0.02, 0.0),
    "250 ± 40 ms": Way(0.21, 0.29, 0.0),
    "250 ± 40 ms, 1 % lost": Way(0.21, 0.29, 0.01),
    "250 ± 40 ms, 5 % lost": Way(0.21, 0.29, 0.05),
    "250 ± 40 ms, 20 % lost": Way(0.21, 0.29, 0.2),
}
"""Links for game engines and us."""

HAND = "aframe_right"
"""Whose hand holds the tool."""

USERS, SECONDS = 30, 20.0


@dataclass
class Measured:
    """A recording at all delays."""

    name: str
    joints: int
    costs: list[Cost] = field(default_factory=list)
    beside: dict[str, dict[str, float]] = field(default_factory=dict)


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, and write where asked."""
    parser = parser_of("live_costs.py", __doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="recordings and rigs")
    parser.add_argument(
        "--only", nargs="+", choices=("bodies", "engines", "room"), default=["bodies", "engines", "room"]
    )
    parser.add_argument("--output", type=Path, help="a Markdown file to write to")
    options = parser.parse_args(arguments)
    paths = sorted(path for folder in options.folders for path in folder.rglob("*"))
    paths = [path for path in paths if path.suffix in {".bvh", ".fbx", ".csv", ".tum"}]
    command = f"python scripts/research live_costs {' '.join(map(str, options.folders))}"
    lines = opening("Bodies live: what they cost", command, __doc__)
    if "bodies" in options.only:
        lines += bodies(paths)
    if "engines" in options.only:
        lines += engines(next(path for path in paths if path.stem == HAND))
    if "room" in options.only:
        lines += room()
    print("\n".join(lines))
    if options.output:
        write_text(options.output, "\n".join(lines) + "\n")
    return 0


def measured(path: Path) -> Iterator[Measured]:
    """What each body of a file costs."""
    for clip in read_clips([str(path)])[0]:
        print(clip.name, file=sys.stderr, flush=True)
        times, poses = samples_of(clip)
        body = body_of(clip, poses, RADIUS)
        found = Measured(clip.name, len(body.joints), beside=packed(body, times, poses))
        found.costs = [measure(body, times, poses, TOLERANCE, delay).cost for delay in DELAYS]
        yield found


def bodies(paths: list[Path]) -> list[str]:
    """Two tables: whole bodies, and single hands and heads."""
    every = [found for path in paths for found in measured(path)]
    whole, single = [[one for one in every if (one.joints > 1) == many] for many in (True, False)]
    return [*_table("Whole bodies", whole), *_table("Single hands and heads", single)]


def _table(title: str, rows: list[Measured]) -> list[str]:
    if not rows:
        return []
    needed = [f"when needed, {1000.0 * delay:.0f} ms" for delay in DELAYS]
    labels = [*needed, *rows[0].beside]
    lines = [
        f"## {title}",
        "",
        "Bytes a second with all headers; RMS and largest error in mm.",
        "",
        f"| recording | joints | {' | '.join(labels)} |",
        f"| --- | ---: | {' | '.join('---:' for _ in labels)} |",
    ]
    found: dict[str, list[tuple[float, float, float]]] = {label: [] for label in labels}
    for row in rows:
        for label, cost in zip(labels, [vars(cost) for cost in row.costs] + list(row.beside.values()), strict=True):
            found[label].append((cost["bytes_a_second_with_headers"], cost["rms_mm"], cost["largest_mm"]))
        cells = [f"{own[-1][0]:.0f}; {own[-1][1]:.1f}; {own[-1][2]:.1f}" for own in found.values()]
        lines.append(f"| {row.name} | {row.joints} | {' | '.join(cells)} |")
    middle = {label: [median(values) for values in zip(*own, strict=True)] for label, own in found.items()}
    lines.append(f"| *median* | | {' | '.join(f'*{a:.0f}; {b:.1f}; {c:.1f}*' for a, b, c in middle.values())} |")
    lines.append(f"| *largest* | | {' | '.join('*' + _largest(own) + '*' for own in found.values())} |")
    lines.append("")
    shares = [[own[0] / even[0] for own, even in zip(found[label], found[FLOATS], strict=True)] for label in needed]
    saved = [f"{100.0 * (1.0 - median(share)):.0f} % less" for share in shares]
    lines += [
        f"In the words of the paper: shown within {1000.0 * TOLERANCE:g} mm, a body that is sent when needed has "
        f"{saved[0]} bandwidth at a delay of {1000.0 * DELAYS[0]:.0f} ms, and {saved[1]} at "
        f"{1000.0 * DELAYS[1]:.0f} ms, than position and rotation of every joint 30 times a second in single precision "
        "(medians). The paper has 33 to 58 % less for single hands, at equal errors.",
        "",
    ]
    return lines


def _largest(values: list[tuple[float, float, float]]) -> str:
    return "{:.0f}; {:.1f}; {:.1f}".format(*(max(column) for column in zip(*values, strict=True)))


def engines(path: Path) -> list[str]:
    """A table of what game engines show, and we."""
    clip = read_clips([str(path)])[0][0]
    times, poses = samples_of(clip)
    truth = truth_of(times, poses[0])
    frames = np.arange(0.5, float(truth.moments[-1]), 1.0 / FPS)
    even = 2.0 * RATE * (7 * 4 + 28)
    lines = [
        "## Beside game engines",
        "",
        f"The hand of `{clip.name}` with a tool 30 cm off, over links that take so long and lose so much. Models of "
        "Mirror's snapshot interpolation, of the lerp of lerp of Netcode for GameObjects and of Godot's synchronizer "
        "(`research/live_streams/engines.py` says what each does), all with 30 poses a second in single precision; "
        f"ours at {1000.0 * TOLERANCE:g} mm and 100 ms. Errors of the hand at the delay that suits it best, in mm; a "
        "freeze stands for 0.1 s while the hand moves, a jump back goes 5 mm against its way in one picture; slip is "
        "how far the tool is from its place in the hand.",
        "",
        "| link | shown by | bytes/s | delay s | RMS | 98 % within | largest | freezes | jumps back | slip, 98 % |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    beside = []
    for label, way in WAYS.items():
        found = {engine: seen(by_engine(engine, truth, way, frames), truth, frames) for engine in ENGINES}
        lines += [_seen(label, engine, even, it) for engine, it in found.items()]
        shown, size = by_codec(truth, way, frames, TOLERANCE, DELAYS[0])
        sent = seen(shown, truth, frames)
        lines.append(_seen(label, "sent when needed", size, sent))
        beside.append((found["Mirror"].rms_mm < sent.rms_mm, found["Mirror"].slip_mm < sent.slip_mm, even / size))
    closer, holds, bytes_more = zip(*beside, strict=True)
    return [
        *lines,
        "",
        f"Mirror's is the best of the engines. It has a smaller RMS than we on {sum(closer)} of {len(WAYS)} links and "
        f"less slip on {sum(holds)}, for {min(bytes_more):.1f} to {max(bytes_more):.1f} times the bytes.",
        "",
    ]


def _seen(label: str, who: str, size: float, it: Seen) -> str:
    return (
        f"| {label} | {who} | {size:.0f} | {it.delay:.2f} | {it.rms_mm:.1f} | {it.p98_mm:.0f} | {it.largest_mm:.0f} | "
        f"{it.freezes} | {it.jumps_back} | {it.slip_mm:.0f} |"
    )


def room() -> list[str]:
    """A room of many on this machine, and one of a thousand by calculation."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    found: Room = figures(USERS, SECONDS)
    users = 1000
    return [
        "## A room",
        "",
        f"{USERS} users, each a process with a session of Zenoh, through one router over TCP on loopback; each sends "
        f"20 datagrams a second of the codec ({found.bytes:.0f} bytes on average) and hears all others, for "
        f"{SECONDS:.0f} s on {os.cpu_count()} processors with a load of {load:.1f} before.",
        "",
        f"- {found.heard} of {found.expected} datagrams were heard; latency {found.median_ms:.1f} ms (median), "
        f"{found.p99_ms:.1f} ms (99 %).",
        f"- Processor: router {found.router:.0%} of one, all users {found.users:.0%}: "
        f"{1e6 * found.router / found.rate:.0f} µs a datagram handed on, {1e6 * found.users / found.rate:.0f} µs a "
        "datagram heard in Python.",
        f"- By calculation, {users} users who all hear all: {20 * users * (users - 1) / 1e6:.0f} million datagrams a "
        f"second, {20 * users * (users - 1) * found.router / found.rate:.0f} processors of routers and "
        f"{20 * (users - 1) * (found.bytes + 28) / 1e6:.1f} MB/s to each user; who hears the nearest 30 only: "
        f"{20 * users * 30 / 1e6:.1f} million, {20 * users * 30 * found.router / found.rate:.0f} processors, "
        f"{20 * 30 * (found.bytes + 28) / 1e3:.0f} kB/s.",
        "",
    ]
