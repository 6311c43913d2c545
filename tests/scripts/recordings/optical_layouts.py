"""One motion in the export formats of Motive, Vicon and Qualisys."""

from collections.abc import Callable

import numpy as np

from tests.scripts.recordings.layouts import (
    COUNT,
    LEFT,
    NUMBERS,
    RIGHT,
    SECONDS,
    Layout,
    Motion,
    flat,
    quaternions,
    rows,
)

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
