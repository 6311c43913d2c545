"""What many clips cost: how much two workers are quicker than one, how much is Blender's rendering, and the memory.

    python scripts/research benchmark_batch
    python scripts/research benchmark_batch --clips 40 --films 4 --rounds 1
    python scripts/research benchmark_batch --output docs/benchmark_batch.md

Clips are pieces of the recordings in `assets/`, each moved to another place, so that no two are alike. `compare.py`
processes all of them with one worker and with two in turn, each time into a new folder; the numbers are those of the
fastest round. Where Blender renders on the processor, a single worker uses several processors, so one worker is also
measured on a single processor (on Linux). The folders are made where `TMPDIR` says, and deleted only at the end: for
minutes after many files were deleted, ext4 takes several times as long to make new ones. Memory is the most that a
process used (on Linux; elsewhere it is left out): the program itself over the number of clips, and its largest worker
over the length of one clip. Compare the ratios; the times depend on the machine.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from research.publishing import more_or_less, opening, publish
from research.summaries import of_batch
from rigid_motion_batch.command_line import parser_of
from rigid_motion_batch.pipeline.store import Store
from rigid_motion_batch.places import ASSETS, PACKAGE

SECONDS = 2.0
"""How long a clip is."""

RATE = 90.0
"""Samples a second of the clip whose length grows."""

SAMPLE = 8 * 8
"""Bytes of a sample as it is read: time, position and quaternion."""

FEW = 20
"""Clips to compare the memory with."""

POLL = 0.05
"""Seconds between two looks at the memory of the processes."""


@dataclass(frozen=True)
class Run:
    """What a run of `compare.py` took."""

    seconds: float

    own: int
    """The most memory of the program itself, in bytes; 0 where that cannot be told."""

    worker: int
    """The most memory of any process that it started."""

    work: float
    """Seconds of all tasks together."""

    rendering: float
    """Seconds of those in which Blender rendered."""


def pieces(count: int) -> Iterator[str]:
    """Clips as text: a piece of an asset, moved elsewhere."""
    random = np.random.default_rng(7)
    recordings = [path.read_text(encoding="utf-8").splitlines() for path in sorted(ASSETS.glob("*.csv"))]
    for number in range(count):
        head, *rows = recordings[number % len(recordings)]
        table = np.array([row.split(",") for row in rows], dtype=float)
        first = random.uniform(table[0, 0], table[-1, 0] - SECONDS)
        table = table[(table[:, 0] >= first) & (table[:, 0] <= first + SECONDS)]
        table[:, 1:4] += random.normal(size=3)
        yield "\n".join((head, *(",".join(map(repr, row)) for row in table.tolist()))) + "\n"


def wandering(samples: int) -> str:
    """One long clip as text."""
    random = np.random.default_rng(8)
    times = np.arange(samples) / RATE
    rows = [np.sin(times * rate + phase) for rate, phase in random.uniform(0.5, 3.0, size=(7, 2))]
    quaternions = np.stack((rows[3] + 3.0, *rows[4:]), axis=1)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    table = np.column_stack((times, *rows[:3], quaternions))
    return "t,x,y,z,qw,qx,qy,qz\n" + "\n".join(",".join(map(repr, row)) for row in table.tolist()) + "\n"


def compare(clips: Sequence[Path], folder: Path, jobs: int, *options: str, alone: bool = False) -> Run:
    """Run `compare.py` on some clips, on a single processor if it is to be alone, into a new folder in that one."""
    output = Path(tempfile.mkdtemp(dir=folder))
    command = [
        sys.executable,
        "-m",
        "rigid_motion_batch",
        "compare",
        *clips,
        "--output",
        output,
        "--jobs",
        str(jobs),
        *options,
    ]
    started = time.perf_counter()
    own = worker = 0
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=PACKAGE.parent) as process:
        if alone:
            os.sched_setaffinity(process.pid, {min(os.sched_getaffinity(0))})
        os.set_blocking(process.stderr.fileno(), False)
        said = b""
        while process.poll() is None:
            own = max(own, peak_memory_of(process.pid))
            worker = max([worker, *map(peak_memory_of, children_of(process.pid))])
            said += process.stderr.read() or b""
            time.sleep(POLL)
        seconds = time.perf_counter() - started
        said += process.stderr.read() or b""
    if process.returncode:
        raise RuntimeError(f"compare.py ended with {process.returncode}: {said.decode(errors='replace')[-2000:]}")
    store = Store(output)
    tasks = [result.index for result in store.latest().values()]
    rendering = sum(task["facts"].get("rendering", 0.0) for task in tasks)
    return Run(seconds, own, worker, sum(task["seconds"] for task in tasks), rendering)


def peak_memory_of(process: int) -> int:
    """Return the most memory, in bytes, that a process has had; 0 where it is gone, or the system does not tell."""
    try:
        status = Path(f"/proc/{process}/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0
    return next((int(line.split()[1]) << 10 for line in status.splitlines() if line.startswith("VmHWM:")), 0)


def children_of(pid: int) -> list[int]:
    """The processes that a process has started; none where the system does not tell."""
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()]
    except OSError:
        return []


def workers(title: str, clips: Sequence[Path], folder: Path, rounds: int, *options: str) -> Iterator[str]:
    """One worker beside two, as lines of Markdown."""
    runs: dict[tuple[int, bool], list[Run]] = {(1, False): [], (2, False): []}
    if hasattr(os, "sched_setaffinity"):
        runs[1, True] = []
    for _ in range(rounds):
        for (jobs, alone), some in runs.items():
            say(f"{title}, {jobs} at work{' on one processor' if alone else ''} ...")
            some.append(compare(clips, folder, jobs, *options, alone=alone))
    best = {way: min(some, key=lambda run: run.seconds) for way, some in runs.items()}
    yield f"## {title}"
    yield ""
    yield f"`compare.py CLIP... {' '.join(options)} --jobs N`"
    yield ""
    yield "| workers | seconds | clips a minute | as fast as one | at work, of the time of all | outside the renderer |"
    yield "|---:|---:|---:|---:|---:|---:|"
    for (jobs, alone), run in best.items():
        outside = f"{1.0 - run.rendering / run.work:.1%}" if run.rendering else ""
        yield (
            f"| {jobs}{' on one processor' if alone else ''} | {run.seconds:.1f} "
            f"| {60.0 * len(clips) / run.seconds:.0f} | {best[1, False].seconds / run.seconds:.2f} times "
            f"| {run.work / run.seconds / jobs:.0%} | {outside} |"
        )
    yield ""


def memory(folder: Path, clips: Sequence[Path], minutes: Sequence[int]) -> Iterator[str]:
    """What the program and its workers take, as lines of Markdown."""
    options = ("--no-video", "--rates", "10")
    yield "## Memory"
    yield ""
    yield "| clips | of the program, MB | beside |"
    yield "|---:|---:|---:|"
    base = 0
    for count in (FEW, len(clips)):
        say(f"memory over {count} clips ...")
        run = compare(clips[:count], folder, 2, *options)
        base = base or run.own
        yield f"| {count} | {run.own / 1e6:.0f} | {more_or_less(run.own / base) if base else ''} |"
    yield ""
    yield "| one clip of | samples | a worker at most, MB | more than for a clip of no length, a sample | seconds |"
    yield "|---:|---:|---:|---:|---:|"
    path = folder / "long.csv"
    rest = 0
    for length in (0, *minutes):
        samples = int(length * 60 * RATE) or 10
        say(f"memory over {length} minutes ...")
        path.write_text(wandering(samples), encoding="utf-8")
        run = compare([path], folder, 1, *options)
        if not length:
            rest = run.worker
            continue
        more = (run.worker - rest) / samples
        times = f"{more:.0f} bytes, {more / SAMPLE:.0f} times what it takes itself"
        yield f"| {length} min | {samples} | {run.worker / 1e6:.0f} | {times} | {run.seconds:.1f} |"
    yield ""


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main(arguments: list[str] | None = None) -> int:
    """Run everything; print, and write where asked."""
    parser = parser_of("benchmark_batch.py", __doc__)
    parser.add_argument("--clips", type=int, default=200, help="without video (%(default)s)")
    parser.add_argument("--films", type=int, default=12, help="clips with video (%(default)s)")
    parser.add_argument("--minutes", default="6,30,60", metavar="N,...", help="lengths of the long clip (%(default)s)")
    parser.add_argument("--rounds", type=int, default=3, help="of one worker and two in turns (%(default)s)")
    parser.add_argument("--output", type=Path, help="a Markdown file to write the tables to")
    options = parser.parse_args(arguments)
    given = f"--clips {options.clips} --films {options.films} --minutes {options.minutes} --rounds {options.rounds}"
    command = f"python scripts/research benchmark_batch {given}"
    lines = opening("Benchmark of many clips", command, __doc__, processors=os.cpu_count())
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        clips = [folder / f"clip_{number:04}.csv" for number in range(max(options.clips, options.films))]
        for path, text in zip(clips, pieces(len(clips)), strict=True):
            path.write_text(text, encoding="utf-8")
        small = ("--rates", "10", "--modes", "lerp_slerp,dq_sclerp,motor_spline", "--resolution", "640x360")
        lines += workers(
            f"{options.clips} clips, numbers only", clips[: options.clips], folder, options.rounds, "--no-video"
        )
        lines += workers(f"{options.films} clips with video", clips[: options.films], folder, options.rounds, *small)
        lines += memory(folder, clips[: options.clips], [int(part) for part in options.minutes.split(",")])
    publish(lines, options.output, of_batch)
    return 0
