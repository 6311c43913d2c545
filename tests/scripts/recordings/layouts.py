"""One motion of one or two bodies in the file layouts of other programs, with the options needed to read each."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from rigid_motion_batch.recordings import Trajectory

COUNT = 24
MICROSECONDS = 11_111 * np.arange(COUNT) + np.arange(COUNT) % 3 * 500
"""Times since the first sample: about 90 samples per second, with jitter."""

SECONDS = MICROSECONDS * 1e-6
NANOSECONDS = 1_600_000_000_000_000_000 + 1000 * MICROSECONDS
NUMBERS = np.arange(COUNT)
AT = NUMBERS / 50.0

COUNTED = {"frame_rate": 50.0}
"""Options for a file without times, in which every row, or every number of a frame, is a sample."""


@dataclass(frozen=True)
class Motion:
    """A recorded motion: metres, and quaternions x, y, z, w."""

    positions: np.ndarray
    turns: Rotation


def _motion(side: float) -> Motion:
    t = SECONDS
    positions = np.stack((0.4 * side + 0.1 * np.sin(5.0 * t), 1.2 + 0.3 * t, 0.2 * np.cos(4.0 * t)), axis=-1)
    return Motion(positions, Rotation.from_rotvec(np.stack((side + 3.0 * t, 0.4 * t, 0.3 - t), axis=-1)))


MOTIONS = {"left": _motion(-1.0), "right": _motion(1.0)}
LEFT, RIGHT = MOTIONS.values()


@dataclass(frozen=True)
class Layout:
    """A program's file of the left motion, and of the right one if it has two bodies."""

    text: str | bytes
    name: str = "take.csv"
    """The name of the file."""

    said: Mapping[str, object] = field(default_factory=dict)
    bodies: tuple[str, ...] = ("take",)
    counted: bool = False
    """True if the file has a frame rate instead of times."""

    warned: bool = False
    within: float = 1e-9

    @property
    def options(self) -> list[str]:
        """What is said, as options of a command."""
        typed = {name: ",".join(map("=".join, said)) if name == "columns" else said for name, said in self.said.items()}
        return [f"--{name.replace('_', '-')}={said}" for name, said in typed.items()]

    @property
    def seconds(self) -> np.ndarray:
        """Seconds since the first sample."""
        return AT if self.counted or "frame_rate" in self.said else SECONDS


def assert_is_the_motion(
    trajectory: Trajectory, motion: Motion, seconds: np.ndarray, *, clock: float = 1e-9, length: float = 1e-9
) -> None:
    """Check times within `clock` seconds, positions within `length` metres, and rotations."""
    np.testing.assert_allclose(trajectory.times - trajectory.times[0], seconds, rtol=1e-15, atol=clock)
    positions = trajectory.poses.positions * trajectory.metres_per_unit
    np.testing.assert_allclose(positions, motion.positions, rtol=1e-15, atol=length)
    turns = Rotation.from_quat(trajectory.poses.quaternions, scalar_first=True)
    assert (turns.inv() * motion.turns).magnitude().max() < 1e-7
    assert trajectory.poses.scales is None


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


def angles(order: str, degrees: bool, motion: Motion = LEFT) -> np.ndarray:
    """Return Euler angles about x, y and z; a lower-case order turns about the world's axes."""
    turned = motion.turns.as_euler(order, degrees=degrees)
    return turned[:, [order.lower().index(axis) for axis in "xyz"]]


def matrices(height: int = 4) -> np.ndarray:
    """Return matrices, shape (n, height, 4)."""
    result = np.tile(np.eye(4), (COUNT, 1, 1))
    result[:, :3, :3], result[:, :3, 3] = LEFT.turns.as_matrix(), LEFT.positions
    return result[:, :height]


def flat(table: np.ndarray) -> np.ndarray:
    return table.reshape(COUNT, -1)


def places(template: str, height: int, width: int = 4, base: int = 0) -> str:
    """Return the column names of a matrix's numbers, row by row."""
    return ",".join(template.format(row + base, column + base) for row in range(height) for column in range(width))


def names(position: str, rotation: str, axes: str = "xyzw") -> str:
    """Return column names of a position and then of a rotation; {} is an axis, {!} an axis as a capital letter."""
    spelled = [(position, axis) for axis in "xyz"] + [(rotation, axis) for axis in axes]
    return ",".join(template.replace("{!}", axis.upper()).replace("{}", axis) for template, axis in spelled)


POSE = LEFT.positions, quaternions()
BOTH = *POSE, RIGHT.positions, quaternions(motion=RIGHT)
HIGH, FLAT, DOWN = flat(matrices()), flat(matrices(height=3)), flat(matrices().transpose(0, 2, 1))
"""Matrices of four rows, of three rows, and of four rows in column-major order."""

FIRST_W = LEFT.positions, quaternions("wxyz")
ZXY = angles("zxy", True)

RAW: dict[str, Layout] = {
    "KITTI": Layout(rows(FLAT), "take.txt", COUNTED),
    "matrices behind times": Layout(rows(SECONDS, FLAT), "take.txt"),
    "whole matrices": Layout(rows(HIGH), "take.txt", COUNTED),
    "whole matrices by columns": Layout(rows(DOWN), "take.txt", COUNTED),
    "whole matrices behind times": Layout(rows(SECONDS, HIGH, separator="\t"), "take.txt"),
    "TUM": Layout(rows(SECONDS, *POSE), "take.txt"),
    "TUM by name": Layout(rows(SECONDS, *POSE, separator="\t"), "take.tum"),
    "TUM under names with commas": Layout("# t, x, y, z, qx, qy, qz, qw\n" + rows(SECONDS, *POSE), "take.txt"),
    "TUM under comments": Layout(
        "# ground truth trajectory\n# file: 'dataset.bag'\n# timestamp tx ty tz qx qy qz qw\n\n" + rows(SECONDS, *POSE),
        "take.txt",
    ),
    "TUM in nanoseconds": Layout(rows(NANOSECONDS, *POSE), "take.txt"),
    "VINS": Layout(rows(NANOSECONDS, *FIRST_W, separator=",", end=","), warned=True),
    "EuRoC without names": Layout(rows(NANOSECONDS, *FIRST_W, np.full((COUNT, 9), 0.1), separator=","), warned=True),
    "w first, by numbers": Layout(
        rows(SECONDS, *FIRST_W), "take.txt", {"columns": [("qw", "5"), ("qx", "6"), ("qy", "7"), ("qz", "8")]}
    ),
    "OpenVINS": Layout(rows(SECONDS, quaternions(), LEFT.positions, np.zeros((COUNT, 9))), "take.txt"),
    "OpenVINS under names": Layout(
        "# timestamp(s) q1 q2 q3 q4 px py pz vx vy vz\n" + rows(SECONDS, quaternions(), *[LEFT.positions] * 2),
        "take.txt",
    ),
    "TUM with frames": Layout(rows(NUMBERS, *POSE), "take.tum", COUNTED),
    "poses without times": Layout(rows(*POSE), said=COUNTED),
    "numbers with decimal commas": Layout(rows(SECONDS, *POSE, separator=";").replace(".", ",")),
    "Nuke": Layout(
        rows(NUMBERS + 1, LEFT.positions, ZXY, np.full(COUNT, 50.0)), "take.chan", COUNTED | {"euler": "zxy"}
    ),
}

EUROC = (
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],v_RS_R_x [m s^-1],"
    "v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],b_w_RS_S_z [rad s^-1]"
)
ROSTOPIC = "%time,field.header.seq,field.header.stamp,field.header.frame_id," + names(
    "field.pose.position.{}", "field.pose.orientation.{}"
)
BAGPY = "Time,header.seq,header.stamp.secs,header.stamp.nsecs," + names("pose.position.{}", "pose.orientation.{}")
ROS2 = "header.seq,header.stamp.sec,header.stamp.nanosec," + names("pose.pose.position.{}", "pose.pose.orientation.{}")
PX4 = "timestamp,timestamp_sample,q[0],q[1],q[2],q[3],position[0],position[1],position[2],velocity[0]"
ARIA = (
    "graph_uid,tracking_timestamp_us,utc_timestamp_ns,"
    + names("t{}_world_device", "q{}_world_device")
    + ",gravity_x_world"
)
ADT = "object_uid,timestamp[ns]," + names("t_wo_{}[m]", "q_wo_{}", "wxyz")
PLOTJUGGLER = "__time," + ",".join(
    names(f"/{side}/pose/position/{{}}", f"/{side}/pose/orientation/{{}}") for side in MOTIONS
)
CLOCKS = ",".join(f"{side}_t," + names(f"{side}_{{}}", f"{side}_q{{}}") for side in MOTIONS)

_euroc = NANOSECONDS, *FIRST_W, np.ones((COUNT, 6))
_bag = NUMBERS, NANOSECONDS // 10**9, NANOSECONDS % 10**9
_r00 = places("r{}{}", 3).replace("r03", "tx").replace("r13", "ty").replace("r23", "tz")

NAMED: dict[str, Layout] = {
    "named matrices": Layout(csv("time," + places("m{}{}", 4), SECONDS, HIGH)),
    "named matrices by columns": Layout(csv("time," + places("m{}{}", 4), SECONDS, DOWN)),
    "T[0][3]": Layout(csv("t," + places("T[{}][{}]", 3), SECONDS, FLAT)),
    "HmdMatrix34": Layout(csv("t," + places("hmd_m[{}][{}]", 3), SECONDS, FLAT), bodies=("hmd",)),
    "matrix[0] to matrix[15]": Layout(csv("t," + ",".join(f"matrix[{place}]" for place in range(16)), SECONDS, HIGH)),
    "r00 and tx": Layout(csv("t," + _r00, SECONDS, FLAT)),
    "R_11 and t_1": Layout(
        csv(
            f"t,{places('R_{}{}', 3, 3, base=1)},t_1,t_2,t_3",
            *(SECONDS, flat(LEFT.turns.as_matrix()), LEFT.positions),
            separator="\t",
        ),
        "take.tsv",
    ),
    "EuRoC": Layout(csv(EUROC, *_euroc)),
    "EuRoC without units": Layout(csv(EUROC.replace(" [ns]", "").replace(" []", ""), *_euroc)),
    "rostopic": Layout(csv(ROSTOPIC, NANOSECONDS + 3_000_000, NUMBERS, NANOSECONDS, ["w"] * COUNT, *POSE)),
    "bagpy": Layout(csv(BAGPY, NANOSECONDS / 1e9, *_bag, *POSE), within=1e-6),
    "seconds and nanoseconds": Layout(csv(ROS2, *_bag, *POSE)),
    "PX4": Layout(
        csv(PX4, MICROSECONDS + 10**8, MICROSECONDS + 10**8 - 99, quaternions("wxyz"), LEFT.positions, SECONDS)
    ),
    "q1 to q4": Layout(csv("t,x,y,z,q1,q2,q3,q4", SECONDS, *POSE)),
    "orientation_0 to orientation_3": Layout(
        csv("t,pos_0,pos_1,pos_2,orientation_0,orientation_1,orientation_2,orientation_3", SECONDS, *POSE)
    ),
    "Project Aria": Layout(
        csv(ARIA, ["g"] * COUNT, MICROSECONDS + 149202610, NANOSECONDS - NANOSECONDS % 10**8, *POSE, SECONDS),
        bodies=("device",),
    ),
    "ADT": Layout(
        csv(ADT, ["5691"] * COUNT, 1000 * MICROSECONDS, *FIRST_W)
        + rows(["77"] * COUNT, 1000 * MICROSECONDS, RIGHT.positions, quaternions("wxyz", RIGHT), separator=","),
        bodies=("5691 wo", "77 wo"),
    ),
    "units below the names": Layout(
        csv("Time,X,Y,Z,qx,qy,qz,qw\n(ms),(mm),(mm),(mm),,,,", MICROSECONDS / 1e3, 1e3 * LEFT.positions, quaternions())
    ),
    "PlotJuggler": Layout(csv(PLOTJUGGLER, SECONDS, *BOTH), bodies=("left", "right")),
    "a clock for each body": Layout(csv(CLOCKS, SECONDS, *POSE, 5.0 + SECONDS, *BOTH[2:]), bodies=("left", "right")),
    "bodies behind the names": Layout(
        csv("t_tool,x_tool,y_tool,z_tool,qx_tool,qy_tool,qz_tool,qw_tool", SECONDS, *POSE), bodies=("tool",)
    ),
}


def colmap(order: Iterable[int], names: Callable[[int], str], points: str, motion: Motion = LEFT) -> str:
    turns, positions = motion.turns.inv(), -motion.turns.inv().apply(motion.positions)
    seen = np.hstack((turns.as_quat(scalar_first=True), positions)).tolist()
    return "".join(f"{place + 1} {' '.join(map(repr, seen[place]))} 1 {names(place)}\n{points}\n" for place in order)


def objects(**columns: Iterable) -> list[dict[str, object]]:
    """Return an object for every sample, from a column for each key."""
    lists = [column.tolist() if isinstance(column, np.ndarray) else column for column in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*lists, strict=True)]


def axes(table: np.ndarray, letters: str = "xyz") -> list[dict[str, float]]:
    return [dict(zip(letters, row, strict=True)) for row in table.tolist()]


def pose(motion: Motion) -> dict[str, list]:
    return {"position": axes(motion.positions), "rotation": axes(motion.turns.as_quat(), "xyzw")}


def of_both(content: Callable[[Motion], object]) -> dict[str, object]:
    return {side: content(motion) for side, motion in MOTIONS.items()}


def in_json(content: object, **settings: object) -> Layout:
    return Layout(json.dumps(content), "take.json", **settings)


def _a_frame(motion: Motion) -> dict[str, object]:
    turns = axes(motion.turns.as_euler("YXZ", degrees=True), "yxz")
    poses = objects(timestamp=MICROSECONDS / 1e3, position=axes(motion.positions), rotation=turns)
    return {"poses": poses, "events": [{"x": 1}]}


_images = objects(file_path=[f"images/{place:04}.jpg" for place in NUMBERS], transform_matrix=matrices())
_fps = {"fps": 50, "w": 640, "K": [1, 2, 3]}

OTHERS: dict[str, Layout] = {
    "COLMAP": Layout(
        "# IMAGE_ID\n#   POINTS2D[] as\n" + colmap(NUMBERS, lambda place: f"frame_{place}.png", "1.5 2 -1 3 4 12"),
        "take.txt",
        COUNTED,
    ),
    "COLMAP in any order": Layout(
        colmap(NUMBERS[::-1], lambda place: f"a b/frame {place:03}.png", ""), "images.txt", COUNTED, ("a b",)
    ),
    "COLMAP of two cameras": Layout(
        colmap(NUMBERS, lambda place: f"left/{place}.png", "1.5 2 -1")
        + colmap(NUMBERS, lambda place: f"right/{place}.png", "1.5 2 -1", RIGHT),
        *("take.txt", COUNTED, ("left", "right")),
    ),
    "g2o": Layout(
        rows(["VERTEX_SE3:QUAT"] * COUNT, NUMBERS, *POSE) + "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1\n", "take.g2o", COUNTED
    ),
    "NeRF": in_json({"fl_x": 500.0, "frames": _images[::-1]}, said=COUNTED),
    "Record3D": in_json(_fps | {"poses": np.hstack((quaternions(), LEFT.positions)).tolist()}, counted=True),
    "nuScenes": in_json(
        objects(
            token=map(str, NUMBERS),
            timestamp=MICROSECONDS + 1532402927612460,
            rotation=quaternions("wxyz"),
            translation=LEFT.positions,
        )
    ),
    "A-Frame of 2017": in_json(objects(timestamp=MICROSECONDS / 1e3, position=LEFT.positions, rotation=quaternions())),
    "A-Frame": in_json(of_both(_a_frame), bodies=("left", "right")),
    "objects": in_json({"samples": objects(t=SECONDS, **pose(LEFT))}),
    "objects of two bodies": in_json(
        objects(time=SECONDS, **of_both(lambda motion: objects(**pose(motion)))), bodies=("left", "right")
    ),
    "a list for each body": in_json(
        of_both(lambda motion: objects(t=SECONDS, **pose(motion))), bodies=("left", "right")
    ),
    "columns of objects": in_json(
        {"t": SECONDS.tolist(), "pos": LEFT.positions.tolist(), "quat": quaternions("wxyz").tolist()}
    ),
    "objects of matrices by columns": in_json(objects(timestamp=SECONDS, transform=DOWN)),
}

MOTIVE = (
    "Format Version;1.23;Take Name;T;Export Frame Rate;90.0;Rotation Type;{};Length Units;{}\n\n"
    ";Type;{};Marker\n;Name;{};M\n;ID;{};2\n;;{};Position\nFrame;Time (Seconds);{};X\n"
)


def motive(kind: str, turns: np.ndarray, axes: str, units: str = "Meters", asset: str = "Rigid Body") -> str:
    count = len(axes) + 3
    header = MOTIVE.format(
        *(kind, units, ";".join([asset] * count), ";".join(["Tool"] * count), ";".join("1" * count)),
        *(";".join(["Rotation"] * len(axes) + ["Position"] * 3), ";".join([*axes, *"XYZ"])),
    )
    metres = {"Meters": 1.0, "Millimeters": 1e-3, "Inches": 0.0254}[units]
    return header + rows(NUMBERS, SECONDS, turns, LEFT.positions / metres, [""] * COUNT, separator=";")


_six = "RX;RY;RZ;TX;TY;TZ"


def vicon(turns: Callable[[Motion], np.ndarray], axes: str, unit: str, title: str = "Objects") -> str:
    header = [title, "50", ";;Tool:Tool" + ";" * len(axes.split(";")) + "Cup:Cup", f"Frame;Sub Frame;{axes};{axes}"]
    units = ";".join([unit] * axes.count("R") + ["mm"] * 3)
    table = [column for motion in (LEFT, RIGHT) for column in (turns(motion), 1e3 * motion.positions)]
    return "\n".join([*header, f";;{units};{units}", rows(NUMBERS + 1, 0 * NUMBERS, *table, separator=";")])


def qualisys(nine: Callable[[np.ndarray], np.ndarray], timed: bool, euler: str = "XYZ") -> str:
    columns = ["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{place}]" for place in range(9))]
    table = [
        column
        for motion in (LEFT, RIGHT)
        for column in (
            1e3 * motion.positions,
            motion.turns.as_euler(euler, degrees=True),
            0.1 + 0.0 * SECONDS,
            flat(nine(motion.turns.as_matrix())),
        )
    ]
    settings = (
        "NO_OF_FRAMES\t24\nNO_OF_CAMERAS\t8\nNO_OF_BODIES\t2\nFREQUENCY\t50\nDATA_INCLUDED\t6D\nBODY_NAMES\tTool\tCup\n"
    )
    names = "\t".join([*(["Frame", "Time"] if timed else []), *columns, *columns])
    return settings + names + "\n" + rows(*((NUMBERS + 1, SECONDS) if timed else ()), *table, separator="\t")


TWO = ("Tool", "Cup")
VICONS = ("Tool:Tool", "Cup:Cup")
QUATERNIONS = motive("Quaternion", quaternions(), "XYZW")
WITH_PARENTS = (
    motive("Quaternion", quaternions(), "XYZW", "Inches")
    .replace(";Type;", ";;")
    .replace(";Name;", ";;")
    .replace(";ID;", ";;")
    .replace("\n;;;Rot", "\n;Parent" + ";" * 8 + "\n;;;Rot")
    .replace("Time (Seconds)", "Time")
)


def by_columns(table: np.ndarray) -> np.ndarray:
    return table.transpose(0, 2, 1)


OPTICAL: dict[str, Layout] = {
    "Motive": Layout(QUATERNIONS.replace(";", ","), bodies=("Tool",)),
    "Motive with semicolons and decimal commas": Layout(
        motive("Quaternion", quaternions(), "XYZW", "Millimeters").replace(".", ","), bodies=("Tool",)
    ),
    "Motive with tabs": Layout(QUATERNIONS.replace(";", "\t"), "take.tsv", bodies=("Tool",)),
    "Motive's bones": Layout(motive("Quaternion", quaternions(), "XYZW", asset="Bone"), bodies=("Tool",)),
    "Motive with parents, without names of rows, in inches": Layout(WITH_PARENTS, bodies=("Tool",)),
    "Motive's angles": Layout(motive("YXZ", LEFT.turns.as_euler("YXZ", degrees=True), "YXZ"), bodies=("Tool",)),
    "Vicon": Layout(
        vicon(lambda motion: quaternions(motion=motion), "RX;RY;RZ;RW;TX;TY;TZ", "").replace(";", ","),
        bodies=VICONS,
        counted=True,
    ),
    "Vicon's angles": Layout(
        vicon(lambda motion: motion.turns.as_euler("XYZ"), _six, "rad", "Segments"),
        said={"euler": "XYZ"},
        bodies=VICONS,
        counted=True,
    ),
    "Vicon behind trajectories": Layout(
        "Trajectories\n50\n;;A:B\nFrame;Sub Frame;X;Y;Z\n;;mm;mm;mm\n1;0;1;2;3\n\n"
        + vicon(lambda motion: motion.turns.as_euler("XYZ", degrees=True), _six, "deg")
        + "\nDevices\n1000\n",
        said={"euler": "XYZ"},
        bodies=VICONS,
        counted=True,
    ),
    "Qualisys": Layout(qualisys(by_columns, True), "take.tsv", bodies=TWO),
    "Qualisys with angles of its own": Layout(qualisys(by_columns, True, "ZXY"), "take.tsv", bodies=TWO, warned=True),
    "Qualisys row by row, without times": Layout(
        qualisys(lambda table: table, False), "take.tsv", bodies=TWO, counted=True
    ),
}

LAYOUTS = RAW | NAMED | OTHERS | OPTICAL
