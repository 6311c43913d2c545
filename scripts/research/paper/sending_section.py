"""The section of the page on live streams that are sent when they are needed. Markdown, written from `sending.csv`."""

from __future__ import annotations

from collections.abc import Sequence

from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.report.numbers import listed

from . import claims
from .sending import AROUND_A_PACKET, DELAYS, HEARTBEAT, MODES_SENT, SentNeeded, at_delay, packet_bytes
from .streaming import TWISTS
from .table import YARDSTICKS
from .wording import grid, heads, holding, less, needed_cell, papers_row, percent, verdict

HEADING = "## Sending when needed"


def sending_section(found: Sequence[SentNeeded], sets: Sequence[str]) -> list[str]:
    """The section, for these sets of clips; nothing where there is nothing."""
    there = [one for one in sets if any(cell.clips == one for cell in found)]
    if not there:
        return []
    first = next(iter(YARDSTICKS))
    lines = [
        HEADING,
        "",
        "The same question for a live stream. The sender knows every pose, and what the receiver shows. It sends a key "
        "when the picture would otherwise be off by more than a tolerance, and chooses the key that keeps the picture "
        "within it for longest. The play-out may be behind by more than the one interval of the even stream: the "
        "delays are multiples of that interval, and the sender looks no further ahead. "
        f"`{TWISTS}` sends how the body moves along with where it is, 13 numbers instead of 7. Each cell has the "
        "updates a second that are as good as the even stream of the state of the art at its rate, and how many fewer "
        f"that is. Heartbeats (the newest key again after {HEARTBEAT:g} s of silence) count as updates.",
        "",
    ]
    for one in there:
        for yardstick, name in YARDSTICKS.items():
            lines += [f"**{name[0].upper()}{name[1:]}, {one}**", "", *_grid(found, one, yardstick), ""]
    lines += [*_verdicts(found, there[0], first), "", *_bytes(found, there[0], first), ""]
    lines += _costs()
    return lines


def in_short(found: Sequence[SentNeeded], clips: str) -> list[str]:
    """A line on these streams, for the beginning of the page."""
    rows = at_delay(found, clips, TWISTS, 2.0, next(iter(YARDSTICKS)))
    if None in rows:
        return []
    updates, numbers = [cell.saved for cell in rows], [_of_numbers(cell) for cell in rows]
    packed, small = [cell.saved_bytes for cell in rows], [cell.saved_small for cell in rows]
    return [
        f"- `{TWISTS}`, sent when needed by a live sender, at a delay of 2 intervals instead of 1: "
        f"{less(updates, 'fewer')} updates. {verdict(updates)} But each has 13 numbers instead of 7: "
        f"{less(numbers, 'fewer')} numbers (as the paper counts; {_short(numbers)}), {less(packed, 'fewer')} bytes "
        f"with headers in doubles ({_short(packed)}), {less(small, 'fewer')} in the smallest packing ({_short(small)})."
    ]


def _short(shares: Sequence[float]) -> str:
    """Which of the paper's savings hold, in brackets."""
    return f"of its savings {_held(shares)}"


def _of_numbers(cell: SentNeeded) -> float:
    """What is saved of the numbers of poses and twists alone, as a share."""
    return 1.0 - (1.0 - cell.saved) * (13.0 / 7.0 if cell.mode == TWISTS else 1.0)


def _grid(found: Sequence[SentNeeded], clips: str, yardstick: str) -> list[str]:
    rows = [
        [f"`{mode}`, {delay:g} intervals", *map(needed_cell, at_delay(found, clips, mode, delay, yardstick))]
        for mode in MODES_SENT
        for delay in DELAYS
    ]
    return grid(heads("sent when needed"), [papers_row(), *rows])


def _verdicts(found: Sequence[SentNeeded], clips: str, yardstick: str) -> list[str]:
    """Which of the paper's savings there are, at which delay."""
    paper = listed([f"{row.saved:.0%}" for row in claims.TABLE])
    lines = [f"Of the paper's {paper} fewer updates, on the {clips}, by the {YARDSTICKS[yardstick]}:", ""]
    for mode in MODES_SENT:
        told = []
        for delay in DELAYS:
            cells = at_delay(found, clips, mode, delay, yardstick)
            shares = [cell.saved if cell else float("nan") for cell in cells]
            told.append(f"at {delay:g} intervals, {_held(shares)}")
        lines.append(f"- `{mode}`: {'; '.join(told)}.")
    return lines


def _held(shares: Sequence[float]) -> str:
    held = [f"{row.saved:.0%}" for row in holding(shares)]
    if len(held) == len(claims.TABLE):
        return "all hold"
    return f"{listed(held)} {'hold' if len(held) > 1 else 'holds'}" if held else "none holds"


def _bytes(found: Sequence[SentNeeded], clips: str, yardstick: str) -> list[str]:
    rows = []
    for mode in (REFERENCE, TWISTS):
        for delay in DELAYS:
            texts = [
                "-"
                if cell is None
                else f"{percent(_of_numbers(cell))}; {percent(cell.saved_bytes)}; {percent(cell.saved_small)}"
                for cell in at_delay(found, clips, mode, delay, yardstick)
            ]
            rows.append([f"`{mode}`, {delay:g} intervals", *texts])
    sizes = [
        f"{packet_bytes(packing, REFERENCE)} bytes, with a twist {packet_bytes(packing, TWISTS)}"
        for packing in ("double", "smallest_three")
    ]
    return [
        f"In bytes, with the header of a packet and the {AROUND_A_PACKET} of UDP over IPv4, by the "
        f"{YARDSTICKS[yardstick]}: an update in doubles has {sizes[0]}; in the smallest packing {sizes[1]}. In a cell: "
        "what is saved of the numbers alone, as the paper counts; of bytes in doubles; and in the smallest packing.",
        "",
        *grid(heads("bytes saved"), rows),
    ]


def _costs() -> list[str]:
    head = ["delay", *(f"{row.state_of_the_art}/s" for row in claims.TABLE)]
    rows = [
        [
            f"{delay:g} interval{'s' * (delay != 1.0)}",
            *(f"{1e3 * delay / row.state_of_the_art:.0f} ms" for row in claims.TABLE),
        ]
        for delay in (1.0, *DELAYS)
    ]
    return ["What each delay costs, the link not counted; the even stream has 1 interval:", "", *grid(head, rows)]
