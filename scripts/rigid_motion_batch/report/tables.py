"""Tables of the report, as rows of text for the templates; in all of them lower is better.

For whole bodies also per joint: errors over time, as images with a row for each joint, and as numbers.
"""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rigid_motion_batch.analysis.needed import DECIMATIONS, KeysNeeded, overall
from rigid_motion_batch.analysis.reconstructions import Groups
from rigid_motion_batch.analysis.results import ChoiceResult, ClipResult
from rigid_motion_batch.palette import error_hex, full_colour
from rigid_motion_batch.recordings.rest_bodies import short_names

from .numbers import MEASURES, MINUS, NONE, Numbers, digits, percent

SPACINGS = dict(zip(DECIMATIONS, ("evenly spaced", "where needed", "where needed, and fitted"), strict=True))


@dataclass(frozen=True)
class TableCell:
    text: str
    small: str = ""
    best: bool = False
    value: float | None = None
    """The value to sort by, if that is not the whole text."""


@dataclass(frozen=True)
class Row:
    modes: tuple[str, ...]
    """The modes that give this same motion."""

    cells: tuple[TableCell, ...]


@dataclass(frozen=True)
class Grid:
    """One measure, for all modes under all choices of keys."""

    scope: str
    """The index of a clip, or "all"."""

    column: int
    """The index of the measure."""

    caption: str
    heads: tuple[str, ...]
    rows: tuple[Row, ...]


def grids(numbers: Numbers, clip: int | None = None) -> list[Grid]:
    """Return a grid for each measure that has values, for a clip or for the mean over all clips."""
    values = numbers.mean(clip)
    groups = numbers.groups(clip)
    where = (
        numbers.clips[clip]
        if clip is not None
        else f"geometric mean over {len(numbers.clips)} clips"
        if len(numbers.clips) > 1
        else numbers.clips[0]
    )
    columns = [numbers.modes.index(group[0]) for group in groups]
    found = []
    for place, measure in enumerate(MEASURES):
        if not np.isfinite(values[place][:, columns]).any():
            continue
        rows = grid_rows(values[place], groups, numbers)
        caption = f"{measure.title}, {measure.unit}: {where}"
        scope = "all" if clip is None else str(clip)
        found.append(Grid(scope, place, caption, tuple(choice.title for choice in numbers.choices), rows))
    return found


def grid_rows(values: np.ndarray, groups: Groups, numbers: Numbers) -> tuple[Row, ...]:
    """Return a row for each motion, from values of shape (choices, modes)."""
    columns = [numbers.modes.index(group[0]) for group in groups]
    reference = numbers.modes.index(numbers.reference) if numbers.reference else None
    own = values[:, columns]
    texts = [[digits(value) for value in row] for row in own.tolist()]
    least = [_lowest_text(row) for row in texts]
    return tuple(
        Row(
            group,
            tuple(
                TableCell(
                    texts[choice][column],
                    _change(own[choice, column], reference, values[choice], group, numbers),
                    texts[choice][column] == least[choice],
                    float(np.nan_to_num(own[choice, column], nan=1e12)),
                )
                for choice in range(len(numbers.choices))
            ),
        )
        for column, group in enumerate(groups)
    )


def _lowest_text(texts: Iterable[str]) -> str:
    """Return the lowest number as displayed, so that ties show as ties; empty if all are equal."""
    different = set(texts) - {NONE}
    return min(different, key=float) if len(different) > 1 else ""


def _change(value: float, reference: int | None, row: np.ndarray, group: Sequence[str], numbers: Numbers) -> str:
    """Return the change of a value relative to the reference's, in percent."""
    if reference is None or not np.isfinite(value):
        return ""
    if numbers.reference in group:
        return "reference"
    if not row[reference] > 0.0:
        return ""
    change = 100.0 * (value / row[reference] - 1.0)
    shown = f"{abs(change):.1f}" if abs(change) < 9.95 else f"{abs(change):.0f}"
    return "same" if shown == "0.0" else f"{'+' if change > 0 else MINUS}{shown}\u00a0%"


def needed_rows(needed: Sequence[KeysNeeded]) -> tuple[list[str], list[tuple[tuple[str, ...], str, list[TableCell]]]]:
    """Return column heads and rows: keys that match the reference at each rate, per motion and way to space keys."""
    together = overall(needed)
    asked = [at for at in range(len(together.rates)) if together.asked[at]]
    single = needed[0] if len(needed) == 1 else None
    finite = np.where(np.isfinite(together.shares), together.shares, np.inf)
    rows = []
    for group, modes in enumerate(together.groups):
        for way in range(together.shares.shape[1]):
            cells = []
            for at in asked:
                share, reached = together.shares[group, way, at], int(together.clips[group, way, at])
                if not reached:
                    cells.append(TableCell("not reached", value=1e9))
                    continue
                number = (
                    f"{single.keys[group, way, at]:.0f}"
                    if single
                    else f"{digits(together.keys_per_s[group, way, at])}/s"
                )
                partly = f" on {reached} of {together.asked[at]} clips" if reached < together.asked[at] else ""
                best = bool(share <= finite[..., at].min() + 5e-3)
                cells.append(TableCell(number, percent(share) + partly, best, float(share)))
            rows.append((modes, SPACINGS[DECIMATIONS[way]], cells))
    return [f"{together.rates[at]}/s" for at in asked], rows


PICTURE_COLUMNS = 240
"""Maximum number of columns in an image, each for a stretch of time."""

SHADE_COUNT = 24


@dataclass(frozen=True)
class Joints:
    """The joints of a body under one choice of keys."""

    place: int
    """The clip's index on the page."""

    clip: str
    choice: str
    title: str
    names: list[str]
    top: str
    """The error that gets the last colour, in mm."""

    pictures: list[tuple[str, str]]
    """For each motion its name and its image, as a data URL."""

    worst: list[str]
    """For each motion the joint with the largest error, and that error in mm."""

    slide: str
    """How far a joint that stands on the ground slides in the recording itself, in mm; empty if none stands."""

    rows: list[list[str]]
    """For each joint, the RMS and largest error under each motion, in mm."""


def joints_of(place: int, clip: ClipResult, result: ChoiceResult, numbers: Numbers) -> Joints | None:
    """Return the joints of a clip under a choice; None for a single rigid body."""
    motions = [motion for motion in result.motions if motion.joint_errors is not None]
    if not motions:
        return None
    in_metres = [motion.joint_errors for motion in motions if motion.joint_errors is not None]
    errors, top = [1e3 * some for some in in_metres], 1e3 * full_colour(in_metres)
    pictures = [
        (numbers.joined(motion.modes), heat_map(some, top)) for motion, some in zip(motions, errors, strict=True)
    ]
    by_mode = [[row for row in result.joints if row.mode == motion.modes[0]] for motion in motions]
    rows = [
        [digits(1e3 * value) for row in of_joint for value in (row.rms_shell_m, row.max_shell_m)]
        for of_joint in zip(*by_mode, strict=True)
    ]
    names = short_names(clip.facts.joint_names)
    places = [int(np.argmax(some.max(axis=1))) for some in errors]
    worst = [f"{names[joint]} {digits(some[joint].max())} mm" for joint, some in zip(places, errors, strict=True)]
    slid = motions[0].metrics[0].recorded_slide_m
    slide = "" if slid is None else digits(1e3 * slid)
    facts = clip.facts.name, result.choice.name, result.choice.title
    return Joints(place, *facts, names, digits(top), pictures, worst, slide, rows)


def heat_map(errors: np.ndarray, top: float) -> str:
    """Return errors (joints, n) as an image, as a data URL, with a row for each joint; `top` gets the last colour."""
    count = errors.shape[1]
    begins = np.unique(np.arange(min(PICTURE_COLUMNS, count)) * count // min(PICTURE_COLUMNS, count))
    largest = np.maximum.reduceat(errors, begins, axis=1)
    shades = np.clip(largest / top * SHADE_COUNT, 0, SHADE_COUNT - 1).astype(np.uint8)
    palette = bytes.fromhex("".join(error_hex(shade / (SHADE_COUNT - 1))[1:] for shade in range(SHADE_COUNT)))
    return f"data:image/png;base64,{base64.b64encode(png(shades, palette)).decode('ascii')}"


def png(pixels: np.ndarray, palette: bytes) -> bytes:
    """Return a PNG of palette indices (rows, columns); the palette has three bytes per colour."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    lines = np.pad(pixels, ((0, 0), (1, 0))).tobytes()
    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 3, 0, 0, 0)
    content = ((b"IHDR", header), (b"PLTE", palette), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*item) for item in content)
