"""JSON files of poses: lists of objects with a position and a rotation, or a matrix, under keys named like columns.

The values of an object become columns, named by their keys (`position.x`, `rotation[3]`); several lists are several
bodies. In addition, the orders and axes of some programs are known. A-Frame's `avatar-recorder` and
`motion-capture-recorder` have degrees applied in the order Y X Z, or quaternions x, y, z, w in recordings of January
2017; axes are right-handed, y up, -z forward. nuScenes has w first, z up and x forward. NeRF's `transforms.json` has no
times, so its images are counted by their names; its world has z up, and its cameras look along -z with y up. Record3D's
`metadata.json` has lists of seven numbers, and their rate; axes are those of ARKit, y up, -z forward.
Sources: https://github.com/dmarcos/aframe-motion-capture-components, https://www.nuscenes.org/nuscenes#data-format,
https://docs.nerf.studio/quickstart/data_conventions.html,
https://developer.apple.com/documentation/arkit/arcamera/transform.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion_batch.axes import NERF

from .column_names import column_name
from .columns import RowLayout, known_in, layout_of
from .options import ReadingOptions
from .plain import in_order, number_in
from .recordings import Selection, Trajectory, TrajectoryError, shown
from .rewriting import WRITTEN_DECIMALS
from .tables import HeaderLine, is_number, read_text
from .times import MAX_SAMPLES_PER_S
from .tracks import read_below

LARGEST_FILE = 1 << 28
"""Bytes: two hours of a headset and two controllers at 90 Hz. The whole file is in memory, at ten times its size."""

MAX_OBJECT_DEPTH = 4
"""Depth of nested objects that are searched."""

LOOKED_AT = 16
"""Poses at the start of a list that determine its columns."""

MOST_VALUES = 1000
"""Values read per pose to determine the columns."""

VECTOR_LENGTHS = (3, 4, 9, 12, 16)
"""Lengths of lists that are vectors, quaternions or matrices."""

RECORD3D = ("qx", "qy", "qz", "qw", "x", "y", "z")

EXPECTED = (
    "it takes a list of objects with a time, a position and a rotation, named as columns are (docs/csv.md), or a "
    "recording of A-Frame, nuScenes, Record3D or NeRF's transforms.json"
)

LONGEST_TEXT = 100
"""Characters of a time or of a body's name."""

Objects = list[dict[str, Any]]

Key = tuple[str | int, ...]
"""The path of keys and indices to a value inside a pose."""


def read(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the bodies that have poses. A body without a name gets that of the file."""
    text = read_text(path, LARGEST_FILE)
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        problem = f"this is not JSON ({error.msg})"
        raise TrajectoryError(path, problem, "save the recording again", error.lineno) from None
    except (RecursionError, ValueError):
        raise TrajectoryError(path, "this JSON cannot be a recording", "save the recording again") from None
    rate = content.get("fps") if isinstance(content, dict) else None
    found: dict[tuple[str, ...], Objects] = {}
    problems: list[TrajectoryError] = []
    for way, poses in _lists(content):
        header, _, said = _header(path, poses, options, rate)
        try:
            layout_of(header, said)
            found[way] = poses
        except TrajectoryError as error:
            # Lists with few known columns, such as lists of events, are not poses: their errors do not count.
            problems += [error] * (known_in(header) > len(header.cells) / 2)
    if not found:
        raise problems[0] if problems else TrajectoryError(path, "this JSON holds no poses", EXPECTED)
    header, keys, said = _header(path, next(iter(found.values())), options, rate)
    # The last key is not a name if it is the same for all lists, such as "poses".
    last = len({way[-1:] for way in found}) == 1
    lists = {".".join(way[: len(way) - last]): poses for way, poses in found.items()}
    rows = cache(partial(_rows, header, keys, layout_of(header, said), lists))
    write = partial(_write, content, lists, keys)
    header = replace(header, rows_of=lambda _: rows(), write=write)
    if len(lists) > 1:
        said = replace(said, columns=(("device", "device"), *(pair for pair in said.columns if pair[0] != "device")))
    return read_below(selection, said, header, "write a list for each")


def _lists(content: Any, way: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Objects]]:
    """Yield the keys that lead to each list of objects, and the list."""
    if isinstance(content, list):
        if content and all(isinstance(item, list) and len(item) == len(RECORD3D) for item in content):
            content = [dict(zip(RECORD3D, item, strict=True)) for item in content]
        if any(isinstance(item, dict) for item in content[:LOOKED_AT]):
            yield way, content
    elif isinstance(content, dict) and len(way) < MAX_OBJECT_DEPTH:
        columns = {key: item for key, item in content.items() if isinstance(item, list) and len(item) > 1}
        if len(columns) > 1 and len({*map(len, columns.values())}) == 1:
            # An object of equally long lists holds the columns of poses.
            yield way, [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        for key, item in content.items():
            yield from _lists(item, (*way, key))


def _header(
    path: Path, poses: Objects, options: ReadingOptions, rate: Any
) -> tuple[HeaderLine, list[Key], ReadingOptions]:
    """Return the columns of a list's poses as a header, their keys, and options with facts known of the program."""
    first = [pose for pose in poses[:LOOKED_AT] if isinstance(pose, dict)]
    keys = list(dict.fromkeys(key for pose in first for key in islice(_keys(pose), MOST_VALUES)))
    cells = ["device", "frame", *map(_cell, keys)]
    names = [column_name(cell) for cell in cells]
    held = {key[0] for key in keys}
    axes = ""
    if {"timestamp", "position", "rotation"} <= held and ("rotation", "w") not in keys:
        names = [name and replace(name, unit="deg" if name.kind == "rotation" else name.unit) for name in names]
        if ("rotation", "x") in keys and not options.euler:
            options = replace(options, euler="YXZ")
        axes = "opengl"
    elif {"translation", "rotation"} <= held:
        names = [name and replace(name, kind="quaternion" if name.kind == "rotation" else name.kind) for name in names]
        axes = "ros"
    elif {"file_path", "transform_matrix"} <= held:
        axes = NERF
    elif first and tuple(first[0]) == RECORD3D:
        axes = "opengl"
    timed = any(name and name.kind == "time" for name in names) or options.frame_rate
    if not timed and isinstance(rate, int | float) and 0.0 < rate < MAX_SAMPLES_PER_S:
        options = replace(options, frame_rate=float(rate), time_unit=None)
    return HeaderLine(path, 0, "\t", cells, names=names, axes=axes), keys, options


def _keys(value: Any, way: Key = ()) -> Iterator[Key]:
    """Yield the paths to all values of a pose that can be columns."""
    if isinstance(value, dict) and len(way) < MAX_OBJECT_DEPTH:
        for key, item in value.items():
            yield from _keys(item, (*way, key))
    elif isinstance(value, list) and len(value) in VECTOR_LENGTHS:
        for place, item in enumerate(value):
            rows = enumerate(item) if isinstance(item, list) and len(item) in (3, 4) else [(None, item)]
            for column, number in rows:
                if number is None or isinstance(number, int | float):
                    yield (*way, place) if column is None else (*way, place, column)
    elif way and (value is None or isinstance(value, int | float | str)):
        yield way


def _cell(key: Key) -> str:
    """Return the column name for a path."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key).lstrip(".")


def _image_name(pose: Any) -> str:
    """Return the file name of a pose's image, or an empty text."""
    return str(pose.get("file_path", "")) if isinstance(pose, dict) else ""


def _image_order(poses: Objects) -> list[int]:
    """Return the indices of poses sorted by the names of their images, or unchanged if there are no images."""
    images = [*map(_image_name, poses)]
    return sorted(range(len(poses)), key=lambda place: in_order(images[place]) if any(images) else [])


def _rows(
    header: HeaderLine, keys: list[Key], layout: RowLayout, lists: Mapping[str, Objects]
) -> list[tuple[int, str]]:
    """Return a row for each pose: its body, the number of the pose or its image, and its values.

    Raises
    ------
    TrajectoryError
        If a pose lacks a needed number.
    """
    needed = {index for body in layout.bodies.values() for index in body.values()}
    needed |= set(layout.times) if len(layout.times) == 1 else set()
    texts = {*layout.devices, *layout.times}
    rows = []
    for name, poses in lists.items():
        for place in _image_order(poses):
            cells = [name, number_in(_image_name(poses[place]), place)]
            for index, key in enumerate(keys, len(cells)):
                cell = _cell_text(poses[place], key) if index in needed or index in texts else ""
                if cell is None or (cell and index not in texts and not is_number(cell)):
                    if index in needed:
                        problem = (
                            f"pose {place} of {shown(name or header.path.stem)} has no number {header.cells[index]}"
                        )
                        raise TrajectoryError(header.path, problem, EXPECTED)
                    cell = ""
                cells.append(cell)
            rows.append((place + 1, "\t".join(cells)))
    return rows


def _write(content: Any, lists: Mapping[str, Objects], keys: Sequence[Key], target: Path, numbers: np.ndarray) -> None:
    """Write the content with other numbers in it; NaN keeps the present number."""
    poses = [own[place] for own in lists.values() for place in _image_order(own)]
    for row, column in np.argwhere(np.isfinite(numbers)).tolist():
        *way, last = keys[column - 2]
        held: Any = poses[row]
        for key in way:
            held = held[key]
        held[last] = round(float(numbers[row, column]), WRITTEN_DECIMALS)
    with target.open("w", encoding="utf-8") as file:
        json.dump(content, file, indent=1, ensure_ascii=False)


def _cell_text(value: Any, key: Key) -> str | None:
    """Return a value of a pose as the cell of a table: empty for null (JavaScript's NaN), None if there is no value."""
    for part in key:
        try:
            value = value[part]
        except (KeyError, IndexError, TypeError):
            return None
    if isinstance(value, str):
        return " ".join(value.split())[:LONGEST_TEXT]
    if isinstance(value, bool) or not isinstance(value, int | float | None):
        return None
    try:
        float(value or 0)
    except OverflowError:
        return None
    return "" if value is None else str(value)
