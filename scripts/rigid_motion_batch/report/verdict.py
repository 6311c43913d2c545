"""The verdict: one sentence with a number that says which mode is best, and in how many cases it was.

It also names the choice of keys that it is about: pages open with that choice, and films show it. The sentence is
computed from the numbers of the run, and true for any outcome. Errors are RMS shell errors; several clips are averaged
by the geometric mean, so a large motion counts as much as a small one, and the sentence says so. Modes that give the
same motion throughout are one candidate, named after the first of them. Draws and losses are reported as such.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.choices import Budget, Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import MAX_ROUNDING_M, geometric_mean
from rigid_motion_batch.analysis.needed import KeysNeeded, overall

from .numbers import KINDS, Numbers, digits, listed, percent

MAX_TIE_RATIO = 0.005
"""Ratios closer to 1 than this count as equal: they would be shown as 0 %."""

ASKED_RATES = ("20", "15", "12", "30")
"""Rates of the reference that the sentence on needed keys may use: the first one possible is taken."""

SPACING_TEXTS = "evenly spaced", "where the motion needs them", "where needed, and fitted"
"""How keys are placed, in the order of `needed.DECIMATIONS`."""

SAMPLE_IS_KEY = "No mode is off by more than rounding: every sample is a key, or nothing moves."


@dataclass(frozen=True)
class Verdict:
    """The conclusion of a run."""

    sentence: str
    choice: Choice | None = None
    """The choice of keys that it is about, or the nearest one in the run; None if no mode has an error."""
    wins: str = ""
    """In how many cases the best mode won; empty for a single case."""

    @property
    def text(self) -> str:
        """The sentence and the wins."""
        return " ".join(filter(None, (self.sentence, self.wins and f"{self.wins}.")))


@dataclass(frozen=True, eq=False)
class _Contest:
    """The candidates of a run under its choices of one kind."""

    numbers: Numbers
    places: tuple[int, ...]
    """The indices of these choices among those of the run."""

    groups: tuple[tuple[str, ...], ...]
    values: np.ndarray
    """The deciding measure, shape (clips, choices, groups)."""

    @property
    def kind(self) -> type:
        return type(self.choices[0])

    @property
    def amounts(self) -> np.ndarray:
        return np.array([choice.size for choice in self.choices])

    @property
    def reference(self) -> int | None:
        """The index of the group with the reference."""
        return next((place for place, group in enumerate(self.groups) if self.numbers.asked in group), None)

    @property
    def distinguishable(self) -> np.ndarray:
        """True where all groups have a value and at least one has an error, shape (clips, choices)."""
        least = MAX_ROUNDING_M * 1e3 if self.kind is not Tolerance else 0.0
        return np.isfinite(self.values).all(axis=2) & (self.values.max(axis=2) > least)

    @property
    def means(self) -> np.ndarray:
        """Geometric means over the clips where groups can be told apart, shape (choices, groups)."""
        return geometric_mean(np.where(self.distinguishable[..., None], np.maximum(self.values, 1e-9), np.nan))

    @property
    def choices(self) -> list[Choice]:
        return [self.numbers.choices[place] for place in self.places]

    def phrase(self, choice: int) -> str:
        return self.choices[choice].phrase

    def name(self, group: int) -> str:
        return self.numbers.label(self.groups[group][0])


def verdict(numbers: Numbers, needed: Sequence[KeysNeeded] = ()) -> Verdict:
    """Return the conclusion of a run in one sentence, and how often the best mode wins.

    Parameters
    ----------
    numbers : Numbers
    needed : sequence of KeysNeeded
        The keys needed on each clip, if computed.
    """
    contests = list(_contests(numbers))
    # The question asked comes first: how many keys a tolerance needs.
    within = [contest for contest in contests if contest.kind is Tolerance]
    verdicts = [*map(_versus_rival, within), _keys_needed(numbers, needed) if needed else None]
    verdicts += [tell(contest) for contest in contests for tell in (_fewer_keys, _versus_rival)]
    said = next((one for one in verdicts if one), None)
    if said is None:
        return Verdict(SAMPLE_IS_KEY)
    counted = next((contest for contest in contests if contest.kind is type(said.choice)), None)
    return replace(said, sentence=said.sentence.replace("\u00a0", " "), wins=_wins(counted) if counted else "")


def nearest(choices: Iterable[Choice], keys_per_s: float) -> Choice:
    """Return the choice whose rate is nearest to `keys_per_s`, as a ratio; tolerances come last."""
    return min(choices, key=lambda one: (isinstance(one, Tolerance), abs(np.log(one.size / keys_per_s))))


def _contests(numbers: Numbers) -> Iterable[_Contest]:
    """Yield a contest for each kind of choice under which any mode had an error."""
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
    """Return the best group, its rival, and the ratios of the two, shape (choices,); None without a winner.

    The rival is the reference, or the second best in a run without it.
    """
    if len(contest.groups) < 2:
        return None
    means = contest.means
    known = np.isfinite(means).all(axis=1)
    scores = np.log(means[known]).mean(axis=0)
    ranked = np.argsort(scores, kind="stable")
    best = int(ranked[0])
    rival = contest.reference if contest.reference is not None else int(ranked[1])
    if np.exp(scores[best] - scores[rival]) > 1.0 - MAX_TIE_RATIO:
        return None
    return best, rival, means[:, best] / means[:, rival]


# -- sentences --------------------------------------------------------------------------------------------------------


def _keys_needed(numbers: Numbers, needed: Sequence[KeysNeeded]) -> Verdict | None:
    """Say how few keys are as good as the reference's at a given rate, from the keys needed."""
    together, reference = overall(needed), needed[0].reference
    rate = next((rate for rate in ASKED_RATES if together.asked[together.rates.index(rate)]), None)
    if rate is None:
        return None
    at = together.rates.index(rate)
    whole = together.clips[..., at] == together.asked[at]
    shares = np.where(whole, together.shares[..., at], np.inf)
    group, way = (int(place) for place in np.unravel_index(np.argmin(shares), shares.shape))
    label, theirs = numbers.label(reference), together.reference_keys_per_s[at]
    wins = shares[group, way] <= 1.0 - MAX_TIE_RATIO
    spaced = [choice for choice in numbers.choices if isinstance(choice, Uniform) == (not wins or way == 0)]
    keys = float(together.keys_per_s[group, way, at]) if wins else theirs
    shown = nearest(spaced or numbers.choices, keys)
    if not wins:
        return Verdict(f"Nothing needs fewer keys than {label}, {theirs:.3g} a second and evenly spaced.", shown)

    def amount(group: int) -> str:
        return f"{together.keys_per_s[group, way, at]:.3g} a second of {numbers.label(together.groups[group][0])}"

    said = f"As good as {theirs:.3g} evenly spaced keys a second of {label} are {amount(group)}, {SPACING_TEXTS[way]}"
    beside = next((place for place, group in enumerate(together.groups) if reference in group), group)
    # Better placed keys are no merit of the mode: its rival can have them too.
    if beside != group and np.isfinite(shares[beside, way]):
        said += f", or {amount(beside)}"
    return Verdict(f"{said}{_mean_note(together.asked[at])}.", shown)


def _mean_note(clips: np.integer) -> str:
    return f" (geometric mean over {clips} clips)" if clips > 1 else ""


def _fewer_keys(contest: _Contest) -> Verdict | None:
    """Say how far the rate can drop until the error equals the reference's at a higher rate.

    None if the curves of this run cannot tell: rates that do not cross, or an error that does not fall with the rate.
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
    if share < MAX_TIE_RATIO:
        return None
    most, least = ("At most ", "at least ") if at_most else ("", "")
    placed = " on average" if contest.kind is Budget else ""
    return Verdict(
        f"{most}{rate:.3g} keys a second{placed} of {contest.name(best)} are as good as {rates[highest]:g} of "
        f"{contest.name(reference)}: {least}{percent(share)} fewer for the same error{_mean_note(whole.sum())}.",
        nearest(contest.choices, rate),
    )


def _versus_rival(contest: _Contest) -> Verdict:
    """Say how much closer the best mode is with the same keys, or how many fewer keys it needs within a tolerance."""
    result = _best(contest)
    if not result:
        return _no_winner(contest)
    best, rival, ratios = result
    at = int(np.nanargmin(ratios))
    first, other, less = contest.name(best), contest.name(rival), percent(1.0 - ratios[at])
    over = _mean_note(contest.distinguishable[:, at].sum())
    choice = contest.choices[at]
    if contest.kind is not Tolerance:
        placed = " on average" if contest.kind is Budget else ""
        same = f"the same {choice.amount} keys a second{placed}{over}"
        return Verdict(f"{first} has {less} less error than {other} with {same}.", choice)
    phrase, (own, others) = contest.phrase(at), contest.means[at, [best, rival]]
    said = f"{phrase[0].upper()}{phrase[1:]}, {first} takes {less} fewer keys than {other}"
    return Verdict(f"{said}: {own:.3g} a second to {others:.3g}{over}.", choice)


def _no_winner(contest: _Contest) -> Verdict:
    """Say that no mode is better than the reference, or than all others.

    The sentence is about the choice with the fewest keys, where modes differ most.
    """
    means, within = contest.means, contest.kind is Tolerance
    known = np.flatnonzero(np.isfinite(means).all(axis=1))
    at = int(known[-1] if within else known[0])
    choice = contest.choices[at]
    best = contest.reference if contest.reference is not None else int(np.argmin(means[at]))
    over = _mean_note(contest.distinguishable[:, at].sum())
    better = means[known].min(axis=1) < (1.0 - MAX_TIE_RATIO) * means[known, best]
    if better.any():
        winners: dict[int, list[str]] = {}
        for place, is_better in zip(known.tolist(), better.tolist(), strict=True):
            winner = int(np.argmin(means[place])) if is_better else best
            winners.setdefault(winner, []).append(contest.phrase(place))
        said = "; ".join(f"{contest.name(winner)} {listed(phrases)}" for winner, phrases in winners.items())
        closest = "needs the fewest keys" if within else "is closest"
        return Verdict(f"What {closest} depends on the keys: {said}{over}.", choice)
    unit, off = ("keys a second", "") if within else ("mm", " off (RMS)")
    said = f"{contest.name(best)}: {digits(means[at, best])} {unit}{off} {contest.phrase(at)}"
    if len(contest.groups) == 1:
        return Verdict(f"{said}{over}.", choice)
    following = next(int(group) for group in np.argsort(means[at], kind="stable") if group != best)
    ratio = means[at, following] / means[at, best] - 1.0
    name = contest.name(following)
    beside = f"{name} is as good" if ratio < MAX_TIE_RATIO else f"{name} is next, with {percent(ratio)} more"
    closer = "needs fewer keys" if within else "comes closer"
    return Verdict(f"Nothing {closer} than {said}; {beside}{over}.", choice)


def _wins(contest: _Contest) -> str:
    """Say in how many cases the best mode won."""
    result = _best(contest)
    if not result or contest.distinguishable.sum() < 2:
        return ""
    values = contest.values[contest.distinguishable]
    won = np.count_nonzero(values[:, result[0]] * (1.0 - MAX_TIE_RATIO) <= values.min(axis=1))
    return f"{'Fewest keys' if contest.kind is Tolerance else 'Closest'} in {won} of {len(values)} cases"
