"""Findings of a comparison: the results of its tasks so far, read from the store without arrays.

The films depend on the choice of keys in the verdict, so they are planned by these findings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby

from rigid_motion_batch.analysis.choices import Choice
from rigid_motion_batch.analysis.held import PairSlips
from rigid_motion_batch.analysis.needed import KeysNeeded
from rigid_motion_batch.analysis.results import ChoiceNumbers
from rigid_motion_batch.report.numbers import Gathering, Numbers
from rigid_motion_batch.report.verdict import Verdict, verdict

from . import comparison_steps as steps
from . import values
from .steps import Task
from .store import Store


@dataclass(frozen=True, eq=False)
class Findings:
    """The results so far; results that could not be made are left out."""

    numbers: Numbers | None = None
    """None if nothing was measured."""

    verdict: Verdict | None = None
    slips: tuple[PairSlips, ...] = ()
    spoken_of: Mapping[str, Choice | None] = field(default_factory=dict)
    """Clip name to the choice of keys that the verdict on its page is about."""

    @classmethod
    def of(cls, store: Store, tasks: Iterable[Task], reference: str, *, alone: bool) -> Findings:
        """Read the results of these tasks. If clips are `alone`, each has its own page and so its own verdict."""
        everything, needed, slips = Gathering(reference), list[KeysNeeded](), list[PairSlips]()
        spoken_of: dict[str, Choice | None] = {}
        measuring = (
            task for task in tasks if isinstance(task.step, steps.Measure | steps.CountKeys | steps.MeasureSlips)
        )
        for name, group in groupby(measuring, key=_clip_of):
            choices, counted = list[ChoiceNumbers](), list[KeysNeeded]()
            for task in group:
                folder = store.results / task.key
                with suppress(OSError, ValueError, KeyError):
                    if isinstance(task.step, steps.MeasureSlips):
                        slips.append(values.read(PairSlips, folder / "slips"))
                    elif isinstance(task.step, steps.CountKeys):
                        counted.append(values.read(KeysNeeded, folder / "needed"))
                    else:
                        choices.append(values.read(ChoiceNumbers, folder / "numbers"))
            needed += counted
            if choices:
                everything.add(name, choices)
                spoken_of[name] = _own_choice(reference, name, choices, counted) if alone else None
        try:
            numbers = everything.numbers()
        except ValueError:
            return cls(slips=tuple(slips))
        said = verdict(numbers, needed)
        return cls(numbers, said, tuple(slips), spoken_of if alone else dict.fromkeys(spoken_of, said.choice))


def _clip_of(task: Task) -> str:
    return task.step.clip.name if isinstance(task.step, steps.Measure | steps.CountKeys) else ""


def _own_choice(reference: str, name: str, choices: list[ChoiceNumbers], counted: list[KeysNeeded]) -> Choice | None:
    """Return the choice of keys that the verdict on a single clip is about."""
    alone = Gathering(reference)
    alone.add(name, choices)
    return verdict(alone.numbers(), counted).choice
