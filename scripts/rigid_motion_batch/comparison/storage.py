"""Recordings and clips as files between the tasks of a run: arrays in an .npz, the rest as JSON beside it.

A recording is one source, which may hold several bodies. What is read back is exactly what was written.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.analysis.choices import Choice
from rigid_motion_batch.analysis.reconstructions import Reconstruction, fill_in
from rigid_motion_batch.files import write_text, written_beside
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.figures import Figure, Skin

SEGMENT_MODES = "segment modes"
"""Among the names of modes, none of which has a blank."""


@dataclass(frozen=True)
class ClipReference:
    """Where a clip is, as plain data: a body of a recording, under its name in this run."""

    name: str

    recording: str
    """The path of its files in the output folder, without their extensions."""

    body: int
    """Which of the bodies, from 0."""


@dataclass(frozen=True)
class StoredRecording:
    """What is known of a recording without its arrays."""

    note: str
    """What the user should know of what was read; may be empty."""

    names: tuple[str, ...]
    """What its clips would like to be called."""

    bodies: tuple[str, ...]
    """And the body of each that the user asked for by name; empty where none was."""

    repairs: tuple[tuple[str, ...], ...]
    """Of each clip."""

    joints: tuple[tuple[str, ...], ...]
    """Of each clip their names; none for a single rigid body."""


def file_names(recording: str) -> tuple[str, str]:
    """The files of a recording."""
    return f"{recording}.npz", f"{recording}.json"


def write_recording(arrays: Path, facts: Path, clips: Sequence[Clip], note: str) -> None:
    """Write all clips of a recording."""
    content = {}
    for body, clip in enumerate(clips):
        content |= {f"{body}.times": clip.times, f"{body}.positions": clip.poses.positions}
        content |= {f"{body}.quaternions": clip.poses.quaternions}
        if clip.poses.scales is not None:
            content[f"{body}.scales"] = clip.poses.scales
        if clip.figure is not None:
            content |= {f"{body}.figure.{name}": array for name, array in _arrays_of(clip.figure).items()}
    with written_beside(arrays) as beside:
        np.savez(beside, **content)
    listed = [
        {"name": clip.name, "source": clip.source, "axes": clip.axes, "repairs": clip.repairs}
        | {"metres_per_unit": clip.metres_per_unit, "body": clip.body, "rate": clip.rate}
        | {"joints": list(clip.figure.joints) if clip.figure else []}
        for clip in clips
    ]
    write_text(facts, json.dumps({"note": note, "clips": listed}, indent=1) + "\n")


def _arrays_of(figure: Figure) -> dict[str, np.ndarray]:
    arrays = {"parents": figure.parents, "rest positions": figure.rest.positions, "tails": figure.tails}
    arrays |= {"rest quaternions": figure.rest.quaternions}
    return arrays | ({f"skin {name}": array for name, array in vars(figure.skin).items()} if figure.skin else {})


def _figure_of(joints: Sequence[str], arrays: Mapping[str, np.ndarray]) -> Figure:
    """The figure of `_arrays_of`."""
    skin = {name.removeprefix("skin "): array for name, array in arrays.items() if name.startswith("skin ")}
    return Figure(
        tuple(joints),
        arrays["parents"],
        Poses(arrays["rest positions"], arrays["rest quaternions"]),
        arrays["tails"],
        Skin(**skin) if skin else None,
    )


def read_facts(output: Path, recording: str) -> StoredRecording:
    """What there is to say about a recording."""
    content = json.loads((output / file_names(recording)[1]).read_text(encoding="utf-8"))
    names, bodies, repairs = ([clip[key] for clip in content["clips"]] for key in ("name", "body", "repairs"))
    joints = tuple(tuple(clip["joints"]) for clip in content["clips"])
    return StoredRecording(content["note"], tuple(names), tuple(bodies), tuple(map(tuple, repairs)), joints)


def read_times(output: Path, reference: ClipReference) -> np.ndarray:
    """The times of a clip, shape (n,), without the rest of it."""
    with np.load(output / file_names(reference.recording)[0]) as arrays:
        return arrays[f"{reference.body}.times"]


def read_clip(output: Path, reference: ClipReference) -> Clip:
    """A clip, under its name in this run."""
    arrays_name, facts_name = file_names(reference.recording)
    facts = json.loads((output / facts_name).read_text(encoding="utf-8"))["clips"][reference.body]
    with np.load(output / arrays_name) as arrays:
        times, positions, quaternions, scales = (
            arrays[name] if (name := f"{reference.body}.{kind}") in arrays else None
            for kind in ("times", "positions", "quaternions", "scales")
        )
        start = f"{reference.body}.figure."
        of_figure = {name.removeprefix(start): arrays[name] for name in arrays.files if name.startswith(start)}
    return Clip(
        reference.name,
        facts["source"],
        facts["axes"],
        times,
        Poses(positions, quaternions, scales),
        tuple(facts["repairs"]),
        facts["metres_per_unit"],
        facts["body"],
        _figure_of(facts["joints"], of_figure) if of_figure else None,
        facts["rate"],
    )


def write_keys(path: Path, made: Reconstruction) -> None:
    """Write what a reconstruction can be made of again: the keys, and under `best_of` the modes of the segments."""
    with written_beside(path) as beside:
        np.savez(beside, **made.keys, **{SEGMENT_MODES: np.array(made.segment_modes, dtype=np.str_)})


def read_keys(path: Path, clip: Clip, choice: Choice, radius: float) -> Reconstruction:
    """Make a reconstruction again from its keys."""
    with np.load(path) as arrays:
        keys = {name: arrays[name] for name in arrays.files if name != SEGMENT_MODES}
        segment_modes = tuple(arrays[SEGMENT_MODES].tolist())
    return fill_in(clip, choice, keys, radius, segment_modes)
