"""Of `reproduce_paper.py`: beside the paper."""

from __future__ import annotations

from collections.abc import Sequence

from rigid_motion_batch.markdown_tables import Table, numbers, tables_of, titled
from rigid_motion_batch.paper import claims
from rigid_motion_batch.paper.wording import less

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
        "Measured: how many updates a second each mode needs to be as good as position and rotation apart at 30, 20, "
        f"15 and 12. The paper has {_less(paper)} for screws and motors; here it is {_less(saved)}, {verdict}."
    )


def _what_saves(page: str) -> str:
    table = titled(page, TABLE_1)
    paper = _saved(table, "*the paper*")
    smooth, chosen = (_saved(table, f"`motor_spline`{kind}") for kind in ("", ", keys where needed"))
    margins = _margins(chosen, paper)
    held = sum(margin >= 0 for margin in margins)
    return (
        f"What saves is to go smoothly through the keys (`motor_spline`: {_less(smooth)}, a stream waits for an update "
        f"more) and to put them where they are needed (with it {_less(chosen)}, which takes the whole recording). That "
        f"reaches the paper's figures in {held} of {len(margins)} rows, the narrowest {_margin(min(margins))}."
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
        f"A live sender that sends when needed has {_less(_saved(sent[0], first), 'fewer')} updates at a delay of 2 "
        f"intervals instead of 1, but only {_less(_saved(packed[0], first), 'fewer')} numbers, since an update then "
        "has 13 and not 7."
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
