"""What a film is about beside the shell error: how far a body slips that another holds, a pivot moves, or feet slide.

Each is a number of every mode, written into its lane, and a remark that says what it is. NumPy alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from rigid_motion_batch.analysis.held import Slip
from rigid_motion_batch.analysis.metrics import Metrics

MAX_FINDINGS = 3
"""Findings of a film at most."""

MIN_SLIDE_M = 5e-5
"""Metres that feet slide at least: what never moves counts as standing."""


@dataclass(frozen=True)
class Finding:
    """The largest of a distance that there would be none of, in a perfect motion."""

    text: str
    """What is written, with braces for the number and its unit."""

    remark: str
    """What that is."""

    metres: Mapping[str, float]
    """Mode id to the distance."""

    recorded: float | None = None
    """That of the recording itself."""


def findings_of(rows: Sequence[Metrics], slips: Iterable[Slip] = ()) -> list[Finding]:
    """Return what there is to say of a clip under a choice of keys, by its rows, and of its slips where it is held."""
    by_holder: dict[str, list[Slip]] = {}
    for slip in slips:
        by_holder.setdefault(slip.clip_a, []).append(slip)
    result = [
        Finding(
            "slips up to {}",
            f"slips: how far it moves in {holder}, which holds it",
            {slip.mode: slip.max_slip_m for slip in own},
            own[0].recorded_slip_m,
        )
        for holder, own in by_holder.items()
    ]
    still = {row.mode: row.still_point_m for row in rows if row.still_point_m is not None}
    slide = {row.mode: row.foot_slide_m for row in rows if row.foot_slide_m is not None}
    if still:
        result.append(Finding("pivot up to {} off", "pivot: the point that stays in the recording", still))
    if max(slide.values(), default=0.0) > MIN_SLIDE_M:
        result.append(
            Finding(
                "feet slide up to {}", "feet slide: while they stand on the ground", slide, rows[0].recorded_slide_m
            )
        )
    return result[:MAX_FINDINGS]
