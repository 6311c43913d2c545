"""The subject of a comparison: the request as one value, and the clips that were found in the recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigid_motion_batch.analysis.choices import EVERYWHERE, Choice, Radii
from rigid_motion_batch.analysis.held import find_held
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.command_line import did_you_mean, listed
from rigid_motion_batch.recordings.clips import Clip, ClipFacts
from rigid_motion_batch.recordings.options import AS_THE_FILE_SAYS, ReadingOptions
from rigid_motion_batch.recordings.reading import split_source
from rigid_motion_batch.report.settings import PageSettings
from rigid_motion_batch.scenes.settings import MODELS, SceneSettings

from .comparison_steps import ClipOf
from .steps import RunError

MOST_FRAMES = 216_000
"""The largest number of frames of a film: an hour at 60 frames per second."""

MOST_POSES = 600_000
"""The largest number of frames times joints of a film of a body: a rig takes half a kilobyte for each, in every
lane."""

RATE_MARGIN = 0.01
"""Fraction by which a rate may exceed that of the recording: a nominal 90 Hz is often 89.9."""


@dataclass(frozen=True)
class Comparison:
    """The recordings to compare, and all settings of the comparison."""

    sources: tuple[str, ...]
    """Sources as the user gave them: FILE, FILE:BODY, FILE:*."""

    choices: tuple[Choice, ...]
    modes: tuple[str, ...]
    against: str = ""
    """The source of another motion to show next to the modes, if there is only one clip."""

    reference: str = REFERENCE
    """The mode that the others are compared with."""

    axes: str | None = None
    """A name in `axes.AXES`; None for the axes of each format."""

    held: tuple[tuple[str, str], ...] = ()
    """Pairs of clip names (held, holder) whose slip is measured in addition to the pairs that are found."""

    reading: ReadingOptions = AS_THE_FILE_SAYS
    radii: Radii = EVERYWHERE
    shared: bool = False
    """Whether adaptive keys of a body are at the same samples for all joints."""

    count_keys: bool = False
    """Whether to find how many keys every mode needs."""

    fit: bool = False
    """Whether to find also how many keys are needed if keys may be fitted."""

    stage: SceneSettings | None = None
    """The stage of the films; None for a run without films."""

    every_film: bool = False
    """Whether every choice of keys gets a film, or only the choice that the verdict is about."""

    about: PageSettings | None = None
    """Facts of the run that pages show; None for a run without pages."""

    subject: str = next(iter(MODELS))
    """The object that rigid bodies move, as for `place_of_subject`. Pages without Blender show the first of
    `MODELS`."""

    blender: str = ""
    """The version of the Blender that films and reads; empty if there is none."""


@dataclass(frozen=True, slots=True)
class Study:
    """A clip, with the choices of keys for which it is long enough."""

    clip: ClipOf
    reader: str
    """The key of the task that reads the clip."""

    facts: ClipFacts = field(repr=False)
    choices: dict[Choice, tuple[float, float]]
    """The choices of keys, each with the times of the first and the last key."""

    @property
    def name(self) -> str:
        return self.clip.name

    @property
    def most_frames(self) -> int:
        return min(MOST_FRAMES, MOST_POSES // max(self.facts.joints, 1))

    def frames(self, choice: Choice, stage: SceneSettings) -> float:
        start, end = self.choices[choice]
        return (end - start) * stage.fps * stage.slow_motion + 1.0


def held_pairs(
    studies: Sequence[Study], comparison: Comparison, read: Callable[[Study], Clip]
) -> list[tuple[Study, Study]]:
    """Return the pairs (holder, held): pairs that the user names, and pairs that are found in a file.

    Raises RunError if a named pair is not valid.
    """
    known = {study.name: study for study in studies}
    result: dict[frozenset[str], tuple[Study, Study]] = {}
    for names in comparison.held:
        said = f"--held {' '.join(names)}"
        for name in names:
            if name not in known:
                near = did_you_mean(name, known) or f"; there are {listed(known, 8)}"
                raise RunError(f"{said}: there is no clip {name!r}{near}")
            if known[name].facts.joints:
                raise RunError(f"{said}: {name} is a whole body; name two rigid bodies")
        if names[0] == names[1]:
            raise RunError(f"{said}: name two clips, the one that is held and the one that holds it")
        pair = known[names[1]], known[names[0]]
        spans = [(clip.times[0], clip.times[-1]) for clip in map(read, pair)]
        if max(start for start, _ in spans) >= min(end for _, end in spans):
            lasts = " and ".join(
                f"{name} lasts from {start:.6g} to {end:.6g} s"
                for name, (start, end) in zip(reversed(names), spans, strict=True)
            )
            raise RunError(f"{said}: they share no times, {lasts}; give both the same clock")
        result[frozenset(names)] = pair
    files: dict[Path, list[Study]] = {}
    for study in studies:
        if not study.facts.joints:
            files.setdefault(split_source(study.facts.source)[0], []).append(study)
    for bodies in files.values():
        clips = [*map(read, bodies)] if len(bodies) > 1 else []
        for holder, held in find_held(clips, comparison.radii.rigid):
            pair = bodies[holder], bodies[held]
            result.setdefault(frozenset(study.name for study in pair), pair)
    return [pair for pair in result.values() if any(choice in pair[1].choices for choice in pair[0].choices)]


def rates_above(times: np.ndarray, choices: Iterable[Choice]) -> list[str]:
    """Return warnings about rates above that of a recording with these times, shape (n,)."""
    rate = 1.0 / float(np.median(np.diff(times)))
    above = [choice.rate for choice in choices if choice.rate and float(choice.rate) > rate * (1.0 + RATE_MARGIN)]
    return (
        [f"it has {rate:.3g} samples a second: {', '.join(above)} keys a second cannot be had of it"] if above else []
    )
