"""Places in a Blender window: of areas, regions, keys in the Dope Sheet, and points of the scene.

A place is x, y in pixels from the lower left corner of the window, as in Blender's mouse events. A box is the place of
its lower left corner, width and height. Types are Blender's own: `Area.type` ("VIEW_3D"), `Region.type` ("WINDOW",
"HEADER", "UI").
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d

Place = tuple[int, int]
Box = tuple[int, int, int, int]

REDO_ROWS = 44
"""Pixels from the top of the redo panel to the middle of its first row."""

REDO_ROW = 22
"""Pixels from one row of the redo panel to the next."""


def area(window: bpy.types.Window, kind: str) -> bpy.types.Area:
    """Return the largest area of this type, for example "VIEW_3D"."""
    result = [item for item in window.screen.areas if item.type == kind]
    if not result:
        raise LookupError(f"no {kind} in the window, only {', '.join(item.type for item in window.screen.areas)}")
    return max(result, key=lambda item: item.width * item.height)


def region(area: bpy.types.Area, kind: str = "WINDOW") -> bpy.types.Region:
    """Return the region of this type in an area; it has to be open."""
    result = next((item for item in area.regions if item.type == kind), None)
    if result is None or min(result.width, result.height) <= 1:
        raise LookupError(f"the {kind} region of the {area.type} is not open")
    return result


def centre(part: bpy.types.Area | bpy.types.Region) -> Place:
    """Return the centre of an area or a region."""
    return part.x + part.width // 2, part.y + part.height // 2


def box(part: bpy.types.Area | bpy.types.Region) -> Box:
    """Return the box of an area or a region."""
    return part.x, part.y, part.width, part.height


def redo_row(redo: bpy.types.Region, number: int, across: float = 0.75) -> Place:
    """Return the place of a row of an unfolded redo panel, from 0, at a fraction of its width."""
    return redo.x + int(across * redo.width), redo.y + redo.height - REDO_ROWS - number * REDO_ROW


def box_around(place: Place, width: int, height: int) -> Box:
    """Return a box of this size around a place."""
    x, y = place
    return x - width // 2, y - height // 2, width, height


def key(area: bpy.types.Area, frame: float, row: int = 0) -> Place:
    """Return the place of a key in a Dope Sheet: in the summary (row 0), or in the row of a channel below it."""
    scale = bpy.context.preferences.system.ui_scale
    # Blender's anim_channels_defines: rows 0.8 widgets high, 0.1 widgets apart, below the frame numbers.
    widget, time_strip = 20 * scale, 23 * scale
    view_y = -time_strip - 0.1 * widget - (row + 0.5) * 0.9 * widget
    window_region = region(area)
    x, y = window_region.view2d.view_to_region(frame, view_y, clip=False)
    return _inside(window_region, x, y, f"frame {frame}, row {row}")


def playhead(area: bpy.types.Area, frame: float) -> Place:
    """Return the place of a frame number at the top of a Dope Sheet, where a click moves the playhead."""
    window_region = region(area)
    x, _ = window_region.view2d.view_to_region(frame, 0, clip=False)
    strip = 23 * bpy.context.preferences.system.ui_scale
    return _inside(window_region, x, window_region.height - strip / 2, f"frame {frame}")


def point(area: bpy.types.Area, location: Sequence[float]) -> Place:
    """Return the place of a point of the scene in a 3D View."""
    window_region = region(area)
    seen = location_3d_to_region_2d(window_region, area.spaces.active.region_3d, location)
    if seen is None:
        raise LookupError(f"the point {tuple(location)} is behind the viewer")
    return _inside(window_region, *seen, f"the point {tuple(location)}")


def _inside(part: bpy.types.Region, x: float, y: float, name: str) -> Place:
    if not (0 <= x < part.width and 0 <= y < part.height):
        raise LookupError(f"{name} is out of sight, at {x:.0f}, {y:.0f} of {part.width} x {part.height}")
    return part.x + round(x), part.y + round(y)
