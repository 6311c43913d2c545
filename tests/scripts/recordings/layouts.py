"""One motion in the file layouts of other programs, with the options needed to read each."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tests.scripts.recordings.logs import COUNT, MICROSECONDS, MOTIONS, Motion

SECONDS = MICROSECONDS * 1e-6
NANOSECONDS = 1_600_000_000_000_000_000 + 1000 * MICROSECONDS
NUMBERS = np.arange(COUNT)
LEFT, RIGHT = MOTIONS["left"], MOTIONS["right"]

COUNTED = {"frame_rate": 50.0}
"""Options for a file without times, in which every row, or every number of a frame, is a sample."""


@dataclass(frozen=True)
class Layout:
    """A program's file of the left motion, and of the right one if it has two bodies."""

    name: str
    """The name of the file."""

    text: str | bytes
    said: Mapping[str, object] = field(default_factory=dict)
    bodies: tuple[str, ...] = ("take",)
    counted: bool = False
    """True if the file has a frame rate instead of times."""

    warned: bool = False
    within: float = 1e-9

    @property
    def seconds(self) -> np.ndarray:
        """Seconds since the first sample."""
        return AT if self.counted or "frame_rate" in self.said else SECONDS


def rows(*columns: Iterable, separator: str = " ", end: str = "") -> str:
    """Return lines of text from columns of numbers or texts, or from tables of columns."""
    tables = [np.atleast_2d(np.array(column, dtype=object).T).T for column in columns]
    return "".join(
        separator.join(cell if isinstance(cell, str) else repr(cell) for cell in row) + f"{end}\n"
        for row in np.hstack(tables).tolist()
    )


def csv(header: str, *columns: Iterable, separator: str = ",") -> str:
    return header.replace(",", separator) + "\n" + rows(*columns, separator=separator)


def quaternions(order: str = "xyzw", motion: Motion = LEFT) -> np.ndarray:
    return motion.turns.as_quat()[:, ["xyzw".index(axis) for axis in order]]


def matrices(motion: Motion = LEFT, height: int = 4) -> np.ndarray:
    """Return matrices, shape (n, height, 4)."""
    result = np.tile(np.eye(4), (COUNT, 1, 1))
    result[:, :3, :3], result[:, :3, 3] = motion.turns.as_matrix(), motion.positions
    return result[:, :height]


def flat(table: np.ndarray) -> np.ndarray:
    return table.reshape(COUNT, -1)


def places(template: str, height: int, base: int = 0) -> str:
    """Return the column names of a matrix's numbers, row by row."""
    return ",".join(template.format(row + base, column + base) for row in range(height) for column in range(4))


def names(*templates: str) -> str:
    """Return column names of a position and then of a quaternion; {} is x, y, z and w."""
    position, rotation = templates
    return ",".join([position.format(axis) for axis in "xyz"] + [rotation.format(axis) for axis in "xyzw"])


AT = NUMBERS / 50.0
POSE = LEFT.positions, quaternions()
BOTH = *POSE, RIGHT.positions, quaternions(motion=RIGHT)
DOWN = flat(matrices().transpose(0, 2, 1))
"""Matrices in column-major order."""

RAW: dict[str, Layout] = {
    "KITTI": Layout("take.txt", rows(flat(matrices(height=3))), COUNTED),
    "matrices behind times": Layout("take.txt", rows(SECONDS, flat(matrices(height=3)))),
    "whole matrices": Layout("take.txt", rows(flat(matrices())), COUNTED),
    "whole matrices by columns": Layout("take.txt", rows(DOWN), COUNTED),
    "whole matrices behind times": Layout("take.txt", rows(SECONDS, flat(matrices()), separator="\t")),
    "TUM": Layout("take.txt", rows(SECONDS, *POSE)),
    "TUM by name": Layout("take.tum", rows(SECONDS, *POSE, separator="\t")),
    "TUM under names with commas": Layout("take.txt", "# t, x, y, z, qx, qy, qz, qw\n" + rows(SECONDS, *POSE)),
    "TUM under comments": Layout(
        "take.txt",
        "# ground truth trajectory\n# file: 'dataset.bag'\n# timestamp tx ty tz qx qy qz qw\n\n" + rows(SECONDS, *POSE),
    ),
    "TUM in nanoseconds": Layout("take.txt", rows(NANOSECONDS, *POSE)),
    "VINS": Layout(
        "take.csv", rows(NANOSECONDS, LEFT.positions, quaternions("wxyz"), separator=",", end=","), warned=True
    ),
    "EuRoC without names": Layout(
        "take.csv",
        rows(NANOSECONDS, LEFT.positions, quaternions("wxyz"), 0.1 * np.ones((COUNT, 9)), separator=","),
        warned=True,
    ),
    "w first, by numbers": Layout(
        "take.txt",
        rows(SECONDS, LEFT.positions, quaternions("wxyz")),
        {"columns": [("qw", "5"), ("qx", "6"), ("qy", "7"), ("qz", "8")]},
    ),
    "OpenVINS": Layout("take.txt", rows(SECONDS, quaternions(), LEFT.positions, 0.0 * np.ones((COUNT, 9)))),
    "OpenVINS under names": Layout(
        "take.txt",
        "# timestamp(s) q1 q2 q3 q4 px py pz vx vy vz\n" + rows(SECONDS, quaternions(), *[LEFT.positions] * 2),
    ),
    "TUM with frames": Layout("take.tum", rows(NUMBERS, *POSE), COUNTED),
    "poses without times": Layout("take.csv", rows(*POSE), COUNTED),
    "numbers with decimal commas": Layout("take.csv", rows(SECONDS, *POSE, separator=";").replace(".", ",")),
    "Nuke": Layout(
        "take.chan",
        rows(NUMBERS + 1, LEFT.positions, LEFT.turns.as_euler("zxy", degrees=True)[:, [1, 2, 0]], 50.0 + 0.0 * SECONDS),
        COUNTED | {"euler": "zxy"},
    ),
}

EUROC = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],v_RS_R_x [m s^-1],"
    "v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],b_w_RS_S_z [rad s^-1]"
)
_euroc = NANOSECONDS, LEFT.positions, quaternions("wxyz"), np.ones((COUNT, 6))
_ros = LEFT.positions, quaternions()
_bag = (
    NUMBERS,
    [f"{tick // 10**9}" for tick in NANOSECONDS.tolist()],
    [f"{tick % 10**9}" for tick in NANOSECONDS.tolist()],
)

NAMED: dict[str, Layout] = {
    "named matrices": Layout("take.csv", csv("time," + places("m{}{}", 4), SECONDS, flat(matrices()))),
    "named matrices by columns": Layout("take.csv", csv("time," + places("m{}{}", 4), SECONDS, DOWN)),
    "T[0][3]": Layout("take.csv", csv("t," + places("T[{}][{}]", 3), SECONDS, flat(matrices(height=3)))),
    "HmdMatrix34": Layout(
        "take.csv", csv("t," + places("hmd_m[{}][{}]", 3), SECONDS, flat(matrices(height=3))), bodies=("hmd",)
    ),
    "matrix[0] to matrix[15]": Layout(
        "take.csv", csv("t," + ",".join(f"matrix[{place}]" for place in range(16)), SECONDS, flat(matrices()))
    ),
    "r00 and tx": Layout(
        "take.csv",
        csv(
            "t," + places("r{}{}", 3).replace("r03", "tx").replace("r13", "ty").replace("r23", "tz"),
            SECONDS,
            flat(matrices(height=3)),
        ),
    ),
    "R_11 and t_1": Layout(
        "take.tsv",
        csv(
            "t," + ",".join(f"R_{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)) + ",t_1,t_2,t_3",
            *(SECONDS, LEFT.turns.as_matrix().reshape(COUNT, 9), LEFT.positions),
            separator="\t",
        ),
    ),
    "EuRoC": Layout("take.csv", csv(EUROC, *_euroc)),
    "EuRoC without units": Layout("take.csv", csv(EUROC.replace(" [ns]", "").replace(" []", ""), *_euroc)),
    "rostopic": Layout(
        "take.csv",
        csv(
            "%time,field.header.seq,field.header.stamp,field.header.frame_id,"
            + names("field.pose.position.{}", "field.pose.orientation.{}"),
            NANOSECONDS + 3_000_000,
            NUMBERS,
            NANOSECONDS,
            ["w"] * COUNT,
            *_ros,
        ),
    ),
    "bagpy": Layout(
        "take.csv",
        csv(
            "Time,header.seq,header.stamp.secs,header.stamp.nsecs," + names("pose.position.{}", "pose.orientation.{}"),
            NANOSECONDS / 1e9,
            *_bag,
            *_ros,
        ),
        within=1e-6,
    ),
    "seconds and nanoseconds": Layout(
        "take.csv",
        csv(
            "header.seq,header.stamp.sec,header.stamp.nanosec,"
            + names("pose.pose.position.{}", "pose.pose.orientation.{}"),
            *_bag,
            *_ros,
        ),
    ),
    "PX4": Layout(
        "take.csv",
        csv(
            "timestamp,timestamp_sample,q[0],q[1],q[2],q[3],position[0],position[1],position[2],velocity[0]",
            MICROSECONDS + 10**8,
            MICROSECONDS + 10**8 - 99,
            quaternions("wxyz"),
            LEFT.positions,
            SECONDS,
        ),
    ),
    "q1 to q4": Layout("take.csv", csv("t,x,y,z,q1,q2,q3,q4", SECONDS, *POSE)),
    "orientation_0 to orientation_3": Layout(
        "take.csv", csv("t,pos_0,pos_1,pos_2,orientation_0,orientation_1,orientation_2,orientation_3", SECONDS, *POSE)
    ),
    "Project Aria": Layout(
        "take.csv",
        csv(
            "graph_uid,tracking_timestamp_us,utc_timestamp_ns,"
            + names("t{}_world_device", "q{}_world_device")
            + ",gravity_x_world",
            *(["g"] * COUNT, MICROSECONDS + 149202610, NANOSECONDS - NANOSECONDS % 10**8, *POSE, SECONDS),
        ),
        bodies=("device",),
    ),
    "ADT": Layout(
        "take.csv",
        csv(
            "object_uid,timestamp[ns],t_wo_x[m],t_wo_y[m],t_wo_z[m],q_wo_w,q_wo_x,q_wo_y,q_wo_z",
            ["5691"] * COUNT,
            1000 * MICROSECONDS,
            LEFT.positions,
            quaternions("wxyz"),
        )
        + rows(["77"] * COUNT, 1000 * MICROSECONDS, RIGHT.positions, quaternions("wxyz", RIGHT), separator=","),
        bodies=("5691 wo", "77 wo"),
    ),
    "units below the names": Layout(
        "take.csv",
        csv("Time,X,Y,Z,qx,qy,qz,qw\n(ms),(mm),(mm),(mm),,,,", MICROSECONDS / 1e3, 1e3 * LEFT.positions, quaternions()),
    ),
    "PlotJuggler": Layout(
        "take.csv",
        csv(
            "__time,"
            + ",".join(names(f"/{side}/pose/position/{{}}", f"/{side}/pose/orientation/{{}}") for side in MOTIONS),
            SECONDS,
            *BOTH,
        ),
        bodies=("left", "right"),
    ),
    "a clock for each body": Layout(
        "take.csv",
        csv(
            ",".join(f"{side}_t," + names(f"{side}_{{}}", f"{side}_q{{}}") for side in MOTIONS),
            SECONDS,
            *POSE,
            5.0 + SECONDS,
            *BOTH[2:],
        ),
        bodies=("left", "right"),
    ),
    "bodies behind the names": Layout(
        "take.csv", csv("t_tool,x_tool,y_tool,z_tool,qx_tool,qy_tool,qz_tool,qw_tool", SECONDS, *POSE), bodies=("tool",)
    ),
}


def colmap(order: Iterable[int], names: Callable[[int], str], points: str, motion: Motion = LEFT) -> str:
    turns, positions = motion.turns.inv(), -motion.turns.inv().apply(motion.positions)
    seen = np.hstack((turns.as_quat(scalar_first=True), positions)).tolist()
    return "".join(f"{place + 1} {' '.join(map(repr, seen[place]))} 1 {names(place)}\n{points}\n" for place in order)


def objects(motion: Motion = LEFT, **keys: Callable[[int], object]) -> list[dict[str, object]]:
    return [{key: value(place) for key, value in keys.items()} for place in range(COUNT)]


def axes(table: np.ndarray, letters: str = "xyz") -> Callable[[int], dict[str, float]]:
    return lambda place: dict(zip(letters, table[place].tolist(), strict=True))


def pose(motion: Motion) -> dict[str, Callable[[int], object]]:
    return {"position": axes(motion.positions), "rotation": axes(motion.turns.as_quat(), "xyzw")}


_time = SECONDS.tolist().__getitem__
_images = objects(
    file_path=lambda place: f"images/{place:04}.jpg", transform_matrix=lambda place: matrices()[place].tolist()
)

OTHERS: dict[str, Layout] = {
    "COLMAP": Layout(
        "take.txt",
        "# IMAGE_ID\n#   POINTS2D[] as\n" + colmap(NUMBERS, lambda place: f"frame_{place}.png", "1.5 2 -1 3 4 12"),
        COUNTED,
    ),
    "COLMAP in any order": Layout(
        "images.txt", colmap(NUMBERS[::-1], lambda place: f"a b/frame {place:03}.png", ""), COUNTED, ("a b",)
    ),
    "COLMAP of two cameras": Layout(
        "take.txt",
        colmap(NUMBERS, lambda place: f"left/{place}.png", "1.5 2 -1")
        + colmap(NUMBERS, lambda place: f"right/{place}.png", "1.5 2 -1", RIGHT),
        *(COUNTED, ("left", "right")),
    ),
    "g2o": Layout(
        "take.g2o",
        "".join(f"VERTEX_SE3:QUAT {line}" for line in rows(NUMBERS, *POSE).splitlines(keepends=True))
        + "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1\n",
        COUNTED,
    ),
    "NeRF": Layout("take.json", json.dumps({"fl_x": 500.0, "frames": _images[::-1]}), COUNTED),
    "Record3D": Layout(
        "take.json",
        json.dumps({"fps": 50, "w": 640, "K": [1, 2, 3], "poses": np.hstack((quaternions(), LEFT.positions)).tolist()}),
        counted=True,
    ),
    "nuScenes": Layout(
        "take.json",
        json.dumps(
            objects(
                token=str,
                timestamp=lambda place: int(MICROSECONDS[place]) + 1532402927612460,
                rotation=lambda place: quaternions("wxyz")[place].tolist(),
                translation=lambda place: LEFT.positions[place].tolist(),
            )
        ),
    ),
    "A-Frame of 2017": Layout(
        "take.json",
        json.dumps(
            objects(
                timestamp=lambda place: float(MICROSECONDS[place] / 1e3),
                position=lambda place: LEFT.positions[place].tolist(),
                rotation=lambda place: quaternions()[place].tolist(),
            )
        ),
    ),
    "A-Frame": Layout(
        "take.json",
        json.dumps(
            {
                side: {
                    "poses": objects(
                        timestamp=lambda place: float(MICROSECONDS[place] / 1e3),
                        position=axes(motion.positions),
                        rotation=axes(motion.turns.as_euler("YXZ", degrees=True), "yxz"),
                    ),
                    "events": [{"x": 1}],
                }
                for side, motion in MOTIONS.items()
            }
        ),
        bodies=("left", "right"),
    ),
    "objects": Layout("take.json", json.dumps({"samples": objects(t=_time, **pose(LEFT))})),
    "objects of two bodies": Layout(
        "take.json",
        json.dumps(
            [
                {"time": _time(place)}
                | {side: {key: value(place) for key, value in pose(motion).items()} for side, motion in MOTIONS.items()}
                for place in range(COUNT)
            ]
        ),
        bodies=("left", "right"),
    ),
    "a list for each body": Layout(
        "take.json",
        json.dumps({side: objects(t=_time, **pose(motion)) for side, motion in MOTIONS.items()}),
        bodies=("left", "right"),
    ),
    "columns of objects": Layout(
        "take.json",
        json.dumps({"t": SECONDS.tolist(), "pos": LEFT.positions.tolist(), "quat": quaternions("wxyz").tolist()}),
    ),
    "objects of matrices by columns": Layout(
        "take.json", json.dumps(objects(timestamp=_time, transform=lambda place: DOWN[place].tolist()))
    ),
}

LAYOUTS = RAW | NAMED | OTHERS
