"""Cost of live streaming: compared with packed poses at even rates, with game engines, and in a crowded room.

    python scripts/research live_costs FOLDER ...

Whole bodies and single hands are sent by the codec of [the wire](wire.md) over UDP on loopback; a receiver in another
process shows them on the recording's clock, however busy the machine is. Bytes are those of datagrams with the 28 bytes
of UDP and IPv4 headers each, without the description that a receiver gets when it joins. Errors are the largest of any
joint's ball, which reaches to the tails of bones in the file, in the root's space, at the moments shown.
"""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from research.live_streams import room
from research.live_streams.engines import ENGINES, PICTURES_PER_S, POSES_PER_S, Way, by_codec, by_engine, seen, truth_of
from research.live_streams.packings import packed
from research.studies import files_in, publish, report, study_parser
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming.measuring import HEADER_BYTES, measure
from rigid_motion_batch.streaming.sending import body_of, samples_of

TOLERANCE_M = 0.005
DELAYS = {0.1: "100 ms", 0.2: "200 ms"}

FLOATS = "float32 at 30 Hz"
"""The state of the art, according to the paper: position and rotation of every joint at an even rate."""

WAYS = {
    "20 ms": Way(0.02, 0.02, 0.0),
    "250 ± 40 ms": Way(0.21, 0.29, 0.0),
    "250 ± 40 ms, 1 % lost": Way(0.21, 0.29, 0.01),
    "250 ± 40 ms, 5 % lost": Way(0.21, 0.29, 0.05),
    "250 ± 40 ms, 20 % lost": Way(0.21, 0.29, 0.2),
}
"""Links that game engines and our codec are tried on."""

HAND = "aframe_right"  # the clip of the hand with the tool

COST = {"bytes": "bytes_a_second_with_headers", "rms_mm": "rms_mm", "largest_mm": "largest_mm"}
"""Names of figures, and their names in the measurements."""


def costs_of(clip: Clip) -> dict[str, Any]:
    """Return the number of joints of a body, and the cost of each way to send it."""
    report(clip.name)
    times, poses = samples_of(clip)
    body = body_of(clip, poses)
    costs = {
        f"when needed, {name}": measure([body], times, poses, TOLERANCE_M, delay)[0] for delay, name in DELAYS.items()
    } | packed(body, times, poses)
    ways = {way: {name: cost[key] for name, key in COST.items()} for way, cost in costs.items()}
    return {"name": clip.name, "joints": len(body.joints), "ways": ways}


def table(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the costs of recordings, the median and maximum of each figure, and the savings compared with floats."""
    ways = [row["ways"] for row in rows]
    return {
        "rows": rows,
        **{
            name: {way: {key: choose(costs[way][key] for costs in ways) for key in COST} for way in ways[0]}
            for name, choose in (("median", median), ("largest", max))
        },
        "saved": {
            name: 1.0 - median(costs[f"when needed, {name}"]["bytes"] / costs[FLOATS]["bytes"] for costs in ways)
            for name in DELAYS.values()
        },
    }


def engines(clip: Clip) -> list[dict[str, Any]]:
    """Return errors and bytes of game engines, and of the codec, for a hand and its tool over each link."""
    times, poses = samples_of(clip)
    truth = truth_of(times, poses[0])
    frames = np.arange(0.5, float(truth.moments[-1]), 1.0 / PICTURES_PER_S)
    rows = []
    for label, way in WAYS.items():
        report(label)
        shown = {
            engine: (by_engine(engine, truth, way, frames), 2.0 * POSES_PER_S * (7 * 4 + HEADER_BYTES))
            for engine in ENGINES
        }
        shown["sent when needed"] = by_codec(truth, way, frames, TOLERANCE_M, next(iter(DELAYS)))
        for engine, (poses_shown, size) in shown.items():
            rows.append({"link": label, "by": engine, "bytes": size, **seen(poses_shown, truth, frames)})
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Measure all costs, and write the figures."""
    parser = study_parser("live_costs", __doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="PATH", help="recordings and rigs, or folders of them")
    parser.add_argument("--users", type=int, default=30, help="of the room (%(default)s)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the room (%(default)g)")
    options = parser.parse_args(arguments)
    paths = sorted(files_in(options.folders, (".bvh", ".fbx", ".csv", ".tum")))
    clips = [clip for path in paths for clip in read_clips([str(path)])[0]]
    rows = [costs_of(clip) for clip in clips]
    result = {
        "tolerance_mm": 1e3 * TOLERANCE_M,
        "bodies": table([row for row in rows if row["joints"] > 1]),
        "single": table([row for row in rows if row["joints"] == 1]),
        "engines": engines(next(clip for clip in clips if clip.name == HAND)),
    }
    result["room"] = room.measured(options.users, options.seconds)
    return publish("live_costs", result, options, *options.folders)
