"""Lanes: what a motion has of the stage. An object that moves, the recording as its ghost, trails, marks, a caption.

A lane is an empty; what moves is its child, so an object's own channels are the poses of `timeline.ShownMotion`. Where
the camera follows, the empty moves the other way. What is written is a child of the frame (`layout`).
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from addon.animation import bake_poses, write_channel
from addon.motion import Poses
from addon.motion.quaternions import rotate

from ..palette import Theme, colour_on
from ..study.modes import label_of
from . import captions, layout, trails
from .framing import Framing
from .materials import ink, surface
from .nodes import apply_group
from .subject import shrink, tinted_slots, vertices_of
from .timeline import ShownMotion, Timeline

TRAIL_SECONDS = 0.8
PATH_BEHIND_SECONDS = 1.2
PATH_AHEAD_SECONDS = 0.5
MARKS_SHOWN = 14
"""About so many marks are shown at once: those nearest in time, where keys are dense."""

# In units of the frame's height.
TRAIL_RADIUS = 0.0036
PATH_RADIUS = 0.0014
MARK_RADIUS = 0.0052

GHOST_ALPHA = 0.3
GHOST_INSET = 0.003
"""How much smaller the ghost is all around, in units of the object: where both agree, the object hides it."""

TITLE, NAME, NUMBER, UNIT, GRAPH = 0.05, 0.033, 0.064, 0.036, 0.07
"""Sizes of what a caption holds, in units of the frame's height, where there is room."""


@dataclass(frozen=True, eq=False)
class Cast:
    """What all lanes share: the motion, the object, and the data-blocks that each of them uses."""

    timeline: Timeline
    motion: ShownMotion
    deviated: dict[str, Poses]
    """Mode id to poses at the fine frames, as far off from the recording as is shown."""

    framing: Framing
    """At the fine frames."""

    layout: layout.Layout

    middle: np.ndarray
    """The middle of all that moves, from the focus on, as `layout.project` gives it but for the depth, which is that of
    the far end."""

    errors: dict[str, np.ndarray]
    """Mode id to the error at each frame, in millimetres."""

    largest_error: float
    """In millimetres: what the graphs reach up to."""

    mesh: bpy.types.Mesh
    notes: dict[str, str]
    """Mode id to what its keys are, where the modes have different ones."""

    traced: np.ndarray
    """The point of the object whose path is drawn, shape (3,)."""

    theme: Theme

    def path_of(self, poses: Poses) -> np.ndarray:
        """The way of the traced point, shape (n, 3)."""
        return layout.swept_points(poses, self.traced[None])


class Lanes:
    """Builds the lanes, one call each, out of materials, groups and meshes that they share."""

    def __init__(self, cast: Cast, frame: bpy.types.Object) -> None:
        self.cast, self.frame = cast, frame
        theme = cast.theme
        self.ink, self.faint = ink("Ink", theme.ink), ink("Faint", theme.faint)
        self.card, self.track = ink("Card", theme.card), ink("Track", theme.track)
        self.ghost = surface("Recording", theme.ghost, alpha=GHOST_ALPHA)
        self.ghost_mesh = cast.mesh.copy()
        self.ghost_mesh.name = f"{cast.mesh.name} recording"
        shrink(self.ghost_mesh, GHOST_INSET * float(np.ptp(vertices_of(cast.mesh), axis=0).max()))
        self.ghost_action: bpy.types.Action | None = None
        self.trail_group, self.marks_group = trails.trail_group(windowed=True), trails.marks_group()
        self.graph_group = trails.graph_group()
        motion, timeline = cast.motion, cast.timeline
        self.path = trails.polyline("Recording path", timeline.fine_frames, cast.path_of(motion.recording))
        self.readout = captions.readout_group("Error in mm", captions.decimals_for(cast.largest_error), self.ink)
        self.title_width = max(captions.width_of(_title(mode)) for mode in motion.modes)

    def build(self, modes: tuple[str, ...], cell: layout.Cell) -> None:
        """Make the lane of modes that are one motion in its cell, in a collection of its own; the first gives names."""
        mode = modes[0]
        self.collection = bpy.data.collections.new(f"Lane {mode}")
        bpy.context.scene.collection.children.link(self.collection)
        lane = bpy.data.objects.new(f"Lane {mode}", None)
        self.collection.objects.link(lane)
        metres = self.cast.layout.metres
        lane.empty_display_size = 0.05 * metres
        self._place(lane, cell)
        self._add_actors(mode, lane)
        self._add_trails(mode, lane, cell)
        self._add_caption(modes, cell)

    def _place(self, lane: bpy.types.Object, cell: layout.Cell) -> None:
        """Put the focus into the middle of the view on every frame."""
        cast = self.cast
        lane.rotation_euler.z = cast.framing.yaw
        home = layout.unproject(np.append(cell.view * cast.layout.metres, -0.01 * cast.layout.metres) - cast.middle)
        focus = rotate(layout.yaw_quaternion(cast.framing.yaw), cast.framing.focus)[:: cast.timeline.steps]
        lane.location = home - focus[0]
        if cast.framing.follows:
            write_channel(lane, "location", cast.timeline.frames, home - focus)
            lane.animation_data.action.name = lane.name

    def _add_actors(self, mode: str, lane: bpy.types.Object) -> None:
        frames, steps, motion = self.cast.timeline.frames, self.cast.timeline.steps, self.cast.motion
        material = surface(f"Mode {mode}", colour_on(self.cast.theme, mode))
        self._add_actor(mode, lane, motion.modes[mode][::steps], material)
        if self.cast.deviated[mode] is not motion.modes[mode]:
            # The motion itself is there for whoever opens the file; its deviation is what is seen.
            bpy.data.objects[mode].hide_render = bpy.data.objects[mode].hide_viewport = True
            self._add_actor(f"{mode} deviating", lane, self.cast.deviated[mode][::steps], material)

        ghost = self._child(lane, f"{mode} recording", self.ghost_mesh)
        ghost.rotation_mode = "QUATERNION"
        _paint(ghost, range(len(ghost.material_slots)), self.ghost)
        if self.ghost_action is None:
            bake_poses(ghost, frames, motion.recording[::steps])
            self.ghost_action = ghost.animation_data.action
            self.ghost_action.name = "recording"
        else:
            ghost.animation_data_create().action = self.ghost_action
            ghost.animation_data.action_slot = self.ghost_action.slots[0]

    def _add_actor(self, name: str, lane: bpy.types.Object, poses: Poses, material: bpy.types.Material) -> None:
        actor = self._child(lane, name, self.cast.mesh)
        actor.rotation_mode = "QUATERNION"
        _paint(actor, tinted_slots(self.cast.mesh), material)
        bake_poses(actor, self.cast.timeline.frames, poses)
        actor.animation_data.action.name = name

    def _add_trails(self, mode: str, lane: bpy.types.Object, cell: layout.Cell) -> None:
        cast, rate, metres = self.cast, self.cast.timeline.rate, self.cast.layout.metres
        trail = trails.polyline(f"{mode} trail", cast.timeline.fine_frames, cast.path_of(cast.deviated[mode]))
        window = {"Past": PATH_BEHIND_SECONDS * rate, "Ahead": PATH_AHEAD_SECONDS * rate}
        keys = cast.motion.keys[mode]
        marks = trails.polyline(f"{mode} keys", cast.motion.key_frames[mode], cast.path_of(keys), joined=False)
        crowded = max(1.0, sum(window.values()) / (MARKS_SHOWN * cast.timeline.frames_per_key(len(keys))))
        width, height = cell.room * metres / 2.0
        picture = {
            "Middle": layout.unproject(np.append(cell.view * metres, 0.0)),
            "Right": layout.RIGHT / width,
            "Up": layout.UP / height,
        }
        apply_group(
            self._child(lane, f"{mode} trail", trail),
            self.trail_group,
            Past=TRAIL_SECONDS * rate,
            Ahead=0.0,
            Radius=TRAIL_RADIUS * metres,
            Taper=0.9,
            Material=ink(f"Trail {mode}", colour_on(cast.theme, mode)),
            **picture,
        )
        apply_group(
            self._child(lane, f"{mode} recording path", self.path),
            self.trail_group,
            **window,
            Radius=PATH_RADIUS * metres,
            Taper=0.0,
            Material=self.faint,
            **picture,
        )
        apply_group(
            self._child(lane, f"{mode} keys", marks),
            self.marks_group,
            **{side: frames / crowded for side, frames in window.items()},
            Radius=MARK_RADIUS * metres,
            Material=self.ink,
            **picture,
        )

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
        self._put(captions.words(f"{mode} title", _title(mode), title, self.ink), left, line)

        number, graph = NUMBER * unit, GRAPH * unit
        self._add_graph(mode, left, cell.foot + inset, room, graph)
        foot = cell.foot + inset + graph + 0.25 * number
        self._put(captions.words(f"{mode} unit", "mm", UNIT * unit, self.faint, "RIGHT"), right, foot)
        error = captions.readout(
            f"{mode} error", self.readout, number, self.cast.timeline.frames, self.cast.errors[mode]
        )
        self._put(error, right - 1.9 * UNIT * unit, foot)

        # The names shrink until their lines fit between the title and the number.
        space, size = line - foot - 0.3 * TITLE * unit - 0.8 * number, NAME * unit
        names = [*modes, *filter(None, (self.cast.notes.get(mode),))]
        text = captions.wrapped(names, room / size)
        while (text.count("\n") + 1.4) * size > space or captions.width_of(text) * size > room:
            size *= 0.95
            text = captions.wrapped(names, room / size)
        self._put(captions.words(f"{mode} names", text, size, self.faint), left, line - 1.4 * size)

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

    def _child(self, lane: bpy.types.Object, name: str, mesh: bpy.types.Mesh) -> bpy.types.Object:
        child = bpy.data.objects.new(name, mesh)
        child.parent = lane
        self.collection.objects.link(child)
        return child

    def _put(self, obj: bpy.types.Object, x: float, y: float, lift: int = 2) -> None:
        captions.put(obj, self.frame, self.collection, x, y, lift)


def _title(mode: str) -> str:
    """What a mode is called, without the algebra in brackets: its id tells."""
    return label_of(mode).partition(" (")[0]


def _paint(obj: bpy.types.Object, slots: list[int] | range, material: bpy.types.Material) -> None:
    """Give this object its own material in slots of the mesh that it shares."""
    for slot in slots:
        obj.material_slots[slot].link = "OBJECT"
        obj.material_slots[slot].material = material
