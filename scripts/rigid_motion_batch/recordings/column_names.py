"""Names of columns in other people's logs: what each holds, of which axis, in which unit, of which body.

Loggers write `t`, `timestamp_ms` and `Time (s)`, `x`, `px`, `PosX`, `pos_x_cm` and `position.x`, `qw`, `rot_w` and
`Rotation W`; with several bodies in a row `left_pos_x` and `LeftHand.position.x`. A name is cut into words, at dots,
dashes, blanks and capitals; words with a meaning are taken away, and what is left is the body's name. Numbers stand for
axes where they end a name of such a kind: `q0`, `position[2]`, `m03`, `R_11`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import cast

from .options import TICKS_PER_S_BY_UNIT

LONGEST_NAME = 100
"""Characters. What is longer is no name of a column that is known."""

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
"""Units, and how they are written."""

UNIT_OF = {spelling: unit for unit, spellings in UNITS.items() for spelling in spellings.split()}

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Units of length."""

UNITS_AS_WORDS = {word for word, unit in UNIT_OF.items() if unit not in TICKS_PER_S_BY_UNIT} - {"in", "feet"}
"""Units that need no brackets to be distinguished from parts of a body."""

KINDS = {
    "position": "p pos position positions t trans translation translate loc location coord coords coordinate",
    "quaternion": "q quat quats quaternion",
    "rotation": "r rot rots rotation rotations ori orient orientation att attitude",
    "euler": "euler eulers angle angles rpy",
    "matrix": "m mat matrix transform pose tf extrinsic extrinsics",
}
"""Kinds of axes, and how each is written. A rotation is a quaternion where it has a w, and Euler angles otherwise."""

KIND_OF = {word: kind for kind, words in KINDS.items() if kind != "matrix" for word in words.split()}
NUMBERED = KIND_OF | dict.fromkeys(KINDS["matrix"].split(), "matrix")
"""Words that a number behind them makes an axis of. Before a letter those of matrices mean nothing."""

LEADING_LETTERS = ("p", "q", "t")
"""Letters that tell the kind where a name begins with them. An r is rather the right side."""

TURNS = ("roll", "pitch", "yaw")
"""Euler angles that do not name their axis."""

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
"""Words for time, and those that may stand with them and change nothing. `delta` and `frame` change the meaning."""

FRAMES = frozenset(_WORDS["frames"].split())
"""Words for a count of frames."""

WITH_FRAMES = FRAMES.union(_WORDS["beside frames"].split())

DATES = {"date", "datetime", "iso"}
"""Words that tell of a time that it is a date."""

DEVICES = tuple(_WORDS["devices"].split())
"""Words for whose a row is, what tells most first."""

WITH_DEVICES = frozenset(DEVICES).union(_WORDS["beside devices"].split())

WITHOUT_MEANING = frozenset(_WORDS["without meaning"].split())
"""Words beside a position or rotation that tell no body from another."""

_UPPER = r"[^\W\d_a-z]"
WORD = re.compile(rf"{_UPPER}+(?={_UPPER}[a-z])|{_UPPER}?[a-z]+|{_UPPER}+|\d+|°")
BRACKETS = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]")
TIME_WITH_UNIT = re.compile(r"^(t|time|timestamp)(sec|ms|us|ns)$")
AXIS = re.compile(rf"({'|'.join(sorted(KIND_OF, key=len, reverse=True))})?([xyzw])(mm|cm|m)?")
ENDS_WITH_AXIS = re.compile(rf"(?:^|[\W_])(?:{AXIS.pattern})$", re.IGNORECASE)


@dataclass(frozen=True)
class ColumnName:
    """Meaning of a column's name."""

    kind: str
    """"time", "frame", "scale", "device", or one of `KINDS`."""

    axis: str = ""
    """x, y, z, w, one of `TURNS`, or a number: "0", or "03" of a row and a column; of a device the word for it; "date"
    of a time that is called so."""

    unit: str = ""
    """One of `UNITS`, or what stood in brackets; empty where nothing is said."""

    body: str = ""
    """The body as it was written."""


@lru_cache(maxsize=4096)
def column_name(text: str) -> ColumnName | None:
    """Return what the name of a column says; None where that is nothing known."""
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
    return result and replace(result, body=_body(text, words, spans, taken))


def unit_in(text: str) -> str:
    """Return the unit that a name ends with, whatever else it says; empty where it has none."""
    text, unit = _without_brackets(text[-LONGEST_NAME:])
    words = WORD.findall(text)
    return unit or (UNIT_OF.get(words[-1].lower(), "") if len(words) > 1 else "")


def _without_brackets(text: str) -> tuple[str, str]:
    """Return a name without the unit in brackets, and the unit. An axis in brackets stays, and so does a number."""
    text, unit = text.strip().replace("\u00b5", "u").replace("\u03bc", "u"), ""
    for match in BRACKETS.finditer(text):
        content, before = match[1].lower(), text[: match.start()]
        numbered = content.isdecimal() and re.search(r"[\w\]]$", before) and not ENDS_WITH_AXIS.search(before)
        if content not in ("x", "y", "z", "w") and not numbered:
            # Of what has no unit one writes [], [1] or [-].
            unit = UNIT_OF.get(content, content.strip("-1"))
            text = before + " " * len(match[0]) + text[match.end() :]
    return text, unit


def _time(words: list[str], unit: str) -> ColumnName | None:
    parts = " ".join(TIME_WITH_UNIT.sub(r"\1 \2", word) for word in words).split()
    units = [UNIT_OF[word] for word in parts if UNIT_OF.get(word) in TICKS_PER_S_BY_UNIT]
    others = [word for word in parts if UNIT_OF.get(word) not in TICKS_PER_S_BY_UNIT]
    # A plain s is a scale; any other unit of time tells that this is one.
    timely = not TIME.isdisjoint(others) or (bool(units) and words != ["s"])
    if not timely or not WITH_TIME.issuperset(others):
        return None
    dated = "" if DATES.isdisjoint(others) else "date"
    return ColumnName("time", dated, unit or (units[-1] if units else ""))


def _pose(words: list[str], unit: str, taken: set[int]) -> ColumnName | None:
    """Return what the name of a position or rotation says; the places of the words that say it are left in `taken`."""
    taken.clear()
    for place, word in enumerate(words):
        # A single letter in between is rather part of a name.
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
    """Return what a name says that ends with one number, or with those of a row and a column."""
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


def _body(text: str, words: list[str], spans: list[tuple[int, int]], taken: set[int]) -> str:
    """Return what is left of a name: as it was written, where it stands together."""
    left = [place for place, word in enumerate(words) if place not in taken and word not in WITHOUT_MEANING]
    if not left:
        return ""
    if left[-1] - left[0] == len(left) - 1:
        return text[spans[left[0]][0] : spans[left[-1]][1]].strip()
    return "_".join(text[slice(*spans[place])] for place in left)
