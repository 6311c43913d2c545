"""One motion in layouts of scripts, spreadsheets and editors: separators, encodings, line ends, units and orders."""

from collections.abc import Callable
from itertools import permutations

import numpy as np

from tests.scripts.recordings.layouts import (
    BOTH,
    COUNT,
    COUNTED,
    FIRST_W,
    LAYOUTS,
    LEFT,
    MICROSECONDS,
    NANOSECONDS,
    NUMBERS,
    POSE,
    SECONDS,
    Layout,
    angles,
    csv,
    names,
    quaternions,
    rows,
)

HEADER = "t,x,y,z,qx,qy,qz,qw"
UNITS = '"t [ms]","x [mm]","y [mm]","z [mm]","qx","qy","qz","qw"'
PLAIN = csv(HEADER, SECONDS, *POSE)
TUM = rows(SECONDS, *POSE)
IN_UNITS = csv(UNITS, MICROSECONDS / 1e3, 1e3 * LEFT.positions, quaternions(), separator=";")
GERMAN = PLAIN.replace(",", ";").replace(".", ",")
"""The CSV of a spreadsheet with decimal commas."""


def each_cell(text: str, change: Callable[[str], str]) -> str:
    return "".join(",".join(map(change, line.split(","))) + "\n" for line in text.splitlines())


def reversed_lines(text: str) -> str:
    return "".join(text.splitlines(keepends=True)[::-1])


def by_turns(*texts: str) -> str:
    """Return the first line of each text, then the second line of each, and so on."""
    return "".join("".join(lines) for lines in zip(*(text.splitlines(keepends=True) for text in texts), strict=True))


ENCODED: dict[str, Layout] = {
    "blanks": Layout(PLAIN.replace(",", "   "), "take.txt"),
    "quoted names": Layout(PLAIN.replace(HEADER, each_cell(HEADER, '"{}"'.format).strip())),
    "quoted names with units and decimal commas": Layout(IN_UNITS.replace(".", ",")),
    "UTF-8 with a mark": Layout(b"\xef\xbb\xbf" + PLAIN.encode()),
    "UTF-16, big end first": Layout(b"\xfe\xff" + PLAIN.encode("utf-16-be")),
    "UTF-16 with tabs, CRLF and decimal commas": Layout(
        GERMAN.replace(";", "\t").replace("\n", "\r\n").encode("utf-16"), "take.txt"
    ),
    "CR": Layout(PLAIN.replace("\n", "\r")),
    "a comma at the end of each row": Layout(PLAIN.replace("\n", ",\n")),
    "blank lines": Layout(PLAIN.replace("\n", "\n\n")),
    "comments": Layout("# my log\n" + PLAIN.replace("\n", "\n# pause\n", 9)),
    "lines before the names": Layout(
        'Recorder v1.2\nRate,90\nOperator,"Ann, Bob"\n\n# calibrated\ngain;1;2;3\n' + PLAIN
    ),
    "lines before names that are not all known": Layout(
        f"Recorder v1.2\nhand,button,{PLAIN}".replace("\n0", "\nleft,A,0"), bodies=("left",)
    ),
    "the separator for spreadsheets, and names in capitals": Layout("sep=,\n" + PLAIN.upper()),
    "exponents and signs": Layout(
        f"{HEADER}\n" + each_cell(rows(SECONDS, *POSE, separator=","), lambda cell: f"{float(cell):+.17E}")
    ),
    "TUM in UTF-8 with a mark": Layout(b"\xef\xbb\xbf" + TUM.encode(), "take.tum"),
    "g2o backwards": Layout(reversed_lines(str(LAYOUTS["g2o"].text)), "take.txt", COUNTED),
}


def vectors(form: str, table: np.ndarray) -> list[str]:
    return [form.format(*row) for row in table.tolist()]


def of_vectors(position: str, rotation: str, separator: str = ",") -> str:
    """Return a CSV with a vector and a quaternion in a cell each."""
    cells = vectors(position, LEFT.positions), vectors(rotation, quaternions())
    return csv("t,Position,Rotation", SECONDS, *cells, separator=separator)


STAMPS = [f"2026-11-22T10:00:{tick // 10**6:02}.{tick % 10**6:06}Z" for tick in MICROSECONDS.tolist()]
THREE_CLOCKS = NANOSECONDS, MICROSECONDS, np.round(MICROSECONDS / 1e3)
EMPTY = [""] * COUNT
ONE_BY_ONE = list(zip(HEADER.split(","), ("When", *"abcdefg"), strict=True))

MEANT: dict[str, Layout] = {
    "w first, without names": Layout(rows(SECONDS, *FIRST_W, separator=","), warned=True),
    "columns named one by one": Layout(csv("when,a,b,c,d,e,f,g", SECONDS, *POSE), said={"columns": ONE_BY_ONE}),
    "rows of positions and of rotations in turn": Layout(
        f"{HEADER}\n"
        + by_turns(
            rows(SECONDS, LEFT.positions, *[EMPTY] * 4, separator=","),
            rows(SECONDS, *[EMPTY] * 3, quaternions(), separator=","),
        )
    ),
    "rows of bodies in turn": Layout(
        f"t,{names('left_{}', 'left_q{}')},{names('right_{}', 'right_q{}')}\n"
        + by_turns(
            rows(SECONDS, *POSE, *[EMPTY] * 7, separator=","), rows(SECONDS, *[EMPTY] * 7, *BOTH[2:], separator=",")
        ),
        bodies=("left", "right"),
    ),
    "two clocks, of which one stands": Layout(
        csv("wall_time,device_time_s," + HEADER[2:], SECONDS // 0.1, SECONDS, *POSE)
    ),
    "two clocks, of which one is said": Layout(
        csv("time,clock," + HEADER[2:], 2.0 * SECONDS, SECONDS, *POSE), said={"columns": [("t", "clock")]}
    ),
    "three clocks": Layout(csv("unix_ns,timestamp_us,elapsed_ms," + HEADER[2:], *THREE_CLOCKS, *POSE)),
    "dates": Layout(csv("Time,x,y,z,qx,qy,qz,qw", STAMPS, *POSE)),
    "inches": Layout(csv("t (s),x_inch,y_inch,z_inch,qx,qy,qz,qw", SECONDS, LEFT.positions / 0.0254, quaternions())),
    "a column of devices": Layout(
        csv("device," + HEADER, ["left"] * COUNT, SECONDS, *POSE)
        + rows(["right"] * COUNT, SECONDS, *BOTH[2:], separator=","),
        bodies=("left", "right"),
    ),
    "a body that lacks an axis": Layout(
        csv(f"{HEADER},left_x,left_z,left_qx,left_qy,left_qz,left_qw", SECONDS, *POSE, np.zeros((COUNT, 6)))
    ),
    "quaternions beside angles": Layout(csv(f"{HEADER},rx,ry,rz", SECONDS, *POSE, np.ones((COUNT, 3)))),
    "angles beside quaternions": Layout(
        csv(f"{HEADER},rx,ry,rz", SECONDS, LEFT.positions, np.full((COUNT, 4), 0.5), angles("XYZ", True)),
        said={"euler": "XYZ", "degrees": True},
    ),
    "a scale that is always 1": Layout(csv(f"{HEADER},s", SECONDS, *POSE, np.ones(COUNT))),
    "vectors in brackets": Layout(of_vectors("({}, {}, {})", "({}, {}, {}, {})", ";")),
    "quoted vectors": Layout(of_vectors('"({}, {}, {})"', '"({}, {}, {}, {})"')),
    "vectors with semicolons and decimal commas": Layout(
        of_vectors("({}; {}; {})", "({}; {}; {}; {})", "\t").replace(".", ",")
    ),
    "vectors with decimal commas": Layout(of_vectors("({}, {}, {})", "({}, {}, {}, {})", ";").replace(".", ",")),
    "vectors with blanks": Layout(of_vectors("[{} {} {}]", '"{} {} {} {}"')),
    "vectors of Unreal": Layout(
        of_vectors('"X={} Y={} Z={}"', '"X={} Y={} Z={} W={}"').replace("t,Position", "Time,Location")
    ),
    "a unit of time that is said": Layout(
        csv("t [min]" + HEADER[1:], MICROSECONDS / 1e3, *POSE), said={"time_unit": "ms"}
    ),
    "many turns, in radians that are said": Layout(
        csv("t,x,y,z,rx_rad,ry_rad,rz_rad", SECONDS, LEFT.positions, angles("XYZ", False) + 58.0 * np.pi),
        said={"euler": "XYZ"},
    ),
    "keys of rows": Layout(csv(HEADER, NUMBERS + 18295873486192640, *POSE), said=COUNTED),
    "frames and their rate": Layout(csv("frame,x,y,z,qx,qy,qz,qw", NUMBERS + 100, *POSE), said=COUNTED),
    "roll, pitch and yaw": Layout(
        csv("t,x,y,z,roll_deg,pitch_deg,yaw_deg", SECONDS, LEFT.positions, angles("xyz", True)),
        said={"euler": "xyz", "columns": [("rx", "roll_deg"), ("ry", "pitch_deg"), ("rz", "yaw_deg")]},
    ),
}

EULER: dict[str, Layout] = {
    f"angles {order} in {unit}": Layout(
        csv(
            f"t,x,y,z,Rot X [{unit}],Rot Y [{unit}],Rot Z [{unit}]",
            *(SECONDS, LEFT.positions, angles(order, unit == "deg")),
        ),
        said={"euler": order},
    )
    for letters, unit in (("XYZ", "deg"), ("xyz", "rad"))
    for order in map("".join, permutations(letters))
}

WRITTEN = ENCODED | MEANT | EULER
