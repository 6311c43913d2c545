"""Poses of cameras that photogrammetry and SLAM find: COLMAP's images.txt and g2o's graphs.

Neither has times: they are numbers of images or vertices, and need a rate. COLMAP has two lines for each image, in any
order, and the world as the camera sees it: its pose is the inverse of that. Cameras look along z, with x to the right
and y down; the axes of the world may be any, and mostly are those of a camera, too. Its unit of length is any.
Sources: https://colmap.github.io/format.html#images-txt, https://github.com/RainerKuemmerle/g2o/wiki/File-Format-SLAM-3D.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from .options import ReadingOptions
from .recordings import Selection, Trajectory
from .tables import HeaderLine, is_number
from .tracks import read_below

COLMAP = ["frame", "device", "qw", "qx", "qy", "qz", "x", "y", "z"]

VERTEX = "VERTEX_SE3:QUAT"

G2O = ["", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"]


def recognises_images(head: list[str]) -> bool:
    """Return whether this is COLMAP's images.txt: by its comments, or by its first image and the points in it."""
    rows = [line for line in head if not line.startswith("#")]
    return any("POINTS2D[]" in line for line in head) or bool(rows and _image(rows[0]))


def read_images(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the cameras of COLMAP's images.txt. Of images in folders, each folder is a body."""
    remark = "poses of the world were turned into those of the camera; COLMAP's unit of length may be any (--scale)"
    header = HeaderLine(path, 0, "\t", COLMAP, rows=_images, inverted=True, axes="opencv", remark=remark, shift=1)
    return read_below(selection, options, header, "name the folder of each camera's images in front of their names")


def _images(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yield a row for each image in the order of their names: the last number in it, its folder, and the pose."""
    images = [(number, cells) for number, line in lines if (cells := _image(line))]
    for place, (number, cells) in enumerate(sorted(images, key=lambda image: in_order(image[1][-1]))):
        yield number, "\t".join([number_in(cells[-1], place), cells[-1].rpartition("/")[0], *cells[1:8]])


def _image(line: str) -> list[str] | None:
    """Return the cells of the first line of an image: a number, a quaternion and a position, a camera, and a name.

    None for any other, such as that of its points, which are numbers to its end.
    """
    cells = line.split(maxsplit=9)
    numbers = len(cells) == 10 and cells[0].isdecimal() and cells[8].isdecimal() and all(map(is_number, cells[1:8]))
    return cells if numbers and not is_number(cells[9].split()[-1]) else None


def in_order(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts names as people do: 9 before 10."""
    return [(int(part or 0), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d{1,18})", name)]


def number_in(name: str, otherwise: int) -> str:
    """Return the last number in the name of an image, or another."""
    file = name.rpartition("/")[2]
    numbers = re.findall(r"\d{1,15}", file.rpartition(".")[0] or file)
    return numbers[-1] if numbers else str(otherwise)


def recognises_graph(head: list[str]) -> bool:
    """Return whether this is a graph of g2o, which has a word in front of every row."""
    return any(line.startswith((VERTEX, "EDGE_SE3:QUAT")) for line in head)


def read_graph(path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    """Read the vertices of a graph, as they are numbered."""
    header = HeaderLine(path, 0, None, G2O, rows=_vertices, advice="export the vertices, too")
    return read_below(selection, options, header, "write a file for each")


def _vertices(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    rows = [(number, line) for number, line in lines if line.startswith(VERTEX)]
    return iter(sorted(rows, key=lambda row: in_order((*row[1].split(maxsplit=2), "", "")[1])))
