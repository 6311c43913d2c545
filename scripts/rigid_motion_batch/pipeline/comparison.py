"""The plan of a comparison: what is wanted, as one value, and the tasks that make it, clip by clip.

What the recordings hold is known only when they have been read. So there are two plans: `reading`, and then `tasks`,
once `look_into` has seen what was read. Both return their tasks one by one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rigid_motion_batch.analysis.choices import Choice, fewest_keys
from rigid_motion_batch.analysis.metrics import body_table_names, table_names
from rigid_motion_batch.analysis.modes import single_modes
from rigid_motion_batch.analysis.radii import EVERYWHERE, Radii
from rigid_motion_batch.command_line import printable
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import clip_names
from rigid_motion_batch.recordings.clips import ClipWarning
from rigid_motion_batch.recordings.options import AS_THE_FILE_SAYS, ReadingOptions
from rigid_motion_batch.recordings.reading import split_source
from rigid_motion_batch.recordings.recordings import listed
from rigid_motion_batch.scenes.settings import StageSettings, place_of_subject
from rigid_motion_batch.scenes.timeline import Timeline

from . import comparison_steps as steps
from . import values
from .comparison_steps import About, ClipOf, ClipShown, Page, SourceFacts
from .running import Outcome, Plan
from .steps import Input, Step, Task
from .store import Store

METRICS, JOINT_METRICS, DECIMATED, KEYS_NEEDED = "metrics.csv", "metrics_joints.csv", "decimated.csv", "keys_needed.csv"

ON_ONE_PAGE = 24
"""So many clips are one page; more have a page each."""

PIECE = 60
"""Frames of a film that are rendered by one task at most: a long film keeps many processors busy, and little is lost
where one is interrupted."""

MOST_FRAMES = 216_000
"""Of a film: an hour at 60 frames a second."""

MOST_POSES = 600_000
"""Frames times joints of a film of a body, whose rigs take half a kilobyte for each in every lane."""

MOST_DECIMATED = 50_000
"""Samples times joints of a body that is set beside Blender's Decimate: minutes for a choice of keys."""

RATE_MARGIN = 0.01
"""By what share a rate may be above that of a recording: 90 Hz are often 89.9 in truth."""

IN_BLENDER = (".blend", ".fbx", ".glb", ".gltf")
"""Recordings that Blender reads."""


@dataclass(frozen=True)
class Comparison:
    """What is wanted of which recordings."""

    sources: tuple[str, ...]
    """As the user gave them: FILE, FILE:BODY, FILE:*."""

    choices: tuple[Choice, ...]
    modes: tuple[str, ...]
    against: str = ""
    """The source of a motion that is shown beside the modes: somebody else's, of the one clip that there is then."""

    axes: str | None = None
    """Of `axes.AXES`; None for those of each format."""

    reading: ReadingOptions = AS_THE_FILE_SAYS
    radii: Radii = EVERYWHERE
    form: str = "csv"
    """Of the tables of poses of rigid bodies, of `metrics.FORMS`."""

    shared: bool = False
    """Whether the joints of a body have their keys at the same samples where the motion chooses them."""

    count_keys: bool = False
    """Whether to find how many keys every mode needs."""

    fit: bool = False
    """And how many where they may be fitted."""

    beside_decimate: bool = True
    """Whether to set adaptive keys of bodies beside those of Blender's Decimate, for which there must be a Blender."""

    stage: StageSettings | None = None
    """How to make the films; None for a run without."""

    every_film: bool = False
    """Whether there is a film of every choice of keys, or only of the one with the fewest keys."""

    about: About | None = None
    """What pages say of the run; None for a run without."""

    blender: str = ""
    """The version of the Blender that films and reads; empty where there is none."""


@dataclass(frozen=True, slots=True)
class Study:
    """A clip, with the choices of keys that it is long enough for."""

    clip: ClipOf
    reader: str
    """The key of the task that reads it."""

    samples: int
    choices: dict[Choice, tuple[float, float]]
    """Each with the times of the first and the last key."""

    joints: int
    """How many a whole body has; 0 for a single rigid one."""

    warnings: tuple[ClipWarning, ...] = field(default=(), repr=False)
    beside_decimate: bool = True
    against: str = ""
    """What the motion is called that it is compared with beside the modes."""

    @property
    def name(self) -> str:
        return self.clip.name

    @property
    def most_frames(self) -> int:
        return min(MOST_FRAMES, MOST_POSES // max(self.joints, 1))

    def frames(self, choice: Choice, stage: StageSettings) -> float:
        start, end = self.choices[choice]
        return (end - start) * stage.fps * stage.slow_motion + 1.0

    @property
    def decimated(self) -> list[Choice]:
        """The choices that are set beside Blender's Decimate: evenly spaced keys are not chosen to be few."""
        if not self.beside_decimate or self.samples * self.joints > MOST_DECIMATED:
            return []
        return [choice for choice in self.choices if self.joints and choice.decimation == "adaptive"]


class ComparisonPlan:
    """The tasks of a comparison in an opened store."""

    def __init__(self, comparison: Comparison, store: Store) -> None:
        self.comparison, self.store = comparison, store
        self.studies: list[Study] = []
        """What there is to compare, after `look_into`."""

    # -- reading ------------------------------------------------------------------------------------------------------

    def reading(self) -> Iterator[Task]:
        """The tasks that read the sources."""
        yield from {task.key: task for task in self._readers}.values()

    @cached_property
    def _readers(self) -> list[Task]:
        """For every source, in their order; for one that is named twice the same one twice."""
        return [*map(self._reader, self.comparison.sources)]

    def _reader(self, source: str) -> Task:
        comparison = self.comparison
        inputs: tuple[Input, ...] = ()
        step: Step = steps.read
        with suppress(TrajectoryError):  # Whoever reads it will say that there is no such file.
            paths = [split_source(one)[0] for one in (source, comparison.against) if one]
            inputs = tuple(map(self.store.input, paths))
            step = steps.read_in_blender if any(path.suffix.lower() in IN_BLENDER for path in paths) else step
        blender = comparison.blender if step is steps.read_in_blender else ""
        parameters = steps.Read(source, comparison.axes, comparison.reading, blender, comparison.against)
        return Task(step, parameters, f"read {source}", inputs=inputs, title=source, weight=0.3)

    def read(self, run: Callable[[Plan], Outcome]) -> tuple[Outcome, list[str]]:
        """Read the sources by a function that runs a plan, and see what is in them: see `look_into`.

        What was read before and turns out to be damaged is read again.
        """
        outcome = run(self.reading)
        try:
            return outcome, self.look_into()
        except Exception:
            damaged = [task.key for task in self.reading() if not self.store.result(task.key, thoroughly=True)]
            if not damaged:
                raise
            for key in damaged:
                self.store.discard(key)
        return run(self.reading), self.look_into()

    def look_into(self) -> list[str]:
        """See what clips there are in the recordings that were read, and return what the user should know of them."""
        comparison = self.comparison
        readers = [task.key for task in self._readers]
        folders = {key: result.folder for key in dict.fromkeys(readers) if (result := self.store.result(key))}
        facts = {key: values.read(SourceFacts, folder / "facts") for key, folder in folders.items()}
        bodies = [(key, body) for key in readers if key in facts for body in range(len(facts[key].bodies))]
        of_bodies = [facts[key].bodies[body] for key, body in bodies]
        names = clip_names([(one.name, one.body) for one in of_bodies])
        notes = [facts[key].note for key in readers if key in facts and facts[key].note]
        notes += [f"{name}: {note}" for name, one in zip(names, of_bodies, strict=True) for note in one.repairs]
        if unknown := comparison.radii.unknown(joint for one in of_bodies for joint in one.joints):
            notes.append(printable(f"no body has a joint {listed(unknown)}, for which --radius has a radius"))
        self.studies = []
        for (key, body), name, one in zip(bodies, names, of_bodies, strict=True):
            times = np.load(folders[key] / f"{body}.times.npy")
            ends = {choice: choice.ends(times) for choice in comparison.choices}
            notes += [
                f"{name}: too short for two keys at {choice.rate} a second; left out"
                for choice, found in ends.items()
                if found is None
            ]
            notes += [f"{name}: {note}" for note in rates_above(times, comparison.choices)]
            long_enough = {
                choice: (float(times[found[0]]), float(times[found[1]])) for choice, found in ends.items() if found
            }
            if long_enough:
                clip, joints = ClipOf(name, body), len(one.joints)
                study = Study(
                    clip, key, len(times), long_enough, joints, one.warnings, comparison.beside_decimate, one.against
                )
                self.studies.append(study)
                notes += self._left_out(study)
        return notes

    def _left_out(self, study: Study) -> Iterator[str]:
        """What is not made of a clip because it is too much, for the user."""
        stage = self.comparison.stage
        if stage and (frames := max(study.frames(choice, stage) for choice in study.choices)) > study.most_frames:
            start, end = next(iter(study.choices.values()))
            yield (
                f"{study.name}: no video: its {end - start:.6g} s make {frames:.6g} frames, more than "
                f"{study.most_frames}; see whether its times are in seconds, cut it, or give a lower --fps or "
                "--slow-motion"
            )
        adaptive = any(choice.decimation == "adaptive" for choice in study.choices)
        if study.joints and adaptive and not self.comparison.beside_decimate:
            yield f"{study.name}: not compared with Blender's Decimate, for there is no Blender here"
        elif study.joints and adaptive and not study.decimated:
            yield (
                f"{study.name}: not compared with Blender's Decimate: {study.joints} joints with {study.samples} "
                f"samples would take too long; cut it to {MOST_DECIMATED // study.joints}"
            )

    # -- comparing ----------------------------------------------------------------------------------------------------

    def tasks(self, *, films: bool = True) -> Iterator[Task]:
        """All tasks, those of numbers first: they take seconds, and are there whatever becomes of the videos.

        Without `films` the pages leave room for them.
        """
        parts: dict[str, list[tuple[str, str]]] = {}
        """Table to the keys of the tasks that make its parts, and the names of these."""
        read = {study.reader for study in self.studies}
        yield from (task for task in self.reading() if task.key in read)
        keys: dict[tuple[str, ...], str] = {}
        """Of what pages show, by kind, clip and choice."""
        for study in self.studies:
            for table, rows, address, task in self._numbers(study):
                yield task
                keys[address] = task.key
                parts.setdefault(table, []).append((task.key, rows))
                if address[0] == "measure" and study.joints:
                    parts.setdefault(JOINT_METRICS, []).append((task.key, steps.JOINT_ROWS))
        for table, made in parts.items():
            after = tuple(key for key, _ in made)
            parameters = steps.Join(made[0][1])
            publish = {"table.csv": table}
            yield Task(steps.tabulate, parameters, table, after, publish=publish, weight=0.002 * len(after))
        if films:
            for study in self.studies:
                for choice in self.filmed(study):
                    for task in self._film(study, choice, keys["measure", study.name, choice.name]):
                        yield task
                        keys["film", study.name, choice.name] = task.key
        if self.comparison.about:
            yield from self._pages(keys, films)

    @property
    def tables(self) -> set[str]:
        """The tables that there will be; of others those of earlier runs are to be withdrawn."""
        bodies = [study for study in self.studies if study.joints]
        found = {METRICS} | ({KEYS_NEEDED} if self.comparison.count_keys else set())
        return (
            found
            | ({JOINT_METRICS} if bodies else set())
            | ({DECIMATED} if any(s.decimated for s in bodies) else set())
        )

    def filmed(self, study: Study) -> list[Choice]:
        """The choices that there are films of."""
        stage = self.comparison.stage
        asked = list(study.choices) if self.comparison.every_film else fewest_keys(study.choices)
        return [choice for choice in asked if stage and study.frames(choice, stage) <= study.most_frames]

    def _numbers(self, study: Study) -> Iterator[tuple[str, str, tuple[str, ...], Task]]:
        """The tasks of a clip's numbers, with the table that they are part of, and what they are to pages."""
        comparison, name = self.comparison, study.name
        modes = single_modes(comparison.modes) if study.joints else comparison.modes
        for choice in study.choices:
            evenly = choice.decimation == "uniform"
            if study.joints:
                tables = body_table_names(choice, modes)
                weight = 0.1 + 5e-6 * study.samples * study.joints * len(modes) * (1.0 if evenly else 40.0)
            else:
                tables = table_names(choice, modes, comparison.form)
                tables += [f"{study.against}.{comparison.form}"] if study.against else []
                weight = 0.02 + 8e-6 * study.samples * len(modes) * (1.0 if evenly else 50.0)
            measuring = Task(
                steps.measure,
                steps.Measure(study.clip, choice, tuple(modes), comparison.radii, comparison.shared, comparison.form),
                f"measure {name}/{choice.name}",
                after=(study.reader,),
                publish={table: f"{name}/{choice.name}/{table}" for table in tables},
                title=f"{name} {choice.phrase}",
                weight=weight,
                group=name,
            )
            yield METRICS, steps.ROWS, ("measure", name, choice.name), measuring
            if choice in study.decimated:
                decimating = Task(
                    steps.decimate,
                    measuring.parameters,
                    f"decimate {name}/{choice.name}",
                    after=(study.reader, measuring.key),
                    title=f"{name} {choice.phrase}, Decimate",
                    weight=0.5 + 8e-3 * study.samples * study.joints,
                    group=name,
                )
                yield DECIMATED, steps.ROWS, ("decimate", name, choice.name), decimating
        if comparison.count_keys:
            fit = comparison.fit and not study.joints
            seconds = 0.003 * study.joints if study.joints else 0.03 if fit else 0.01
            counting = Task(
                steps.count_keys,
                steps.CountKeys(study.clip, comparison.modes, comparison.radii, fit),
                f"count keys {name}",
                after=(study.reader,),
                title=f"{name}, keys needed",
                weight=seconds * study.samples,
                group=name,
            )
            yield KEYS_NEEDED, steps.ROWS, ("needed", name), counting

    def _film(self, study: Study, choice: Choice, measured: str) -> Iterator[Task]:
        """The tasks of a film; the last one makes it."""
        comparison, stage = self.comparison, self.comparison.stage
        seconds = 0.03 + 4e-7 * stage.resolution[0] * stage.resolution[1]
        folder, title = f"{study.name}/{choice.name}", f"{study.name} {choice.phrase}"
        subject = () if study.joints else (self.store.input(place_of_subject(stage.subject)[0]),)
        building = Task(
            steps.build,
            steps.Build(study.clip, comparison.radii, comparison.shared, stage, comparison.blender),
            f"build {folder}",
            after=(study.reader, measured),
            inputs=subject,
            publish={steps.BLEND: f"{folder}/{steps.BLEND}"},
            title=title,
            group=folder,
        )
        yield building
        count = Timeline.between(*study.choices[choice], stage.fps, stage.slow_motion).count
        pieces = math.ceil(count / PIECE)
        firsts = [1 + count * number // pieces for number in range(pieces + 1)]
        rendered = []
        for first, following in itertools.pairwise(firsts):
            frames = following - first
            rendering = Task(
                steps.render,
                steps.Frames(title, first, following - 1),
                f"render {folder} from {first}",
                after=(building.key,),
                title=title,
                weight=seconds * frames,
                amount=frames,
                unit="frame",
                group=f"{folder} from {first}",
            )
            rendered.append(rendering.key)
            yield rendering
        yield Task(
            steps.encode,
            steps.Frames(title, 1, count),
            f"encode {folder}",
            after=(building.key, *rendered),
            publish={steps.FILM: f"{folder}/{steps.FILM}"},
            title=title,
            weight=seconds * count * 0.06,
            group=folder,
        )

    # -- pages --------------------------------------------------------------------------------------------------------

    def _pages(self, keys: dict[tuple[str, ...], str], films: bool) -> Iterator[Task]:
        """The page of a few clips, or a page for each of many and one that leads to them."""
        if len(self.studies) <= ON_ONE_PAGE:
            yield self._page(steps.page, self.studies, keys, films, "")
            return
        pages = []
        for study in self.studies:
            task = self._page(steps.page, [study], keys, films, study.name)
            pages.append(task.key)
            yield task
        yield self._page(steps.overview, self.studies, keys, films, "", pages)

    def _page(
        self,
        step: Step,
        studies: Iterable[Study],
        keys: dict[tuple[str, ...], str],
        films: bool,
        folder: str,
        pages: Iterable[str] = (),
    ) -> Task:
        shown, before, filmed = [], [], []
        for study in studies:
            name, of_films = study.name, [choice.name for choice in self.filmed(study)]
            needed, decimated = keys.get(("needed", name)), [choice.name for choice in study.decimated]
            before += [study.reader, *([needed] if needed else [])]
            for choice in study.choices:
                before.append(keys["measure", name, choice.name])
                before += [keys["decimate", name, choice.name]] if choice.name in decimated else []
            filmed += [keys["film", name, choice] for choice in of_films if films]
            choices = tuple(choice.name for choice in study.choices)
            shown.append(ClipShown(study.clip, choices, bool(needed), tuple(decimated), tuple(of_films)))
        parameters = Page(
            tuple(shown),
            self.comparison.about,
            self.comparison.radii,
            coming=not films and step is steps.page,
            overview=f"../{steps.PAGE}" if folder else "",
            folder=folder,
        )
        place = f"{folder}/" if folder else ""
        return Task(
            step,
            parameters,
            f"page {folder}" if folder else steps.PAGE,
            after=(*before, *(filmed if step is steps.page else pages)),
            publish={name: place + name for name in (steps.PAGE, steps.PAGE_DATA)},
            title=f"{place}{steps.PAGE}",
            weight=0.02 * len(shown),
        )


def rates_above(times: np.ndarray, choices: Iterable[Choice]) -> list[str]:
    """What to say of rates that are above that of a recording with these times, shape (n,)."""
    rate = 1.0 / float(np.median(np.diff(times)))
    above = [choice.rate for choice in choices if choice.rate and float(choice.rate) > rate * (1.0 + RATE_MARGIN)]
    return (
        [f"it has {rate:.3g} samples a second: {', '.join(above)} keys a second cannot be had of it"] if above else []
    )
