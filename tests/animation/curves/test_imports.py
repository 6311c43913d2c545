"""The files of F-curves import one way, in the order in which the docstring of the folder has them."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from rigid_motion.animation import curves

FOLDER = Path(curves.__file__).parent
ORDER = ("keys", "easings", "solvers", "reading", "cycles", "spans", "grouping", "evaluation")


def test_every_file_has_its_place():
    assert {path.stem for path in FOLDER.glob("*.py")} == {"__init__", *ORDER}
    assert all(name in curves.__doc__ for name in ORDER)


@pytest.mark.parametrize("name", ORDER)
def test_a_file_imports_only_files_before_it(name):
    tree = ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8"))
    beside = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level == 1}
    assert beside <= set(ORDER[: ORDER.index(name)])
