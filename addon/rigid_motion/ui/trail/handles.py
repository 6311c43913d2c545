"""Keys on the paths that are drawn: where they are in the world and on the screen, and what their channels are in.

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
"""How far from a key or a path the mouse may be to mean it, at a resolution scale of 1."""

NO_KEYS_SELECTED = n_("Select keys on the path first: click on them, or press A for all")

KEY_EDITORS = ("VIEW_3D", "DOPESHEET_EDITOR", "GRAPH_EDITOR", "TIMELINE")


@dataclass(frozen=True, eq=False)
class Handles:
    """The keys of one path that is drawn."""

    target: Transform
    space: Matrix
    path: DrawnPath

    def in_world(self, points: np.ndarray) -> np.ndarray:
        """Return points (n, 3) of its path's space in the world."""
        return maps_of(self.space).at(points)

    @property
    def selected(self) -> np.ndarray:
        """The frames of its keys that are selected, shape (n,)."""
        return self.path.key_frames[self.path.selected]

    def at_keys(self, context: Any) -> np.ndarray:
        """Return where its keys are on the screen, (k, 2)."""
        return _on_screen(context, self.in_world(self.path.keys))

    def nearest_moment(self, context: Any, place: np.ndarray) -> tuple[float, float]:
        """Return how far from a place on the screen its path is, in pixels, and the frame where it is so near."""
        path = self.path
        line = _on_screen(context, self.in_world(path.line))
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


def _on_screen(context: Any, points: np.ndarray) -> np.ndarray:
    region, view = context.region, context.region_data
    return on_screen(points, np.array(view.perspective_matrix), (region.width, region.height))


def key_under(context: Any, handles: Iterable[Handles], place: np.ndarray) -> tuple[Handles, float] | None:
    """Return the key that a place on the screen is on, by its frame; None where it is on none."""
    hit = nearest_under(context, ((one, one.at_keys(context)) for one in handles), place)
    return None if hit is None else (hit[0], float(hit[0].path.key_frames[hit[1]]))


def nearest_under(
    context: Any, shown: Iterable[tuple[Handles, np.ndarray]], place: np.ndarray
) -> tuple[Handles, int] | None:
    """Return which of the points (n, 2) of which path a place on the screen is on; None where it is on none."""
    nearest, result = REACH_PX * context.preferences.system.ui_scale, None
    for one, points in shown:
        distances = np.nan_to_num(np.linalg.norm(points - place, axis=1), nan=np.inf)
        if (distance := float(distances.min())) <= nearest:
            nearest, result = distance, (one, int(distances.argmin()))
    return result


def select(context: bpy.types.Context, handles: Iterable[Handles], chosen: dict[Transform, np.ndarray]) -> None:
    """Have these frames of keys be selected, (n,) of each target, and no others of the paths."""
    for one in handles:
        select_keys(one.target, chosen.get(one.target, np.empty(0)))
    cache.notice_selection(one.target for one in handles)
    redraw(context, *KEY_EDITORS)


def selected_spaces(
    handles: Iterable[Handles], reach: float = 0.0, *, leave_carried: bool
) -> dict[Transform, KeySpaces]:
    """Return the selected keys, with those within so many frames of them, and what their channels are in; see `spaces`.

    The weight of each is that which Proportional Editing gives it.
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
    """Return what the channels of keys are in, from their frames and weights, (n,) each; without those, if these are
    to be left, whose parent or holder has one on the same frame, which carries them along.
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
        """Report why some could not be edited, have the rest be drawn, and return what Blender is told."""
        if reasons := dict.fromkeys(map(str, refused)):
            self.report({"WARNING"}, "\n".join(reasons))
        redraw(bpy.context, *KEY_EDITORS)
        return {"FINISHED"}

    def without_keys(self, handles: list[Handles], refused: Iterable[Refused] = ()) -> Returned:
        """Return what Blender is told where no key can be edited: without paths, to do what the key is for itself."""
        reasons = "\n".join(dict.fromkeys(map(str, refused)))
        if handles:
            self.report({"WARNING"}, reasons or rpt_(NO_KEYS_SELECTED))
        return {"CANCELLED"} if handles else {"PASS_THROUGH", "CANCELLED"}
