"""The plan of a comparison: its tasks, clip by clip.

There are three plans in turn, since the clips are known only after reading, and the choice of keys to film only after
measuring: `reading` and `inspect_clips`, `measuring` and `conclude`, then `tasks`, which yields all tasks.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cached_property
from typing import Any, cast

import numpy as np

from rigid_motion_batch.analysis.choices import Choice, fewest_keys
from rigid_motion_batch.analysis.metrics import table_names
from rigid_motion_batch.analysis.modes import name_of_other
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import clip_names
from rigid_motion_batch.recordings.clips import Clip, ClipFacts
from rigid_motion_batch.recordings.reading import split_source
from rigid_motion_batch.report.settings import PageSettings
from rigid_motion_batch.scenes.settings import SceneSettings, place_of_subject
from rigid_motion_batch.scenes.timeline import Timeline

from . import comparison_steps as steps
from . import values
from .comparison_steps import ClipOf, Page, Part
from .findings import Findings
from .steps import Task
from .store import Store
from .studies import Comparison, Study, held_pairs, rates_above

METRICS, JOINT_METRICS, KEYS_NEEDED = "metrics.csv", "metrics_joints.csv", "keys_needed.csv"
SLIPS = "slip.csv"

ON_ONE_PAGE = 24
"""The largest number of clips on one page; with more, each has a page of its own."""

MAX_PIECE_FRAMES = 60
"""The largest number of frames of a film that one task renders. Short pieces keep many processors busy with a long
film, and lose little if one is interrupted."""

TABLES = {
    METRICS: ("measure", steps.ROWS),
    JOINT_METRICS: ("measure", steps.JOINT_ROWS),
    KEYS_NEEDED: ("count_keys", steps.ROWS),
    SLIPS: ("slips", steps.ROWS),
}
"""Tables of all clips: name to the kind of results that it joins, as in `Part.what`, and the name of their rows."""

IN_BLENDER = (".blend", ".fbx")
"""Extensions of recordings that Blender reads."""


class ComparisonPlan:
    """The tasks of a comparison in an open store."""

    def __init__(self, comparison: Comparison, store: Store) -> None:
        self.comparison, self.store = comparison, store
        self.studies: list[Study] = []
        """The clips to compare, after `inspect_clips`."""
        self.held: list[tuple[Study, Study]] = []
        """Pairs of clips (holder, held)."""
        self.found = Findings()
        """The measured results, after `conclude`."""

    # -- reading ------------------------------------------------------------------------------------------------------

    def reading(self) -> Iterator[Task]:
        """Yield the tasks that read the sources."""
        yield from {task.key: task for task in self._readers}.values()

    @cached_property
    def _readers(self) -> list[Task]:
        """The tasks that read the sources, in order; a source that is named twice has the same task twice."""
        return [*map(self._reader, self.comparison.sources)]

    def _reader(self, source: str) -> Task:
        comparison = self.comparison
        inputs: dict[str, str] = {}
        kind, called = steps.Read, ""
        with suppress(TrajectoryError):  # The task that reads it reports the missing file.
            paths = [split_source(item)[0] for item in (source, comparison.against) if item]
            called = name_of_other(paths[-1].stem) if comparison.against else ""
            inputs = self.store.inputs(*paths)
            kind = steps.ReadInBlender if any(path.suffix.lower() in IN_BLENDER for path in paths) else kind
        blender = comparison.blender if kind.blender else ""
        step = kind(source, comparison.axes, comparison.reading, blender, comparison.against, called)
        return Task(step, f"read {source}", inputs=inputs, seconds=0.3)

    def inspect_clips(self) -> list[str]:
        """Find the clips in the recordings that were read, and return notes for the user.

        Raises RunError for a pair in --held that cannot hold.
        """
        comparison = self.comparison
        keys = [task.key for task in self._readers if self.store.index_of(task.key)]
        read = {
            key: values.read(tuple[str, tuple[ClipFacts, ...]], self.store.results / key / "facts") for key in {*keys}
        }
        notes = [note for note, _ in (read[key] for key in keys) if note]
        bodies = [(key, body, facts) for key in keys for body, facts in enumerate(read[key][1])]
        names = clip_names([(facts.name, facts.body) for _, _, facts in bodies])
        self.studies, of_clips = [], []
        for name, (key, body, facts) in zip(names, bodies, strict=True):
            notes += [f"{name}: {note}" for note in facts.repairs]
            times = np.load(self.store.results / key / f"{body}.times.npy")
            enough = {}
            for choice in comparison.choices:
                if matches := choice.ends(times):
                    enough[choice] = float(times[matches[0]]), float(times[matches[1]])
                else:
                    of_clips.append(f"{name}: too short for two keys at {choice.rate} a second; left out")
            of_clips += [f"{name}: {note}" for note in rates_above(times, comparison.choices)]
            if enough:
                self.studies.append(Study(ClipOf(name, body), key, facts, enough))
                of_clips += self._notes_on_left_out_films(self.studies[-1])
        if self._shows_object and not comparison.blender:
            notes.append(f"the report shows a drill, since no Blender here can read {comparison.subject}")
        self.held = held_pairs(self.studies, comparison, self.read)
        return notes + of_clips

    def read(self, study: Study) -> Clip:
        """Return a clip with its samples."""
        return study.clip.read(self.store.results / study.reader)

    @property
    def _shows_object(self) -> bool:
        """Return whether pages show an object other than the default, which needs no Blender."""
        rigid = any(not study.facts.joints for study in self.studies)
        return rigid and self.comparison.subject != Comparison.subject

    def _notes_on_left_out_films(self, study: Study) -> Iterator[str]:
        """Yield messages about films that are left out because they would be too long."""
        stage = self.comparison.stage
        if stage and (frames := max(study.frames(choice, stage) for choice in study.choices)) > study.most_frames:
            start, end = next(iter(study.choices.values()))
            yield (
                f"{study.name}: no video: its {end - start:.6g} s make {frames:.6g} frames, more than "
                f"{study.most_frames}; see whether its times are in seconds, cut it, or give a lower --fps or "
                "--slow-motion"
            )

    # -- measuring ----------------------------------------------------------------------------------------------------

    def measuring(self) -> Iterator[Task]:
        """Yield the tasks that measure all numbers. They take seconds, and do not depend on the videos."""
        return self._measuring({})

    def conclude(self) -> None:
        """Read the measured numbers, and decide which choices of keys to film."""
        reference, alone = self.comparison.reference, self._has_overview
        self.found = Findings.of(self.store, self.measuring(), reference, alone=alone)

    @property
    def _has_overview(self) -> bool:
        return len(self.studies) > ON_ONE_PAGE

    def _measuring(self, keys: dict[Part, str]) -> Iterator[Task]:
        """Yield the tasks of all numbers, and enter the keys of results for pages into `keys`."""
        read = {study.reader for study in self.studies}
        yield from (task for task in self.reading() if task.key in read)
        for study in self.studies:
            keys[Part("read", study.clip)] = study.reader
            for part, task in self._measuring_tasks(study):
                yield task
                keys[part] = task.key
        for holder, held in self.held:
            shared = [choice.name for choice in holder.choices if choice in held.choices]
            measured = [keys[Part("measure", one.clip, name)] for name in shared for one in (holder, held)]
            measuring = steps.MeasureSlips(holder.clip, held.clip, self.comparison.radii, self.comparison.shared)
            after = holder.reader, held.reader, *measured
            yield (task := Task(measuring, f"slip of {held.name} in {holder.name}", after, seconds=0.02 * len(after)))
            keys[Part("slips", held.clip, holder.name)] = task.key
        for table in self.tables:
            what, rows = TABLES[table]
            clips = {study.clip for study in self.studies if study.facts.joints or table != JOINT_METRICS}
            after = tuple(key for part, key in keys.items() if part.what == what and part.clip in clips)
            step = steps.Tabulate(rows)
            yield Task(step, table, after, publish={"table.csv": table}, seconds=0.002 * len(after))

    @property
    def tables(self) -> list[str]:
        """The tables that this run writes; other tables of earlier runs must be withdrawn."""
        there = {
            METRICS: True,
            KEYS_NEEDED: self.comparison.count_keys,
            JOINT_METRICS: any(study.facts.joints for study in self.studies),
            SLIPS: bool(self.held),
        }
        return [table for table in TABLES if there[table]]

    def _measuring_tasks(self, study: Study) -> Iterator[tuple[Part, Task]]:
        """Yield the tasks of a clip's numbers, each with its part of a page."""
        comparison, clip, name, after = self.comparison, study.clip, study.name, (study.reader,)
        joints, size = study.facts.joints, study.facts.samples * max(study.facts.joints, 1)
        modes = comparison.modes
        for choice in study.choices:
            folder = f"{name}/{choice.name}"
            names = table_names(choice, modes, study.facts.against, body=bool(joints))
            publish = {table: f"{folder}/{table}" for table in names}
            seconds = 0.02 + 6e-6 * size * len(modes) * (1.0 if choice.decimation == "uniform" else 45.0)
            step = steps.Measure(clip, choice, modes, comparison.radii, comparison.shared)
            yield (
                Part("measure", clip, choice.name),
                Task(step, f"measure {folder}", after, publish=publish, seconds=seconds),
            )
        if comparison.count_keys:
            fit = comparison.fit and not joints
            count, seconds = (
                steps.CountKeys(clip, comparison.modes, comparison.radii, fit, comparison.reference),
                0.03 if fit else 0.008,
            )
            yield Part("count_keys", clip), Task(count, f"count keys {name}", after, seconds=seconds * size)

    # -- drawing ------------------------------------------------------------------------------------------------------

    def tasks(self, *, films: bool = True) -> Iterator[Task]:
        """Yield all tasks: numbers, films and pages; without `films`, pages leave room for the films."""
        keys: dict[Part, str] = {}
        yield from self._measuring(keys)
        slips: dict[ClipOf, list[str]] = {}
        for part, key in keys.items():
            if part.what == "slips":
                slips.setdefault(part.clip, []).append(key)
        filmed: dict[Part, str] = {}
        for study in self.studies:
            for choice in self.filmed(study):
                film = Part("encode", study.clip, choice.name)
                filmed[film] = ""
                before = keys[Part("measure", study.clip, choice.name)], *slips.get(study.clip, ())
                for task in self._film(study, choice, before) if films else ():
                    yield task
                    filmed[film] = task.key
        if self.comparison.about:
            yield from self._pages(keys, filmed, films)

    def filmed(self, study: Study) -> list[Choice]:
        """Return the choices to film: the one that the verdict is about, unless all are requested."""
        stage, own = self.comparison.stage, study.choices
        spoken_of = self.found.spoken_of.get(study.name)
        one = [spoken_of] if spoken_of in own else fewest_keys(own)[:1]
        choices = own if self.comparison.every_film else one
        return [choice for choice in choices if stage and study.frames(choice, stage) <= study.most_frames]

    def _film(self, study: Study, choice: Choice, before: tuple[str, ...]) -> Iterator[Task]:
        """Yield the tasks of a film from results that were measured before; the last task makes the film."""
        comparison, stage = self.comparison, cast(SceneSettings, self.comparison.stage)
        seconds = 0.03 + 4e-7 * stage.resolution[0] * stage.resolution[1]
        folder, title = f"{study.name}/{choice.name}", f"{study.name} {choice.phrase}"
        building = Task(
            steps.Build(study.clip, comparison.radii, comparison.shared, stage, comparison.blender),
            f"build {folder}",
            after=(study.reader, *before),
            inputs={} if study.facts.joints else self._subject_file(),
            publish={steps.BLEND: f"{folder}/{steps.BLEND}"},
        )
        yield building
        count = Timeline.between(*study.choices[choice], stage.fps, stage.slow_motion).count
        pieces = math.ceil(count / MAX_PIECE_FRAMES)
        firsts = [1 + count * number // pieces for number in range(pieces + 1)]
        rendering: list[Task] = []
        for first, following in itertools.pairwise(firsts):
            step, name = steps.Render(title, first, following - 1), f"render {folder} from {first}"
            rendering.append(Task(step, name, (building.key,), seconds=seconds * (following - first)))
        keys = tuple(task.key for task in rendering)
        encoding = Task(
            steps.Encode(title, 1, count),
            f"encode {folder}",
            after=(building.key, *keys),
            spends=keys,
            publish={steps.FILM: f"{folder}/{steps.FILM}"},
            seconds=seconds * count * 0.06,
        )
        if not self.store.index_of(encoding.key):
            yield from rendering
        yield encoding

    def _subject_file(self) -> dict[str, str]:
        return self.store.inputs(place_of_subject(self.comparison.subject)[0])

    # -- pages --------------------------------------------------------------------------------------------------------

    def _pages(self, keys: dict[Part, str], filmed: dict[Part, str], films: bool) -> Iterator[Task]:
        """Yield one page of a few clips, or a page for each of many clips and an overview with links to them."""
        comparison, subject = self.comparison, self.comparison.subject
        if comparison.blender and self._shows_object:
            step = steps.Subject(subject, comparison.blender)
            yield (task := Task(step, f"object {subject}", inputs=self._subject_file()))
            keys |= {Part("subject"): task.key}
        if not self._has_overview:
            yield self._page(Page, keys | filmed, coming=not films)
            return
        of_clips: dict[ClipOf, dict[Part, str]] = {}
        for part, key in (keys | filmed).items():
            of_clips.setdefault(part.clip, {})[part] = key
        shared, pages = of_clips.pop(ClipOf(""), {}), []
        for clip, own in of_clips.items():
            films_of = {part: own.pop(part) for part in [*own] if part in filmed}
            page = {"overview": f"../{steps.PAGE}", "folder": clip.name}
            yield (task := self._page(Page, own | shared | films_of, coming=not films, **page))
            pages.append(task.key)
        yield self._page(steps.Overview, keys, pages)

    def _page(self, kind: type[Page], parts: dict[Part, str], pages: Iterable[str] = (), **how: Any) -> Task:
        step = kind(tuple(parts), cast(PageSettings, self.comparison.about), **how)
        place = f"{step.folder}/" if step.folder else ""
        return Task(
            step,
            f"page {step.folder}" if step.folder else steps.PAGE,
            after=(*filter(None, parts.values()), *pages),
            publish={name: place + name for name in (steps.PAGE, steps.PAGE_DATA)},
            seconds=0.02 * len(step.clips),
        )
