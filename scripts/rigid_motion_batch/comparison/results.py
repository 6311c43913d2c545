"""Results: what a report needs of a reconstruction, without its poses. Small enough to keep for thousands of clips.

They are written as JSON, and read back as exactly what they were. Errors are in metres.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigid_motion_batch.analysis.choices import Choice, choice_from, choice_parts
from rigid_motion_batch.analysis.metrics import Metrics, measure_reconstruction
from rigid_motion_batch.analysis.needed import KeysNeeded
from rigid_motion_batch.analysis.reconstructions import Groups, Reconstruction, identical_modes
from rigid_motion_batch.analysis.results import ClipFacts, SegmentModes
from rigid_motion_batch.files import write_text
from rigid_motion_batch.recordings.clips import Clip

if TYPE_CHECKING:
    from rigid_motion_batch.analysis.body_metrics import MeasuredBody


@dataclass(frozen=True)
class Result:
    """A clip under one choice of keys, measured."""

    choice: Choice

    rows: tuple[Metrics, ...]
    """One for each mode."""

    groups: Groups
    """The modes, those together that gave the same poses: see `identical_modes`."""

    segment_modes: SegmentModes | None

    charts: Callable[[], str]
    """The errors over time, as the report has them: markup."""

    body: Callable[[], str] = str
    """What the report shows of a whole body: markup; nothing of a single rigid one."""

    decimated: Callable[[], str] = str
    """Its keys beside those of Blender's Decimate: markup; nothing where that was not looked for."""

    @classmethod
    def of(cls, reconstruction: Reconstruction, charts: Callable[[], str] = str) -> Result:
        return cls(
            reconstruction.choice,
            tuple(measure_reconstruction(reconstruction)),
            identical_modes([reconstruction]),
            SegmentModes.of(reconstruction),
            charts,
        )

    @classmethod
    def of_body(cls, measured: MeasuredBody, charts: Callable[[], str] = str) -> Result:
        return cls(measured.made.choice, measured.rows, measured.groups, None, charts)

    @property
    def clip(self) -> str:
        """The name of the clip."""
        return self.rows[0].clip


@dataclass(frozen=True)
class ClipResults:
    """All results of a clip, at least one."""

    facts: ClipFacts
    results: tuple[Result, ...]
    needed: KeysNeeded | None = None
    """The keys that are needed, where that was looked for."""


def write_result(path: Path, clip: Clip, result: Result) -> None:
    """Write a result, but for its charts, with the facts of its clip."""
    content = {
        "clip": asdict(ClipFacts.of(clip)),
        "choice": choice_parts(result.choice),
        "rows": [asdict(row) for row in result.rows],
        "groups": result.groups,
        "segment_modes": asdict(result.segment_modes) if result.segment_modes else None,
    }
    write_text(path, json.dumps(content, indent=1) + "\n")


def read_result(path: Path, charts: Path, body: Path, decimated: Path | None = None) -> tuple[ClipFacts, Result]:
    """What `write_result` wrote, with markup from files that are read when it is wanted."""
    facts, result = read_numbers(path)

    def markup_of(file: Path | None) -> Callable[[], str]:
        return (lambda: file.read_text(encoding="utf-8")) if file else str

    return facts, replace(
        result,
        charts=markup_of(charts),
        body=markup_of(body if facts.joints else None),
        decimated=markup_of(decimated),
    )


def read_numbers(path: Path) -> tuple[ClipFacts, Result]:
    """What `write_result` wrote, without any markup."""
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    facts = ClipFacts(**{**content["clip"], "repairs": tuple(content["clip"]["repairs"])})
    return facts, Result(
        choice_from(*content["choice"]),
        tuple(Metrics(**row) for row in content["rows"]),
        tuple(map(tuple, content["groups"])),
        SegmentModes(**content["segment_modes"]) if content["segment_modes"] else None,
        str,
    )
