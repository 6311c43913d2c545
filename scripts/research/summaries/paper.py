"""Of `reproduce_paper.py`: beside the paper."""

from __future__ import annotations

from collections.abc import Sequence

from research.markdown_tables import Table, numbers, tables_of, titled
from research.paper import claims
from research.paper.wording import less

from .on_top import facts, span


def of_paper(page: str) -> list[str]:
    """Of the page of `reproduce_paper.py`."""
    return facts(page, (_papers_question, _what_saves, _streams, _time_of_frames))


TABLE_1 = "RMS shell error, recordings"


def percent_saved(cell: str) -> float:
    """The percent of a cell, which is in brackets or at its beginning: "28.1 (6%)".

    What takes more, "30.9 (3% more)", is below zero, and what was not reached, "-", is NaN.
    """
    inside = cell.partition("(")[2] or cell
    found = numbers(inside)
    if not found:
        return float("nan")
    return -found[0] if "% more" in inside else found[0]


def _saved(table: Table, first: str) -> list[float]:
    """The percents of a row."""
    return [percent_saved(cell) for cell in table.row(first)[1:]]


def _less(percents: Sequence[float], word: str = "less") -> str:
    return less([percent / 100.0 for percent in percents], word)


def _papers_question(page: str) -> str:
    table = titled(page, TABLE_1)
    paper = _saved(table, "*the paper*")
    (screw,) = [row[0] for row in table.rows if row[0].startswith("`dq_sclerp`")]
    saved = _saved(table, screw)
    verdict = "which is the paper's saving" if min(_margins(saved, paper)) >= 0 else "which is not what the paper says"
    return (
        "Measured: how many updates a second each mode needs to be as good as position and rotation interpolated "
        f"separately at 30, 20, 15 and 12. The paper has {_less(paper)} for screws and motors; here it is "
        f"{_less(saved)}, {verdict}."
    )


def _what_saves(page: str) -> str:
    table = titled(page, TABLE_1)
    paper = _saved(table, "*the paper*")
    smooth, chosen = (_saved(table, f"`motor_spline`{kind}") for kind in ("", ", keys where needed"))
    margins = _margins(chosen, paper)
    held = sum(margin >= 0 for margin in margins)
    return (
        f"Two things save updates: to pass through the keys smoothly (`motor_spline`: {_less(smooth)}, but a stream "
        f"waits for one more update), and to place the keys where they are needed (both together: {_less(chosen)}, but "
        "that takes the whole recording). Together they reach the paper's figures in "
        f"{held} of {len(margins)} rows, the narrowest {_margin(min(margins))}."
    )


def _margins(saved: Sequence[float], paper: Sequence[float]) -> list[float]:
    """How many points more is saved than in the paper; where nothing was reached, all of it is missing."""
    pairs = zip(saved, paper, strict=True)
    return [round(ours - theirs) if ours == ours else -round(theirs) for ours, theirs in pairs]


def _margin(points: float) -> str:
    if not points:
        return "just so"
    count = f"{abs(points):.0f} point{'s' * (abs(points) != 1)}"
    return f"by {count}" if points > 0 else f"short by {count}"


def _streams(page: str) -> str:
    sections = tables_of(page, "Sending when needed")
    sent = [one for one in sections if one.title == TABLE_1]
    packed = [one for one in sections if one.head[0] == "bytes saved"]
    if not sent or not packed:
        raise LookupError("no streams")
    first = "`motor_twists`, 2 intervals"
    return (
        f"A live sender that sends only when needed has {_less(_saved(sent[0], first), 'fewer')} updates at a delay of "
        f"2 intervals instead of 1, but only {_less(_saved(packed[0], first), 'fewer')} numbers, because an update "
        "then has 13 numbers instead of 7."
    )


def _time_of_frames(page: str) -> str:
    table = titled(page, "At equal rates")
    ratios = [numbers(cell)[0] for cell in table.row("`pga_lerp`")[1:]]
    spline = [numbers(cell)[0] for cell in table.row("`motor_spline`")[1:]]
    return (
        f"Where it hurts: a frame by multivectors takes {span(ratios, 2)} times as long as the state of the art at "
        f"equal rates, where the paper has {1.0 - claims.TIME_SAVED:.3f}, and by `motor_spline` {span(spline, 2)} "
        "times."
    )
