"""The figure of the shell error shows what the program measures."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from research.paper import shell
from research.paper.table import RADIUS
from rigid_motion.motion import shell_error

SVG = "{http://www.w3.org/2000/svg}"


def lines(name: str) -> list[np.ndarray]:
    """The ends of the lines of a class, shape (2, 2), in pixels."""
    drawn = ElementTree.fromstring(shell.draw()).iter(f"{SVG}line")
    ends = ("x1", "y1", "x2", "y2")
    return [np.array([float(one.get(end)) for end in ends]).reshape(2, 2) for one in drawn if one.get("class") == name]


def length(line: np.ndarray) -> float:
    return float(np.linalg.norm(line[1] - line[0])) / shell.SCALE


def test_the_red_line_is_as_long_as_the_shell_error():
    (farthest,) = lines("farthest")
    recorded, shown = shell.poses()
    assert length(farthest) == pytest.approx(shell_error(shown, recorded, RADIUS)[0], abs=2e-4)


def test_no_other_point_of_the_shell_is_off_by_more():
    ways = [length(way) for way in lines("way")]
    assert len(ways) == shell.POINTS
    assert max(ways) <= shell.error() + 2e-4
    assert min(ways) < 0.5 * shell.error()


def test_it_says_the_numbers_that_it_shows(monkeypatch: pytest.MonkeyPatch):
    words = "".join(ElementTree.fromstring(shell.draw()).itertext())
    assert f"the most, {1e3 * shell.error():.0f} mm" in words
    monkeypatch.setattr(shell, "OFFSET", 2.0 * shell.OFFSET)
    assert f"its origin, {2e3 * np.hypot(0.042, 0.014):.0f} mm" in shell.draw()


def test_all_of_it_is_within_the_drawing_and_nothing_from_elsewhere():
    drawing = shell.draw()
    root = ElementTree.fromstring(drawing)
    for text in root.iter(f"{SVG}text"):
        # Letters of 15 are less than 8 wide on average, in a wide typeface too.
        assert float(text.get("x")) + 8.0 * len("".join(text.itertext())) <= shell.WIDTH
    for circle in root.iter(f"{SVG}circle"):
        x, y, r = (float(circle.get(name)) for name in ("cx", "cy", "r"))
        assert r <= min(x, y, shell.HEIGHT - y)
    assert "prefers-color-scheme:dark" in drawing
    assert "<script" not in drawing
    assert "href" not in drawing
