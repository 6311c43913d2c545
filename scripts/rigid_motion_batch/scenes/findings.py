"""Findings shown in a film besides the shell error: slip of a held object, drift of a pivot, foot sliding.

Each is a number per mode, written into its lane, and a remark that explains it. Uses only NumPy.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from rigid_motion_batch.analysis.held import Slip
from rigid_motion_batch.analysis.metrics import Metrics

MAX_FINDINGS = 3
"""Maximum number of findings in a film."""

MIN_SLIDE_M = 5e-5
"""Minimum foot sliding, in metres, that is a finding: joints that never move count as standing."""


@dataclass(frozen=True)
class Finding:
    """The maximum of a distance that would be zero in a perfect motion."""

    text: str
    """The text, with braces for the number and its unit."""

    remark: str
    """Explains the text."""

    metres: Mapping[str, float]
    """Mode id to the distance."""

    recorded: float | None = None
    """The distance in the recording itself."""


def findings_of(rows: Sequence[Metrics], slips: Iterable[Slip] = ()) -> list[Finding]:
    """Return the findings about a clip under a choice of keys, from its metrics, and its slips if it is held."""
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
