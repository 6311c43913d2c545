"""The plan of a comparison, in two parts: what the recordings hold is known only when they have been read.

First a task for every source; then for every clip and choice of keys one that measures it, and for a film one that
builds its stage, some that render a piece of it each, and one that joins the pieces; last the tables and the report.
Everything goes into the plan that it depends on, so that a second run does only what is missing or has changed.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion_batch.analysis.choices import Choice, choice_parts, fewest_keys
from rigid_motion_batch.analysis.metrics import body_table_names, table_names
from rigid_motion_batch.analysis.modes import single_modes
from rigid_motion_batch.analysis.radii import EVERYWHERE, Radii
from rigid_motion_batch.command_line import printable
from rigid_motion_batch.comparison.storage import ClipReference, file_names, read_facts, read_times
from rigid_motion_batch.recordings import ReadingOptions, TrajectoryError
from rigid_motion_batch.recordings.clip_reading import clip_names
from rigid_motion_batch.recordings.options import AS_THE_FILE_SAYS
from rigid_motion_batch.recordings.reading import split_source
from rigid_motion_batch.recordings.recordings import listed
from rigid_motion_batch.scenes.settings import StageSettings, place_of_subject
from rigid_motion_batch.scenes.timeline import Timeline
from rigid_motion_batch.workplan import Plan, Task

from . import steps
from .report.pages import ON_ONE_PAGE, Settings
from .version import step_versions

MODULE = steps.__name__

FILMING = {f"{MODULE}:{step}" for step in ("build", "build_body", "render", "encode")}
"""The steps at the end of which there is a film."""

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


@dataclass(frozen=True)
class Wanted:
    """What is wanted of every clip."""

    choices: tuple[Choice, ...]
    modes: tuple[str, ...]
    radii: Radii
    """Of the shell."""

    settings: Settings
    """What the report says of the run."""

    stage: StageSettings | None
    """How to make the films; None for a run without."""

    every_film: bool
    """Whether there is a film of every choice of keys, or only of the one with the fewest keys."""

    count_keys: bool
    """Whether to find out how many keys every mode needs."""

    fit: bool = False
    """And how many where they may be fitted."""

    shared: bool = False
    """Whether the joints of a body have their keys at the same samples where the motion chooses them."""


@dataclass(frozen=True, slots=True)
class Study:
    """A clip, with the choices of keys that it is long enough for."""

    clip: ClipReference
    samples: int
    choices: dict[Choice, tuple[float, float]]
    """Each with the times of the first and the last key."""

    joints: int = 0
    """How many a whole body has; 0 for a single rigid one."""

    def filmed(self, wanted: Wanted) -> list[Choice]:
        """The choices that there are films of."""
        asked = list(self.choices) if wanted.every_film else fewest_keys(self.choices)
        return [choice for choice in asked if wanted.stage and self._frames(choice, wanted.stage) <= self._most_frames]

    def left_out(self, stage: StageSettings) -> str:
        """Why there is no film of the clip, for the user; empty where there can be one."""
        frames = max(self._frames(choice, stage) for choice in self.choices)
        if frames <= self._most_frames:
            return ""
        start, end = next(iter(self.choices.values()))
        return (
            f"{self.clip.name}: no video: its {end - start:.6g} s make {frames:.6g} frames, more than "
            f"{self._most_frames}; see whether its times are in seconds, cut it, or give a lower --fps or --slow-motion"
        )

    @property
    def decimated(self) -> list[Choice]:
        """The choices that are set beside Blender's Decimate: evenly spaced keys are not chosen to be few."""
        if self.samples * self.joints > MOST_DECIMATED:
            return []
        return [choice for choice in self.choices if self.joints and choice.decimation == "adaptive"]

    @property
    def not_decimated(self) -> str:
        """Why the clip is not, for the user; empty where it is, or nobody asks."""
        if self.decimated or not (self.joints and any(choice.decimation == "adaptive" for choice in self.choices)):
            return ""
        return (
            f"{self.clip.name}: not compared with Blender's Decimate: {self.joints} joints with {self.samples} samples "
            f"would take too long; cut it to {MOST_DECIMATED // self.joints}"
        )

    @property
    def _most_frames(self) -> int:
        return min(MOST_FRAMES, MOST_POSES // max(self.joints, 1))

    def _frames(self, choice: Choice, stage: StageSettings) -> float:
        start, end = self.choices[choice]
        return (end - start) * stage.fps * stage.slow_motion + 1.0

    @property
    def parts(self) -> tuple[str, list[tuple[str, str]]]:
        """As plain data, which is how tasks are told of many."""
        return self.clip.name, [choice_parts(choice) for choice in self.choices]


# -- reading ----------------------------------------------------------------------------------------------------------


def plan_of(tasks: Sequence[Task], version: str) -> Plan:
    """The plan of some tasks, of which each is done again where what its step uses has changed."""
    return Plan(tasks, version, versions=step_versions(task.function for task in tasks))


def reading_tasks(sources: Iterable[str], axes: str | None, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Task]:
    """A task for every source, in their order; for a source that is named twice the same one twice."""
    return [_reading(source, axes, options) for source in sources]


def _reading(source: str, axes: str | None, options: ReadingOptions) -> Task:
    digest = hashlib.sha256(json.dumps([source, axes, asdict(options)]).encode()).hexdigest()[:16]
    recording = steps.recording_of(digest)
    try:
        inputs = (str(split_source(source)[0]),)
    except TrajectoryError:
        inputs = ()  # Whoever reads it will say that there is no such file.
    return Task(
        name=f"read {digest}",
        function=f"{MODULE}:read",
        arguments={"source": source, "axes": axes, "options": asdict(options), "recording": recording},
        inputs=inputs,
        outputs=file_names(recording),
        title=source,
        weight=0.3,
    )


@dataclass(frozen=True)
class Found:
    """What the recordings hold."""

    studies: tuple[Study, ...]
    """Of the clips that are long enough for any choice of keys."""

    notes: tuple[str, ...]
    """What the user should know, a line each."""


def look_into(output: Path, read: Sequence[Task], choices: Sequence[Choice], radii: Radii = EVERYWHERE) -> Found:
    """See what clips there are in the recordings that were read, in the order of the sources.

    Parameters
    ----------
    output : Path
        The output folder.
    read : sequence of Task
        Of `reading_tasks`, done. A task that is there twice gives its clips twice, under different names.
    choices : sequence of Choice
        That are wanted.
    radii : Radii
        Of whose joints it is said where no body has them.
    """
    recordings = [task.arguments["recording"] for task in read]
    known = {recording: read_facts(output, recording) for recording in dict.fromkeys(recordings)}
    bodies = [(recording, body) for recording in recordings for body in range(len(known[recording].names))]
    names = clip_names([(known[recording].names[body], known[recording].bodies[body]) for recording, body in bodies])
    notes = [known[recording].note for recording in recordings if known[recording].note]
    studies = []
    for (recording, body), name in zip(bodies, names, strict=True):
        notes += [f"{name}: {repaired}" for repaired in known[recording].repairs[body]]
    if unknown := radii.unknown(joint for one in known.values() for some in one.joints for joint in some):
        notes.append(printable(f"no body has a joint {listed(unknown)}, for which --radius has a radius"))
    for (recording, body), name in zip(bodies, names, strict=True):
        clip = ClipReference(name, recording, body)
        times = read_times(output, clip)
        ends = {choice: choice.ends(times) for choice in choices}
        notes += [
            f"{name}: too short for two keys at {choice.rate} a second; left out"
            for choice, found in ends.items()
            if found is None
        ]
        notes += [f"{name}: {note}" for note in asked_in_vain(times, choices)]
        long_enough = {
            choice: (float(times[found[0]]), float(times[found[1]])) for choice, found in ends.items() if found
        }
        if long_enough:
            studies.append(Study(clip, len(times), long_enough, len(known[recording].joints[body])))
    return Found(tuple(studies), tuple(notes))


def asked_in_vain(times: np.ndarray, choices: Iterable[Choice]) -> list[str]:
    """What to say of rates that are above that of a recording with these times, shape (n,)."""
    rate = 1.0 / float(np.median(np.diff(times)))
    above = [choice.rate for choice in choices if choice.rate and float(choice.rate) > rate * (1.0 + RATE_MARGIN)]
    if not above:
        return []
    return [f"it has {rate:.3g} samples a second: {', '.join(above)} keys a second cannot be had of it"]


# -- comparing --------------------------------------------------------------------------------------------------------


def comparison_tasks(studies: Sequence[Study], read: Sequence[Task], wanted: Wanted) -> list[Task]:
    """All tasks of a comparison, those that read the recordings among them, in the order in which they are wanted."""
    readers = {task.arguments["recording"]: task for task in read}
    reader_of = {study.clip.name: readers[study.clip.recording].name for study in studies}
    # All numbers first: they take seconds, and are there whatever becomes of the videos.
    measures = [task for study in studies for task in _measures(study, reader_of[study.clip.name], wanted)]
    tasks = [*readers.values(), *measures, _table(steps.METRICS, "tabulate", studies, measures)]
    if bodies := [study for study in studies if study.joints]:
        of_bodies = [task for task in measures if task.function == f"{MODULE}:measure_body"]
        tasks.append(_table(steps.JOINT_METRICS, "tabulate_joints", bodies, of_bodies))
        if beside := [task for study in bodies for task in _decimations(study, reader_of[study.clip.name], wanted)]:
            tasks += [*beside, _table(steps.DECIMATED, "tabulate_decimated", bodies, [*of_bodies, *beside])]
    if wanted.count_keys:
        counts = [_count(study, reader_of[study.clip.name], wanted) for study in studies]
        tasks += [*counts, _table(steps.KEYS_NEEDED, "tabulate_keys", studies, [*measures, *counts])]
    if wanted.stage:
        tasks += [task for study in studies for task in _films(study, wanted, wanted.stage)]
    return [*tasks, *_reports(studies, {task.name: task.name for task in tasks}, wanted)]


def without_films(tasks: Iterable[Task]) -> list[Task]:
    """The tasks of a comparison but for those of its films, with reports that leave room for these."""
    films: set[str] = set()
    others = []
    for task in tasks:
        if task.function in FILMING:
            films.add(task.name)
        elif task.partial:
            coming = {"coming": True} if "coming" in task.arguments else {}
            after = tuple(before for before in task.after if before not in films)
            others.append(replace(task, after=after, arguments={**task.arguments, **coming}))
        else:
            others.append(task)
    return others


def _measures(study: Study, reader: str, wanted: Wanted) -> Iterator[Task]:
    clip = study.clip.name
    for choice in study.choices:
        uniform = choice.decimation == "uniform"
        arguments = {"clip": asdict(study.clip), "choice": choice_parts(choice)}
        outputs = (*steps.result_of(clip, choice), steps.keys_of(clip, choice))
        if study.joints:
            modes = single_modes(wanted.modes)
            tables = body_table_names(choice, modes)
            outputs += (steps.joints_of(clip, choice), steps.body_of(clip, choice))
            arguments |= {"modes": modes, "radii": asdict(wanted.radii), "shared": wanted.shared}
            weight = 0.1 + 5e-6 * study.samples * study.joints * len(modes) * (1.0 if uniform else 40.0)
        else:
            tables = table_names(choice, wanted.modes)
            arguments |= {"modes": wanted.modes, "radius": wanted.radii.rigid}
            weight = 0.02 + 8e-6 * study.samples * len(wanted.modes) * (1.0 if uniform else 50.0)
        yield Task(
            name=steps.measuring(clip, choice),
            function=f"{MODULE}:measure_body" if study.joints else f"{MODULE}:measure",
            arguments=arguments,
            outputs=(*(f"{steps.folder_of(clip, choice)}/{name}" for name in tables), *outputs),
            after=(reader,),
            title=f"{clip} {choice.phrase}",
            weight=weight,
        )


def _decimations(study: Study, reader: str, wanted: Wanted) -> Iterator[Task]:
    clip = study.clip.name
    for choice in study.decimated:
        arguments = {"clip": asdict(study.clip), "choice": choice_parts(choice)}
        yield Task(
            name=steps.decimating(clip, choice),
            function=f"{MODULE}:decimate_body",
            arguments=arguments | {"radii": asdict(wanted.radii), "shared": wanted.shared},
            outputs=steps.decimated_of(clip, choice),
            after=(reader, steps.measuring(clip, choice)),
            title=f"{clip} {choice.phrase}, Decimate",
            weight=0.5 + 8e-3 * study.samples * study.joints,
        )


def _count(study: Study, reader: str, wanted: Wanted) -> Task:
    clip = study.clip.name
    arguments = {"clip": asdict(study.clip), "modes": wanted.modes}
    if study.joints:
        arguments |= {"radii": asdict(wanted.radii)}
        weight = 0.003 * study.samples * study.joints
    else:
        arguments |= {"radius": wanted.radii.rigid, "fit": wanted.fit}
        weight = (0.03 if wanted.fit else 0.01) * study.samples
    return Task(
        name=steps.counting(clip),
        function=f"{MODULE}:count_key_poses" if study.joints else f"{MODULE}:count_keys",
        arguments=arguments,
        outputs=(steps.needed_of(clip),),
        after=(reader,),
        title=f"{clip}, keys needed",
        weight=weight,
    )


def _table(path: str, function: str, studies: Sequence[Study], before: Iterable[Task]) -> Task:
    return Task(
        name=path,
        function=f"{MODULE}:{function}",
        arguments={"studies": [study.parts for study in studies]},
        outputs=(path,),
        after=tuple(task.name for task in before),
        weight=0.01 * len(studies),
        partial=True,
    )


def _films(study: Study, wanted: Wanted, stage: StageSettings) -> Iterator[Task]:
    clip = study.clip.name
    seconds_a_frame = 0.03 + 4e-7 * stage.resolution[0] * stage.resolution[1]
    for choice in study.filmed(wanted):
        start, end = study.choices[choice]
        count = Timeline.between(start, end, stage.fps, stage.slow_motion).count
        pieces = math.ceil(count / PIECE)
        firsts = [1 + count * number // pieces for number in range(pieces + 1)]
        names = {first: f"render {clip}/{choice.name} from {first}" for first in firsts[:-1]}
        building, title, parts = f"build {clip}/{choice.name}", f"{clip} {choice.phrase}", choice_parts(choice)
        arguments = {"clip": asdict(study.clip), "choice": parts, "stage": asdict(stage)}
        if study.joints:
            arguments |= {"radii": asdict(wanted.radii), "shared": wanted.shared}
        else:
            arguments |= {"radius": wanted.radii.rigid}
        yield Task(
            name=building,
            function=f"{MODULE}:build_body" if study.joints else f"{MODULE}:build",
            arguments=arguments,
            inputs=() if study.joints else (str(place_of_subject(stage.subject)[0]),),
            outputs=(steps.blend_of(clip, choice),),
            after=(steps.measuring(clip, choice),),
            title=title,
            weight=1.0,
        )
        for (first, name), following in zip(names.items(), firsts[1:], strict=True):
            last = following - 1
            yield Task(
                name=name,
                function=f"{MODULE}:render",
                arguments={"clip": clip, "choice": parts, "first": first, "last": last},
                outputs=(steps.piece_of(clip, choice, first),),
                after=(building,),
                title=title,
                weight=seconds_a_frame * (last - first + 1),
                temporary=True,
                amount=last - first + 1,
                unit="frame",
            )
        yield Task(
            name=steps.filming(clip, choice),
            function=f"{MODULE}:encode",
            arguments={"clip": clip, "choice": parts, "firsts": firsts[:-1]},
            outputs=(steps.film_of(clip, choice),),
            after=(building, *names.values()),
            title=title,
            weight=seconds_a_frame * count * 0.06,
        )


def _reports(studies: Sequence[Study], names: Mapping[str, str], wanted: Wanted) -> list[Task]:
    """The report: of a few clips on one page, of more on a page each.

    `names` are of the tasks that there are, each to itself: so the same text is not kept twice.
    """
    settings = {name: value for name, value in vars(wanted.settings).items() if name != "date"}
    shared = {"settings": settings, "coming": False}
    filmed = {
        study.clip.name: [(study.clip.name, choice_parts(choice)) for choice in study.filmed(wanted)]
        for study in studies
    }
    shown = {study.clip.name: _shown_of(study, names) for study in studies}
    everything = [name for some in shown.values() for name in some]
    parts = [study.parts for study in studies]
    if len(studies) <= ON_ONE_PAGE:
        return [
            _report(
                steps.REPORT,
                "report",
                {"studies": parts, "filmed": [film for some in filmed.values() for film in some], **shared},
                everything,
            )
        ]
    pages = [
        _report(
            steps.page_of(study.clip.name),
            "clip_page",
            {"studies": [study.parts], "filmed": filmed[study.clip.name], **shared},
            shown[study.clip.name],
            steps.paging(study.clip.name),
        )
        for study in studies
    ]
    before = [*everything, *(page.name for page in pages)]
    return [*pages, _report(steps.REPORT, "overview", {"studies": parts, "settings": settings}, before)]


def _report(path: str, function: str, arguments: Mapping[str, Any], before: Sequence[str], name: str = "") -> Task:
    return Task(
        name=name or path,
        function=f"{MODULE}:{function}",
        arguments=arguments,
        outputs=(path,),
        after=tuple(before),
        title=path,
        weight=0.02 * len(arguments["studies"]),
        partial=True,
    )


def _shown_of(study: Study, names: Mapping[str, str]) -> list[str]:
    """The tasks whose results a report shows of a clip."""
    clip = study.clip.name
    of_choices = [
        name
        for choice in study.choices
        for name in (steps.measuring(clip, choice), steps.decimating(clip, choice), steps.filming(clip, choice))
    ]
    return [names[name] for name in (*of_choices, steps.counting(clip)) if name in names]
