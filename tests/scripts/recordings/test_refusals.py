"""Tests of wrong and large text files: each is refused with its line and a way out, in little memory and time."""

import json
import struct
import time
import tracemalloc
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.recordings import TrajectoryError, bvh, read_trajectories, recordings, tables
from rigid_motion_batch.recordings.fbx import MAGIC
from tests.scripts.bvh_bodies import TIMES, bvh_text
from tests.scripts.recordings.layouts import BOTH, LAYOUTS, POSE, SECONDS, csv, names, rows
from tests.scripts.recordings.test_bvh import ARM
from tests.scripts.recordings.written_layouts import HEADER, by_turns

MOTIVE = str(LAYOUTS["Motive"].text)
ROWS = "0.0,1,2,3,0.1,0.2,0.3,0.9\n0.1,4,5,6,0.4,0.5,0.6,0.4\n"
TUM_COMMENTS = "# ground truth trajectory\n# file: 'dataset.bag'\n# timestamp tx ty tz qx qy qz qw\n"
TUM_ROWS = "1305031098.6659 1.3 0.6 1.6 0.6132 0.5962 -0.3311 -0.3986\n1305031098.6758 1.4 0.7 1.7 0.1 0.2 0.3 0.4\n"
MIXED = by_turns(rows(SECONDS, *POSE), rows(SECONDS, *BOTH[2:]))
"""Two devices in alternating rows that nothing tells apart."""


def broken(**changes: object) -> str:
    """Return an A-Frame recording with changes to the third pose of the first device."""
    content = json.loads(LAYOUTS["A-Frame"].text)
    content["left"]["poses"][2].update(changes)
    return json.dumps(content)


def zeros(header: str) -> str:
    return f"{header}\n" + ",".join("0" for _ in header.split(",")) + "\n"


def at_times(*times: object) -> str:
    return f"{HEADER}\n" + "".join(f"{time},1,2,3,0,0,0,1\n" for time in times)


def next_date(time: str) -> str:
    return at_times("2026-11-22T10:00:00", time)


def of_gltf(**content: object) -> str:
    return json.dumps({"asset": {"version": "2.0"}} | content)


NESTED = [*({"children": [node + 1]} for node in range(5000)), {}]
VRM = {"VRMC_vrm_animation": {"humanoid": {"humanBones": {"hips": {"node": 0}}}}}
TURNED = "t,x,y,z,rx,ry,rz\n0,0,0,0,359,0,0\n.1,0,0,0,1,0,0\n"
CLOCKS = csv("time,clock," + HEADER[2:], 2.0 * SECONDS, SECONDS, *POSE)
MANY = csv(f"id,{HEADER}", np.arange(1200), np.arange(1200) / 10.0, *np.eye(7)[[6] * 1200].T)
OF_DEVICES = {"columns": [("device", "id"), ("t", "t")]}
FAR_APART = [3e9 * row for row in range(9)]
KEYS = range(18295873486192640, 18295873486192649)
WHICH = "--columns rx=roll,ry=pitch,rz=yaw in ROS, rx=pitch,ry=yaw,rz=roll in Unity"
SAID_THERE = "leave it out, as its files say that themselves"
NO_DATE = "neither a number nor a date that can be read; write 2026-11-22T10:00:00.123, 10:00:00.123 or seconds"

WRONG: dict[str, list[tuple]] = {
    "take.csv": [
        ("", None, "the file is empty"),
        (f"{HEADER.removesuffix(',qw')}\n{ROWS}", 1, "no column named qw"),
        ("# about\n\nt,x,y,z\n0,1,2,3\n", 3, "positions only, and rotations are needed (found t, x, y, z); record"),
        (f"{HEADER},x\n{ROWS}", 1, "two columns mean x ('x'); say which with --columns x=NAME, or rename or"),
        (f"{HEADER}\n{ROWS}0.2,1,2\n", 4, "3 columns where 8 are needed"),
        (f"{HEADER}\n0,1,2,3,0,0,0,1,5\n{ROWS}", 2, "9 columns where 8 have a name"),
        (f"{HEADER}\n{ROWS}{'9' * 100_000},{'x' * 100_000},2,3,0,0,0,1\n", 4, f"x is '{'x' * 24}...', not a number"),
        (f"{HEADER}\n{ROWS}\x1b[2J,1,2,3,0,0,0,1\n", 4, r"t is '\x1b[2J', not a number"),
        (f"{HEADER}\n{ROWS}".encode() + b"0.2,\xff\xfe,2,3,0,0,0,1\n", 4, "this is not text (byte 0xff)"),
        (f"Recorder v1.2\n\n{HEADER[:-3]}\n0,1,2,3,0.1,0.2,0.3\n", 3, "no column named qw"),
        (f"Recorder v1.2\na,b,c\n{ROWS}", 1, "no column has a known name (found Recorder, v1.2)"),
        (f"Recorder\n{HEADER}\n{ROWS}{HEADER}\n{ROWS}", 2, "lines 2 and 5 both name columns"),
        ("Recorder\n" * 50 + f"{HEADER}\n{ROWS}", 1, "no column has a known name (found Recorder)"),
        (f"Recorder\n{HEADER}\n{ROWS}0.2,1,2,three,0,0,0,1\n", 5, "z is 'three', not a number"),
        (
            zeros("when,a,b,c,d,e,f,g"),
            1,
            "no column has a known name (found when, a, b, c, d, e, f, g); known are t, time, timestamp_ms; "
            "x, px, pos_x, position.x; qw, rot_w, rotation.w; or --columns",
        ),
        (zeros("frame" + HEADER[1:]), 1, "no column of time, only one that counts frames ('frame')…--frame-rate 90"),
        (zeros("t,left_x,left_y,left_z,button"), 1, "positions only, and rotations are needed (found t, left_x, left"),
        (zeros("t,x,y,z,rx,ry,rz"), 1, "rotations are Euler angles here (rx, ry, rz), and their order is not said; s"),
        ("t,Position,Rotation\n0,(0, 0, 0),(30, 0, 0)\n", 1, "rotations are Euler angles here (Rotation.x, Rotation.y"),
        (zeros(HEADER), 1, "no column named rx, ry, rz (found t, x, y, z, qx, qy, qz, qw); kn", {"euler": "XYZ"}),
        (zeros("t,x,y,z,roll,pitch,yaw"), 1, f"roll, pitch and yaw are about other axes…{WHICH}", {"euler": "ZYX"}),
        (zeros(HEADER), 1, "no column is named 'when'; --columns t=NAME takes one", {"columns": [("t", "when")]}),
        (zeros("t [min],x,y,z,qx,qy,qz,qw"), 1, "'min' is not a known unit of time; --time-unit s, ms, us, ns"),
        (zeros("t,x [furlong],y,z,qx,qy,qz,qw"), 1, "'furlong' is not a known unit of length; say how many metres it"),
        (TURNED, 1, "angles go up to 359, which are not radians; say so: --degrees;", {"euler": "XYZ"}),
        (CLOCKS, 1, "two columns mean t and disagree ('time' lasts…say which with --columns t=NAME"),
        (MANY, 1, "more than 1000 different values in the column of devices; name another with --columns", OF_DEVICES),
        (
            f"{HEADER}\n" + MIXED.replace(" ", ","),
            1,
            "40 of 48 samples jump from one place to another and back, at 68.9 m/s: these are several…"
            "--columns device=NAME (found t, x, y, z, qx, qy, qz, qw), or split the file",
        ),
        (at_times(*FAR_APART), 1, "t goes in steps of 3e+09: as seconds that is one sample…--time-unit s, ms, us, ns"),
        (at_times(*KEYS), 1, f"t counts up by 1 from {KEYS[0]}: these are numbers of rows or keys, not times"),
    ],
    "dates.csv": [
        (next_date("2026-13-22T10:00:00"), 3, "t is '2026-13-22T10:00:00', not a date; delete this line if it is dam"),
        (next_date("2026-11-22T10:00:61"), 3, "t is '2026-11-22T10:00:61', not a date"),
        (next_date("2026-11-22T10:00:00.1234567891"), 3, "t is '2026-11-22T10:00:00.1234567891', not a date"),
        (next_date("2026-11-22T10:00:00\u0661"), 3, "t is '2026-11-22T10:00:00\u0661', not a date"),
        (next_date("2026-11-22T10:00:00+25:00"), 3, "t is '2026-11-22T10:00:00+25:00', not a date"),
        (next_date("2026-11-22T10:00:00Z"), 3, "t is '2026-11-22T10:00:00Z', not a date without an offset from UTC as"),
        (at_times("11/22/2026 10:00:00"), 2, f"t is '11/22/2026 10:00:00', {NO_DATE}"),
        (at_times("22.11.2026 10:00"), 2, f"t is '22.11.2026 10:00', {NO_DATE}"),
        (at_times("2026-11-22"), 2, f"t is '2026-11-22', {NO_DATE}"),
        (at_times("20261122T100000"), 2, f"t is '20261122T100000', {NO_DATE}"),
        (at_times("10:00:00Z"), 1, "--time-unit ms is for times that are numbers…; leave it out", {"time_unit": "ms"}),
    ],
    "motive.csv": [
        (MOTIVE.splitlines()[0], 1, "the rows that say what the columns are end too early"),
        (MOTIVE.replace("Rigid Body", "Marker"), None, "no rigid body, only Marker"),
        (MOTIVE.replace("Meters", "Cubits"), 1, "Length Units is 'Cubits'"),
        (MOTIVE.replace("Quaternion", "Matrix"), 1, "Rotation Type is 'Matrix'"),
        (MOTIVE.replace("Quaternion", "XYZ").replace("X,Y,Z,W", "X,Y,Q,W"), 7, "no column named rx, ry, rz for 'Tool'"),
        (MOTIVE + "3,0.025" + ",1" * 99 + "\n", 32, "101 columns where 10 have a name"),
        (MOTIVE.replace(",Tool", ',"Tool', 1).replace("Tool", "x" * 200_000, 1), 4, "this line is not a header"),
        (MOTIVE.replace("Rigid Body", "").replace("Marker", ""), 7, "no rigid body in this take"),
        ("t,Position,Rotation\n0,(0, 0, 0),(0, 0, 0, 1)\n.1,(0, 0),(0, 0, 0, 1)\n", 3, "6 columns where 8 are needed"),
        (MOTIVE, None, f"--time-unit means nothing to Motive CSV; {SAID_THERE}", {"time_unit": "ms"}),
    ],
    "vicon.csv": [
        ("Trajectories\n100\n,,a:b\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n", None, "no table of Objects or Segments in"),
        ("Objects\nfast\n", 1, "no column has a known name (found Objects)"),
        ("Objects\n0\n,,A\nFrame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ\n", 2, "the rate is '0'; say it: --frame-rate 100"),
    ],
    "body.tsv": [
        ("NO_OF_FRAMES\t9\nNO_OF_BODIES\t1\n", None, "no line names the columns X, Y, Z; export 6D data with Include"),
        ("NO_OF_FRAMES\t9\nNO_OF_BODIES\t1\nX\tY\tZ\n", 1, "the rate is ''; say it: --frame-rate 100"),
    ],
    "poses.json": [
        ("", 1, "this is not JSON"),
        ('{"poses":\n[}', 2, "this is not JSON"),
        ('{"poses": [%s]}' % ("9" * 5000), None, "this JSON cannot be a recording"),
        ('{"camera": 1, "left": {"events": []}}', None, "this JSON holds no poses"),
        (broken(position={"x": 1, "y": 2}), None, "pose 2 of 'left' has no number position.z"),
        (broken(timestamp=10**400), None, "pose 2 of 'left' has no number timestamp"),
        ('[{"t": 0, "position": [1, 2, 3]}]', None, "positions only, and rotations are needed (found "),
        ('[{"t": 0, "pos": [1, 2, 3], "quat": [1,0,0,0]}, {"t": 1}]', None, "pose 1 of 'poses' has no number pos[0]"),
        ('{"frames": [{"file_path": "a.png", "transform_matrix": 1}]}', None, "this JSON holds no poses; it takes a l"),
    ],
    "poses.txt": [
        (str(LAYOUTS["KITTI"].text), None, "poses without times; say how many frames a second it has: --frame-rate 90"),
        ("#   POINTS2D[] as (X, Y)\n", None, "no column of time, only one that counts frames"),
    ],
    "walk.tum": [
        ("0 1 2 3 4 5 6\n", 1, "7 numbers in a row, which are not known poses; write a first line of names"),
        (f"{TUM_COMMENTS}0 1 2 3 0 0 0 1\n0.1 1 2\n", 5, "3 columns where 8 are needed"),
        (f"{TUM_COMMENTS}0 1 2 3 0 0 0 1 9\n", 4, "9 columns where 8 have a name"),
        ("0 1 2 3\n0.1 1 2 3\n", 1, "positions only, and rotations are needed; write t x y z qx qy qz qw"),
        (f"{TUM_ROWS}1,2,3\n", 3, "1 columns where 8 are needed"),
        (f"# {HEADER}\n{MIXED}", 1, "40 of 48 samples jump from one place to another and back…; write a file for each"),
    ],
    "old.fbx": [
        (MAGIC + struct.pack("<I", 6100) + bytes(200), None, "this is FBX 6.1, and Blender imports 7.1 and later; exp"),
        ("; FBX 7.4.0 project file\n", None, "this is an FBX of text, or none; export it as binary FBX"),
    ],
    "walk.gltf": [
        (of_gltf(nodes=NESTED), None, "more than 1000 nodes hang on one another; export"),
        (of_gltf(nodes=[{}] * 200_000), None, "200000 nodes are more than the 100000"),
        (of_gltf(skins=[{"joints": [0] * 4000}]), None, "4000 joints of a skin are more than the 3000 that"),
        (of_gltf(animations=[{"channels": [{}] * 200_000}]), None, "'animation 0': channel 0 has no target; export"),
        (of_gltf(nodes=[{"name": "Hips"}, {"name": 3}], extensions=VRM), None, "nothing moves in this file"),
    ],
    "arm.bvh": [
        ("", 1, "the file ends where HIERARCHY is expected"),
        (ARM.split("MOTION")[0], 16, "the file ends where MOTION is expected"),
        (ARM.replace("}\nMOTION", "MOTION"), 15, "a } is missing before MOTION"),
        (ARM.replace("}\nMOTION", "}\n}\nMOTION"), 16, "'}' is out of place"),
        (ARM.replace("JOINT Elbow", "ROOT Elbow"), 6, "'ROOT' is out of place"),
        (ARM.replace("2.0 0.0 0.0", "2.0 0.0"), 9, "'CHANNELS' where a number of the OFFSET is expected"),
        (ARM.replace("CHANNELS 3 Z", "CHANNELS 3 Q"), 9, "'Qrotation' is not a channel"),
        (ARM.replace("CHANNELS 3 Z", "CHANNELS 3 X"), 9, "a channel occurs twice in a joint"),
        (ARM.replace("Frames: 2", "Frames: two"), 17, "'Frames: two' where Frames: and a positive number are expected"),
        (ARM.replace("1 5 0  90", "1 5 0  9O").rstrip(), 20, "Shoulder Zrotation is '9O', not a number"),
        (f"{ARM}2 5 0  90 0 0  -91 0", 21, "8 columns where 9 are needed; delete this line if it is damaged"),
        ("HIERARCHY\nROOT A\n{\nOFFSET 0 0 0\n}\nMOTION\nFrames: 1\nFrame Time: 1\n0\n", 6, "no joint has CHANNELS"),
        ("HIERARCHY\n" + "ROOT A {" + "JOINT B {" * 50_000, 2, "more than 500 joints hang on one another; export a"),
        ("HIERARCHY\n" + "ROOT A {" + "JOINT B {}" * 50_000, 2, "more than 3000 joints; export fewer, such as one bod"),
        (ARM, None, f"--columns means nothing to BVH; {SAID_THERE}", {"columns": [("t", "t")]}),
        (ARM, None, f"--euler means nothing to BVH; {SAID_THERE}", {"euler": "XYZ"}),
    ],
}
"""File names and contents; the line that is wrong; the beginning of the error, and after … its end; options."""


@pytest.mark.parametrize(("name", "row"), [(name, row) for name, wrong in WRONG.items() for row in wrong])
def test_a_wrong_file_is_told_with_its_line(write, refusal, name: str, row: tuple) -> None:
    text, line, told, *options = row
    told_line, message = refusal(write(name, text), **dict(*options))
    beginning, _, end = told.partition("…")
    assert message.startswith(beginning)
    assert message.endswith(end)
    assert told_line == line
    assert len(message) < 200 or len(text) < 10_000


SIZE = 100_000
"""The size of each file in bytes: enough to show how memory grows with it."""

BASE = 2_000_000
OF_THE_FILE = {".json": 30.0}
OF_ANY_OTHER = 16.0
OF_A_LINE = 250.0
"""Limits of memory for reading: bytes in any case, bytes per byte of the file, and bytes per line."""

PATIENCE = 30.0
"""Limit of processor time in seconds, while `tracemalloc` measures."""

CSV = f"{HEADER}\n"
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
    "bodies.csv": "t," + ",".join(names(f"b{body}_{{}}", f"b{body}_q{{}}") for body in range(300)) + "\n" + of("0,"),
    "long numbers.csv": CSV + of("9" * 50_000 + ",0,0,0,0,0,0,1\n"),
    "wide characters.csv": CSV + of("0,0,0,0,0,0,0,1\n") + "#\U0001f600\n",
    "endless header.csv": MOTIVE.splitlines(keepends=True)[0] + of("a\n"),
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
    "sound.csv": CSV + rows(SECONDS, *POSE, separator=",") * 100,
    "sound.tum": str(LAYOUTS["TUM"].text) * 100,
    "sound.json": json.dumps({"poses": 100 * json.loads(LAYOUTS["A-Frame of 2017"].text)}),
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
        (tables, "MOST_ROWS", 5, "take.tum", str(LAYOUTS["TUM"].text), 24, "more than 5 rows; split the recording"),
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
