"""Speed of the active object or bone: its curves in the Graph Editor, a panel, and *Equalise Speed*."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import blf
import bpy
import gpu
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from .. import animation
from ..animation import EvenSpeed, Refused
from ..animation.edits.speed import CONSTANT
from ..animation.queries.polls import with_more_keys_than
from ..animation.queries.segments import frame_in_action
from ..animation.transforms import OWN_WORDS, Transform
from ..blender import BoolProperty, EnumProperty, Returned, existing, with_properties
from ..handlers import append_drawing, remove_drawing
from ..motion.speeds import ways_and_turns
from .overlay.cache import path_of
from .overlay.drawing import KEY_COLOUR, Pen, batch_of, blended, drawn
from .overlay.held import motion_now
from .overlay.points import DrawnPath
from .overlay.settings import overlay_settings
from .targets import SELECTED, WHOLE, OnTargets, active_target, grouped_by_frames, is_key_editor
from .wording import degrees, labelled, length

SAMPLES_PER_FRAME = 2
"""Samples per frame; speed is measured from each sample to the next."""

BAND_RATIOS = 0.09, 0.42
"""The bottom and the top of the speed curves, as fractions of the editor's height from below."""

BAND_COLOR = (0.08, 0.08, 0.08, 0.55)
"""The background of the speed curves, which distinguishes them from F-curves."""

KEY_DIAMETER_PX, TEXT_SIZE_PX, MARGIN_PX = 7.0, 12.0, 8.0

MIN_BEND_RATIO = 1e-4
"""The report mentions a deviation of the path above this fraction of its length."""

MIN_SPEED = 1e-6
"""Up to this speed, in units or radians per frame, a target is at rest."""


@dataclass(frozen=True, eq=False)
class Speeds:
    """Speeds between frames (n,) and the next ones: in units and in radians per frame, (n - 1,) each."""

    frames: np.ndarray
    going: np.ndarray
    turning: np.ndarray
    keys: np.ndarray
    """The frames of the keys, shape (k,)."""

    def at(self, values: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return `values`, one of the two speeds, on frames (m,). On a key it is the speed after the key."""
        at = np.searchsorted(self.frames, frames + 1e-3, side="right") - 1
        return values[np.clip(at, 0, len(values) - 1)]


_speeds_by_path: WeakKeyDictionary[DrawnPath, Speeds] = WeakKeyDictionary()
"""Cache by path, a new object after every edit."""


def speeds_of(target: Transform, context: Any) -> Speeds | None:
    """Return the speeds of a target in the world; None if it has no path."""
    path = path_of(target, context)
    if path is None or path in _speeds_by_path:
        return None if path is None else _speeds_by_path[path]
    motion = motion_now(target, context.view_layer.depsgraph)
    keys, even = motion.source.keyed_frames, motion.frames(SAMPLES_PER_FRAME)
    # Between samples that nearly coincide, rounding errors would look like speed.
    far = np.abs(even[:, None] - keys).min(axis=1) > 0.1 / SAMPLES_PER_FRAME
    frames = np.union1d(even[far], keys)
    going, turning = (part / np.diff(frames) for part in ways_and_turns(motion.space @ motion.at_point(frames)))
    _speeds_by_path[path] = Speeds(frames, going, turning, keys)
    return _speeds_by_path[path]


def _speed_texts(context: Any, going: float, turning: float) -> tuple[str, str]:
    """Return a speed and a rate of rotation as texts per second, from units and radians per frame."""
    render = context.scene.render
    fps = render.fps / render.fps_base
    return f"{length(context.scene, going * fps, precision=3)}/s", f"{degrees(turning * fps)}/s"


def draw_panel(context: Any, layout: bpy.types.UILayout) -> None:
    """Draw the speed on the current frame in a panel."""
    target = active_target(context)
    speeds = None if target is None else speeds_of(target, context)
    if target is not None and speeds is not None:
        frame = np.array([frame_in_action(target.animated, context.scene.frame_current_final)])
        texts = _speed_texts(context, *(float(speeds.at(part, frame)[0]) for part in (speeds.going, speeds.turning)))
        labelled(layout, "").label(text=", ".join(texts), translate=False)
    layout.operator(RIGID_MOTION_OT_equalise_speed.bl_idname)


@drawn
def draw() -> None:
    """Draw the speeds of the active object or bone in the current Graph Editor."""
    context: Any = bpy.context
    target = active_target(context) if overlay_settings(context.scene).show_speed else None
    speeds = speeds_of(target, context) if target is not None and context.space_data.mode == "FCURVES" else None
    if target is not None and speeds is not None:
        with blended():
            _draw(context, target, speeds)


def _draw(context: Any, target: Transform, speeds: Speeds) -> None:
    region, pen = context.region, Pen(context)
    bottom, top = (ratio * region.height for ratio in BAND_RATIOS)
    to_scene = partial(frame_in_action, target.animated)
    zero, one = (region.view2d.view_to_region(frame - to_scene(0.0), 0.0, clip=False)[0] for frame in (0.0, 1000.0))
    sidebars = [part.x - region.x for part in context.area.regions if part.type == "UI" and part.width > 1]
    right = min(region.width, *sidebars, region.width) - MARGIN_PX * pen.scale
    spent = (bottom - MARGIN_PX, top + 2.0 * TEXT_SIZE_PX * pen.scale)
    corners = [(0, spent[0], 0), (region.width, spent[0], 0), (0, spent[1], 0), (region.width, spent[1], 0)]
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.uniform_float("color", BAND_COLOR)
    existing(batch_of("TRIS", np.array(corners)[[0, 1, 2, 1, 3, 2]])).draw(shader)
    colors, peaks = (pen.look.mode_color, pen.look.key_color), list[float]()

    def placed(frames: np.ndarray, values: np.ndarray, peak: float) -> np.ndarray:
        across = zero + frames * (one - zero) / 1000.0
        return np.stack((across, bottom + values / peak * (top - bottom), np.zeros(len(frames))), axis=1)

    for values, color in zip((speeds.turning, speeds.going), colors[::-1], strict=True):
        peak = float(values.max(initial=0.0))
        peaks.insert(0, peak)
        if peak > MIN_SPEED:
            # Drawn at the middles of samples: zoomed in, a curve would look like steps half a frame wide.
            middles = 0.5 * (speeds.frames[1:] + speeds.frames[:-1])
            pen.line(batch_of("LINE_STRIP", placed(middles, values, peak)), color, pen.look.line_width)
            on_keys = placed(speeds.keys, speeds.at(values, speeds.keys), peak)
            pen.dot(batch_of("POINTS", on_keys), KEY_COLOUR, KEY_DIAMETER_PX)
    blf.size(0, TEXT_SIZE_PX * pen.scale)
    for text, color in list(zip(_speed_texts(context, *peaks), colors, strict=True))[::-1]:
        right -= blf.dimensions(0, text)[0]
        blf.color(0, *color)
        blf.position(0, right, top + 0.7 * TEXT_SIZE_PX * pen.scale, 0)
        blf.draw(0, text)
        right -= 2.0 * MARGIN_PX * pen.scale


@with_properties
class RIGID_MOTION_OT_equalise_speed(OnTargets):
    bl_idname = "rigid_motion.equalise_speed"
    bl_label = "Equalise Speed"
    bl_description = (
        "Move the selection at an even speed along its path, which does not change: keys between the first and the "
        "last one move in time, and handles set the timing between them"
    )
    nothing_to_do = n_("Nothing here has two keys to move between")
    with_work = staticmethod(partial(with_more_keys_than, count=1))
    leaves_others = True

    ease: str = EnumProperty(
        name="Speed",
        description="How the speed begins and ends",
        items=[
            (CONSTANT, "Constant", "The same from the first key to the last"),
            ("EASE_IN", "Ease In", "From rest, up to full speed"),
            ("EASE_OUT", "Ease Out", "From full speed, down to rest"),
            ("EASE_IN_OUT", "Ease In and Out", "From rest to rest"),
        ],
        translation_context=OWN_WORDS,
    )
    turning: bool = BoolProperty(
        name="Turning",
        description="Even out the rotation, not the speed along the path. Used for anything that stays in place",
    )
    between_frames: bool = BoolProperty(
        name="Between Frames",
        description="Allow keys between frames if an even speed needs them",
    )
    selected: bool = BoolProperty(
        name="Selected Keys",
        description="From the first to the last selected key, not from the first to the last of all",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Returned:
        targets = self.each_target(context) if is_key_editor(context) else ()
        self.selected = any(len(animation.key_frames(target, selected=True)) > 1 for target in targets)
        return self.execute(context)

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        done: dict[Transform, EvenSpeed] = {}
        scope = SELECTED if self.selected else WHOLE
        for frames, group in grouped_by_frames(context, targets, scope, refused).items():
            settings: Any = {"turning": self.turning, "between_frames": self.between_frames, "refused": refused}
            done |= animation.equalise_speed(group, self.ease, frames, **settings)
        return "; ".join(self._summary(context, done)) if done else ""

    def _summary(self, context: Any, done: dict[Transform, EvenSpeed]) -> Iterator[str]:
        """Yield a summary of the target with the least even speed, and of the path that changed most."""
        one = max(done.values(), key=lambda one: one.unevenness)
        text = rpt_("{speed} from frame {first:g} to {last:g}, even to {percent:.2g} %")
        speed = _speed_texts(context, one.speed, one.speed)[one.is_turning]
        yield text.format(speed=speed, first=one.first, last=one.last, percent=100.0 * one.unevenness)
        bent = max(done.values(), key=lambda one: one.bend)
        if bent.bend > MIN_BEND_RATIO * bent.speed * (bent.last - bent.first):
            text = rpt_("the path of Smooth Screw, which depends on the frames of its keys, is up to {length} off")
            yield text.format(length=length(context.scene, bent.bend, precision=3))


def register() -> None:
    append_drawing(bpy.types.SpaceGraphEditor, draw, "POST_PIXEL")


def unregister() -> None:
    remove_drawing(bpy.types.SpaceGraphEditor, draw)
