"""Tests of limits: the memory and time for reading a file depend on its size, whatever numbers it states.

Memory is that of Python and NumPy, as measured by `tracemalloc`.
"""

import json
import time
import tracemalloc
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.recordings import TrajectoryError, bvh, read_trajectories, recordings, tables
from tests.scripts.bvh_bodies import TIMES, bvh_text
from tests.scripts.recordings.layouts import OTHERS, RAW
from tests.scripts.recordings.written_layouts import PLAIN

SIZE = 100_000
"""The size of each file in bytes: enough to show how memory grows with it."""

BASE = 2_000_000
OF_THE_FILE = {".json": 30.0}
OF_ANY_OTHER = 16.0
OF_A_LINE = 250.0
"""Limits of memory for reading: bytes in any case, bytes per byte of the file, and bytes per line."""

PATIENCE = 30.0
"""Limit of processor time in seconds, while `tracemalloc` measures."""

CSV = "t,x,y,z,qx,qy,qz,qw\n"
COLUMNS = CSV.strip().split(",")[1:]
MOTIVE = "Format Version,1.23,Rotation Type,Quaternion,Length Units,Meters\n"
ROOT = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n"


def of(piece: str) -> str:
    """Return a piece of text repeated to the size of a file."""
    return piece * (SIZE // len(piece))


def motion(frames: object, rows: str) -> str:
    return f"MOTION\nFrames: {frames}\nFrame Time: 0.01\n{rows}"


BOMBS: dict[str, str] = {
    "nothing but line ends.csv": "\n" * SIZE,
    "one long number.csv": "1" * SIZE,
    "a column for every byte.csv": "," * SIZE,
    "devices.csv": "device," + CSV + "".join(f"{row // 9},0,0,0,0,0,0,0,1\n" for row in range(SIZE // 20)),
    "bodies.csv": "t," + ",".join(f"b{body}_{column}" for body in range(300) for column in COLUMNS) + "\n" + of("0,"),
    "long numbers.csv": CSV + of("9" * 50_000 + ",0,0,0,0,0,0,1\n"),
    "wide characters.csv": CSV + of("0,0,0,0,0,0,0,1\n") + "#\U0001f600\n",
    "endless header.csv": MOTIVE + of("a\n"),
    "deep lists.json": "[" * SIZE,
    "objects.json": f"[{of('{},')}0]",
    "one long number.json": f"[{'9' * SIZE}]",
    "devices.json": "{" + ",".join(f'"{device}":{{"poses":[]}}' for device in range(SIZE // 22)) + "}",
    "deep.bvh": "HIERARCHY\nROOT a {\n" + of("JOINT b {\n"),
    "an endless name.bvh": "HIERARCHY\nROOT " + of("a ") + "{",
    "a billion frames.bvh": ROOT + "}\n" + motion("1000000000", "0\n0\n"),
    "a billion channels.bvh": ROOT.replace("CHANNELS 1", "CHANNELS 1000000000"),
    "small frames.bvh": ROOT + "}\n" + motion(SIZE // 2, "0\n" * (SIZE // 2)),
    "small joints in small frames.bvh": ROOT
    + "JOINT b { }\n" * 10_000
    + "}\n"
    + motion(SIZE // 4, "0\n" * (SIZE // 4)),
    "one long row.bvh": ROOT + "}\n" + motion(1, of("0 ")),
}


HEADER, _, ROWS = PLAIN.partition("\n")

BOMBS |= {
    "sound.csv": f"{HEADER}\n{ROWS * 100}",
    "sound.tum": str(RAW["TUM"].text) * 100,
    "sound.json": json.dumps({"poses": 100 * json.loads(OTHERS["A-Frame of 2017"].text)}),
    "sound.bvh": bvh_text(np.arange(600) / 30.0),
}
"""Contents of files by name; some are sound recordings."""


@pytest.mark.parametrize("name", BOMBS)
def test_what_a_file_takes_is_bounded_by_what_it_holds(tmp_path: Path, name: str) -> None:
    path, text = tmp_path / name, BOMBS[name]
    path.write_text(text, encoding="utf-8", newline="")
    factor = OF_THE_FILE.get(path.suffix, OF_ANY_OTHER)
    allowed = BASE + factor * path.stat().st_size + OF_A_LINE * text.count("\n")
    recording, started = None, time.process_time()
    tracemalloc.start()
    try:
        with suppress(TrajectoryError):
            recording = read_trajectories(f"{path}:*" if name.endswith(".bvh") else str(path))
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert time.process_time() - started < PATIENCE
    assert peak <= allowed, f"{peak / allowed:.2f} of what is allowed"
    assert recording or not name.startswith("sound")


@pytest.mark.parametrize(
    ("module", "limit", "lowered", "name", "text", "line", "told"),
    [
        (tables, "LARGEST_FILE", 10, "take.csv", CSV, None, "the file has 0 MiB, and 0 can be read; split"),
        (tables, "MOST_ROWS", 5, "take.tum", str(RAW["TUM"].text), 24, "more than 5 rows; split the recording"),
        (tables, "LONGEST_LINE", 50, "take.csv", CSV + "1" * 60, 2, "this line is longer than 50 characters; name a"),
        (tables, "MOST_COLUMNS", 5, "take.csv", CSV, 1, "more than 5 columns; export fewer bodies"),
        (bvh, "MOST_JOINTS", 1, "take.bvh", bvh_text(TIMES[:8]), 8, "more than 1 joints; export fewer, such as one"),
        (bvh, "LONGEST_NAME", 0, "take.bvh", bvh_text(TIMES[:8]), 2, "a { is missing after a name; export the BVH"),
        (recordings, "MOST_POSES", 15, "take.bvh", bvh_text(TIMES[:8]), None, "3 joints in 8 frames are more than 15"),
    ],
)
def test_what_is_beyond_a_limit_is_refused(write, refusal, monkeypatch, module, limit, lowered, name, text, line, told):
    path = write(name, text)
    monkeypatch.setattr(module, limit, lowered)
    told_line, message = refusal(path)
    assert message.startswith(told)
    assert told_line == line
