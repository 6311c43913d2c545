"""What the numbers of a run say, in sentences: computed from the metrics, for any clips, rates and modes.

The error meant here is the RMS shell error. Errors are compared as ratios to those of the reference mode on the same
clip at the same rate, and averaged over clips by the geometric mean, so that a clip with large motion counts as much
as one with small.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from addon.motion.measures import shell_error

from .clips import Reconstruction
from .metrics import Metrics

REFERENCE = "lerp_slerp"
"""The state of the art in the paper: what the other modes are held against."""

UPDATES_IN_THE_PAPER = {"30": "20", "20": "10", "15": "7", "12": "5"}
"""The paper's table: updates a second under its state of the art, and those that it found to look the same."""

NOTHING = 1e-9
"""An error below this, in metres, is rounding: every sample was a key, or nothing moved."""

SAME = "the same"


@dataclass(frozen=True, eq=False)
class Summary:
    """The RMS shell errors of a run as one array."""

    clips: tuple[str, ...]
    rates: tuple[str, ...]
    """As the user wrote them, from the lowest to the highest."""

    modes: tuple[str, ...]

    groups: tuple[tuple[str, ...], ...]
    """The modes once more, those together that gave the same poses throughout: see `identical_modes`."""

    errors: np.ndarray
    """Shape (clips, rates, modes), NaN where a clip has no such rate."""

    @property
    def reference(self) -> str:
        """`lerp_slerp`, or the first mode of a run without it."""
        return REFERENCE if REFERENCE in self.modes else self.modes[0]

    @cached_property
    def ratios(self) -> np.ndarray:
        """Errors as multiples of the reference's, shape (clips, rates, modes). NaN where that has none."""
        reference = self.of(self.reference)[..., None]
        return np.divide(self.errors, reference, out=np.full_like(self.errors, np.nan), where=reference > NOTHING)

    @cached_property
    def relative(self) -> np.ndarray:
        """The geometric mean of the ratios over the clips, shape (rates, modes). NaN where no clip has one."""
        return np.exp(_mean_over_clips(np.log(np.maximum(self.ratios, 1e-12))))

    def of(self, mode: str) -> np.ndarray:
        """The errors of one mode, shape (clips, rates)."""
        return self.errors[..., self.modes.index(mode)]


def summarise(rows: Sequence[Metrics], groups: Iterable[tuple[str, ...]]) -> Summary:
    """Gather the rows of all clips, rates and modes."""
    clips = tuple(dict.fromkeys(row.clip for row in rows))
    rates = tuple(sorted(dict.fromkeys(row.rate_hz for row in rows), key=float))
    modes = tuple(dict.fromkeys(row.mode for row in rows))
    errors = np.full((len(clips), len(rates), len(modes)), np.nan)
    for row in rows:
        errors[clips.index(row.clip), rates.index(row.rate_hz), modes.index(row.mode)] = row.rms_shell_m
    return Summary(clips, rates, modes, tuple(groups), errors)


def identical_modes(reconstructions: Sequence[Reconstruction]) -> tuple[tuple[str, ...], ...]:
    """The modes in groups that gave the same poses in all of these reconstructions.

    The same means: apart by less than a millionth of their error, by the shell measure, or than what rounding does.
    Some modes are one curve by theory (ScLERP and the SLERP of motors); this looks whether they were.
    """
    groups: list[list[str]] = []
    for mode in dict.fromkeys(mode for reconstruction in reconstructions for mode in reconstruction.poses):
        for group in groups:
            if all(_same(reconstruction, group[0], mode) for reconstruction in reconstructions):
                group.append(mode)
                break
        else:
            groups.append([mode])
    return tuple(map(tuple, groups))


def _same(reconstruction: Reconstruction, first: str, second: str) -> bool:
    if first not in reconstruction.poses or second not in reconstruction.poses:
        return False
    poses, others = (reconstruction.clip.in_metres(reconstruction.poses[mode]) for mode in (first, second))
    rounding = 1e-12 * (1.0 + np.abs(poses.positions).max())
    apart = shell_error(poses, others).max()
    return bool(apart <= 1e-6 * reconstruction.errors[first].shell.max() + rounding)


def findings(summary: Summary, labels: dict[str, str]) -> list[str]:
    """Sentences about the run. `labels` are the names of the modes in prose.

    Of modes that are identical throughout, the first speaks for all, once that has been said.
    """
    return [
        *_what_is_identical(summary, labels),
        *_compared_with_the_reference(summary, labels),
        *_keys_for_the_same_error(summary, labels),
        *_who_is_closest(summary, labels),
        *_extremes(summary, labels),
    ]


def _what_is_identical(summary: Summary, labels: dict[str, str]) -> list[str]:
    same = [listed([labels[mode] for mode in group]) for group in summary.groups if len(group) > 1]
    if not same:
        return []
    where = "" if summary.errors[..., 0].size == 1 else ", on every clip at every rate"
    return [
        f"Identical in-betweens came from {'; and from '.join(same)}{where}. They share a line in the plots, and here "
        "the first of them speaks for the others."
    ]


def _compared_with_the_reference(summary: Summary, labels: dict[str, str]) -> list[str]:
    sentences = []
    mean = f" (geometric mean over {len(summary.clips)} clips)" if len(summary.clips) > 1 else ""
    for group in summary.groups:
        relative = summary.relative[:, summary.modes.index(group[0])]
        if summary.reference in group or not np.isfinite(relative).any():
            continue
        changes = [
            f"{_change(ratio)} at {rate}"
            for rate, ratio in zip(summary.rates, relative, strict=True)
            if np.isfinite(ratio)
        ]
        sentences.append(
            f"Compared with {labels[summary.reference]}, the error of {labels[group[0]]} was {listed(changes)} keys/s"
            f"{mean}."
        )
    return sentences


def _keys_for_the_same_error(summary: Summary, labels: dict[str, str]) -> list[str]:
    """The paper's question: how far down can the rate go, until the error is that of the reference at a higher one?"""
    rates = np.array([float(rate) for rate in summary.rates])
    whole = (summary.errors > NOTHING).all(axis=(1, 2))
    if len(rates) < 2 or not whole.any():
        return []
    curves = {group: np.log(summary.of(group[0])[whole]).mean(axis=0) for group in summary.groups}
    target = next(curve for group, curve in curves.items() if summary.reference in group)[-1]
    needed = [
        f"by {labels[group[0]]} at {np.exp(np.interp(-target, -curve, np.log(rates))):.3g}"
        for group, curve in curves.items()
        if summary.reference not in group and np.all(np.diff(curve) < 0.0) and curve[-1] <= target <= curve[0]
    ]
    if not needed:
        return []
    highest = summary.rates[-1]
    paper = UPDATES_IN_THE_PAPER.get(highest)
    beside = f"; the paper's table has {paper} instead of {highest}" if paper else ""
    return [
        f"The error of {labels[summary.reference]} at {highest} keys/s was reached {listed(needed)} keys/s (read off "
        f"between the rates of this run{beside})."
    ]


def _who_is_closest(summary: Summary, labels: dict[str, str]) -> list[str]:
    errors = np.stack([summary.of(group[0]) for group in summary.groups], axis=-1)
    names = [labels[group[0]] for group in summary.groups]
    sentences, nothing = [], []
    for at, rate in enumerate(summary.rates):
        told_apart = errors[:, at][np.isfinite(errors[:, at]).all(axis=-1) & (errors[:, at].max(axis=-1) > NOTHING)]
        if not len(told_apart):
            nothing.append(rate)
        if not len(told_apart) or len(names) < 2:
            continue
        wins = np.bincount(told_apart.argmin(axis=-1), minlength=len(names))
        ranked = [place for place in np.argsort(-wins, kind="stable") if wins[place]]
        who = names[ranked[0]]
        if len(summary.clips) > 1:
            who += f" on {wins[ranked[0]]} of {_clips(len(told_apart))}"
            who += "".join(f", {names[place]} on {wins[place]}" for place in ranked[1:])
        sentences.append(f"Closest to the recording at {rate} keys/s: {who}.")
    if nothing:
        sentences.append(f"At {listed(nothing)} keys/s no mode was off by more than rounding.")
    return sentences


def _extremes(summary: Summary, labels: dict[str, str]) -> list[str]:
    if len(summary.clips) < 2 or not np.isfinite(summary.ratios).any():
        return []
    sentences = []
    for place, title in (
        (np.nanargmin(summary.ratios), "The largest gain over"),
        (np.nanargmax(summary.ratios), "The largest loss to"),
    ):
        clip, rate, mode = np.unravel_index(place, summary.ratios.shape)
        change = _change(ratio := summary.ratios[clip, rate, mode])
        if change != SAME and (ratio < 1.0) == title.endswith("over"):
            first = next(group[0] for group in summary.groups if summary.modes[mode] in group)
            sentences.append(
                f"{title} {labels[summary.reference]} was that of {labels[first]} on {summary.clips[clip]} at "
                f"{summary.rates[rate]} keys/s: an error {change}."
            )
    return sentences


def _mean_over_clips(values: np.ndarray) -> np.ndarray:
    """The mean over the first axis of what is not NaN; NaN where nothing is left."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    total = np.where(known, values, 0.0).sum(axis=0)
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)


def _change(ratio: float) -> str:
    percent = round(abs(ratio - 1.0) * 100.0)
    return f"{percent}\u00a0% {'lower' if ratio < 1.0 else 'higher'}" if percent else SAME


def listed(words: Sequence[str]) -> str:
    """Words as prose lists them: "5, 10 and 15"."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _clips(count: int) -> str:
    return "1 clip" if count == 1 else f"{count} clips"
