"""Tests of converting values to JSON and arrays, and back."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.pipeline import values


@dataclass(frozen=True)
class Shape:
    name: str


@dataclass(frozen=True)
class Circle(Shape):
    radius: float = 1.0


@dataclass(frozen=True)
class Square(Shape):
    side: int = 1


@dataclass(frozen=True, eq=False)
class Drawing:
    shapes: tuple[Shape, ...]
    points: np.ndarray
    weights: dict[str, np.ndarray]
    best: Circle | Square | None
    pair: tuple[int, Circle]
    number: float = 2.0
    either: str | tuple[str, ...] = "all"
    counted: int = field(init=False, default=3)


DRAWING = Drawing(
    shapes=(Circle("a", 0.1), Square("b", 3)),
    points=np.arange(6.0).reshape(2, 3),
    weights={"x": np.array([True, False]), "y": np.zeros((0, 2))},
    best=Square("c"),
    pair=(4, Circle("d")),
    number=1e-17,
    either=("x", "y"),
)


def test_a_value_is_read_as_it_was_written(tmp_path: Path) -> None:
    values.write(tmp_path / "drawing", DRAWING)
    read = values.read(Drawing, tmp_path / "drawing")
    for name in ("shapes", "best", "pair", "number", "either"):
        assert getattr(read, name) == getattr(DRAWING, name)
    np.testing.assert_array_equal(read.points, DRAWING.points)
    assert read.points.dtype == DRAWING.points.dtype
    assert {name: array.shape for name, array in read.weights.items()} == {"x": (2,), "y": (0, 2)}
    assert read.weights["x"].dtype == bool


def test_without_arrays_there_is_one_file(tmp_path: Path) -> None:
    values.write(tmp_path / "circle", Circle("a"))
    assert [path.name for path in tmp_path.iterdir()] == ["circle.json"]
    assert values.read(Shape, tmp_path / "circle") == Circle("a")


def test_a_class_of_another_kind_is_refused(tmp_path: Path) -> None:
    values.write(tmp_path / "circle", Circle("a"))
    with pytest.raises(ValueError, match="Circle is no Square"):
        values.read(Square, tmp_path / "circle")


@pytest.mark.parametrize("name", ["os:system", "pathlib:Path", "nowhere:Circle", "Circle"])
def test_what_is_no_class_of_values_is_not_made(tmp_path: Path, name: str) -> None:
    (tmp_path / "value.json").write_text(json.dumps({"$": name}))
    with pytest.raises(ValueError, match="is not a class of values"):
        values.read(Shape, tmp_path / "value")


def test_what_is_no_value_is_refused() -> None:
    with pytest.raises(TypeError, match="object is not a value"):
        values.plain(object())
    with pytest.raises(TypeError, match="ndarray is not a value"):
        values.plain(np.zeros(2))


def test_numbers_of_numpy_become_those_of_python() -> None:
    assert json.dumps([np.float64(0.5), np.int64(3), np.bool_(True)], default=values.plain) == "[0.5, 3, true]"
