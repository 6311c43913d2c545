"""What many clips cost: how much two workers are quicker than one, and the memory.

    python scripts/research benchmark_batch
    python scripts/research benchmark_batch --clips 40 --films 4 --rounds 1

Clips are pieces of the recordings in `assets/`. The numbers are those of the fastest round. The folders are made where
`TMPDIR` says, and deleted only at the end: for minutes after many files were deleted, ext4 takes several times as long
to make new ones.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from research.making.tracking import table
from research.paper.motions import assets
from research.studies import interleaved_seconds, publish, report, study_parser
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch.places import PACKAGE

SECONDS = 2.0  # of a clip
RATE = 90.0  # samples a second of the clip whose length grows
FEW = 20  # clips to compare the memory with
MAIN = """
import os, resource, sys
if {}:
    os.sched_setaffinity(0, {{min(os.sched_getaffinity(0))}})
from rigid_motion_batch.cli.commands import main
code = main(sys.argv[1:])
taken, children = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
if sys.platform == "linux":  # Where that counts the process that started this one, too.
    taken = open("/proc/self/status").read().partition("VmHWM:")[2].split()[0]
print(taken, children)
sys.exit(code)
"""
"""The program in the process that is started; `-m rigid_motion_batch` does the work in a child of that."""

UNIT = 1 if sys.platform == "darwin" else 1024  # bytes


class Run(NamedTuple):
    """What a run of `compare` took: seconds, and the most memory of the program and of any process that it started."""

    seconds: float
    program: int
    worker: int


def pieces(count: int) -> Iterator[str]:
    """Yield clips as text: a piece of an asset, moved elsewhere."""
    random, clips = np.random.default_rng(7), list(assets().values())
    for number in range(count):
        clip = clips[number % len(clips)]
        first = random.uniform(clip.times[0], clip.times[-1] - SECONDS)
        part = (clip.times >= first) & (clip.times <= first + SECONDS)
        poses = clip.poses[part]
        yield table(clip.times[part], Poses(poses.positions + random.normal(size=3), poses.quaternions))


def wandering(samples: int) -> str:
    """Return one long clip as text."""
    random = np.random.default_rng(8)
    times = np.arange(samples) / RATE
    rows = [np.sin(times * rate + phase) for rate, phase in random.uniform(0.5, 3.0, size=(7, 2))]
    return table(times, Poses(np.stack(rows[:3], axis=1), normalise(np.stack((rows[3] + 3.0, *rows[4:]), axis=1))))


def compare(clips: Sequence[Path], folder: Path, jobs: int, *options: str, alone: bool = False) -> Run:
    """Run `compare` on some clips, on a single processor if it is to be alone, into a new folder in that one."""
    command = [*clips, "--output", tempfile.mkdtemp(dir=folder), "--jobs", jobs, *options]
    program = [sys.executable, "-c", MAIN.format(alone), "compare", *map(str, command)]
    started = time.perf_counter()
    said = subprocess.run(program, cwd=PACKAGE.parent, stdout=subprocess.PIPE, text=True, check=True).stdout
    return Run(time.perf_counter() - started, *(UNIT * int(number) for number in said.splitlines()[-1].split()))


def workers(clips: Sequence[Path], folder: Path, rounds: int, *options: str) -> list[dict[str, Any]]:
    """Return what one worker takes beside two, and beside one that has a single processor."""
    ways = [(1, False), (2, False), *([(1, True)] if hasattr(os, "sched_setaffinity") else [])]
    runs = {way: partial(compare, clips, folder, way[0], *options, alone=way[1]) for way in ways}
    report(f"{len(clips)} clips")
    best = {way: min(seconds) for way, seconds in interleaved_seconds(runs, rounds).items()}
    return [
        {
            "workers": jobs,
            "one_processor": alone,
            "seconds": seconds,
            "clips_a_minute": 60.0 * len(clips) / seconds,
            "speedup": best[1, False] / seconds,
        }
        for (jobs, alone), seconds in best.items()
    ]


def memory(folder: Path, clips: Sequence[Path], minutes: Sequence[int]) -> dict[str, list[dict[str, float]]]:
    """Return what the program takes over the number of clips, and its workers over the length of one."""
    options = ("--no-video", "--rates", "10")
    report(f"memory over clips, and over {minutes} minutes")
    taken = {count: compare(clips[:count], folder, 2, *options).program / 1e6 for count in (FEW, len(clips))}
    long = []
    path, rest = folder / "long.csv", 0
    for length in (0, *minutes):
        samples = int(length * 60 * RATE) or 10
        path.write_text(wandering(samples), encoding="utf-8")
        run = compare([path], folder, 1, *options)
        rest = rest or run.worker
        if length:
            figures = {"mb": run.worker / 1e6, "bytes_a_sample": (run.worker - rest) / samples, "seconds": run.seconds}
            long.append({"minutes": length, "samples": samples, **figures})
    return {"programs": [{"clips": count, "mb": mb} for count, mb in taken.items()], "workers": long}


def main(arguments: list[str] | None = None) -> int:
    """Run everything, and write the figures."""
    parser = study_parser("benchmark_batch", __doc__)
    parser.add_argument("--clips", type=int, default=200, help="without video (%(default)s)")
    parser.add_argument("--films", type=int, default=12, help="clips with video (%(default)s)")
    parser.add_argument("--minutes", default="6,60", metavar="N,...", help="lengths of the long clip (%(default)s)")
    parser.add_argument("--rounds", type=int, default=3, help="of one worker and two, interleaved (%(default)s)")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        clips = [folder / f"clip_{number:04}.csv" for number in range(max(options.clips, options.films))]
        for path, text in zip(clips, pieces(len(clips)), strict=True):
            path.write_text(text, encoding="utf-8")
        small = ("--rates", "10", "--modes", "lerp_slerp,dq_sclerp,motor_spline", "--resolution", "640x360")
        figures = {
            "clips": options.clips,
            "films": options.films,
            "numbers": workers(clips[: options.clips], folder, options.rounds, "--no-video"),
            "videos": workers(clips[: options.films], folder, options.rounds, *small),
            **memory(folder, clips[: options.clips], [int(part) for part in options.minutes.split(",")]),
        }
    given = f"--clips {options.clips} --films {options.films} --minutes {options.minutes} --rounds {options.rounds}"
    return publish("benchmark_batch", figures, options, given, processors=os.cpu_count())
