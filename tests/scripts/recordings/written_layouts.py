"""One motion in layouts of scripts, spreadsheets and editors: separators, encodings, line ends, units and orders."""

from collections.abc import Callable
from itertools import permutations

import numpy as np

from tests.scripts.recordings.layouts import (
    BOTH,
    COUNTED,
    LEFT,
    NANOSECONDS,
    NUMBERS,
    OTHERS,
    POSE,
    SECONDS,
    Layout,
    csv,
    quaternions,
    rows,
)
from tests.scripts.recordings.logs import COUNT, MICROSECONDS

HEADER = "t,x,y,z,qx,qy,qz,qw"
UNITS = '"t [ms]","x [mm]","y [mm]","z [mm]","qx","qy","qz","qw"'
PLAIN = csv(HEADER, SECONDS, *POSE)
TUM = rows(SECONDS, *POSE)
IN_UNITS = csv(UNITS, MICROSECONDS / 1e3, 1e3 * LEFT.positions, quaternions(), separator=";")
GERMAN = PLAIN.replace(",", ";").replace(".", ",")
"""The CSV of a spreadsheet with decimal commas."""


def ended(text: str, end: str = "\r\n") -> bytes:
    """Return a text with other line ends."""
    return text.replace("\n", end).encode()


def each_cell(text: str, change: Callable[[str], str]) -> str:
    return "".join(",".join(map(change, line.split(","))) + "\n" for line in text.splitlines())


def reversed_lines(text: str) -> str:
    return "".join(text.splitlines(keepends=True)[::-1])


ENCODED: dict[str, Layout] = {
    "semicolons and decimal commas": Layout("take.csv", GERMAN),
    "tabs and decimal commas": Layout("take.tsv", GERMAN.replace(";", "\t")),
    "blanks": Layout("take.txt", PLAIN.replace(",", "   ")),
    "quoted names": Layout("take.csv", PLAIN.replace(HEADER, each_cell(HEADER, '"{}"'.format).strip())),
    "quoted names with units and decimal commas": Layout("take.csv", IN_UNITS.replace(".", ",")),
    "UTF-8 with a mark": Layout("take.csv", b"\xef\xbb\xbf" + PLAIN.encode()),
    "UTF-16, little end first": Layout("take.csv", b"\xff\xfe" + PLAIN.encode("utf-16-le")),
    "UTF-16, big end first": Layout("take.csv", b"\xfe\xff" + PLAIN.encode("utf-16-be")),
    "UTF-16 with tabs, CRLF and decimal commas": Layout(
        "take.txt", GERMAN.replace(";", "\t").replace("\n", "\r\n").encode("utf-16")
    ),
    "CRLF": Layout("take.csv", ended(PLAIN)),
    "CR": Layout("take.csv", ended(PLAIN, "\r")),
    "a comma at the end of each row": Layout("take.csv", PLAIN.replace("\n", ",\n")),
    "blank lines": Layout("take.csv", PLAIN.replace("\n", "\n\n")),
    "comments": Layout("take.csv", "# my log\n" + PLAIN.replace("\n", "\n# pause\n", 9)),
    "lines before the names": Layout(
        "take.csv", 'Recorder v1.2\nRate,90\nOperator,"Ann, Bob"\n\n# calibrated\ngain;1;2;3\n' + PLAIN
    ),
    "lines before names that are not all known": Layout(
        "take.csv", f"Recorder v1.2\nhand,button,{PLAIN}".replace("\n0", "\nleft,A,0"), bodies=("left",)
    ),
    "the separator for spreadsheets, and names in capitals": Layout("take.csv", "sep=,\n" + PLAIN.upper()),
    "exponents and signs": Layout(
        "take.csv",
        HEADER
        + each_cell("\n" + rows(SECONDS, *POSE, separator=","), lambda cell: f"{float(cell):+.17E}" if cell else ""),
    ),
    "TUM in UTF-8 with a mark": Layout("take.tum", b"\xef\xbb\xbf" + TUM.encode()),
    "g2o backwards": Layout("take.txt", reversed_lines(str(OTHERS["g2o"].text)), COUNTED),
}


def in_units(time: str, length: str) -> str:
    return f"t ({time}),x_{length},y_{length},z_{length},qx,qy,qz,qw"


def angles(order: str, degrees: bool) -> np.ndarray:
    """Return Euler angles about x, y and z; a lower-case order turns about the world's axes."""
    turned = LEFT.turns.as_euler(order, degrees=degrees)
    return turned[:, [order.lower().index(axis) for axis in "xyz"]]


def vectors(form: str, table: np.ndarray) -> list[str]:
    return [form.format(*row) for row in table.tolist()]


STAMPS = [f"2026-11-22T10:00:{tick // 10**6:02}.{tick % 10**6:06}Z" for tick in MICROSECONDS.tolist()]
EMPTY = [""] * COUNT
_vectors = vectors("({}, {}, {})", LEFT.positions), vectors("({}, {}, {}, {})", quaternions())

MEANT: dict[str, Layout] = {
    "w first, without names": Layout(
        "take.csv", rows(SECONDS, LEFT.positions, quaternions("wxyz"), separator=","), warned=True
    ),
    "rows of positions and of rotations in turn": Layout(
        "take.csv",
        HEADER
        + "\n"
        + "".join(
            f"{time!r},{','.join(map(repr, place))},,,,\n{time!r},,,,{','.join(map(repr, turn))}\n"
            for time, place, turn in zip(SECONDS.tolist(), LEFT.positions.tolist(), quaternions().tolist(), strict=True)
        ),
    ),
    "two clocks, of which one stands": Layout(
        "take.csv", csv("wall_time,device_time_s," + HEADER[2:], SECONDS // 0.1, SECONDS, *POSE)
    ),
    "three clocks": Layout(
        "take.csv",
        csv(
            "unix_ns,timestamp_us,elapsed_ms," + HEADER[2:],
            NANOSECONDS,
            MICROSECONDS,
            np.round(MICROSECONDS / 1e3),
            *POSE,
        ),
    ),
    "dates": Layout("take.csv", csv("Time,x,y,z,qx,qy,qz,qw", STAMPS, *POSE)),
    "inches": Layout("take.csv", csv(in_units("s", "inch"), SECONDS, LEFT.positions / 0.0254, quaternions())),
    "a column of devices": Layout(
        "take.csv",
        csv("device," + HEADER, ["left"] * COUNT, SECONDS, *POSE)
        + rows(["right"] * COUNT, SECONDS, *BOTH[2:], separator=","),
        bodies=("left", "right"),
    ),
    "vectors in brackets": Layout("take.csv", csv("t;Position;Rotation", SECONDS, *_vectors, separator=";")),
    "quoted vectors": Layout(
        "take.csv", csv("t,Position,Rotation", SECONDS, *([f'"{cell}"' for cell in column] for column in _vectors))
    ),
    "vectors with semicolons and decimal commas": Layout(
        "take.csv",
        csv(
            "t,Position,Rotation",
            *(SECONDS, vectors("({}; {}; {})", LEFT.positions), vectors("({}; {}; {}; {})", quaternions())),
            separator="\t",
        ).replace(".", ","),
    ),
    "vectors with decimal commas": Layout(
        "take.csv", csv("t;Position;Rotation", SECONDS, *_vectors, separator=";").replace(".", ",")
    ),
    "vectors with blanks": Layout(
        "take.csv",
        csv(
            "t,Position,Rotation",
            *(SECONDS, vectors("[{} {} {}]", LEFT.positions), vectors('"{} {} {} {}"', quaternions())),
        ),
    ),
    "vectors of Unreal": Layout(
        "take.csv",
        csv(
            "Time,Location,Rotation",
            SECONDS,
            vectors('"X={} Y={} Z={}"', LEFT.positions),
            vectors('"X={} Y={} Z={} W={}"', quaternions()),
        ),
    ),
    "a unit of time that is said": Layout(
        "take.csv", csv("t [min]" + HEADER[1:], MICROSECONDS / 1e3, *POSE), {"time_unit": "ms"}
    ),
    "frames and their rate": Layout("take.csv", csv("frame,x,y,z,qx,qy,qz,qw", NUMBERS + 100, *POSE), COUNTED),
    "roll, pitch and yaw": Layout(
        "take.csv",
        csv("t,x,y,z,roll_deg,pitch_deg,yaw_deg", SECONDS, LEFT.positions, angles("xyz", True)),
        {"euler": "xyz", "columns": [("rx", "roll_deg"), ("ry", "pitch_deg"), ("rz", "yaw_deg")]},
    ),
}

EULER: dict[str, Layout] = {
    f"angles {order} in {unit}": Layout(
        "take.csv",
        csv(
            f"t,x,y,z,Rot X [{unit}],Rot Y [{unit}],Rot Z [{unit}]",
            SECONDS,
            LEFT.positions,
            angles(order, unit == "deg"),
        ),
        {"euler": order},
    )
    for letters, unit in (("XYZ", "deg"), ("xyz", "rad"))
    for order in map("".join, permutations(letters))
}

WRITTEN = ENCODED | MEANT | EULER
