"""The report's part on the keys that are needed (`needed`): the curve of error over keys a second, and the table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.analysis.needed import DECIMATIONS, TABLE_RATES, KeysNeeded, Overall, overall

from .charts import Curve, axis_over, line_chart
from .elements import curve, heading, is_best, label, missing_cell, mode_cell, number_cell, rounded, table, text_cell
from .findings import listed
from .markup import Content, Markup, element

SPACINGS = {"uniform": "evenly spaced", "adaptive": "adaptive", "fitted": "adaptive and fitted"}
"""What the decimations are called."""

HOW_TO_READ = (
    "Solid: keys placed where the mode needs them. Dashed: evenly spaced keys. The further a line is to the lower "
    "left, the fewer keys the mode needs for the same error."
)


def keys_section(clips: Sequence[KeysNeeded]) -> Markup:
    """The section of all clips: geometric means, or the numbers themselves where there is but one clip."""
    together = overall(clips)
    reference = label(REFERENCE)
    explained = (
        f"At the rate at the head of each column, {reference} with evenly spaced keys has a certain RMS shell error. "
        "The cell says how many keys a mode needs for the same error, evenly spaced or chosen by the motion, and how "
        f"many per cent of the keys of {reference} that is."
    )
    if together.shares.shape[1] == len(DECIMATIONS):
        explained += " Fitted keys are not recorded poses, but moved to where the motion follows the recording best."
    if len(clips) > 1:
        explained += f" Geometric means over the {len(clips)} clips."
    return element(
        "section",
        element("h2", "Keys needed"),
        element("ul", [element("li", sentence) for sentence in savings(together)], class_="findings"),
        element("p", explained, class_="note"),
        _table_over_all(together, len(clips)) if len(clips) > 1 else _table_of(clips[0]),
        _chart_over_all(together, len(clips)) if len(clips) > 1 else _chart_of("needed", clips[0]),
        id="needed",
    )


def clip_part(name: str, clip: KeysNeeded) -> Markup:
    """The same of one clip, for its own section; `name` is that section's."""
    return element("div", element("h3", "Keys needed"), _table_of(clip), _chart_of(name, clip), class_="needed")


def savings(together: Overall) -> list[str]:
    """What the table comes to, in a sentence for each decimation: the mode that did with the fewest keys."""
    rates = [rate for rate in TABLE_RATES if together.asked[together.rates.index(rate)]]
    columns = [together.rates.index(rate) for rate in rates]
    sentences: list[str] = []
    if not rates:
        return sentences
    for decimation in reversed(range(together.shares.shape[1])):
        whole = (together.clips[:, decimation, columns] == together.asked[columns]).all(axis=1)
        shares = np.where(whole[:, None], together.shares[:, decimation, columns], np.nan)
        if not np.isfinite(shares).all(axis=1).any():
            continue
        best = int(np.nanargmin(np.log(shares).sum(axis=1)))
        if REFERENCE in together.groups[best] and DECIMATIONS[decimation] == "uniform":
            continue
        percents = listed([_percent(share) for share in shares[best]])
        sentences.append(
            f"{label(together.groups[best][0])} with {SPACINGS[DECIMATIONS[decimation]]} keys was as good as "
            f"{label(REFERENCE)} at {listed(rates)} keys/s with {percents} of the keys."
        )
    return sentences


# -- tables -----------------------------------------------------------------------------------------------------------


def _table_of(clip: KeysNeeded) -> Markup:
    def cell(at: tuple[int, int, int], best: float) -> Markup:
        if np.isnan(clip.keys[at]):
            return missing_cell("n/a")
        if np.isinf(clip.keys[at]):
            return missing_cell("not reached")
        return _share_cell(f"{clip.keys[at]:.0f}", clip.shares[at], best)

    columns = [clip.rates.index(rate) for rate in TABLE_RATES]
    heads = [f"{clip.targets[at] * 1e3:.3g} mm" if np.isfinite(clip.targets[at]) else "" for at in columns]
    return _table(
        f"{clip.clip}: keys needed to be as good as {label(REFERENCE)}", clip.groups, clip.shares, columns, heads, cell
    )


def _table_over_all(together: Overall, clips: int) -> Markup:
    def cell(at: tuple[int, int, int], best: float) -> Markup:
        reached, asked = int(together.clips[at]), int(together.asked[at[-1]])
        if not asked:
            return missing_cell("n/a")
        if not reached:
            return missing_cell("not reached")
        partly = f" on {reached} of {asked} clips" if reached < asked else ""
        return _share_cell(f"{rounded(together.keys_per_s[at])}/s", together.shares[at], best, partly)

    columns = [together.rates.index(rate) for rate in TABLE_RATES]
    caption = f"Keys a second needed to be as good as {label(REFERENCE)}"
    heads = ["" if asked == clips else f"({asked} of {clips} clips)" for asked in together.asked[columns].tolist()]
    return _table(caption, together.groups, together.shares, columns, heads, cell)


def _table(
    caption: str,
    groups: Sequence[tuple[str, ...]],
    shares: np.ndarray,
    columns: Sequence[int],
    heads: Sequence[str],
    cell: Callable[[tuple[int, int, int], float], Markup],
) -> Markup:
    head = [
        heading("Mode", "text"),
        heading("Keys", "text"),
        *(heading(f"{rate}/s", "number", under) for rate, under in zip(TABLE_RATES, heads, strict=True)),
    ]
    finite = np.where(np.isfinite(shares), shares, np.inf)
    best = finite.min(axis=(0, 1))
    body = [
        element(
            "tr",
            mode_cell(*group),
            text_cell(SPACINGS[decimation]),
            [cell((row, column, at), best[at]) for at in columns],
        )
        for row, group in enumerate(groups)
        for column, decimation in enumerate(DECIMATIONS[: shares.shape[1]])
    ]
    return table(caption, head, body)


def _share_cell(number: str, share: float, best: float, partly: str = "") -> Markup:
    shown: Content = [number, element("small", _percent(share) + partly)]
    return number_cell(share, shown, best=is_best(share, best), tint=share)


def _percent(share: float) -> str:
    return f"{share * 100.0:.0f}\u00a0%"


# -- curves -----------------------------------------------------------------------------------------------------------


def _chart_of(name: str, clip: KeysNeeded) -> Markup:
    return _chart(
        f"{name}-needed",
        clip.groups,
        (clip.reference_keys_per_s, clip.uniform_errors),
        (clip.keys_per_s[:, 1], clip.reached[:, 1]),
        "RMS shell error",
    )


def _chart_over_all(together: Overall, clips: int) -> Markup:
    """Means over different clips do not make one curve: points are left out that not all clips have a part in."""
    whole = together.asked == clips
    reached = together.clips[:, 1] == clips
    return _chart(
        "all-needed",
        together.groups,
        (together.reference_keys_per_s, np.where(whole, together.uniform_errors, np.nan)),
        (together.keys_per_s[:, 1], np.where(reached, together.reached[:, 1], np.nan)),
        "RMS shell error, geometric mean",
    )


def _chart(
    name: str,
    groups: Sequence[tuple[str, ...]],
    uniform: tuple[np.ndarray, np.ndarray],
    adaptive: tuple[np.ndarray, np.ndarray],
    measure: str,
) -> Markup:
    """Pairs of keys a second and errors in metres as lines on log axes, on which powers of the rate are straight."""
    curves: list[Curve] = []
    for row, group in enumerate(groups):
        evenly = curve(group, *_rising(uniform[0], uniform[1][row] * 1e3))
        evenly = replace(evenly, labels=(f"{' = '.join(evenly.labels)}, evenly spaced",), dashed=True)
        curves += [evenly, curve(group, *_rising(adaptive[0][row], adaptive[1][row] * 1e3))]
    return element(
        "figure",
        line_chart(
            name,
            "Error over keys a second",
            f"{measure} of each mode over the keys a second that it kept, evenly spaced and chosen by the motion.",
            curves,
            axis_over("keys kept", "keys/s", np.concatenate([one.x for one in curves]), log=True),
            axis_over(measure, "mm", np.concatenate([one.y for one in curves]), log=True),
            points=True,
            listed=True,
        ),
        element("figcaption", "Error over keys a second"),
        element("p", HOW_TO_READ, class_="note"),
    )


def _rising(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points that can be drawn, from left to right."""
    drawn = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    drawn = drawn[np.argsort(x[drawn], kind="stable")]
    return x[drawn], y[drawn]
