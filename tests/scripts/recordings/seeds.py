"""A small sound recording in each text format, from which damaged ones are made (`mutations`).

Every one holds the same handful of samples of a body that turns while it moves, so that damage is near what matters.
"""

import json
from collections.abc import Iterable

import numpy as np
from scipy.spatial.transform import Rotation

COUNT = 8
TIMES = np.arange(COUNT) / 50.0
POSITIONS = np.round(np.stack((TIMES, np.sin(9.0 * TIMES), 1.0 - TIMES), axis=-1), 4)
TURNS = Rotation.from_rotvec(np.stack((4.0 * TIMES, TIMES, -TIMES), axis=-1))
XYZW = np.round(TURNS.as_quat(), 5)
DEGREES, ZXY = (np.round(TURNS.as_euler(order, degrees=True), 3) for order in ("YXZ", "ZXY"))


def _rows(columns: Iterable[np.ndarray], separator: str = ",") -> str:
    table = np.column_stack(tuple(columns))
    return "".join(separator.join(f"{number:.5g}" for number in row) + "\n" for row in table.tolist())


def _motive(rotations: np.ndarray, kind: str) -> str:
    axes = list("XYZW" if kind == "Quaternion" else kind)
    held = ["Rotation"] * len(axes) + ["Position"] * 3
    cells = {"Type": ["Rigid Body"] * 2, "Name": ["Drill", "Head, left"], "ID": ["B1", "B2"]}
    lines = [f"Format Version,1.23,Take Name,Take 3,Rotation Type,{kind},Length Units,Millimeters", ""]
    for label, (first, second) in cells.items():
        row = [first] * len(held) + [f'"{second}"'] * len(held)
        lines.append(",".join(["", label, *row]))
    lines.append(",".join(["", "", *held, *held]))
    lines.append(",".join(["Frame", "Time (Seconds)", *[*axes, "X", "Y", "Z"] * 2]))
    body = (rotations, 1e3 * POSITIONS)
    return "\n".join(lines) + "\n" + _rows((np.arange(COUNT), TIMES, *body, *body)).replace("nan", "")


def _aframe() -> dict:
    """What avatar-recorder writes."""
    poses = [
        {
            "timestamp": 1000.0 * time,
            "position": dict(zip("xyz", position, strict=True)),
            "rotation": dict(zip("yxz", turn, strict=True)),
        }
        for time, position, turn in zip(TIMES.tolist(), POSITIONS.tolist(), DEGREES.tolist(), strict=True)
    ]
    return {"camera": {"poses": poses, "events": []}, "left": {"poses": poses, "gamepad": {"hand": "left"}}}


def _aframe_of_2017() -> list:
    return [
        {"timestamp": 1000.0 * time, "position": position, "rotation": turn}
        for time, position, turn in zip(TIMES.tolist(), POSITIONS.tolist(), XYZW.tolist(), strict=True)
    ]


ARM = """HIERARCHY
ROOT Shoulder
{
    OFFSET 0.0 0.0 0.0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    JOINT Elbow
    {
        OFFSET 2.0 0.0 0.0
        CHANNELS 3 Zrotation Xrotation Yrotation
        End Site
        {
            OFFSET 1.0 0.0 0.0
        }
    }
}
MOTION
"""
"""A shoulder and an elbow in BVH, up to where the frames begin."""

_SCALES = np.linspace(1.0, 1.2, COUNT)
_POSE = ("px", "py", "pz", "qx", "qy", "qz", "qw")
_POSE_ROWS = _rows((POSITIONS, XYZW)).splitlines(keepends=True)
_EUROC = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],v_RS_R_x [m s^-1]\n"
)

SEEDS: dict[str, tuple[str, ...]] = {
    ".csv": (
        "t,x,y,z,qx,qy,qz,qw\n" + _rows((TIMES, POSITIONS, XYZW)),
        "frame;Time;TX;TY;TZ;qw;qx;qy;qz;scale\n"
        + _rows((np.arange(COUNT), TIMES, POSITIONS, XYZW[:, 3], XYZW[:, :3], _SCALES), ";").replace(".", ","),
        "timestamp_ms,PosX (cm),PosY (cm),PosZ (cm),rotation.x,rotation.y,rotation.z,rotation.w,hand\n"
        + _rows((1e3 * TIMES, 1e2 * POSITIONS, XYZW)).replace("\n", ",left\n"),
        "t_us\t"
        + "\t".join(f"{body}_{name}" for body in ("left", "right") for name in _POSE)
        + "\n"
        + _rows((1e6 * TIMES, POSITIONS, XYZW, POSITIONS, XYZW), "\t"),
        "Recorder v1.2\nDate: 2026-11-22\n\ntime,x,y,z,qx,qy,qz,qw\n"
        + "".join(f"2026-11-22T23:59:59.{2 * row:02}+01:00,{line}" for row, line in enumerate(_POSE_ROWS)),
        '# a comment\n"t"\t"x"\t"y"\t"z"\t"qx"\t"qy"\t"qz"\t"qw"\n' + _rows((TIMES, POSITIONS, XYZW), "\t"),
    ),
    ".tum": (
        "# timestamp tx ty tz qx qy qz qw\n" + _rows((TIMES, POSITIONS, XYZW), " "),
        _rows((TIMES, POSITIONS, XYZW), " "),
    ),
    ".euroc.csv": (
        _EUROC
        + "".join(
            f"{1403636580838555648 + 20_000_001 * row},{line}"
            for row, line in enumerate(
                _rows((POSITIONS, XYZW[:, 3], XYZW[:, :3], POSITIONS[:, 0])).splitlines(keepends=True)
            )
        ),
    ),
    ".motive.csv": (_motive(XYZW, "Quaternion"), _motive(DEGREES, "YXZ")),
    ".json": (json.dumps(_aframe(), indent=1), json.dumps(_aframe()["left"]), json.dumps(_aframe_of_2017(), indent=1)),
    ".bvh": (
        f"{ARM}Frames: {COUNT}\nFrame Time: 0.02\n" + _rows((POSITIONS, ZXY, ZXY[::-1]), " "),
        f"{ARM}Frames: {COUNT}\nFrame Time: 0.02\n".replace("Elbow", "Shoulder").replace("\n", "\r\n")
        + _rows((POSITIONS, ZXY, 0.0 * ZXY), "\t"),
    ),
}
"""By how the file's name ends. Each has the same motion in the spellings that its reader knows."""


def repeated(seed: str, times: int) -> str:
    """A recording with the samples of a seed so many times, one after the other; time begins anew with each."""
    if seed.startswith(("{", "[")):
        content = json.loads(seed)
        devices = [content] if "poses" in content else [] if isinstance(content, list) else list(content.values())
        for poses in [device["poses"] for device in devices] or [content]:
            poses *= times
        return json.dumps(content)
    lines = seed.splitlines(keepends=True)
    return "".join(lines[:-COUNT] + lines[-COUNT:] * times).replace(f"Frames: {COUNT}", f"Frames: {COUNT * times}")
