"""Helpers for drawing motions in a plane: poses, the bar that represents a body, and SVG elements."""

from __future__ import annotations

from html import escape

import numpy as np

from rigid_motion.motion import Poses


def poses_of(points: np.ndarray, degrees: np.ndarray, sizes: np.ndarray | None = None) -> Poses:
    """Return poses in the plane of x and y at points (n, 2), turned by angles (n,)."""
    half = 0.5 * np.radians(degrees)
    turned = np.stack((np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)), axis=1)
    return Poses(np.column_stack((points, np.zeros(len(points)))), turned, sizes)


def bars(poses: Poses, half: float) -> np.ndarray:
    """Return both ends of bars along the bodies' y axes, `half` long to each side, shape (n, 2, 2)."""
    angles = 2.0 * np.arctan2(poses.quaternions[:, 3], poses.quaternions[:, 0])
    along = half * np.stack((-np.sin(angles), np.cos(angles)), axis=1)
    if poses.scales is not None:
        along = along * poses.scales[:, None]
    return np.stack([poses.positions[:, :2] + sign * along for sign in (-1.0, 1.0)], axis=1)


def polyline(points: np.ndarray) -> str:
    """Return a line through points (n, 2) in pixels, as the `d` attribute of an SVG path."""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def element(name: str, *content: str, **attributes: object) -> str:
    """Return an SVG element; `class_` and `text_anchor` become class and text-anchor."""
    named = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items()}
    written = "".join(f' {key}="{escape(str(value))}"' for key, value in named.items())
    return f"<{name}{written}>{''.join(content)}</{name}>"


def drawing(title: str, style: str, width: int, height: int, *content: str) -> str:
    """Return the text of an SVG file of this width and height in pixels."""
    about = element("title", escape(title)), element("style", style)
    size = {"viewBox": f"0 0 {width} {height}", "width": width, "height": height}
    return element("svg", *about, *content, xmlns="http://www.w3.org/2000/svg", **size, role="img") + "\n"
