"""Drawing of paths in the 3D viewport, by batches that stay on the graphics card.

Batches are in the space of the object's channels. The matrix from there into the world is applied when drawing, so a
moving parent costs nothing. Colours are as on the screen, widths in pixels at a resolution scale of 1.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, cast
from weakref import WeakKeyDictionary

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ...animation.queries.segments import frame_in_action
from ...animation.transforms import Transform
from ...blender import existing
from ...handlers import append_drawing, remove_drawing
from ..holding import hue_of
from ..preferences import Color, preferences
from ..targets import selected_in_view
from . import cache
from .points import MAX_TICKS, PASSING_HOLDER, DrawnPath, readable, thinned
from .settings import RigidMotionOverlay, is_shown, overlay_settings

log = logging.getLogger(__package__)

OUTLINE_COLOUR: Color = (0.0, 0.0, 0.0, 1.0)
"""Outline of lines and dots, so that they stand out from any background."""

KEY_COLOUR: Color = (1.0, 1.0, 1.0, 1.0)
"""Colour of unselected keys, as in the Dope Sheet."""

TICK_DIAMETER_PX, KEY_DIAMETER_PX, NOW_DIAMETER_PX = 6.0, 10.0, 12.0
"""Diameters of dots, outline included: ticks, keys, and the object on the current frame."""

AXIS_OPACITY = 0.8

MIN_BRIGHTNESS = 0.2
"""A theme colour whose components are all below this is meant to be dark: it is not fully brightened."""

MOST_VIEWS = 24
"""The most views of a path whose ticks and axes stay on the graphics card."""


@functools.cache
def _dot_shader() -> gpu.types.GPUShader:
    """Return a shader for round dots with an outline. Blender's own dots are square."""
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.push_constant("VEC4", "color")
    info.push_constant("VEC4", "outline")
    info.push_constant("FLOAT", "size")
    info.push_constant("FLOAT", "border")
    # Blender sets this if the shader has to convert sRGB colours to linear ones.
    info.push_constant("BOOL", "srgbTarget")
    info.vertex_in(0, "VEC3", "pos")
    info.fragment_out(0, "VEC4", "fragColor")
    info.vertex_source(
        """
        void main()
        {
          gl_Position = ModelViewProjectionMatrix * vec4(pos, 1.0);
          gl_PointSize = size + 1.0;
        }
        """
    )
    # A pixel on the edge is covered partly.
    info.fragment_source(
        """
        void main()
        {
          float inside = 0.5 * size - length(gl_PointCoord - vec2(0.5)) * (size + 1.0);
          fragColor = mix(outline, color, clamp(inside - border + 0.5, 0.0, 1.0));
          fragColor.a *= clamp(inside + 0.5, 0.0, 1.0);
          if (srgbTarget) {
            vec3 bent = pow((fragColor.rgb + 0.055) / 1.055, vec3(2.4));
            fragColor.rgb = mix(fragColor.rgb / 12.92, bent, step(vec3(0.04045), fragColor.rgb));
          }
        }
        """
    )
    return gpu.shader.create_from_info(info)


def brightened(color: Sequence[float]) -> Color:
    """Return a theme colour, brightened to match the lines of modes."""
    red, green, blue = (part / max(*color, MIN_BRIGHTNESS) for part in color)
    return red, green, blue, 1.0


Batch = gpu.types.GPUBatch | None
"""A batch on the graphics card; None if it would be empty."""


class _Marks(NamedTuple):
    """The ticks and axes of a path that are legible in a view, on the graphics card."""

    native_ticks: Batch
    desired_ticks: Batch
    axes: tuple[Batch, ...]


@dataclass(frozen=True)
class _Batches:
    """A path on the graphics card."""

    path: DrawnPath
    native: Batch
    desired: Batch
    keys: Batch
    selected: Batch

    pieces: tuple[tuple[int, Batch], ...]
    """The pieces of the mode's path (without a mode: of Blender's), with the numbers of their holders."""

    views: dict[tuple, _Marks] = field(default_factory=dict)
    """The marks for the views in which the path was seen lately."""

    @classmethod
    def of(cls, path: DrawnPath) -> _Batches:
        return cls(
            path,
            native=batch_of("LINE_STRIP", thinned(path.native)),
            desired=None if path.desired is None else batch_of("LINE_STRIP", thinned(path.desired)),
            keys=batch_of("POINTS", path.keys[~path.selected]),
            selected=batch_of("POINTS", path.keys[path.selected]),
            pieces=tuple(
                (piece.holder, batch_of("LINE_STRIP", thinned(path.line[piece.first : piece.last + 1])))
                for piece in path.pieces
            ),
        )

    def marks(self, pen: Pen, *, every_tick: bool) -> _Marks:
        """Return the ticks and axes that are legible in the view being drawn."""
        path, projection = self.path, np.array(gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix())
        view = projection.tobytes(), pen.size, pen.scale, every_tick
        if view not in self.views:
            if len(self.views) >= MOST_VIEWS:
                self.views.clear()
            chosen = readable(path, projection, pen.size, pen.scale, every_tick=every_tick)
            desired = None if path.desired_ticks is None else path.desired_ticks[existing(chosen.desired_ticks)]
            self.views[view] = _Marks(
                batch_of("POINTS", path.native_ticks[chosen.native_ticks]),
                None if desired is None else batch_of("POINTS", desired),
                tuple(batch_of("LINES", path.axes[chosen.axes, axis].reshape(-1, 3)) for axis in range(3)),
            )
        return self.views[view]


Primitive = Literal["POINTS", "LINES", "LINE_STRIP", "TRIS"]

own_space: Callable[[], AbstractContextManager[None]] = cast(Any, gpu.matrix.push_pop)
_batches: WeakKeyDictionary[DrawnPath, _Batches] = WeakKeyDictionary()


def batch_of(kind: Primitive, points: np.ndarray | list) -> Batch:
    """Return a batch of points (n, 3), to be drawn as lines or dots."""
    if not len(points):
        return None
    # Other shaders can draw it, too: all take positions alone.
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    content: Any = {"pos": np.ascontiguousarray(points, dtype=np.float32)}
    return batch_for_shader(shader, kind, content)


class Pen:
    """Draws batches in one redraw of one viewport."""

    def __init__(self, context: Any) -> None:
        self.lines = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        self.dots = _dot_shader()
        self.look = preferences()
        theme = context.preferences.themes[0].user_interface
        self.hues = [brightened(item.color) for item in context.preferences.themes[0].strip_color]
        self.axis_colors = [(*color, AXIS_OPACITY) for color in (theme.axis_x, theme.axis_y, theme.axis_z)]
        self.size = context.region.width, context.region.height
        self.scale = context.preferences.system.ui_scale

    def held_color(self, holder: int, free: Color) -> Color:
        """Return the colour of a holder by its number, or `free` for 0, the world."""
        if holder == 0:
            return free
        return self.look.tick_color if holder == PASSING_HOLDER else self.hues[hue_of(holder) - 1]

    def line(self, batch: Batch, color: Color, width: float) -> None:
        if batch:
            self.lines.uniform_float("viewportSize", self.size)
            self.lines.uniform_float("lineWidth", width * self.scale)
            self.lines.uniform_float("color", color)
            batch.draw(self.lines)

    def outlined_line(self, batch: Batch, color: Color, width: float) -> None:
        self.line(batch, OUTLINE_COLOUR, width + 2.0)
        self.line(batch, color, width)

    def dot(
        self,
        batch: Batch,
        color: Color,
        diameter: float,
        outline: Color = OUTLINE_COLOUR,
        border: float = 1.0,
    ) -> None:
        if batch:
            self.dots.uniform_float("color", color)
            self.dots.uniform_float("outline", outline)
            self.dots.uniform_float("size", diameter * self.scale)
            self.dots.uniform_float("border", border * self.scale)
            batch.draw(self.dots)


path_drawers: list[Callable[[Pen, Transform, DrawnPath, float, RigidMotionOverlay], None]] = []
"""Functions that draw more for each path, below it and in its space, on a frame of its Action."""


def drawn(draw: Callable[[], None]) -> Callable[[], None]:
    """Return a draw callback that never raises: an exception is logged."""

    @functools.wraps(draw)
    def draw_or_complain() -> None:
        global _complaint
        try:
            draw()
        except Exception as problem:
            # Log it once: the next redraw is a moment away.
            if repr(problem) != _complaint:
                _complaint = repr(problem)
                log.exception("The paths could not be drawn")

    return draw_or_complain


@contextmanager
def blended() -> Iterator[None]:
    """Turn on alpha blending, and dot sizes set by the shader."""
    gpu.state.blend_set("ALPHA")
    gpu.state.program_point_size_set(True)
    try:
        yield
    finally:
        gpu.state.program_point_size_set(False)
        gpu.state.blend_set("NONE")


@drawn
def draw_paths() -> None:
    """Draw the paths of the selected objects or bones, and what `path_drawers` adds, in a viewport."""
    if is_shown(bpy.context):
        _draw(bpy.context)


@drawn
def follow_selection() -> None:
    """Redraw the viewports if the key selection was changed in the editor being drawn."""
    context = bpy.context
    # During playback the viewports are redrawn anyway.
    if not is_shown(context) or existing(context.screen).is_animation_playing:
        return
    if cache.notice_selection(selected_in_view(context)):
        redraw(context, "VIEW_3D")


def redraw(context: bpy.types.Context, *kinds: str) -> None:
    """Tag all areas of these types for redraw."""
    for window in existing(context.window_manager).windows:
        for area in window.screen.areas:
            if area.type in kinds:
                area.tag_redraw()


def _draw(context: Any) -> None:
    scene, settings, paths = context.scene, overlay_settings(context.scene), cache.shown_paths(context)
    if not paths:
        return
    pen = Pen(context)
    native_now, desired_now = [], []
    gpu.state.depth_test_set("NONE")
    with blended():
        for target, space, path in paths:
            frame = frame_in_action(target.animated, scene.frame_current_final)
            with own_space():
                gpu.matrix.multiply_matrix(space)
                for draw in path_drawers:
                    draw(pen, target, path, frame, settings)
                if not settings.show_paths:
                    continue
                _draw_path(pen, path, settings)
            native, desired = path.at(frame)
            if settings.show_native or desired is None:
                native_now.append(space @ Vector(native.tolist()))
            if desired is not None:
                desired_now.append(space @ Vector(desired.tolist()))
        pen.dot(batch_of("POINTS", native_now), pen.look.native_color, NOW_DIAMETER_PX)
        pen.dot(batch_of("POINTS", desired_now), pen.look.mode_color, NOW_DIAMETER_PX)


def _draw_path(pen: Pen, path: DrawnPath, settings: RigidMotionOverlay) -> None:
    batches = _batches.get(path)
    if batches is None:
        batches = _batches[path] = _Batches.of(path)
    look = pen.look
    marks = batches.marks(pen, every_tick=settings.tick_step > 0)
    if settings.show_axes:
        for batch, color in zip(marks.axes, pen.axis_colors, strict=True):
            pen.line(batch, color, 0.75 * look.line_width)
    if settings.show_native or batches.desired is None:
        pen.outlined_line(batches.native, look.native_color, 0.6 * look.line_width)
        pen.dot(marks.native_ticks, OUTLINE_COLOUR, TICK_DIAMETER_PX, look.native_color, 1.25)
    if batches.desired is not None:
        pen.line(batches.desired, OUTLINE_COLOUR, look.line_width + 2.0)
        for holder, piece in batches.pieces or ((0, batches.desired),):
            pen.line(piece, pen.held_color(holder, look.mode_color), look.line_width)
        pen.dot(marks.desired_ticks, look.tick_color, TICK_DIAMETER_PX)
    diameter = KEY_DIAMETER_PX if len(path.keys) <= MAX_TICKS else TICK_DIAMETER_PX
    pen.dot(batches.keys, KEY_COLOUR, diameter)
    pen.dot(batches.selected, look.key_color, diameter)


DRAWN_SPACES = (
    (bpy.types.SpaceView3D, draw_paths, "POST_VIEW"),
    (bpy.types.SpaceDopeSheetEditor, follow_selection, "POST_PIXEL"),
    (bpy.types.SpaceGraphEditor, follow_selection, "POST_PIXEL"),
)
"""Editors, their draw callbacks, and the moment of the call."""

_complaint = ""
"""The last logged problem."""


def register() -> None:
    for drawing in DRAWN_SPACES:
        append_drawing(*drawing)


def unregister() -> None:
    for space, draw, _ in DRAWN_SPACES:
        remove_drawing(space, draw)
    _batches.clear()
    _dot_shader.cache_clear()
