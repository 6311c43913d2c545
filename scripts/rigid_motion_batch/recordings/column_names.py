"""Names of columns in tracker logs: what a column holds, and its axis, unit and body.

Loggers write `t`, `timestamp_ms` and `Time (s)`, `x`, `px`, `PosX`, `pos_x_cm` and `position.x`, `qw`, `rot_w` and
`Rotation W`; with several bodies in a row `left_pos_x` and `LeftHand.position.x`. A name is split into words, at dots,
dashes, blanks and capitals. Words with a known meaning are removed, and the rest is the name of the body. Numbers stand
for axes if they end such a name: `q0`, `position[2]`, `m03`, `R_11`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import cast

from .options import TICKS_PER_S_BY_UNIT

LONGEST_NAME = 100
"""Characters. No known column has a longer name."""

UNITS = {
    "s": "s sec secs second seconds",
    "ms": "ms msec msecs millisec milli millis millisecond milliseconds",
    "us": "us usec usecs microsec micro micros microsecond microseconds",
    "ns": "ns nsec nsecs nanosec nano nanos nanosecond nanoseconds",
    "m": "m meter meters metre metres",
    "cm": "cm centimeter centimeters centimetre centimetres",
    "mm": "mm millimeter millimeters millimetre millimetres",
    "in": "in inch inches",
    "ft": "ft feet",
    "deg": "deg degs degree degrees °",
    "rad": "rad rads radian radians",
}
"""Units and their spellings."""

UNIT_OF = {spelling: unit for unit, spellings in UNITS.items() for spelling in spellings.split()}

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Units of length, in metres."""

UNITS_AS_WORDS = {word for word, unit in UNIT_OF.items() if unit not in TICKS_PER_S_BY_UNIT} - {"in", "feet"}
"""Units that, without brackets, cannot be mistaken for body parts."""

KINDS = {
    "position": "p pos position positions t trans translation translate loc location coord coords coordinate",
    "quaternion": "q quat quats quaternion",
    "rotation": "r rot rots rotation rotations ori orient orientation att attitude",
    "euler": "euler eulers angle angles rpy",
    "matrix": "m mat matrix transform pose tf extrinsic extrinsics",
}
"""Kinds of columns and their spellings. A rotation with a w is a quaternion, any other rotation is Euler angles."""

KIND_OF = {word: kind for kind, words in KINDS.items() if kind != "matrix" for word in words.split()}
NUMBERED = KIND_OF | dict.fromkeys(KINDS["matrix"].split(), "matrix")
"""Words that make an axis together with a number after them. Before a letter, words for matrices have no meaning."""

LEADING_LETTERS = ("p", "q", "t")
"""Letters that tell the kind at the beginning of a name. An r there more likely means the right side."""

TURNS = ("roll", "pitch", "yaw")
"""Names of Euler angles that do not state their axis."""

_WORDS = {
    "time": "t ts time times timestamp timestamps stamp clock elapsed realtime datetime",
    "beside time": "since start startup begin beginning launch recording session game app unity unreal system sys host "
    "unix epoch utc posix absolute relative rel abs total sample capture log header field rosbag from of in at the "
    "real level load unscaled scaled date iso tracking wall device sensor hardware monotonic server client",
    "frames": "frame frames sample samples",
    "beside frames": "index idx number num no nr count counter id",
    "devices": "device tracker controller body object node joint bone hand side role name id",
    "beside devices": "label serial xr tracked rigid game uid uuid guid",
    "without meaning": "m local world global pose transform tf field data value component",
}

TIME = frozenset(_WORDS["time"].split())
"""Words for time."""

WITH_TIME = TIME | frozenset(_WORDS["beside time"].split())
"""Words for time, and words that may accompany them without effect. `delta` and `frame` change the meaning."""

FRAMES = frozenset(_WORDS["frames"].split())
"""Words for a frame count."""

WITH_FRAMES = FRAMES.union(_WORDS["beside frames"].split())

DATES = {"date", "datetime", "iso"}
"""Words for a time that is a date."""

DEVICES = tuple(_WORDS["devices"].split())
"""Words for a column that says whose row it is, the most specific first."""

WITH_DEVICES = frozenset(DEVICES).union(_WORDS["beside devices"].split())

WITHOUT_MEANING = frozenset(_WORDS["without meaning"].split())
"""Words in the name of a position or rotation that do not distinguish bodies."""

_UPPER = r"[^\W\d_a-z]"
WORD = re.compile(rf"{_UPPER}+(?={_UPPER}[a-z])|{_UPPER}?[a-z]+|{_UPPER}+|\d+|°")
BRACKETS = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]")
TIME_WITH_UNIT = re.compile(r"^(t|time|timestamp)(sec|ms|us|ns)$")
AXIS = re.compile(rf"({'|'.join(sorted(KIND_OF, key=len, reverse=True))})?([xyzw])(mm|cm|m)?")
ENDS_WITH_AXIS = re.compile(rf"(?:^|[\W_])(?:{AXIS.pattern})$", re.IGNORECASE)


@dataclass(frozen=True)
class ColumnName:
    """The meaning of a column's name."""

    kind: str
    """"time", "frame", "scale", "device", or one of `KINDS`."""

    axis: str = ""
    """x, y, z, w, one of `TURNS`, or a number: "0", or "03" for row 0 and column 3. For a device, the word for it. For
    a time, "date" if the name says so."""

    unit: str = ""
    """One of `UNITS`, or the text in brackets; empty if the name states no unit."""

    body: str = ""
    """The body, spelled as in the file."""


@lru_cache(maxsize=4096)
def column_name(text: str) -> ColumnName | None:
    """Return the meaning of a column's name, or None if it is not known."""
    if len(text) > LONGEST_NAME:
        return None
    text, unit = _without_brackets(text)
    spans = [match.span() for match in WORD.finditer(text)]
    words = [text[start:end].lower() for start, end in spans]
    if not FRAMES.isdisjoint(words) and WITH_FRAMES.issuperset(words):
        return ColumnName("frame")
    if time := _time(words, unit):
        return time
    devices = [word for word in DEVICES if word in words]
    if devices and WITH_DEVICES.issuperset(words):
        return ColumnName("device", devices[0])
    if words == ["s"]:
        return ColumnName("scale")
    taken = {len(words) - 1}
    result = ColumnName("scale") if words[-1:] == ["scale"] else _pose(words, unit, taken)
    return result and replace(result, body=_body_name(text, words, spans, taken))


def unit_in(text: str) -> str:
    """Return the unit at the end of any name; empty if there is none."""
    text, unit = _without_brackets(text[-LONGEST_NAME:])
    words = WORD.findall(text)
    return unit or (UNIT_OF.get(words[-1].lower(), "") if len(words) > 1 else "")


def _without_brackets(text: str) -> tuple[str, str]:
    """Return a name without the unit in brackets, and the unit. An axis or a number in brackets stays."""
    text, unit = text.strip().replace("\u00b5", "u").replace("\u03bc", "u"), ""
    for match in BRACKETS.finditer(text):
        content, before = match[1].lower(), text[: match.start()]
        numbered = content.isdecimal() and re.search(r"[\w\]]$", before) and not ENDS_WITH_AXIS.search(before)
        if content not in ("x", "y", "z", "w") and not numbered:
            # Quantities without a unit are marked [], [1] or [-].
            unit = UNIT_OF.get(content, content.strip("-1"))
            text = before + " " * len(match[0]) + text[match.end() :]
    return text, unit


def _time(words: list[str], unit: str) -> ColumnName | None:
    parts = " ".join(TIME_WITH_UNIT.sub(r"\1 \2", word) for word in words).split()
    units = [UNIT_OF[word] for word in parts if UNIT_OF.get(word) in TICKS_PER_S_BY_UNIT]
    others = [word for word in parts if UNIT_OF.get(word) not in TICKS_PER_S_BY_UNIT]
    # A plain s is a scale; any other unit of time means a time.
    timely = not TIME.isdisjoint(others) or (bool(units) and words != ["s"])
    if not timely or not WITH_TIME.issuperset(others):
        return None
    dated = "" if DATES.isdisjoint(others) else "date"
    return ColumnName("time", dated, unit or (units[-1] if units else ""))


def _pose(words: list[str], unit: str, taken: set[int]) -> ColumnName | None:
    """Return the meaning of a position's or rotation's name. The places of the words used are left in `taken`."""
    taken.clear()
    for place, word in enumerate(words):
        # A single letter in the middle is more likely part of the body's name.
        if place and word in UNITS_AS_WORDS and (len(word) > 1 or place == len(words) - 1):
            unit = unit or UNIT_OF[word]
            taken.add(place)
    axes = [place for place, word in enumerate(words) if place not in taken and (AXIS.fullmatch(word) or word in TURNS)]
    if not axes:
        return _numbered(words, unit, taken) if words[-1:] and words[-1].isdecimal() else None
    place = axes[-1]
    of_kinds = {other for other, word in enumerate(words) if len(word) > 1 and word in KIND_OF}
    leading = place > 1 and not of_kinds and words[0] in LEADING_LETTERS  # p_RS_R_x, q_wo_w
    of_kinds |= {0} if leading else set()
    taken |= of_kinds | {place}
    if words[place] in TURNS:
        return ColumnName("euler", words[place], unit)
    kinds = {KIND_OF[words[other]] for other in of_kinds - {place}}
    fused, axis, fused_unit = cast("re.Match[str]", AXIS.fullmatch(words[place])).groups()
    if fused:
        kinds.add(KIND_OF[fused])
    elif place and not leading and len(words[place - 1]) == 1 and words[place - 1] in KIND_OF:
        kinds.add(KIND_OF[words[place - 1]])
        taken.add(place - 1)
    kind = next((kind for kind in ("quaternion", "euler", "rotation") if kind in kinds), "position")
    return None if axis == "w" and kind in ("position", "euler") else ColumnName(kind, axis, unit or fused_unit or "")


def _numbered(words: list[str], unit: str, taken: set[int]) -> ColumnName | None:
    """Return the meaning of a name that ends with one number, or with the numbers of a row and a column."""
    first = len(words) - 2 if len(words[-1]) == 1 and words[-2:-1] and words[-2].isdecimal() else len(words) - 1
    kinds = {place: NUMBERED[word] for place, word in enumerate(words[:first]) if word in NUMBERED}
    axis = "".join(words[first:])
    if not kinds or len(axis) > 2:
        return None
    taken |= {*kinds, *range(first, len(words))}
    known = [
        kind for place, kind in kinds.items() if kind != "matrix" and (len(words[place]) > 1 or place == first - 1)
    ]
    return ColumnName(known[-1] if known else NUMBERED[words[max(kinds)]], axis, unit)


def _body_name(text: str, words: list[str], spans: list[tuple[int, int]], taken: set[int]) -> str:
    """Return the words left of a name: as written, if they are adjacent, else joined by underscores."""
    left = [place for place, word in enumerate(words) if place not in taken and word not in WITHOUT_MEANING]
    if not left:
        return ""
    if left[-1] - left[0] == len(left) - 1:
        return text[spans[left[0]][0] : spans[left[-1]][1]].strip()
    return "_".join(text[slice(*spans[place])] for place in left)
