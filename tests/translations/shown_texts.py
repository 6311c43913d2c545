"""Every text of the extension that a user sees, by the context in which Blender looks for its translation.

Texts of classes and properties are read from what Blender has registered; those that code draws, reports or raises,
from the code itself: what is marked with Blender's own functions, and the literals that Blender translates by itself.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import bpy
from bpy.app.translations import contexts

import rigid_motion
from rigid_motion import ui
from rigid_motion.animation import properties
from rigid_motion.ui.wording import LABELS, OWN_WORDS

PACKAGE = Path(rigid_motion.__file__).parent
FLOORS = ("animation", "live", "ui")
"""The packages that have texts. The core names its modes, which are enum items above, and its errors are for Python."""

Message = tuple[str, str]
"""Context and text, as in a dictionary of translations."""

DEFAULT, OF_OPERATORS = contexts.default, contexts.operator_default

MARKS = ("n_", "rpt_", "iface_", "tip_")
"""Blender's functions for texts that it cannot translate by itself, as this program imports them."""

DRAWN = {
    "label": ("text", DEFAULT),
    "prop": ("text", DEFAULT),
    "menu": ("text", DEFAULT),
    "operator": ("text", OF_OPERATORS),
    "operator_menu_enum": ("text", OF_OPERATORS),
    "invoke_props_dialog": ("confirm_text", DEFAULT),
}
"""Functions that translate a literal they are given: under which name, and its context."""

CLASSES = (*ui.CLASSES, *properties.CLASSES)


@cache
def messages() -> set[Message]:
    """All of them. The extension has to be registered."""
    result = {message for path in sources() for message in marked_or_drawn(parsed(path))}
    for cls in CLASSES:
        result |= set(of_class(cls))
        result |= set(of_properties(cls))
    result |= {(OWN_WORDS, label) for label in LABELS.values()}
    return {(context, text) for context, text in result if text}


def sources() -> list[Path]:
    """The files that may have texts in them."""
    return [path for floor in FLOORS for path in sorted((PACKAGE / floor).rglob("*.py"))]


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def of_class(cls: type) -> Iterator[Message]:
    """Label and description."""
    context = OF_OPERATORS if issubclass(cls, bpy.types.Operator) else DEFAULT
    yield vars(cls).get("bl_translation_context", context), getattr(cls, "bl_label", "")
    yield DEFAULT, getattr(cls, "bl_description", "")


def of_properties(cls: type) -> Iterator[Message]:
    """Names, descriptions and enum items of the properties that are not hidden."""
    stated: dict[bool, dict[str, object]] = {True: {}, False: {}}
    for base in cls.__mro__:
        stated[base.__module__.startswith(PACKAGE.name)].update(vars(base).get("__annotations__", {}))
    # What Blender's own bases bring, Blender translates.
    own = {name for name, kind in stated[True].items() if isinstance(kind, bpy.props._PropertyDeferred)} - {
        *stated[False]
    }
    rna = operator_type(cls) if issubclass(cls, bpy.types.Operator) else cls.bl_rna
    for prop in rna.properties:
        if prop.identifier not in own or prop.is_hidden:
            continue
        if prop.name != prop.identifier:
            yield prop.translation_context, prop.name
        yield DEFAULT, prop.description
        for item in prop.enum_items_static if prop.type == "ENUM" else ():
            yield prop.translation_context, item.name
            yield DEFAULT, item.description


def operator_type(cls: type) -> bpy.types.Struct:
    """What has the properties of an operator; the class itself has those that all operators have."""
    module, name = cls.bl_idname.split(".")
    return getattr(getattr(bpy.ops, module), name).get_rna_type()


def marked_or_drawn(tree: ast.AST) -> Iterator[Message]:
    """The literals that are marked, or given to what translates them."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = name_of(node)
        if name in MARKS and (text := literal(node.args[0])) is not None:
            yield OWN_WORDS if len(node.args) > 1 else DEFAULT, text
        elif name in DRAWN:
            keyword, context = DRAWN[name]
            for given in node.keywords:
                if given.arg == keyword and (text := literal(given.value)) is not None:
                    yield OWN_WORDS if any(other.arg == "text_ctxt" for other in node.keywords) else context, text
        elif name == "report" and (text := literal(node.args[1])) is not None:
            yield DEFAULT, text


def literal(node: ast.AST) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


OF_PROGRAMMERS = {"exception", "ValueError", "TypeError", "Ticking", "compile", "Shortcut"}
"""Functions whose texts go into the log, to callers from Python, or into Blender's keymaps and patterns."""


def sentences(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Every literal with words in it that may be shown, also as a part of an f-string: line and text.

    Docstrings, annotations and the texts of hidden properties are none.
    """
    left_out: list[ast.AST] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr):
            left_out.append(node.value)
        elif isinstance(node, ast.AnnAssign):
            left_out.append(node.annotation)
        elif isinstance(node, ast.Call):
            options = [ast.unparse(given.value) for given in node.keywords if given.arg == "options"]
            if name_of(node) in OF_PROGRAMMERS or any("HIDDEN" in given for given in options):
                left_out += ast.walk(node)
    hidden = set(map(id, left_out))
    for node in ast.walk(tree):
        text = literal(node)
        if text is not None and id(node) not in hidden and has_words(text):
            yield node.lineno, text


def name_of(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def has_words(text: str) -> bool:
    """Whether a text is more than a name in code: words with spaces between or around them."""
    return " " in text and any(character.isalpha() for character in text)


def texts_of(result: Iterable[Message]) -> set[str]:
    return {text for _, text in result}
