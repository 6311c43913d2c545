"""The keys of a whole body in the report, beside those that Blender's Decimate leaves at the same largest error."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rigid_motion_batch.analysis.body_decimated import DECIMATE, SHARED, KeysOfBody
from rigid_motion_batch.analysis.reconstructions import Groups

from .elements import heading, label, missing_cell, mode_cell, number_cell, rounded, table
from .findings import listed
from .markup import Content, Markup, element

TITLE = "Beside Blender's Decimate, at the same largest error"


def decimated_table(where: str, rows: Sequence[KeysOfBody], groups: Groups) -> Markup:
    """The table of a body under one choice of keys.

    Parameters
    ----------
    where : str
        The clip and its choice of keys, for the caption.
    rows : sequence of KeysOfBody
        Of `beside_decimate`.
    groups : Groups
        The modes, those together that are one motion and have a row together.
    """
    ours = {row.mode: row for row in rows if row.how != DECIMATE}
    theirs = {row.mode: row for row in rows if row.how == DECIMATE}
    shown = [group for group in groups if group[0] in ours]
    head = [
        heading("Keys of", "text"),
        heading("Frames with keys", "number"),
        heading("Keys", "number"),
        heading("Numbers", "number"),
        heading("Shell largest", "number", "mm"),
        heading("Decimate's frames", "number", "times ours"),
        heading("Decimate's numbers", "number", "times ours"),
    ]
    body = [
        element(
            "tr", mode_cell(*group), _counts(ours[group[0]]), list(_multiples(ours[group[0]], theirs.get(group[0])))
        )
        for group in shown
    ]
    # One and the same outcome is what several modes are often held against.
    outcomes: dict[tuple[int, int, int, float], list[str]] = {}
    for group in shown:
        if left := theirs.get(group[0]):
            outcome = (left.frames_with_keys, left.keys, left.numbers, left.max_shell_m)
            outcomes.setdefault(outcome, []).append(group[0])
    for modes in outcomes.values():
        name = "Blender's Decimate" + (f", beside {listed(list(map(label, modes)))}" if len(outcomes) > 1 else "")
        cells = [element("th", name, scope="row", data_value=name), _counts(theirs[modes[0]])]
        body.append(element("tr", cells, missing_cell(""), missing_cell("")))
    return element(
        "div", element("h4", TITLE), element("p", _said(ours.values()), class_="note"), table(where, head, body)
    )


def _counts(row: KeysOfBody) -> list[Content]:
    counts = (row.frames_with_keys, row.keys, row.numbers)
    error = 1e3 * row.max_shell_m
    cells: list[Content] = [number_cell(count, str(count), best=False) for count in counts]
    return [*cells, number_cell(error, rounded(error), best=False)]


def _multiples(own: KeysOfBody, left: KeysOfBody | None) -> Iterable[Markup]:
    """How many times as many frames and numbers Decimate has."""
    for counted in ("frames_with_keys", "numbers"):
        ours = getattr(own, counted)
        if left is None or not ours:
            yield missing_cell("not reached" if ours else "nothing moves")
        else:
            ratio = getattr(left, counted) / ours
            yield number_cell(ratio, f"{ratio:.2f}", best=False)


def _said(ours: Iterable[KeysOfBody]) -> str:
    """What is compared with what."""
    shared = any(row.how == SHARED for row in ours)
    return (
        "Decimate gets a rig with a key on every sample, joined by straight lines or smooth curves, and one error "
        "margin for all F-curves: the one that leaves the fewest keys with no larger error. Our keys are "
        f"{'key poses of all joints together' if shared else 'keys of each joint for itself'}. Such a key is the pose "
        "of a joint; its numbers are its rotation, its location where that varies, and its time, which a key pose has "
        "once. A key of Decimate belongs to a single F-curve and has free handles: six numbers. The in-betweens of a "
        "mode are computed from its keys, and not counted."
    )
