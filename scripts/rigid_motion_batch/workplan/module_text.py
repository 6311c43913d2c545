"""The text of a module: what it imports, which files it names, and what a function in it refers to."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from rigid_motion_batch import places

Import = tuple[str, tuple[str, ...]]
"""A module, and the names that are taken from it; none where it is imported itself."""


@dataclass(frozen=True)
class Module:
    """What there is to know of a module."""

    imports: tuple[Import, ...]
    """What it imports, at once or later."""

    at_once: tuple[Import, ...]
    """What it imports when it is imported itself. Of a package that is imported on the way to a module in it there is
    no more: what its functions import, their callers ask for. That registers the extension."""

    places: tuple[str, ...]
    """The files and folders that it names from its own place, or from one of `places`; as that names them."""

    def as_json(self) -> list[Any]:
        return [self.imports, self.at_once, self.places]

    @classmethod
    def from_json(cls, content: list[Any]) -> Module:
        """The module of `as_json`. Raises ValueError, TypeError or LookupError where it is none."""
        imports, at_once, places = content
        return cls(
            *(tuple((str(b), tuple(map(str, n))) for b, n in some) for some in (imports, at_once)), tuple(places)
        )


def read_module(path: Path, name: str) -> Module:
    """Read a module of that name."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    at_once = (node for node in _statements(tree) if isinstance(node, ast.Import | ast.ImportFrom))
    return Module(
        imports_in([tree], path, name),
        _taken(at_once, path, name),
        tuple(_places(tree, path) if "__file__" in text or places.__name__ in text else ()),
    )


def own_text(path: Path, name: str, function: str) -> tuple[str, tuple[Import, ...]]:
    """The text of a function, and of what it refers to in its module, and what the module has to import for it.

    Nothing where there is no such function.
    """
    tree, lines = _parsed(path)
    reached = _reached(tree, function)
    at_once = [node for node in _statements(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    own = ("\n".join(lines[_first_line(node) - 1 : node.end_lineno]) for node in reached)
    return "\n".join(own), imports_in([*at_once, *reached], path, name)


@cache
def _parsed(path: Path) -> tuple[ast.Module, list[str]]:
    text = path.read_text(encoding="utf-8")
    return ast.parse(text), text.splitlines()


def packages_above(module: str) -> list[str]:
    """The packages that a module is in, which are imported before it."""
    parts = module.split(".")
    return [".".join(parts[:count]) for count in range(1, len(parts))]


# -- imports ----------------------------------------------------------------------------------------------------------


def imports_in(nodes: Iterable[ast.AST], path: Path, name: str) -> tuple[Import, ...]:
    """The imports in some nodes of a module, but for those that are for type checkers alone."""
    found, waiting = [], list(nodes)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            found.append(node)
        waiting += node.orelse if _is_for_types(node) else _inner_statements(node)
    return _taken(found, path, name)


def _taken(nodes: Iterable[ast.Import | ast.ImportFrom], path: Path, name: str) -> tuple[Import, ...]:
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found: list[Import] = []
    for node in nodes:
        if isinstance(node, ast.Import):
            found += [(alias.name, ()) for alias in node.names]
        else:
            above = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join(filter(None, [*above, node.module]))
            found.append((base, tuple(alias.name for alias in node.names)))
    return tuple(dict.fromkeys(found))


def _inner_statements(node: ast.AST) -> Iterator[ast.AST]:
    """The statements within one, and what holds some: expressions, which are by far the most nodes, have none."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        inner = getattr(node, part, ())
        yield from inner if isinstance(inner, list) else ()


def _is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _statements(tree: ast.Module) -> Iterator[ast.stmt]:
    """The statements that are carried out when a module is imported, those under conditions too."""
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, ast.stmt):
            yield node
        if isinstance(node, ast.If | ast.Try | ast.With | ast.ExceptHandler) and not _is_for_types(node):
            waiting += _inner_statements(node)


# -- a function in its module -----------------------------------------------------------------------------------------


def _reached(tree: ast.Module, function: str) -> list[ast.stmt]:
    """The statements that define a function and what it refers to, in their order."""
    defined: dict[str, list[ast.stmt]] = {}
    for node in _statements(tree):
        for name in _defined(node):
            defined.setdefault(name, []).append(node)
    reached: set[ast.stmt] = set()
    waiting = list(defined.get(function, ()))
    while waiting:
        node = waiting.pop()
        if node not in reached:
            reached.add(node)
            waiting += [other for name in _used(node) for other in defined.get(name, ())]
    return sorted(reached, key=_first_line)


def _used(node: ast.AST) -> set[str]:
    """The names that a node takes from around it; what a function calls by such a name itself is another thing."""
    used: set[str] = set()
    given: set[str] = set()
    for child in ast.iter_child_nodes(node):
        used |= _used(child)
        given |= {one.id for one in ast.walk(child) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
        given |= {one.arg for one in ast.walk(child) if isinstance(one, ast.arg)}
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
        used.add(node.id)
    return used - given if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) else used


def _defined(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [inner.id for target in targets for inner in ast.walk(target) if isinstance(inner, ast.Name)]


def _first_line(node: ast.stmt) -> int:
    return min((one.lineno for one in getattr(node, "decorator_list", ())), default=node.lineno)


# -- files that a module names ----------------------------------------------------------------------------------------


def _places(tree: ast.Module, path: Path) -> Iterator[str]:
    """The paths that a module names: `Path(__file__).parent / "page"`, `ASSETS / "models.blend"`."""
    known: dict[str, Path] = {}
    found: set[Path] = set()
    for node in _statements(tree):
        named = (_place(inner, path, known) for inner in ast.walk(node) if isinstance(inner, ast.BinOp))
        found |= {place for place in named if place}
        if isinstance(node, ast.ImportFrom) and node.module == places.__name__:
            taken = {alias.asname or alias.name: getattr(places, alias.name, None) for alias in node.names}
            known |= {name: place for name, place in taken.items() if isinstance(place, Path)}
        if isinstance(node, ast.Assign) and (place := _place(node.value, path, known)):
            known |= dict.fromkeys(_defined(node), place)
    for place in sorted(found):
        # What a longer path begins with is no file of its own to the module.
        if place.exists() and (name := places.name_of(place)) and not any(place in other.parents for other in found):
            yield name


def _place(node: ast.expr, path: Path, known: Mapping[str, Path]) -> Path | None:
    """The path that an expression stands for, where it is made of the module's own and of literals."""
    match node:
        case ast.Name(id=name):
            return known.get(name)
        case ast.Call(func=ast.Name(id="Path"), args=[ast.Name(id="__file__")]):
            return path
        case ast.Call(func=ast.Attribute(value=inner, attr="resolve"), args=[]):
            return _place(inner, path, known)
        case ast.Attribute(value=inner, attr="parent"):
            return place.parent if (place := _place(inner, path, known)) else None
        case ast.Subscript(value=ast.Attribute(value=inner, attr="parents"), slice=ast.Constant(value=int(number))):
            return place.parents[number] if (place := _place(inner, path, known)) else None
        case ast.BinOp(left=inner, op=ast.Div(), right=ast.Constant(value=str(name))):
            return place / name if (place := _place(inner, path, known)) else None
    return None
