"""What the numbers of a run say, in sentences: computed from the metrics, for any clips, choices of keys and modes.

The error meant here is the RMS shell error. Errors are compared as ratios to those of the reference mode on the same
clip with the same choice, and averaged over clips by the geometric mean, so that a clip with large motion counts as
much as one with small. Where a tolerance decides, the number of keys takes the place of the error.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigid_motion_batch.analysis.choices import Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import NOTHING, geometric_mean
from rigid_motion_batch.analysis.modes import BEST_OF, REFERENCE, single_modes
from rigid_motion_batch.analysis.reconstructions import Groups, joint_groups
from rigid_motion_batch.comparison.results import Result

UPDATES_IN_THE_PAPER = {"30": "20", "20": "10", "15": "7", "12": "5"}
"""The paper's table: updates a second under its state of the art, and those that it found to look the same."""

SAME = "the same"


@dataclass(frozen=True, eq=False)
class Summary:
    """The RMS shell errors of a run as one array, for its choices of one kind."""

    clips: tuple[str, ...]
    choices: tuple[Choice, ...]
    """From the smallest amount to the largest."""

    modes: tuple[str, ...]

    groups: tuple[tuple[str, ...], ...]
    """The modes once more, those together that gave the same poses throughout: see `identical_modes`."""

    errors: np.ndarray
    """Shape (clips, choices, modes), NaN where a clip is too short for a choice.

    Where a tolerance decides, keys a second instead, which are what it leaves to compare.
    """

    @property
    def kind(self) -> type[Choice]:
        """Of all choices."""
        return type(self.choices[0])

    @property
    def amounts(self) -> tuple[str, ...]:
        return tuple(choice.amount for choice in self.choices)

    @property
    def what(self) -> str:
        """What is compared."""
        return "number of keys" if self.kind is Tolerance else "error"

    @property
    def reference(self) -> str:
        """`lerp_slerp`, or the first mode of a run without it."""
        return REFERENCE if REFERENCE in self.modes else self.modes[0]

    @cached_property
    def ratios(self) -> np.ndarray:
        """Errors as multiples of the reference's, shape (clips, choices, modes). NaN where that has none."""
        reference = self.of(self.reference)[..., None]
        return np.divide(self.errors, reference, out=np.full_like(self.errors, np.nan), where=reference > NOTHING)

    @cached_property
    def relative(self) -> np.ndarray:
        """The geometric mean of the ratios over the clips, shape (choices, modes). NaN where no clip has one."""
        return geometric_mean(np.maximum(self.ratios, 1e-12))

    def of(self, mode: str) -> np.ndarray:
        """The errors of one mode, shape (clips, choices)."""
        return self.errors[..., self.modes.index(mode)]


def summarise(results: Iterable[Result]) -> list[Summary]:
    """Gather the rows of all clips and modes, a summary for each kind of choice that there is."""
    # Of thousands of clips only these few numbers are kept.
    gathered: dict[type[Choice], dict[tuple[str, Choice], dict[str, float]]] = {}
    groupings: dict[type[Choice], dict[Groups, None]] = {}
    for result in results:
        kind = type(result.choice)
        found = {row.mode: row.keys_per_s if kind is Tolerance else row.rms_shell_m for row in result.rows}
        gathered.setdefault(kind, {})[result.clip, result.choice] = found
        groupings.setdefault(kind, {})[result.groups] = None
    return [_summary(found, joint_groups(groupings[kind])) for kind, found in gathered.items()]


def _summary(found: Mapping[tuple[str, Choice], Mapping[str, float]], groups: Groups) -> Summary:
    clips = tuple(dict.fromkeys(clip for clip, _ in found))
    choices = tuple(sorted(dict.fromkeys(choice for _, choice in found), key=lambda choice: choice.size))
    modes = tuple(dict.fromkeys(mode for errors in found.values() for mode in errors))
    rows, layers, columns = ({one: place for place, one in enumerate(some)} for some in (clips, choices, modes))
    errors = np.full((len(clips), len(choices), len(modes)), np.nan)
    for (clip, choice), by_mode in found.items():
        for mode, error in by_mode.items():
            errors[rows[clip], layers[choice], columns[mode]] = error
    return Summary(clips, choices, modes, groups, errors)


def findings(summary: Summary, labels: dict[str, str]) -> list[str]:
    """Sentences about the run. `labels` are the names of the modes in prose.

    Of modes that are identical throughout, the first speaks for all, once that has been said.
    """
    return [
        *_what_is_identical(summary, labels),
        *_compared_with_the_reference(summary, labels),
        *_keys_for_the_same_error(summary, labels),
        *_what_choosing_gains(summary, labels),
        *_who_is_closest(summary, labels),
        *_extremes(summary, labels),
    ]


def _what_is_identical(summary: Summary, labels: dict[str, str]) -> list[str]:
    same = [listed([labels[mode] for mode in group]) for group in summary.groups if len(group) > 1]
    if not same:
        return []
    where = "" if summary.errors[..., 0].size == 1 else f", on every clip {_every(summary)}"
    return [
        f"Identical in-betweens came from {'; and from '.join(same)}{where}. They share a line in the charts, and the "
        "sentences below name only the first of them."
    ]


def _compared_with_the_reference(summary: Summary, labels: dict[str, str]) -> list[str]:
    sentences = []
    mean = f" (geometric mean over {len(summary.clips)} clips)" if len(summary.clips) > 1 else ""
    for group in summary.groups:
        relative = summary.relative[:, summary.modes.index(group[0])]
        if summary.reference in group or not np.isfinite(relative).any():
            continue
        changes = [
            f"{compared(ratio)} {choice.at} {choice.amount}"
            for choice, ratio in zip(summary.choices, relative, strict=True)
            if np.isfinite(ratio)
        ]
        said = f"{listed(changes)} {summary.kind.unit}".rstrip()
        sentences.append(
            f"Compared with {labels[summary.reference]}, the {summary.what} of {labels[group[0]]} was {said}{mean}."
        )
    return sentences


def _keys_for_the_same_error(summary: Summary, labels: dict[str, str]) -> list[str]:
    """The paper's question: how far down can the rate go, until the error is that of the reference at a higher one?"""
    rates = np.array([choice.size for choice in summary.choices])
    whole = (summary.errors > NOTHING).all(axis=(1, 2))
    if summary.kind is not Uniform or len(rates) < 2 or not whole.any():
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
    highest = summary.amounts[-1]
    paper = UPDATES_IN_THE_PAPER.get(highest)
    beside = f"; the paper's table has {paper} instead of {highest}" if paper else ""
    return [
        f"The error of {labels[summary.reference]} at {highest} keys/s was reached {listed(needed)} keys/s "
        f"(interpolated between the rates of this run{beside})."
    ]


def _what_choosing_gains(summary: Summary, labels: dict[str, str]) -> list[str]:
    """The best mode of each segment beside the best single mode of each clip, by the error."""
    if BEST_OF not in summary.modes or summary.kind is Tolerance:
        return []
    modes = single_modes(summary.modes)
    single = np.stack([summary.of(mode) for mode in modes], axis=-1)
    least = single.min(axis=-1)
    ratios = np.divide(summary.of(BEST_OF), least, out=np.full_like(least, np.nan), where=least > NOTHING)
    if not np.isfinite(ratios).any():
        return []
    changes = [
        f"{compared(ratio)} {choice.at} {choice.amount}"
        for choice, ratio in zip(summary.choices, geometric_mean(ratios), strict=True)
        if np.isfinite(ratio)
    ]
    several = len(summary.clips) > 1
    mean = f" (geometric mean over {len(summary.clips)} clips)" if several else ""
    said = (
        f"Choosing the best mode of each segment made the error {listed(changes)} {summary.kind.unit} compared with "
        f"the best single mode{' of each clip' if several else ''}{mean}."
    )
    clip, choice = np.unravel_index(np.nanargmin(ratios), ratios.shape)
    if several and (change := compared(ratios[clip, choice])) != SAME:
        best = modes[int(single[clip, choice].argmin())]
        said += (
            f" It gained most on {summary.clips[clip]} {summary.choices[choice].phrase}: {change} than by "
            f"{labels[best]}."
        )
    return [said]


def _who_is_closest(summary: Summary, labels: dict[str, str]) -> list[str]:
    # What is chosen for being closest says nothing by being so.
    groups = [group for group in summary.groups if group[0] != BEST_OF]
    errors = np.stack([summary.of(group[0]) for group in groups], axis=-1)
    names = [labels[group[0]] for group in groups]
    sentences, nothing = [], []
    best = "Fewest keys" if summary.kind is Tolerance else "Closest to the recording"
    for at, choice in enumerate(summary.choices):
        told_apart = errors[:, at][np.isfinite(errors[:, at]).all(axis=-1) & (errors[:, at].max(axis=-1) > NOTHING)]
        if not len(told_apart):
            nothing.append(choice.amount)
        if not len(told_apart) or len(names) < 2:
            continue
        wins = np.bincount(told_apart.argmin(axis=-1), minlength=len(names))
        ranked = [place for place in np.argsort(-wins, kind="stable") if wins[place]]
        who = names[ranked[0]]
        if len(summary.clips) > 1:
            who += f" on {wins[ranked[0]]} of {_clips(len(told_apart))}"
            who += "".join(f", {names[place]} on {wins[place]}" for place in ranked[1:])
        sentences.append(f"{best} {choice.phrase}: {who}.")
    if nothing:
        sentences.append(f"At {listed(nothing)} {summary.kind.unit} no mode was off by more than rounding.")
    return sentences


def _extremes(summary: Summary, labels: dict[str, str]) -> list[str]:
    modes = single_modes(summary.modes)
    ratios = summary.ratios[..., [summary.modes.index(mode) for mode in modes]]
    if len(summary.clips) < 2 or not np.isfinite(ratios).any():
        return []
    sentences = []
    article = "a" if summary.kind is Tolerance else "an"
    for place, title in (
        (np.nanargmin(ratios), "The largest gain over"),
        (np.nanargmax(ratios), "The largest loss to"),
    ):
        clip, choice, mode = np.unravel_index(place, ratios.shape)
        change = compared(ratio := ratios[clip, choice, mode])
        if change != SAME and (ratio < 1.0) == title.endswith("over"):
            first = next(group[0] for group in summary.groups if modes[mode] in group)
            sentences.append(
                f"{title} {labels[summary.reference]} was that of {labels[first]} on {summary.clips[clip]} "
                f"{summary.choices[choice].phrase}: {article} {summary.what} {change}."
            )
    return sentences


def _every(summary: Summary) -> str:
    return "within every tolerance" if summary.kind is Tolerance else "at every rate"


def compared(ratio: float) -> str:
    """A ratio as prose has it: "12 % lower"."""
    percent = round(abs(ratio - 1.0) * 100.0)
    return f"{percent}\u00a0% {'lower' if ratio < 1.0 else 'higher'}" if percent else SAME


def listed(words: Sequence[str]) -> str:
    """Words as prose lists them: "5, 10 and 15"."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _clips(count: int) -> str:
    return "1 clip" if count == 1 else f"{count} clips"
