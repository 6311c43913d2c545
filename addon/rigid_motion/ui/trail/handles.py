"""Keys on drawn paths as handles: their places in the world and on the screen, and the space of their channels.

Places on the screen are x, y in pixels of the viewport's region, shape (2,) or (n, 2).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from mathutils import Matrix

from ...animation import Refused
from ...animation.edits.path_keys import KeySpaces, select_keys
from ...animation.evaluation.marks import near
from ...animation.transforms import Transform
from ...blender import Operator, Returned, existing, view_layer
from ..overlay import cache
from ..overlay.drawing import redraw
from ..overlay.held import motion_of
from ..overlay.kinds import space_of
from ..overlay.parents import CarriedTargets, maps_of
from ..overlay.points import DrawnPath, on_screen
from ..overlay.settings import is_shown, overlay_settings
from .proportional import falloff

REACH_PX = 14.0
"""How close the mouse must be to hit a key or a path, in pixels at a resolution scale of 1."""

NO_KEYS_SELECTED = n_("Select keys on the path first: click on them, or press A for all")

KEY_EDITORS = ("VIEW_3D", "DOPESHEET_EDITOR", "GRAPH_EDITOR", "TIMELINE")


@dataclass(frozen=True, eq=False)
class Handles:
    """The keys of one drawn path."""

    target: Transform
    space: Matrix
    path: DrawnPath

    def in_world(self, points: np.ndarray) -> np.ndarray:
        """Return points (n, 3) of the path's space in the world."""
        return maps_of(self.space).at(points)

    @property
    def selected(self) -> np.ndarray:
        """The frames of the selected keys, shape (n,)."""
        return self.path.key_frames[self.path.selected]

    def at_keys(self, context: Any) -> np.ndarray:
        """Return the keys on the screen, (k, 2)."""
        return _to_pixels(context, self.in_world(self.path.keys))

    def nearest_moment(self, context: Any, place: np.ndarray) -> tuple[float, float]:
        """Return the distance in pixels from a place on the screen to the path, and the frame of the nearest point."""
        path = self.path
        line = _to_pixels(context, self.in_world(path.line))
        chords, away = np.diff(line, axis=0), place - line[:-1]
        lengths = np.einsum("ij,ij->i", chords, chords)
        shares = np.clip(np.einsum("ij,ij->i", away, chords) / np.where(lengths > 0.0, lengths, 1.0), 0.0, 1.0)
        distances = np.linalg.norm(away - shares[:, None] * chords, axis=1)
        number = int(np.nanargmin(distances)) if np.isfinite(distances).any() else 0
        frame = path.frames[number] + shares[number] * (path.frames[number + 1] - path.frames[number])
        return float(np.nan_to_num(distances[number], nan=np.inf)), float(frame)


def handles_of(context: bpy.types.Context) -> list[Handles]:
    """Return the handles on all paths that the viewport shows."""
    is_drawn = overlay_settings(context.scene).show_paths and is_shown(context)
    return [Handles(*one) for one in cache.shown_paths(context)] if is_drawn else []


def _to_pixels(context: Any, points: np.ndarray) -> np.ndarray:
    region, view = context.region, context.region_data
    return on_screen(points, np.array(view.perspective_matrix), (region.width, region.height))


def key_under(context: Any, handles: Iterable[Handles], place: np.ndarray) -> tuple[Handles, float] | None:
    """Return the key at a place on the screen, by its frame; None if there is none."""
    hit = nearest_under(context, ((one, one.at_keys(context)) for one in handles), place)
    return None if hit is None else (hit[0], float(hit[0].path.key_frames[hit[1]]))


def nearest_under(
    context: Any, shown: Iterable[tuple[Handles, np.ndarray]], place: np.ndarray
) -> tuple[Handles, int] | None:
    """Return the path and index of the nearest point (n, 2) at a place on the screen; None if none is in reach."""
    nearest, result = REACH_PX * context.preferences.system.ui_scale, None
    for one, points in shown:
        distances = np.nan_to_num(np.linalg.norm(points - place, axis=1), nan=np.inf)
        if (distance := float(distances.min())) <= nearest:
            nearest, result = distance, (one, int(distances.argmin()))
    return result


def select(context: bpy.types.Context, handles: Iterable[Handles], chosen: dict[Transform, np.ndarray]) -> None:
    """Select keys on these frames, (n,) by target, and deselect all others of the paths."""
    for one in handles:
        select_keys(one.target, chosen.get(one.target, np.empty(0)))
    cache.notice_selection(one.target for one in handles)
    redraw(context, *KEY_EDITORS)


def selected_spaces(
    handles: Iterable[Handles], reach: float = 0.0, *, leave_carried: bool
) -> dict[Transform, KeySpaces]:
    """Return the spaces of the selected keys, and of the keys within `reach` frames of them; see `spaces`.

    Proportional Editing determines the weight of each key.
    """
    keys = {}
    for one in (one for one in handles if len(one.selected)):
        away = np.abs(one.path.key_frames[:, None] - one.selected).min(axis=1)
        weights = falloff(away, reach)
        keys[one] = one.path.key_frames[weights > 0.0], weights[weights > 0.0]
    return spaces(keys, leave_carried=leave_carried)


def spaces(
    keys: Mapping[Handles, tuple[np.ndarray, np.ndarray]], *, leave_carried: bool = False
) -> dict[Transform, KeySpaces]:
    """Return the spaces of keys, from their frames and weights, (n,) each.

    With `leave_carried`, keys are left out if a parent or holder has a key on the same frame, which carries them along.
    """
    carried, depsgraph = CarriedTargets(), existing(view_layer().depsgraph)
    frames = {one.target: at for one, (at, _) in keys.items()}
    result = {}
    for one, (at, weights) in keys.items():
        target = one.target
        source = existing(carried.read((target,))[target][1])
        motion = motion_of(target, source, carried, space_of(target, depsgraph))
        for carrier in motion.carriers & frames.keys() if leave_carried else ():
            stays = ~near(at, frames[carrier])
            at, weights = at[stays], weights[stays]
        if len(at):
            maps, turns = motion.spaces(at)
            points = one.in_world(one.path.keys)[near(one.path.key_frames, at)]
            result[target] = KeySpaces(at, motion.space @ maps, turns, points, weights)
    return result


class OnPath(Operator):
    """Operators on the keys of the paths that are drawn."""

    def finish(self, refused: Iterable[Refused]) -> Returned:
        """Report refusals, redraw, and return the operator's result."""
        if reasons := dict.fromkeys(map(str, refused)):
            self.report({"WARNING"}, "\n".join(reasons))
        redraw(bpy.context, *KEY_EDITORS)
        return {"FINISHED"}

    def without_keys(self, handles: list[Handles], refused: Iterable[Refused] = ()) -> Returned:
        """Return the operator's result if no key can be edited: without paths, the event is passed on to Blender."""
        reasons = "\n".join(dict.fromkeys(map(str, refused)))
        if handles:
            self.report({"WARNING"}, reasons or rpt_(NO_KEYS_SELECTED))
        return {"CANCELLED"} if handles else {"PASS_THROUGH", "CANCELLED"}
