"""Rooms of `rigid_motion.animation`, and modules in them, import only what their docstrings list above them."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from rigid_motion import animation

HOUSE = Path(animation.__file__).parent
OF_NUMBERS = {"fcurves", "evaluation"}
"""The rooms that need no Blender, as `rigid_motion.motion` does not."""

BLENDERS = {"bpy", "bpy_extras", "mathutils"}


def listed(folder: Path) -> list[str]:
    """The names in the order of the table in the docstring of a folder."""
    docstring = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8")))
    return re.findall(r"^(\w+)  ", docstring, re.MULTILINE)


def imports_of(path: Path, level: int) -> set[str]:
    """What a file imports from so many folders up, by the first name below that folder; from anywhere for 0."""
    result = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, (ast.Import, ast.ImportFrom)) and getattr(node, "level", 0) == level:
            module = getattr(node, "module", None)
            result |= {name.split(".")[0] for name in ([module] if module else [alias.name for alias in node.names])}
    return result


FOLDERS = [HOUSE, *sorted(path.parent for path in HOUSE.glob("*/__init__.py"))]
FILES = [path for folder in FOLDERS[1:] for path in sorted(folder.glob("*.py"))]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_the_docstring_of_a_folder_lists_all_that_is_in_it(folder):
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    expected = modules | {path.parent.name for path in folder.glob("*/__init__.py")}
    assert sorted(listed(folder)) == sorted(expected)


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_module_imports_only_rooms_and_modules_above_it(path):
    room, rooms, modules = path.parent.name, listed(HOUSE), listed(path.parent)
    assert imports_of(path, 2) <= set(rooms[: rooms.index(room)])
    if path.stem != "__init__":
        assert imports_of(path, 1) <= set(modules[: modules.index(path.stem)])
    if room in OF_NUMBERS:
        assert imports_of(path, 2) <= OF_NUMBERS
        assert not imports_of(path, 0) & BLENDERS
        assert imports_of(path, 3) <= {"motion"}


GUESSED = re.compile(
    r"\b(?:if|not|and|or) [\w.]+\.prefix(?: and| or| else|[:)\]]|$)|\.prefix (?:if|and|or)\b", re.MULTILINE
)
"""A prefix that is tested for being there."""


@pytest.mark.parametrize("path", [*FILES, *sorted((HOUSE.parent / "ui").rglob("*.py"))], ids=lambda path: path.stem)
def test_kinds_are_asked_and_not_guessed(path):
    assert GUESSED.findall(path.read_text(encoding="utf-8")) == []
