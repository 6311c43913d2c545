"""The section of the page on why a screw wins on one motion and loses on another. Markdown."""

from __future__ import annotations

import numpy as np

from rigid_motion_batch.report.numbers import listed

from . import claims
from .bows import FORMULA
from .results import Results
from .table import ADAPTIVE
from .wording import grid, less, number

SPLINES = ("motor_spline", "motor_spline_causal")

WHAT_ASSETS_ARE = {
    "pivot": "a tool turned about its resting tip",
    "reach": "an arm that reaches",
    "screw": "a tool that drives a screw",
    "throw": "a tool thrown and caught",
}


def bows_section(found: Results) -> list[str]:
    if not found.bows:
        return []
    rates = list(dict.fromkeys(one.updates for one in found.bows))
    clips = list(dict.fromkeys(one.clip for one in found.bows))
    at = {(one.clip, one.updates): one for one in found.bows}
    errors = {clip: float(np.mean([at[clip, rate].error for rate in rates if (clip, rate) in at])) for clip in clips}
    shares = {clip: float(np.mean([at[clip, rate].share for rate in rates if (clip, rate) in at])) for clip in clips}
    best, worst = min(clips, key=errors.__getitem__), max(clips, key=errors.__getitem__)
    lines = [
        "## Why a screw wins here and loses there",
        "",
        "Between two updates, the state of the art moves the origin straight, and a screw moves it on a bow. The "
        "number k says how much of that bow the recorded path has. For each sample between updates, a leads from the "
        "straight line to where the origin was recorded, and b to where the screw puts it. Summed over all samples,",
        "",
        *(f"    {line}" for line in FORMULA),
        "",
        "So k is 1 where the path has all of the bow, and 0 where it has none of it. Since a - b is the screw's "
        "error, the screw has the smaller RMS position error exactly where k is above a half. Each cell has k, and the "
        "screw's error as a multiple of the state of the art's.",
        "",
        *grid(
            ["clip", *(f"{rate}/s" for rate in rates)],
            [
                [
                    clip,
                    *(
                        f"{number(at[clip, rate].share)}; {at[clip, rate].error:.2f}" if (clip, rate) in at else ""
                        for rate in rates
                    ),
                ]
                for clip in clips
            ],
        ),
        "",
        f"A screw is best on {_said(best)}: {errors[best]:.2f} times the error on average, with a k of "
        f"{number(shares[best])}; and worst on {_said(worst)}: {errors[worst]:.2f} times, with "
        f"{number(shares[worst])}. " + _motions_in_words(shares),
    ]
    wins = {rate: [at[clip, rate].share > 0.5 for clip in clips if (clip, rate) in at] for rate in rates}
    low, high = min(rates), max(rates)
    lines.append(
        f"At {low} updates a second the screw is closer on {sum(wins[low])} of {len(wins[low])} clips, at {high} on "
        f"{sum(wins[high])} of {len(wins[high])}"
        + (": between updates far apart a hand does more than one screw." if sum(wins[low]) < sum(wins[high]) else ".")
    )
    left = [one.error for one in found.bows if one.updates >= claims.TABLE[-1].state_of_the_art]
    if left:
        lines.append(
            "How much a screw can change is limited: of the state of the art's error at "
            f"{claims.TABLE[-1].state_of_the_art} updates a second and more, it left {min(left):.0%} where it was best "
            f"and {max(left):.0%} where it was worst."
        )
    splines = [mode for mode in SPLINES if np.isfinite(found.saved(mode)).any()]
    if splines:
        told = [f"`{mode}` {less(found.saved(mode))}" for mode in splines]
        lines.append(
            "A straight line and a screw both have a corner at every update, and that costs more than the path between "
            f"updates does. Bandwidth without corners: {listed(told)}. Keys placed where the motion needs them save "
            f"more, where no stream has to wait for them: `{SPLINES[0]}` {less(found.saved(SPLINES[0], ADAPTIVE))}."
        )
    return lines


def _motions_in_words(means: dict[str, float]) -> str:
    """What the assets, of which it is known what moves, have of the bow."""
    known = {clip: WHAT_ASSETS_ARE[clip] for clip in means if clip in WHAT_ASSETS_ARE}
    bowed = [f"{what} ({means[clip]:.2f})" for clip, what in known.items() if means[clip] > 0.5]
    straight = [f"{what} ({means[clip]:.2f})" for clip, what in known.items() if means[clip] <= 0.5]
    parts = []
    if bowed:
        parts.append(f"Of the motions that are known, a screw suits {listed(bowed)}")
    if straight:
        parts.append(f"{'it' if bowed else 'a screw'} does not suit {listed(straight)}")
    return "; ".join(parts) + "." if parts else ""


def _said(clip: str) -> str:
    return f"`{clip}`, {WHAT_ASSETS_ARE[clip]}" if clip in WHAT_ASSETS_ARE else f"`{clip}`"
