"""The page about reduced files: their bytes and keys before and after, with both versions playing side by side.

One file with the viewer of comparisons, where "before" and "after" take the place of modes.
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
"""The modes whose colours "before" and "after" have."""

CHOICE = "reduced"

DRAWN_STEP_RATIO = 1e-4
"""The precision of drawn joint positions, as a fraction of the body's size."""

MOST_TABS = 8
"""Maximum number of clips shown as tabs; more become a list to choose from."""

IN_THE_PAGE = 40_000_000
"""Maximum bytes of playable clips in the page; above it, the files that had most bytes are kept."""

MIN_BETWEEN_FRAMES_RATIO = 1.02
"""An error between frames is mentioned if it exceeds the proven errors by this ratio."""

UNMOVED = Mesh(np.eye(3), np.arange(3)[None])
"""A placeholder mesh: the viewer requires one, although it only draws bodies here."""


@dataclass(frozen=True, eq=False)
class ShownClip:
    """A clip before and after, in metres with z up."""

    name: str
    joints: Sequence[str]
    parents: np.ndarray
    """The index of the point that each point's line starts at, -1 for none, shape (points,)."""

    before: np.ndarray
    after: np.ndarray
    """Positions at the drawn moments, shape (points, moments, 3): of the joints, and other points drawn with them."""

    times: np.ndarray
    """Times, in seconds, at which errors are known."""

    moments: np.ndarray
    """The indices of the times that are drawn."""

    errors: np.ndarray
    """Shape (times,)."""

    joint_errors: np.ndarray
    """Shape (joints, moments)."""

    worst_joint: int
    keys: tuple[np.ndarray, np.ndarray]
    """The indices of the times that have keys, before and after."""

    key_counts: tuple[int, int]
    bytes: tuple[int, int]


def clip_data(shown: ShownClip) -> dict[str, Any]:
    """Return the viewer's data about a clip: see `data.clip_data`."""
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
    """Return points (points, moments, 3) as rows of one coordinate each."""
    return points.transpose(0, 2, 1).reshape(-1, points.shape[1])


def _grouped(number: float) -> str:
    return f"{number:,.0f}".replace(",", "\u202f")


# -- the page ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """A file's row in the table."""

    name: str
    state: str
    reason: str
    clips: int
    keys: tuple[int, int] | None
    bytes: tuple[int, int] | None
    error: float | None
    """In metres."""

    tolerance: float | None
    """None if a number of keys was requested instead."""

    where: str
    address: str
    """The link to the file's clip that had most bytes; empty if no clip can be played."""

    @property
    def share(self) -> float | None:
        """The fraction of bytes that is left."""
        return self.bytes[1] / self.bytes[0] if self.bytes and self.bytes[0] else None


def write_reduced(
    path: Path, done: Sequence[tuple[Mapping[str, Any], Sequence[dict[str, Any]]]], program: str, command: str
) -> None:
    """Write the page about the given files.

    Parameters
    ----------
    path : Path
    done : sequence of pairs
        The result of each input, as in `reduce.py --json`, and the data of its clips that can be played.
    program : str
        Name and version.
    command : str
        The command line, as typed.
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
    total = _total_row(rows)
    between = max((choice["worst"] for _, views in done for view in views for choice in view["choices"]), default=0.0)
    context = {
        "rows": rows,
        "sum": total,
        "between": between if total.error is not None and between > MIN_BETWEEN_FRAMES_RATIO * total.error else None,
        "states": _state_counts(row.state for row in rows),
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
    """Return the names of files on the page: their paths relative to their common folder."""
    folders = {Path(os.path.abspath(source)).parent for source in sources}
    try:
        common = os.path.commonpath(folders)
    except ValueError:  # On several drives.
        return [*sources]
    return [Path(os.path.relpath(source, common)).as_posix() for source in sources]


def _title(file: str, clip: str, taken: set[str]) -> str:
    """Return a unique title for a clip."""
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


def _total_row(rows: Sequence[Row]) -> Row:
    """Return the row with the totals of all reduced files."""

    def total(pairs: Iterable[tuple[int, int] | None]) -> tuple[int, int] | None:
        known = [pair for pair in pairs if pair]
        return (sum(pair[0] for pair in known), sum(pair[1] for pair in known)) if known else None

    errors = [row.error for row in rows if row.error is not None]
    clips, largest = sum(row.clips for row in rows if row.keys), max(errors, default=None)
    keys, weighs = total(row.keys for row in rows), total(row.bytes for row in rows)
    return Row("All", "", "", clips, keys, weighs, largest, None, "", "")


def _state_counts(states: Iterable[str]) -> str:
    """Return how many files are in each state, except the written ones."""
    counts = Counter(state for state in states if "written" not in state)
    return ", ".join(f"{count} {state}" for state, count in sorted(counts.items()))
