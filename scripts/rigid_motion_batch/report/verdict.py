"""The verdict: one sentence with a number that answers "which mode", and in how many cases that mode was the best.

Everything is computed from the numbers of the run, and true for any outcome of it. Errors are RMS shell errors;
several clips are averaged by the geometric mean, so that a large motion counts as much as a small one, and it is said
so. Modes that are one motion throughout are one candidate, and the first of them names it. A draw is said to be one,
and so is a loss.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.choices import Budget, Tolerance
from rigid_motion_batch.analysis.metrics import NOTHING, geometric_mean
from rigid_motion_batch.analysis.needed import KeysNeeded, overall

from .numbers import KINDS, Numbers, digits, listed, percent

TIE = 0.005
"""Ratios closer to 1 than this are no difference: they would be shown as 0 %."""

ASKED = ("20", "15", "12", "30")
"""The rate of the reference that the sentence on keys needed is about: the first that was possible."""

SPACED = "evenly spaced", "where the motion needs them", "where needed, and fitted"
"""How keys are placed, by `needed.DECIMATIONS`."""

SAMPLE_IS_KEY = "No mode is off by more than rounding: every sample is a key, or nothing moves."


@dataclass(frozen=True)
class Verdict:
    """What a run comes to."""

    sentence: str
    wins: str = ""
    """In how many cases the best mode was; empty of a single case."""


@dataclass(frozen=True, eq=False)
class _Contest:
    """The candidates of a run under its choices of one kind."""

    numbers: Numbers
    places: tuple[int, ...]
    """Of the choices among those of the run."""

    groups: tuple[tuple[str, ...], ...]
    values: np.ndarray
    """What decides, shape (clips, choices, groups)."""

    @property
    def kind(self) -> type:
        return type(self.numbers.choices[self.places[0]])

    @property
    def amounts(self) -> np.ndarray:
        return np.array([self.numbers.choices[place].size for place in self.places])

    @property
    def reference(self) -> int | None:
        """The group that the reference is in."""
        return next((place for place, group in enumerate(self.groups) if self.numbers.asked in group), None)

    @property
    def distinguishable(self) -> np.ndarray:
        """Where all groups have a value and at least one of them has an error, shape (clips, choices)."""
        least = NOTHING * 1e3 if self.kind is not Tolerance else 0.0
        return np.isfinite(self.values).all(axis=2) & (self.values.max(axis=2) > least)

    @property
    def means(self) -> np.ndarray:
        """Geometric means over the clips where groups can be told apart, shape (choices, groups)."""
        return geometric_mean(np.where(self.distinguishable[..., None], np.maximum(self.values, 1e-9), np.nan))

    def phrase(self, choice: int) -> str:
        return self.numbers.choices[self.places[choice]].phrase

    def name(self, group: int) -> str:
        return self.numbers.label(self.groups[group][0])


def verdict(numbers: Numbers, needed: Sequence[KeysNeeded] = ()) -> Verdict:
    """Return what a run says, in one sentence, and how often the best mode wins.

    Parameters
    ----------
    numbers : Numbers
    needed : sequence of KeysNeeded
        Of the clips, where that was looked for.
    """
    contests = list(_contests(numbers))
    # What was asked is answered first: within a tolerance, how many keys.
    within = [contest for contest in contests if contest.kind is Tolerance]
    sentences = [*map(_beside_rival, within), _keys_needed(numbers, needed) if needed else None]
    sentences += [tell(contest) for contest in contests for tell in (_fewer_keys, _beside_rival)]
    said = [sentence for sentence in sentences if sentence]
    if not said:
        return Verdict(SAMPLE_IS_KEY)
    return Verdict(said[0].replace("\u00a0", " "), _wins(contests[0]) if contests else "")


def _contests(numbers: Numbers) -> Iterable[_Contest]:
    """One for each kind of choices under which anything was off."""
    groups = tuple(
        own for group in numbers.groups() if (own := tuple(mode for mode in group if mode in MODES)) and own[0] in MODES
    )
    for kind in KINDS:
        places = tuple(place for place, choice in enumerate(numbers.choices) if type(choice) is kind)
        if not places or not groups:
            continue
        columns = [numbers.modes.index(group[0]) for group in groups]
        measure = numbers.deciding(places[0])
        values = numbers.values[measure][:, places][..., columns]
        contest = _Contest(numbers, places, groups, values)
        if contest.distinguishable.any():
            yield contest


def _best(contest: _Contest) -> tuple[int, int, np.ndarray] | None:
    """Return best group, what it is held against, and the ratios of the two, shape (choices,); None without a winner.

    Held against the reference, or the next best in a run without it.
    """
    if len(contest.groups) < 2:
        return None
    means = contest.means
    known = np.isfinite(means).all(axis=1)
    scores = np.log(means[known]).mean(axis=0)
    ranked = np.argsort(scores, kind="stable")
    best = int(ranked[0])
    rival = contest.reference if contest.reference is not None else int(ranked[1])
    if np.exp(scores[best] - scores[rival]) > 1.0 - TIE:
        return None
    return best, rival, means[:, best] / means[:, rival]


# -- sentences --------------------------------------------------------------------------------------------------------


def _keys_needed(numbers: Numbers, needed: Sequence[KeysNeeded]) -> str | None:
    """How few keys are as good as those of the reference at a rate, of those that were looked for."""
    together, reference = overall(needed), needed[0].reference
    rate = next((rate for rate in ASKED if together.asked[together.rates.index(rate)]), None)
    if rate is None:
        return None
    at = together.rates.index(rate)
    whole = together.clips[..., at] == together.asked[at]
    shares = np.where(whole, together.shares[..., at], np.inf)
    group, way = (int(place) for place in np.unravel_index(np.argmin(shares), shares.shape))
    label, theirs = numbers.label(reference), together.reference_keys_per_s[at]
    if shares[group, way] > 1.0 - TIE:
        return f"Nothing needs fewer keys than {label}, {theirs:.3g} a second and evenly spaced."

    def amount(group: int) -> str:
        return f"{together.keys_per_s[group, way, at]:.3g} a second of {numbers.label(together.groups[group][0])}"

    said = f"As good as {theirs:.3g} evenly spaced keys a second of {label} are {amount(group)}, {SPACED[way]}"
    beside = next((place for place, group in enumerate(together.groups) if reference in group), group)
    # Where keys are chosen better that is no merit of the mode: its rival has as good ones.
    if beside != group and np.isfinite(shares[beside, way]):
        said += f", or {amount(beside)}"
    return f"{said}{_over(together.asked[at])}."


def _over(clips: np.integer) -> str:
    return f" (geometric mean over {clips} clips)" if clips > 1 else ""


def _fewer_keys(contest: _Contest) -> str | None:
    """How far down the rate can go, until the error is that of the reference at a higher one.

    None where the curves of this run do not tell: rates that do not cross, or an error that does not fall with them.
    """
    result = _best(contest)
    if contest.kind is Tolerance or not result or contest.reference is None or len(contest.places) < 2:
        return None
    best, reference, _ = result
    whole = contest.distinguishable.all(axis=1)
    if not whole.any():
        return None
    curves = np.log(np.maximum(contest.values[whole], 1e-9)).mean(axis=0)
    own, theirs, rates = curves[:, best], curves[:, reference], contest.amounts
    if np.any(np.diff(own) >= 0.0):
        return None
    crossed = (at for at in range(len(rates) - 1, 0, -1) if own[-1] <= theirs[at] and own[at] < theirs[at])
    highest = next(crossed, None)
    if highest is None:
        return None
    rate = float(np.exp(np.interp(-theirs[highest], -own, np.log(rates))))
    at_most = theirs[highest] > own[0]
    share = 1.0 - rate / rates[highest]
    if share < TIE:
        return None
    most, least = ("At most ", "at least ") if at_most else ("", "")
    placed = " on average" if contest.kind is Budget else ""
    return (
        f"{most}{rate:.3g} keys a second{placed} of {contest.name(best)} are as good as {rates[highest]:g} of "
        f"{contest.name(reference)}: {least}{percent(share)} fewer for the same error{_over(whole.sum())}."
    )


def _beside_rival(contest: _Contest) -> str:
    """How much closer the best mode is with as many keys, or how many fewer it needs within a tolerance."""
    result = _best(contest)
    if not result:
        return _no_winner(contest)
    best, rival, ratios = result
    at = int(np.nanargmin(ratios))
    first, other, less = contest.name(best), contest.name(rival), percent(1.0 - ratios[at])
    over = _over(contest.distinguishable[:, at].sum())
    if contest.kind is not Tolerance:
        keys = contest.numbers.choices[contest.places[at]].amount
        placed = " on average" if contest.kind is Budget else ""
        return f"{first} has {less} less error than {other} with the same {keys} keys a second{placed}{over}."
    phrase, (own, others) = contest.phrase(at), contest.means[at, [best, rival]]
    said = f"{phrase[0].upper()}{phrase[1:]}, {first} takes {less} fewer keys than {other}"
    return f"{said}: {own:.3g} a second to {others:.3g}{over}."


def _no_winner(contest: _Contest) -> str:
    """Where no mode is better than the reference, or than all others; the choice with the most keys speaks."""
    means, within = contest.means, contest.kind is Tolerance
    known = np.flatnonzero(np.isfinite(means).all(axis=1))
    at = int(known[0] if within else known[-1])
    best = contest.reference if contest.reference is not None else int(np.argmin(means[at]))
    over = _over(contest.distinguishable[:, at].sum())
    better = means[known].min(axis=1) < (1.0 - TIE) * means[known, best]
    if better.any():
        winners: dict[int, list[str]] = {}
        for choice, is_better in zip(known.tolist(), better.tolist(), strict=True):
            winner = int(np.argmin(means[choice])) if is_better else best
            winners.setdefault(winner, []).append(contest.phrase(choice))
        said = "; ".join(f"{contest.name(winner)} {listed(phrases)}" for winner, phrases in winners.items())
        return f"What {'needs the fewest keys' if within else 'is closest'} depends on the keys: {said}{over}."
    unit, off = ("keys a second", "") if within else ("mm", " off (RMS)")
    said = f"{contest.name(best)}: {digits(means[at, best])} {unit}{off} {contest.phrase(at)}"
    if len(contest.groups) == 1:
        return f"{said}{over}."
    following = next(int(group) for group in np.argsort(means[at], kind="stable") if group != best)
    ratio = means[at, following] / means[at, best] - 1.0
    name = contest.name(following)
    beside = f"{name} is as good" if ratio < TIE else f"{name} is next, with {percent(ratio)} more"
    return f"Nothing {'needs fewer keys' if within else 'comes closer'} than {said}; {beside}{over}."


def _wins(contest: _Contest) -> str:
    """Return in how many cases the best mode was."""
    result = _best(contest)
    if not result or contest.distinguishable.sum() < 2:
        return ""
    values = contest.values[contest.distinguishable]
    won = np.count_nonzero(values[:, result[0]] * (1.0 - TIE) <= values.min(axis=1))
    return f"{'Fewest keys' if contest.kind is Tolerance else 'Closest'} in {won} of {len(values)} cases"
