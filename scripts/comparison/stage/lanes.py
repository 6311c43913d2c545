"""Lanes: what one mode has of the stage. An object that moves, the recording as its ghost, trails, marks, a caption.

A lane is an empty; what moves is its child, so an object's own channels are the poses of `timeline.ShownMotion`. What
is written is a child of the frame (`layout`).
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from addon.animation import bake_poses, write_channel
from addon.motion import Poses

from .. import palette
from ..study.modes import label_of
from . import captions, layout, trails
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
TRAIL_RADIUS = 0.0032
PATH_RADIUS = 0.0012
MARK_RADIUS = 0.0042

GHOST_ALPHA = 0.24
GHOST_INSET = 0.003
"""How much smaller the ghost is all around, in units of the object: where both agree, the object hides it."""

BAR_HEIGHT = 0.009
NUMBER_WIDTH = 3.6
"""Of the error with its unit, in units of its size."""


@dataclass(frozen=True, eq=False)
class Cast:
    """What all lanes share: the motion, the object, and the data-blocks that each of them uses."""

    timeline: Timeline
    motion: ShownMotion
    layout: layout.Layout
    yaw: float
    """The turn about z in radians that shows the motion from its broad side."""

    middle: np.ndarray
    """The middle of all that moves, as `layout.project` gives it but for the depth, which is that of the far end."""

    errors: dict[str, np.ndarray]
    """Mode id to the error at each frame, in millimetres."""

    largest_error: float
    """In millimetres: that of a full bar."""

    mesh: bpy.types.Mesh
    notes: dict[str, str]
    """Mode id to what is written small below the name of the mode."""

    traced: np.ndarray
    """The point of the object whose path is drawn, shape (3,)."""

    def path_of(self, poses: Poses) -> np.ndarray:
        """The way of the traced point, shape (n, 3)."""
        return layout.swept_points(poses, self.traced[None])


class Lanes:
    """Builds the lanes, one call each, out of materials, groups and meshes that they share."""

    def __init__(self, cast: Cast, frame: bpy.types.Object) -> None:
        self.cast, self.frame = cast, frame
        self.ink, self.faint = ink("Ink", palette.INK), ink("Faint", palette.FAINT)
        self.card, self.track = ink("Card", palette.CARD), ink("Track", palette.TRACK)
        self.ghost = surface("Recording", palette.GHOST, alpha=GHOST_ALPHA)
        self.ghost_mesh = cast.mesh.copy()
        self.ghost_mesh.name = f"{cast.mesh.name} recording"
        shrink(self.ghost_mesh, GHOST_INSET * float(np.ptp(vertices_of(cast.mesh), axis=0).max()))
        self.ghost_action: bpy.types.Action | None = None
        self.trail_group, self.marks_group = trails.trail_group(), trails.marks_group()
        motion, timeline = cast.motion, cast.timeline
        self.path = trails.polyline("Recording path", timeline.fine_frames, cast.path_of(motion.recording))
        self.readout = captions.readout_group("Error in mm", captions.decimals_for(cast.largest_error), self.ink)
        labels = [label_of(mode) for mode in motion.modes]
        self.label_width = max(captions.width_of(label) for label in labels)
        self.note_width = max(captions.width_of(note) for note in cast.notes.values())
        self.broken_label_width = max(captions.width_of(captions.in_two_lines(label)) for label in labels)

    def build(self, mode: str, cell: layout.Cell) -> None:
        """Make the lane of a mode in its cell, in a collection of its own."""
        self.collection = bpy.data.collections.new(f"Lane {mode}")
        bpy.context.scene.collection.children.link(self.collection)
        lane = bpy.data.objects.new(f"Lane {mode}", None)
        self.collection.objects.link(lane)
        metres = self.cast.layout.metres
        lane.empty_display_size = 0.05 * metres
        lane.rotation_euler.z = self.cast.yaw
        lane.location = layout.unproject(np.append(cell.view * metres, -0.01 * metres) - self.cast.middle)
        self._add_actors(mode, lane)
        self._add_trails(mode, lane)
        self._add_caption(mode, cell)

    def _add_actors(self, mode: str, lane: bpy.types.Object) -> None:
        frames, steps = self.cast.timeline.frames, self.cast.timeline.steps
        actor = self._child(lane, mode, self.cast.mesh)
        actor.rotation_mode = "QUATERNION"
        _paint(actor, tinted_slots(self.cast.mesh), surface(f"Mode {mode}", palette.colour_of(mode)))
        bake_poses(actor, frames, self.cast.motion.modes[mode][::steps])
        actor.animation_data.action.name = mode

        ghost = self._child(lane, f"{mode} recording", self.ghost_mesh)
        ghost.rotation_mode = "QUATERNION"
        _paint(ghost, range(len(ghost.material_slots)), self.ghost)
        if self.ghost_action is None:
            bake_poses(ghost, frames, self.cast.motion.recording[::steps])
            self.ghost_action = ghost.animation_data.action
            self.ghost_action.name = "recording"
        else:
            ghost.animation_data_create().action = self.ghost_action
            ghost.animation_data.action_slot = self.ghost_action.slots[0]

    def _add_trails(self, mode: str, lane: bpy.types.Object) -> None:
        cast, rate, metres = self.cast, self.cast.timeline.rate, self.cast.layout.metres
        trail = trails.polyline(f"{mode} trail", cast.timeline.fine_frames, cast.path_of(cast.motion.modes[mode]))
        window = {"Past": PATH_BEHIND_SECONDS * rate, "Ahead": PATH_AHEAD_SECONDS * rate}
        keys = cast.motion.keys[mode]
        marks = trails.polyline(f"{mode} keys", cast.motion.key_frames[mode], cast.path_of(keys), joined=False)
        crowded = max(1.0, sum(window.values()) / (MARKS_SHOWN * cast.timeline.frames_per_key(len(keys))))
        apply_group(
            self._child(lane, f"{mode} trail", trail),
            self.trail_group,
            Past=TRAIL_SECONDS * rate,
            Ahead=0.0,
            Radius=TRAIL_RADIUS * metres,
            Taper=0.9,
            Material=ink(f"Trail {mode}", palette.colour_of(mode)),
        )
        apply_group(
            self._child(lane, f"{mode} recording path", self.path),
            self.trail_group,
            **window,
            Radius=PATH_RADIUS * metres,
            Taper=0.0,
            Material=self.faint,
        )
        apply_group(
            self._child(lane, f"{mode} keys", marks),
            self.marks_group,
            **{side: frames / crowded for side, frames in window.items()},
            Radius=MARK_RADIUS * metres,
            Material=self.ink,
        )

    def _add_caption(self, mode: str, cell: layout.Cell) -> None:
        card = captions.card(f"{mode} card", cell.width, cell.height, self.card)
        self._put(bpy.data.objects.new(card.name, card), cell.x, cell.y, 1)
        width, height = cell.caption
        inset = min(0.02, 0.08 * width)
        left, right, room = cell.left + inset, cell.left + width - inset, width - 2.0 * inset
        line = cell.foot + 0.33 * layout.CAPTION_HEIGHT
        if cell.beside:
            label, label_size = captions.in_two_lines(label_of(mode)), min(0.034, room / self.broken_label_width)
            label_line, id_size, number_size = cell.foot + height - 0.046, min(0.027, 0.15 * room), 0.26 * room
            id_line = line + 1.2 * min(0.046, number_size)
        else:
            label, label_size = label_of(mode), min(0.033, room / self.label_width)
            label_line, id_size, number_size = cell.foot + 0.7 * height, min(0.027, 0.1 * room), 0.2 * room
            id_line = line
        number_size = min(0.046, number_size)
        self._put(captions.words(f"{mode} label", label, label_size, self.ink), left, label_line)
        note = self.cast.notes[mode]
        taken = self.note_width * id_size + (0.0 if cell.beside else NUMBER_WIDTH * number_size)
        if taken > room:
            note = captions.in_two_lines(note)
        if "\n" in note:
            id_size *= 0.8
            id_line += id_size
        elif taken > room:
            # What cannot be broken shrinks, and the number with it.
            id_size, number_size = id_size * room / taken, number_size * room / taken
        self._put(captions.words(f"{mode} id", note, id_size, self.faint), left, id_line)
        self._put(captions.words(f"{mode} unit", "mm", 0.6 * number_size, self.faint, "RIGHT"), right, line)
        number = captions.readout(
            f"{mode} error", self.readout, number_size, self.cast.timeline.frames, self.cast.errors[mode]
        )
        self._put(number, right - 1.2 * number_size, line)
        self._add_bar(mode, left, cell.foot + 0.018, room)

    def _add_bar(self, mode: str, left: float, y: float, length: float) -> None:
        track = captions.card(f"{mode} track", length, BAR_HEIGHT, self.track, corner=0.0)
        self._put(bpy.data.objects.new(track.name, track), left + length / 2.0, y)
        mesh = captions.card(f"{mode} bar", length, BAR_HEIGHT, ink(f"Bar {mode}", palette.colour_of(mode)), corner=0.0)
        mesh.transform(Matrix.Translation((length / 2.0, 0.0, 0.0)))
        bar = bpy.data.objects.new(mesh.name, mesh)
        self._put(bar, left, y, 3)
        full = self.cast.errors[mode] / (self.cast.largest_error or 1.0)
        write_channel(bar, "scale", self.cast.timeline.frames, np.stack([full, *np.ones((2, len(full)))], axis=-1))
        bar.animation_data.action.name = mesh.name

    def _child(self, lane: bpy.types.Object, name: str, mesh: bpy.types.Mesh) -> bpy.types.Object:
        child = bpy.data.objects.new(name, mesh)
        child.parent = lane
        self.collection.objects.link(child)
        return child

    def _put(self, obj: bpy.types.Object, x: float, y: float, lift: int = 2) -> None:
        captions.put(obj, self.frame, self.collection, x, y, lift)


def _paint(obj: bpy.types.Object, slots: list[int] | range, material: bpy.types.Material) -> None:
    """Give this object its own material in slots of the mesh that it shares."""
    for slot in slots:
        obj.material_slots[slot].link = "OBJECT"
        obj.material_slots[slot].material = material
