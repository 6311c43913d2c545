"""What bodies cost live, beside packed poses at even rates, beside game engines, and in a room of many.

    python scripts/research live_costs FOLDER ...

Whole bodies and single hands are sent by the codec of [the wire](wire.md) over UDP on loopback; a receiver in another
process shows them, and goes by the recording's clock, however busy the machine is. Bytes are those of datagrams with
the 28 bytes of UDP and IPv4 around each, without what somebody who joins is told once. Errors are the largest of any
joint's ball of 3 cm, in the root's space, at every sample.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from research.live_streams.engines import ENGINES, FPS, RATE, Way, by_codec, by_engine, seen, truth_of
from research.live_streams.room import figures
from research.publishing import publish, say, study_parser
from rigid_motion_batch.cli.stream_measure import packed
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming.measuring import measure
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
"""The clip of the hand that holds the tool."""

USERS, SECONDS = 30, 20.0


COST = {"bytes": "bytes_a_second_with_headers", "rms_mm": "rms_mm", "largest_mm": "largest_mm"}
"""By the names that they have here."""

Costs = dict[str, dict[str, float]]
"""Figures by way to send."""


def costs_of(clip: Clip) -> tuple[int, Costs]:
    """The joints of a body, and what each way to send it costs."""
    say(clip.name)
    times, poses = samples_of(clip)
    body = body_of(clip, poses, RADIUS)
    result = {needed(delay): vars(measure(body, times, poses, TOLERANCE, delay)[0]) for delay in DELAYS}
    result |= packed(body, times, poses)
    return len(body.joints), {way: {name: cost[key] for name, key in COST.items()} for way, cost in result.items()}


def needed(delay: float) -> str:
    """The name of what is sent when needed."""
    return f"when needed, {1000.0 * delay:.0f} ms"


def table(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Recordings, what is in their middle and the largest of each figure, and what is saved beside floats."""
    every: list[Costs] = [row["ways"] for row in rows]
    saved = {
        f"{1000.0 * delay:.0f} ms": 1.0 - median(ways[needed(delay)]["bytes"] / ways[FLOATS]["bytes"] for ways in every)
        for delay in DELAYS
    }
    of_all = {
        name: {way: {key: choose(ways[way][key] for ways in every) for key in COST} for way in every[0]}
        for name, choose in (("median", median), ("largest", max))
    }
    return {"rows": rows, **of_all, "saved": saved}


def engines(clip: Clip) -> list[dict[str, Any]]:
    """What game engines show of a hand and its tool over each link, and what the codec does."""
    times, poses = samples_of(clip)
    truth = truth_of(times, poses[0])
    frames = np.arange(0.5, float(truth.moments[-1]), 1.0 / FPS)
    rows = []
    for label, way in WAYS.items():
        say(label)
        shown = {engine: (by_engine(engine, truth, way, frames), 2.0 * RATE * (7 * 4 + 28)) for engine in ENGINES}
        shown["sent when needed"] = by_codec(truth, way, frames, TOLERANCE, DELAYS[0])
        for who, (poses_shown, size) in shown.items():
            rows.append({"link": label, "by": who, "bytes": size, **asdict(seen(poses_shown, truth, frames))})
    return rows


def room(users: int, seconds: float) -> dict[str, float]:
    """A room of many on this machine."""
    say("a room")
    result = asdict(figures(users, seconds))
    return {"users": users, "seconds": seconds, "listeners": result.pop("users"), **result}


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write the figures."""
    parser = study_parser("live_costs", __doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="PATH", help="recordings and rigs, or folders of them")
    parser.add_argument("--users", type=int, default=USERS, help="of the room (%(default)s)")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of the room (%(default)g)")
    options = parser.parse_args(arguments)
    paths = sorted(path for folder in options.folders for path in [folder, *folder.rglob("*")])
    clips = [
        clip for path in paths if path.suffix in {".bvh", ".fbx", ".csv", ".tum"} for clip in read_clips([str(path)])[0]
    ]
    rows: dict[str, list[dict[str, Any]]] = {"bodies": [], "single": []}
    for clip in clips:
        joints, ways = costs_of(clip)
        rows["bodies" if joints > 1 else "single"].append({"name": clip.name, "joints": joints, "ways": ways})
    result = {
        "tolerance_mm": 1e3 * TOLERANCE,
        **{kind: table(some) for kind, some in rows.items()},
        "engines": engines(next(clip for clip in clips if clip.name == HAND)),
        "room": room(options.users, options.seconds),
    }
    return publish("live_costs", result, options, *options.folders)
