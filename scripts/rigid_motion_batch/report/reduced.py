"""The page of reduced files: what each was and is in bytes and keys, and its clips before and after, side by side.

It is one file with the viewer of comparisons, in which the two are what modes are there.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, cast

import numpy as np

from rigid_motion.motion.measures import rms
from rigid_motion_batch.palette import ERROR_COLOURS, colours_on_pages, full_colour

from .data import MOST_CHARTED, Mesh, PackedNumbers, json_in_page, mesh_data, nice, peaks, size_as_text
from .rendering import SCRIPTS, address, script_of, shaders, style, write_page

BEFORE, AFTER = "lerp_slerp", "dq_sclerp"
"""The modes whose colours they have."""

CHOICE = "reduced"

DRAWN_STEP_RATIO = 1e-4
"""Of the size of a body: how finely its joints are drawn."""

MOST_TABS = 8
"""More clips are a list to choose from."""

IN_THE_PAGE = 40_000_000
"""Bytes of all clips that can be played; of more files, those play that had most bytes."""

MIN_BETWEEN_FRAMES_RATIO = 1.02
"""By how much an error between frames is larger than those that were proven, where it is worth a word."""

UNMOVED = Mesh(np.eye(3), np.arange(3)[None])
"""The viewer wants a mesh, although it draws bodies alone."""


@dataclass(frozen=True, eq=False)
class ShownClip:
    """A clip before and after, in metres with z up."""

    name: str
    joints: Sequence[str]
    parents: np.ndarray
    """The points that lines lead from, -1 for none, shape (points,)."""

    before: np.ndarray
    after: np.ndarray
    """Where points are at the moments, shape (points, moments, 3): the joints, and what is drawn beside them."""

    times: np.ndarray
    """Seconds at which errors are known."""

    moments: np.ndarray
    """Which of them are drawn."""

    errors: np.ndarray
    """Shape (times,)."""

    joint_errors: np.ndarray
    """Shape (joints, moments)."""

    worst_joint: int
    keys: tuple[np.ndarray, np.ndarray]
    """Which of the times have keys, before and after."""

    key_counts: tuple[int, int]
    bytes: tuple[int, int]


def clip_data(shown: ShownClip) -> dict[str, Any]:
    """Return what the viewer has of a clip: see `data.clip_data`."""
    block, recorded, times = PackedNumbers(), PackedNumbers(), shown.times - shown.times[0]
    low, high = shown.before.min(axis=(0, 1)), shown.before.max(axis=(0, 1))
    truth = shown.before - (low + high) / 2.0
    size = float(np.median(np.linalg.norm(np.ptp(truth, axis=0), axis=1))) or 1.0
    away = shown.after - shown.before
    heat = np.pad(shown.joint_errors, ((0, len(truth) - len(shown.joint_errors)), (0, 0)), mode="edge")
    every, errors = -(-len(times) // MOST_CHARTED), 1e3 * shown.errors[None]
    cell = nice(0.3 * size)

    def motion(mode: str, name: str, scale: float, keys: np.ndarray) -> dict[str, Any]:
        return {
            "modes": [mode],
            "name": name,
            "also": [],
            "rms": [1e3 * scale * rms(shown.errors)],
            "errors": [block.put(row) for row in peaks(scale * errors, every)],
            "keys": block.put(keys, 4, 1.0),
            "away": block.put(_rows(scale * away), step=DRAWN_STEP_RATIO * size),
            "by_joint": block.put(scale * heat, 1),
        }

    keys, weighs = (f"{_grouped(before)} to {_grouped(after)}" for before, after in (shown.key_counts, shown.bytes))
    return {
        "name": shown.name,
        "joints": [*shown.joints],
        "parents": shown.parents.tolist(),
        "drawn": [*range(len(truth))],
        "size": size,
        "cell": cell,
        "grid": size_as_text(cell),
        "box": [((low - high) / 2.0).tolist(), ((high - low) / 2.0).tolist()],
        "warnings": [],
        "recording": {
            "times": recorded.put(times, 4, 1e-6),
            "seen": recorded.put(shown.moments, 4, 1.0),
            "places": recorded.put(_rows(truth), step=DRAWN_STEP_RATIO * size),
            "block": recorded.text(),
        },
        "choices": [
            {
                "name": CHOICE,
                "title": CHOICE,
                "about": f"{keys} keys, {weighs} bytes",
                "first": 0,
                "count": len(times),
                "every": every,
                "seen": [0, len(shown.moments)],
                "keyed": True,
                "worst": float(shown.errors.max()),
                "factor": 1,
                "joint": shown.worst_joint,
                "top": full_colour([shown.joint_errors]),
                "motions": [motion(BEFORE, "Before", 0.0, shown.keys[0]), motion(AFTER, "After", 1.0, shown.keys[1])],
                "block": block.text(),
            }
        ],
    }


def _rows(points: np.ndarray) -> np.ndarray:
    """Points (points, moments, 3) as rows of one coordinate each."""
    return points.transpose(0, 2, 1).reshape(-1, points.shape[1])


def _grouped(number: float) -> str:
    return f"{number:,.0f}".replace(",", "\u202f")


# -- the page ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """A file in the table."""

    name: str
    state: str
    reason: str
    clips: int
    keys: tuple[int, int] | None
    bytes: tuple[int, int] | None
    error: float | None
    """In metres."""

    tolerance: float | None
    """None where a number of keys was asked for instead."""

    where: str
    address: str
    """Of the clip of it that had most bytes; empty where none can be played."""

    @property
    def share(self) -> float | None:
        """Of the bytes that are left."""
        return self.bytes[1] / self.bytes[0] if self.bytes and self.bytes[0] else None


def write_reduced(
    path: Path, done: Sequence[tuple[Mapping[str, Any], Sequence[dict[str, Any]]]], program: str, command: str
) -> None:
    """Write the page of some files.

    Parameters
    ----------
    path : Path
    done : sequence of pairs
        What became of each input, as `reduce.py --json` has it, and the data of its clips that can be played.
    program : str
        Name and version.
    command : str
        As one would type it.
    """
    names = _names([fate["source"] for fate, _ in done])
    order = sorted(range(len(done)), key=lambda place: (not done[place][0]["written"], -_saved(done[place][0])))
    rows: list[Row] = []
    places: list[dict[str, str]] = []
    inside: list[str] = []
    room, taken = IN_THE_PAGE, set[str]()
    for place in order:
        fate, views = done[place]
        first = ""
        for view in sorted(views, key=lambda view: -len(view["recording"]["block"])):
            title = _title(names[place], view["name"], taken)
            data = json_in_page(view | {"name": title})
            room -= len(data)
            if room > 0:
                first = first or address(title, CHOICE)
                places.append({"name": title, "data": ""})
                inside.append(data)
        rows.append(_row(names[place], fate, first))
    total = _sum(rows)
    between = max((choice["worst"] for _, views in done for view in views for choice in view["choices"]), default=0.0)
    context = {
        "rows": rows,
        "sum": total,
        "between": between if total.error is not None and between > MIN_BETWEEN_FRAMES_RATIO * total.error else None,
        "states": _counted(row.state for row in rows),
        "clips": places,
        "left_out": sum(len(views) for _, views in done) - len(places),
        "unplayed": sum(bool(fate["written"] and not views) for fate, views in done),
        "inside": inside,
        "most_tabs": MOST_TABS,
        "program": program,
        "command": command,
        "date": datetime.now(),
        "script": script_of(SCRIPTS if places else ("tables",)),
        "style": style(),
        "colours": [colours_on_pages(mode) for mode in (BEFORE, AFTER)],
        "ramp": ERROR_COLOURS,
        "grouped": _grouped,
        "page": json_in_page(
            {
                "clips": places,
                "modes": [BEFORE, AFTER],
                "mesh": mesh_data(UNMOVED),
                "shaders": shaders(),
                "ramp": ERROR_COLOURS,
                "start": {"clip": places[0]["name"] if places else "", "choice": CHOICE},
                "begins": {"speed": 1, "layout": "side"},
                "plays": True,
            }
        ),
    }
    write_page(path, "reduced.html.j2", context)


def _names(sources: Sequence[str]) -> list[str]:
    """Return what files are called on the page: their paths from the folder that all of them are in."""
    folders = {Path(os.path.abspath(source)).parent for source in sources}
    try:
        common = os.path.commonpath(folders)
    except ValueError:  # On several drives.
        return [*sources]
    return [Path(os.path.relpath(source, common)).as_posix() for source in sources]


def _title(file: str, clip: str, taken: set[str]) -> str:
    """Return what a clip is called, which no other one is."""
    title = wanted = file if clip == Path(file).stem else f"{file}: {clip}"
    number = 1
    while title in taken:
        number += 1
        title = f"{wanted} ({number})"
    taken.add(title)
    return title


def _saved(fate: Mapping[str, Any]) -> int:
    return (fate.get("bytes_before") or 0) - (fate.get("bytes_after") or 0)


def _row(name: str, fate: Mapping[str, Any], first: str) -> Row:
    clips = fate.get("clips", ())
    reduced = [clip for clip in clips if not clip["reason"]] if fate["written"] else []
    worst = max(reduced, key=lambda clip: clip["error"], default=None)
    weighs = (fate.get("bytes_before"), fate.get("bytes_after")) if fate["written"] else (None, None)
    return Row(
        name,
        fate["state"],
        fate["reason"] or "; ".join(f"{clip['name']}: {clip['reason']}" for clip in clips if clip["reason"]),
        len(clips),
        (sum(clip["keys_before"] for clip in clips), sum(clip["keys_after"] for clip in clips)) if reduced else None,
        None if None in weighs else cast(tuple[int, int], weighs),
        worst and worst["error"],
        fate.get("tolerance") if worst and worst["error"] <= (fate.get("tolerance") or 0.0) else None,
        worst["where"] if worst else "",
        first,
    )


def _sum(rows: Sequence[Row]) -> Row:
    """Return all that was reduced as one."""

    def total(pairs: Iterable[tuple[int, int] | None]) -> tuple[int, int] | None:
        known = [pair for pair in pairs if pair]
        return (sum(pair[0] for pair in known), sum(pair[1] for pair in known)) if known else None

    errors = [row.error for row in rows if row.error is not None]
    clips, largest = sum(row.clips for row in rows if row.keys), max(errors, default=None)
    keys, weighs = total(row.keys for row in rows), total(row.bytes for row in rows)
    return Row("All", "", "", clips, keys, weighs, largest, None, "", "")


def _counted(states: Iterable[str]) -> str:
    """Return how many files are in each state, but for those that were written."""
    counts = Counter(state for state in states if "written" not in state)
    return ", ".join(f"{count} {state}" for state, count in sorted(counts.items()))
