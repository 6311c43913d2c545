"""Rooms of `rigid_motion.animation`, and modules in them, import only what their docstrings list above them."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion import animation
from rigid_motion.animation.transforms import Transform

HOUSE = Path(animation.__file__).parent
OUTSIDE = {"handlers"}
"""What belongs to no room."""

OF_NUMBERS = ("fcurves", "evaluation")
"""The rooms that need no Blender."""

WITHOUT_BLENDER = """
import importlib, sys, types
for name in ("bpy", "bpy_extras", "mathutils"):
    sys.modules[name] = None
house = types.ModuleType("rigid_motion.animation")
house.__path__ = [sys.argv[1]]
sys.modules[house.__name__] = house
for module in sys.argv[2:]:
    importlib.import_module(f"rigid_motion.animation.{module}")
"""
"""Imports modules past the `__init__` of the house, which needs Blender."""


def docstring_of(folder: Path) -> str:
    return ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8")))


def names_in(folder: Path) -> set[str]:
    """The modules and packages in a folder, and not the folder's own file."""
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    return modules | {path.parent.name for path in folder.glob("*/__init__.py")}


def listed(folder: Path) -> list[str]:
    """The names in the order of the table in the docstring of a folder."""
    first_words = (line.split("  ")[0] for line in docstring_of(folder).splitlines() if "  " in line)
    return [word for word in first_words if word]


def imports_of(path: Path, level: int) -> set[str]:
    """What a file imports from so many folders up, by the first name below that folder."""
    result = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == level:
            result |= {node.module.split(".")[0]} if node.module else {alias.name for alias in node.names}
    return result


FOLDERS = [HOUSE, *sorted(path.parent for path in HOUSE.glob("*/__init__.py"))]
FILES = [path for folder in FOLDERS[1:] for path in sorted(folder.glob("*.py"))]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_the_docstring_of_a_folder_lists_all_that_is_in_it(folder):
    expected = names_in(folder) - (OUTSIDE if folder == HOUSE else set())
    assert sorted(listed(folder)) == sorted(expected)


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_module_imports_only_rooms_and_modules_above_it(path):
    rooms, modules = listed(HOUSE), listed(path.parent)
    assert imports_of(path, 2) <= {*rooms[: rooms.index(path.parent.name)], *OUTSIDE}
    if path.stem != "__init__":
        assert imports_of(path, 1) <= set(modules[: modules.index(path.stem)])


@pytest.mark.parametrize("name", sorted(OUTSIDE))
def test_what_belongs_to_no_room_imports_none(name):
    assert not imports_of(HOUSE / f"{name}.py", 1)


@pytest.mark.parametrize("room", OF_NUMBERS)
def test_rooms_of_numbers_need_no_blender(room):
    modules = [f"{room}.{module}" for module in listed(HOUSE / room)]
    command = [sys.executable, "-c", WITHOUT_BLENDER, str(HOUSE), *modules]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def guesses(path: Path) -> list[int]:
    """The lines where a file guesses a kind: it tests a prefix for being there, or asks for the class of a kind."""
    result = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.If | ast.IfExp):
            tested = [node.test]
        elif isinstance(node, ast.comprehension):
            tested = node.ifs
        elif isinstance(node, ast.BoolOp):
            tested = node.values
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            tested = [node.operand]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
            names = {name.id for name in ast.walk(node.args[1]) if isinstance(name, ast.Name)}
            result += [node.lineno] if names & {kind.__name__ for kind in Transform.__subclasses__()} else []
            continue
        else:
            continue
        result += [test.lineno for test in tested if isinstance(test, ast.Attribute) and test.attr == "prefix"]
    return sorted(set(result))


@pytest.mark.parametrize("path", [*FILES, *sorted((HOUSE.parent / "ui").rglob("*.py"))], ids=lambda path: path.stem)
def test_kinds_are_asked_and_not_guessed(path):
    assert guesses(path) == []
