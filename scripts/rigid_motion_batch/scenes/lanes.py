"""Lanes: what a motion has of the stage. What moves and its recording (`solids`, `bodies`), and a caption.

A lane is an empty; what moves is its child. Where the camera follows, the empty moves the other way. What is written
is a child of the frame (`layout`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import bpy
import numpy as np

from rigid_motion.animation import write_channel
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.analysis.modes import label_of
from rigid_motion_batch.palette import Theme, colour_on

from . import captions, layout, trails
from .framing import Framing
from .materials import ink
from .nodes import apply_group
from .timeline import Timeline

TITLE, NAME, NUMBER, UNIT, GRAPH = 0.05, 0.033, 0.064, 0.036, 0.07
"""Sizes of what a caption holds, in units of the frame's height, where there is room."""

NUMBER_OF_JOINT, GRAPH_OF_JOINT, JOINT = 0.052, 0.056, 0.03
"""The same where the number is that of a joint, which is named above it."""


@dataclass(frozen=True, eq=False)
class Cast:
    """What all lanes share."""

    timeline: Timeline
    framing: Framing
    """At the moments that it was made for: `framing_steps` for each frame."""

    framing_steps: int
    layout: layout.Layout

    middle: np.ndarray
    """The middle of all that moves, from the focus on, as `layout.project` gives it but for the depth, which is that of
    the far end."""

    errors: Mapping[str, np.ndarray]
    """Mode id to the error at each frame, in millimetres."""

    largest_error: float
    """In millimetres: what the graphs reach up to."""

    notes: Mapping[str, str]
    """Mode id to what its keys are, where the modes have different ones."""

    theme: Theme
    ink: bpy.types.Material
    faint: bpy.types.Material

    joints: tuple[str, ...] = ()
    """What the joints of a body are called."""

    worst: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Mode id to the joint that the error is of, at each frame."""


@dataclass(frozen=True, eq=False)
class Lane:
    """One lane, to be filled."""

    mode: str
    """The first of those that are one motion."""

    empty: bpy.types.Object
    collection: bpy.types.Collection
    cell: layout.Cell

    def child(self, name: str, data: bpy.types.ID | None) -> bpy.types.Object:
        """A new object that moves with the lane."""
        child = bpy.data.objects.new(name, data)
        child.parent = self.empty
        self.collection.objects.link(child)
        return child


class Actors(Protocol):
    """What moves."""

    def enter(self, lane: Lane) -> None:
        """Add what moves under the mode of a lane, and the recording."""


class Lanes:
    """Builds the lanes, one call each, out of materials, groups and meshes that they share."""

    def __init__(self, cast: Cast, frame: bpy.types.Object, actors: Actors) -> None:
        self.cast, self.frame, self.actors = cast, frame, actors
        self.card, self.track = ink("Card", cast.theme.card), ink("Track", cast.theme.track)
        self.graph_group = trails.graph_group()
        self.readout = captions.readout_group("Error in mm", captions.decimals_for(cast.largest_error), cast.ink)
        self.names = captions.choice_group("Joint", cast.joints, cast.ink) if cast.joints else None
        self.title_width = max(captions.width_of(_title(mode)) for mode in cast.errors)

    def build(self, modes: tuple[str, ...], cell: layout.Cell) -> None:
        """Make the lane of modes that are one motion in its cell, in a collection of its own; the first gives names."""
        mode = modes[0]
        self.collection = bpy.data.collections.new(f"Lane {mode}")
        bpy.context.scene.collection.children.link(self.collection)
        empty = bpy.data.objects.new(f"Lane {mode}", None)
        self.collection.objects.link(empty)
        empty.empty_display_size = 0.05 * self.cast.layout.metres
        self._place(empty, cell)
        self.actors.enter(Lane(mode, empty, self.collection, cell))
        self._add_caption(modes, cell)

    def _place(self, lane: bpy.types.Object, cell: layout.Cell) -> None:
        """Put the focus into the middle of the view on every frame."""
        cast = self.cast
        lane.rotation_euler.z = cast.framing.yaw
        home = layout.unproject(np.append(cell.view * cast.layout.metres, -0.01 * cast.layout.metres) - cast.middle)
        focus = rotate(layout.yaw_quaternion(cast.framing.yaw), cast.framing.focus)[:: cast.framing_steps]
        lane.location = home - focus[0]
        if cast.framing.follows:
            write_channel(lane, "location", cast.timeline.frames, home - focus)
            lane.animation_data.action.name = lane.name

    def _add_caption(self, modes: tuple[str, ...], cell: layout.Cell) -> None:
        """From the top the title and the names of the modes, at the foot the error: a number, and a graph of it."""
        mode = modes[0]
        card = captions.card(f"{mode} card", cell.width, cell.height, self.card)
        self._put(bpy.data.objects.new(card.name, card), cell.x, cell.y, 1)
        width, height = cell.caption
        unit = min(1.0, height / layout.CAPTION_HEIGHT, width / layout.CAPTION_WIDTH)
        inset = 0.022 * unit
        left, right, room = cell.left + inset, cell.left + width - inset, width - 2.0 * inset
        title = min(TITLE * unit, room / self.title_width)
        line = cell.foot + height - inset - 0.75 * TITLE * unit
        self._put(captions.words(f"{mode} title", _title(mode), title, self.cast.ink), left, line)

        jointed = self.names is not None
        number, graph = (NUMBER_OF_JOINT if jointed else NUMBER) * unit, (GRAPH_OF_JOINT if jointed else GRAPH) * unit
        self._add_graph(mode, left, cell.foot + inset, room, graph)
        foot = cell.foot + inset + graph + 0.25 * number
        self._put(captions.words(f"{mode} unit", "mm", UNIT * unit, self.cast.faint, "RIGHT"), right, foot)
        error = captions.readout(
            f"{mode} error", self.readout, number, self.cast.timeline.frames, self.cast.errors[mode]
        )
        self._put(error, right - 1.9 * UNIT * unit, foot)
        top = foot + 0.8 * number
        if jointed:
            self._add_joint(mode, left, top + 0.15 * number, room, unit)
            top += JOINT * unit

        # The names shrink until their lines fit between the title and the number.
        space, size = line - top - 0.3 * TITLE * unit, NAME * unit
        names = [*modes, *filter(None, (self.cast.notes.get(mode),))]
        text = captions.wrapped(names, room / size)
        while (text.count("\n") + 1.4) * size > space or captions.width_of(text) * size > room:
            size *= 0.95
            text = captions.wrapped(names, room / size)
        self._put(captions.words(f"{mode} names", text, size, self.cast.faint), left, line - 1.4 * size)

    def _add_joint(self, mode: str, left: float, foot: float, room: float, unit: float) -> None:
        """The joint that the number is of."""
        widest = max(map(captions.width_of, self.cast.joints))
        size = min(JOINT * unit, room / max(widest, 1e-6))
        joint = captions.choice(f"{mode} joint", self.names, size, self.cast.timeline.frames, self.cast.worst[mode])
        self._put(joint, left, foot)

    def _add_graph(self, mode: str, left: float, foot: float, width: float, height: float) -> None:
        """The error over time, all of it faint, and what has passed in the colour of the mode."""
        cast = self.cast
        heights = height * cast.errors[mode] / (cast.largest_error or 1.0)
        mesh = trails.graph(f"{mode} graph", cast.timeline.frames, heights, width)
        mesh.materials.append(self.track)
        self._put(bpy.data.objects.new(f"{mode} graph to come", mesh), left, foot, 3)
        passed = bpy.data.objects.new(f"{mode} graph", mesh)
        apply_group(passed, self.graph_group, Material=ink(f"Graph {mode}", colour_on(cast.theme, mode)))
        self._put(passed, left, foot, 4)
        base = captions.card(f"{mode} base", width, 0.0025, self.track, corner=0.0)
        self._put(bpy.data.objects.new(base.name, base), left + width / 2.0, foot - 0.00125)

    def _put(self, obj: bpy.types.Object, x: float, y: float, lift: int = 2) -> None:
        captions.put(obj, self.frame, self.collection, x, y, lift)


def _title(mode: str) -> str:
    """What a mode is called, without the algebra in brackets: its id tells."""
    return label_of(mode).partition(" (")[0]
