"""Lanes: each mode's part of the stage, with the moving object and its recording (`solids`, `bodies`), and a caption.

A lane is an empty with the moving objects as children. If the view follows the motion, the empty moves the other way.
Text is a child of the frame (`layout`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from rigid_motion.animation import write_channel
from rigid_motion.blender import action_of, scene
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.analysis.modes import STATE_OF_THE_ART, label_of
from rigid_motion_batch.analysis.reconstructions import Groups, Reconstruction
from rigid_motion_batch.palette import THEMES, Theme, colour_on

from . import captions, layout, trails
from .findings import Finding
from .framing import Extent, Framing
from .materials import ink
from .nodes import apply_group
from .settings import SceneSettings
from .timeline import Timeline, peaks

# Letter sizes on a card, in units of the frame's height, if there is room.
TITLE_SIZE = 0.044
NAME_SIZE = 0.026
NUMBER_SIZE = 0.05
UNIT_SIZE = 0.032
SMALL_SIZE = 0.028
FINDING_SIZE = 0.036

INSET_RATIO, COLUMN_RATIO = 0.016, 0.15
"""The free space at the edges of a card, and the width of the column of numbers next to the graph."""

GRAPH_HEIGHT_RATIO, GRAPH_COLUMNS = 0.066, 300
"""The height of a graph, and the number of its columns: each keeps its lowest and highest sample."""


@dataclass(frozen=True, eq=False)
class Cast:
    """Data shared by all lanes."""

    timeline: Timeline
    framing: Framing
    """Has `framing_steps` moments per frame."""

    framing_steps: int
    layout: layout.Layout

    extent: Extent

    errors: Mapping[str, np.ndarray]
    """Mode id to the error at each frame, in millimetres."""

    sampled: Mapping[str, np.ndarray]
    """Mode id to the error at each sample of the recording, in millimetres, shape (n,)."""

    sample_frames: np.ndarray
    """The frames of the samples, shape (n,)."""

    notes: Mapping[str, str]
    """Mode id to a note on its keys, if the modes have different ones."""

    findings: Sequence[Finding]
    theme: Theme
    ink: bpy.types.Material
    faint: bpy.types.Material

    joints: tuple[str, ...] = ()
    """The names of the joints of a body."""

    worst: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Mode id to the index of the joint with the error, at each frame."""

    @classmethod
    def arranged(
        cls,
        made: Reconstruction,
        settings: SceneSettings,
        lanes_of: Groups,
        extent: Extent,
        notes: Mapping[str, str],
        findings: Sequence[Finding],
        timeline: Timeline,
        **own: Any,
    ) -> Cast:
        """Return the cast, with lanes arranged for the visible extent of the motion; `own` are the remaining fields.

        Errors at frames, unless given, are interpolated from those at the samples.
        """
        theme, (width, height) = THEMES[settings.theme], settings.resolution
        named = any(names_of(modes, notes) for modes in lanes_of)
        plan = layout.arrange(len(lanes_of), extent.size, width / height, named=named, found=len(findings))
        sampled = {mode: 1e3 * made.shell(mode).max(axis=0) for modes in lanes_of for mode in modes[:1]}
        times = timeline.times_of(timeline.frames)
        own.setdefault("errors", {mode: np.interp(times, made.times, errors) for mode, errors in sampled.items()})
        return cls(
            timeline=timeline,
            layout=plan,
            extent=extent,
            sampled=sampled,
            sample_frames=timeline.frames_of(made.times),
            notes=notes,
            findings=findings,
            theme=theme,
            ink=ink("Ink", theme.ink),
            faint=ink("Faint", theme.faint),
            **own,
        )

    @property
    def largest_error(self) -> float:
        """The upper end of the graphs, in millimetres."""
        return max(float(errors.max()) for errors in self.sampled.values())

    def found(self, finding: Finding, mode: str) -> str:
        """Return the text of a finding for the lane of a mode; empty if the mode has none."""
        if mode not in finding.metres:
            return ""
        decimals = captions.decimals_for(1e3 * max(finding.metres.values()))
        return finding.text.format(f"{1e3 * finding.metres[mode]:.{decimals}f} mm")

    def seen_from_focus(self, places: np.ndarray) -> np.ndarray:
        """Return points (n, 3) at the frames, relative to the focus and turned to the view, as in `Framing.extent`."""
        focus = self.framing.focus[:: self.framing_steps]
        return rotate(layout.yaw_quaternion(self.framing.yaw), places - focus)

    @property
    def behind(self) -> np.ndarray:
        """The offset, in the space of a lane, that puts the recording behind the motion, where it hides nothing."""
        return rotate(layout.yaw_quaternion(-self.framing.yaw), self.extent.depth * layout.AWAY_AXIS)


@dataclass(frozen=True, eq=False)
class Lane:
    """A lane to add objects to."""

    mode: str
    """The first of the modes with this motion."""

    empty: bpy.types.Object
    collection: bpy.types.Collection
    cell: layout.Cell

    def window(self, metres: float) -> dict[str, np.ndarray]:
        """Return the visible window of the lane, as inputs of `trails.WINDOW`; `metres` is the picture's height."""
        width, height = self.cell.room * metres / 2.0
        middle = layout.unproject(np.append(self.cell.view * metres, 0.0))
        return {"Middle": middle, "Right": layout.RIGHT_AXIS / width, "Up": layout.UP_AXIS / height}

    def child(self, name: str, data: bpy.types.ID | None) -> bpy.types.Object:
        """Return a new object that moves with the lane."""
        child = bpy.data.objects.new(name, data)
        child.parent = self.empty
        self.collection.objects.link(child)
        return child


class Lanes:
    """Builds the lanes, one per call, with shared materials, node groups and meshes."""

    def __init__(self, cast: Cast, frame: bpy.types.Object, enter: Callable[[Lane], None]) -> None:
        self.cast, self.frame, self.enter = cast, frame, enter
        self.card, self.track = ink("Card", cast.theme.card), ink("Track", cast.theme.track)
        self.graph_group = trails.graph_group()
        self.readout = captions.readout_group("Error in mm", captions.decimals_for(cast.largest_error), cast.ink)
        self.names = captions.choice_group("Joint", cast.joints, cast.ink) if cast.joints else None
        self.title_width = max(captions.width_of(_title(mode)) for mode in cast.errors)

    def build(self, modes: tuple[str, ...], cell: layout.Cell) -> None:
        """Make the lane of modes with identical motion in its cell, in a collection named after the first mode."""
        mode = modes[0]
        self.collection = bpy.data.collections.new(f"Lane {mode}")
        scene().collection.children.link(self.collection)
        empty = bpy.data.objects.new(f"Lane {mode}", None)
        self.collection.objects.link(empty)
        empty.empty_display_size = 0.05 * self.cast.layout.metres
        self._place(empty, cell)
        self.enter(Lane(mode, empty, self.collection, cell))
        self._add_caption(modes, cell)

    def _place(self, lane: bpy.types.Object, cell: layout.Cell) -> None:
        """Keep the focus in the middle of the view on every frame."""
        cast = self.cast
        lane.rotation_euler.z = cast.framing.yaw
        low, high = cast.extent.low, cast.extent.high
        middle = np.append((low + high)[:2] / 2.0, high[2] + cast.extent.depth)
        home = layout.unproject(np.append(cell.view * cast.layout.metres, -0.01 * cast.layout.metres) - middle)
        focus = rotate(layout.yaw_quaternion(cast.framing.yaw), cast.framing.focus)[:: cast.framing_steps]
        lane.location = home - focus[0]
        if cast.framing.follows:
            write_channel(lane, "location", cast.timeline.frames, home - focus)
            action_of(lane).name = lane.name

    def _add_caption(self, modes: tuple[str, ...], cell: layout.Cell) -> None:
        """Add the title and notes on the keys at the top, and a graph of the error and a number at the bottom."""
        cast, mode, unit = self.cast, modes[0], cell.unit
        card = captions.card(f"{mode} card", cell.width, cell.height, self.card)
        self._put(bpy.data.objects.new(card.name, card), cell.x, cell.y, 1)
        left, right = cell.left + INSET_RATIO * unit, cell.left + cell.width - INSET_RATIO * unit
        room = right - left
        title = min(TITLE_SIZE * unit, room / self.title_width)
        line = cell.foot + cell.height - INSET_RATIO * unit - 0.72 * TITLE_SIZE * unit
        self._put(captions.words(f"{mode} title", _title(mode), title, cast.ink), left, line)
        if names := names_of(modes, cast.notes):
            size = NAME_SIZE * unit
            while (text := captions.wrapped(names, room / size)).count("\n") > 1 or captions.width_of(
                text
            ) * size > room:
                size *= 0.95
            self._put(captions.words(f"{mode} names", text, size, cast.faint), left, line - 0.036 * unit)

        lines = [cast.found(finding, mode) for finding in cast.findings]
        for place, text in enumerate(filter(None, reversed(lines))):
            size = min(FINDING_SIZE * unit, room / captions.width_of(text))
            line = (
                cell.foot
                + (
                    INSET_RATIO
                    + GRAPH_HEIGHT_RATIO
                    + 0.5 * layout.CARD_FINDING_RATIO
                    + layout.CARD_FINDING_RATIO * place
                )
                * unit
            )
            self._put(captions.words(f"{mode} finding {place + 1}", text, size, cast.ink), left, line)

        column, foot = right - COLUMN_RATIO * unit, cell.foot + INSET_RATIO * unit
        self._add_graph(mode, left, foot, column - left - INSET_RATIO * unit, GRAPH_HEIGHT_RATIO * unit)
        number = foot + GRAPH_HEIGHT_RATIO * unit - 0.72 * NUMBER_SIZE * unit
        self._put(captions.words(f"{mode} unit", "mm", UNIT_SIZE * unit, cast.faint, "RIGHT"), right, number)
        error = captions.readout(
            f"{mode} error", self.readout, NUMBER_SIZE * unit, cast.timeline.frames, cast.errors[mode]
        )
        self._put(error, right - 1.7 * UNIT_SIZE * unit, number)
        if self.names is None:
            text = f"max {cast.sampled[mode].max():.{captions.decimals_for(cast.largest_error)}f}"
            self._put(captions.words(f"{mode} max", text, SMALL_SIZE * unit, cast.faint, "RIGHT"), right, foot)
        else:  # The joint with the error.
            size = min(SMALL_SIZE, COLUMN_RATIO / max(map(captions.width_of, cast.joints))) * unit
            changes = captions.changes(cast.timeline.frames, cast.worst[mode])
            joint = captions.readout(f"{mode} joint", self.names, size, *changes, interpolation="CONSTANT")
            self._put(joint, column, foot)

    def _add_graph(self, mode: str, left: float, foot: float, width: float, height: float) -> None:
        """Add the error over time: faint for the whole film, in the mode's colour up to the present."""
        cast = self.cast
        kept = peaks(cast.sampled[mode], GRAPH_COLUMNS)
        heights = height * cast.sampled[mode][kept] / (cast.largest_error or 1.0)
        mesh = trails.graph(f"{mode} graph", cast.sample_frames[kept], heights, width)
        mesh.materials.append(self.track)
        self._put(bpy.data.objects.new(f"{mode} graph to come", mesh), left, foot, 3)
        passed = bpy.data.objects.new(f"{mode} graph", mesh)
        apply_group(passed, self.graph_group, Material=ink(f"Graph {mode}", colour_on(cast.theme, mode)))
        self._put(passed, left, foot, 4)
        base = captions.card(f"{mode} base", width, 0.0025, self.track, corner=0.0)
        self._put(bpy.data.objects.new(base.name, base), left + width / 2.0, foot - 0.00125)

    def _put(self, obj: bpy.types.Object, x: float, y: float, lift: int = 2) -> None:
        captions.put(self.frame, self.collection, obj, x, y, lift)


def names_of(modes: tuple[str, ...], notes: Mapping[str, str]) -> list[str]:
    """Return the lines below the title of modes with identical motion: a note on their keys, what most game engines do,
    and the other modes.
    """
    others = [_title(mode) for mode in modes[1:]]
    known = ["as most game engines do"] if STATE_OF_THE_ART in modes else []
    return [*filter(None, (notes.get(modes[0]),)), *known, *(["= " + others[0], *others[1:]] if others else [])]


def remark_on(finding: Finding) -> str:
    """Return the explanation of a finding's number, and its value in the recording."""
    if finding.recorded is None:
        return finding.remark
    recorded = 1e3 * finding.recorded
    return f"{finding.remark}; {recorded:.{captions.decimals_for(recorded)}f} mm in the recording"


def _title(mode: str) -> str:
    """Return the name of a mode, without the algebra in brackets."""
    return label_of(mode).partition(" (")[0]
