"""Blender's Decimate of the Graph Editor, run as its users run it."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion import animation


def decimate(obj: bpy.types.Object, **options: object) -> None:
    """Decimate all keys of an object and its bones: `mode`, and `factor` or `remove_error_margin`.

    Raises
    ------
    RuntimeError
        Where Blender cannot: it has no window for its Graph Editor, or nothing in that to decimate.
    """
    for fcurve in animation.channelbag_of(obj).fcurves:
        fcurve.select = True
        fcurve.keyframe_points.foreach_set("select_control_point", np.ones(len(fcurve.keyframe_points), dtype=bool))
    window = next(iter(bpy.context.window_manager.windows), None)
    if window is None:
        raise RuntimeError("this Blender has no window for a Graph Editor")
    area = window.screen.areas[0]
    area.type = "GRAPH_EDITOR"
    area.spaces[0].dopesheet.show_only_selected = False
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.graph.decimate(**options)
