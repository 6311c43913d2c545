"""Tests of the zip against the rules of reviewers of extensions.blender.org.

Source: "Guidelines" and "Canned Responses" of the moderators, https://developer.blender.org/docs/features/extensions/,
and Blender's manual, "Creating Extensions".
"""

import ast
import re
import sys
import tomllib
import zipfile

import pytest

from rigid_motion_batch.places import MANIFEST

pytestmark = pytest.mark.any_blender

LARGEST = 1_000_000
"""The largest size in bytes: the zip contains only code."""

OF_BLENDER = {*("addon_utils", "blf", "bpy", "bpy_extras", "gpu", "gpu_extras", "mathutils", "numpy", "rna_keymap_ui")}
"""Modules that come with Blender, besides Python's own."""

UNWANTED = {
    *("asyncio", "ftplib", "http", "imaplib", "requests", "smtplib", "socketserver", "ssl", "urllib"),
    *("concurrent", "ctypes", "multiprocessing", "pty", "signal", "subprocess", "_thread"),
    *("ensurepip", "imp", "importlib", "pip", "pkgutil", "runpy", "site", "zipimport"),
    *("cProfile", "code", "debugpy", "faulthandler", "pdb", "profile", "trace", "tracemalloc"),
}
"""Python's own modules for networks, processes, loading code, and debugging."""

FORBIDDEN = {
    "starts a thread": r"\bThread\(|\bTimer\(",
    "ends or halts Blender": r"\b(breakpoint|exit|quit)\(",
    "prints": r"(?<![.\w])p?print\(|\bsys\.std(out|err)\b|\bprint_exc\(",
    "loads other code": r"\bsys\.(path|modules|meta_path)\b|(?<![.\w])(eval|exec|compile|__import__)\(",
    "uses its own folder": r"\b__file__\b",
    "uses the clipboard": r"\.clipboard\b",
    "is named by something else than its package": r"(?<!\.)\b__name__\b|\bbl_info\b",
    "has letters that are not English": r"[^\W\d_a-zA-Z]",
}
"""Problem to a pattern that finds it in code, outside of strings."""

KINDS = {"Operator": "OT", "Menu": "MT", "Panel": "PT", "UIList": "UL"}
"""Infixes of class names by base class, which avoid replacing classes of others by accident."""

PAIRS = {
    "register_class(": "unregister_class(",
    "timers.register(": "timers.unregister(",
    "translations.register(": "translations.unregister(",
    "draw_handler_add(": "draw_handler_remove(",
    "def register(": "def unregister(",
}
"""Calls that register something in Blender, and the calls in the same module that undo them."""


@pytest.fixture(scope="module")
def files(extension_zip) -> dict[str, str]:
    with zipfile.ZipFile(extension_zip) as package:
        return {name: package.read(name).decode() for name in package.namelist()}


def may_be_imported(module: str) -> bool:
    if module in ("importlib.resources", "urllib.parse"):  # files of a package, not code; words, no network
        return True
    module = module.partition(".")[0]
    return module in OF_BLENDER or (module in sys.stdlib_module_names and module not in UNWANTED)


def complaints(content: str) -> list[str]:
    """Return the problems for which a reviewer would send back a module."""
    tree, result = ast.parse(content), []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            result += [f"imports {alias.name}" for alias in node.names if not may_be_imported(alias.name)]
        elif isinstance(node, ast.ImportFrom) and not node.level and not may_be_imported(node.module):
            result.append(f"imports {node.module}")
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
        elif isinstance(node, ast.ClassDef):
            kinds = re.findall(r"\b(Operator|Menu|Panel|UIList)\b", ast.unparse(node).partition(":")[0])
            starts = [f"RIGID_MOTION_{KINDS[kind]}_" for kind in kinds] or [
                f"RIGID_MOTION_{k}_" for k in KINDS.values()
            ]
            # Classes that are private or lack a label are bases, which are not registered; lists have no label.
            is_given = "UIList" in kinds or "bl_label =" in ast.unparse(node)
            if is_given and not node.name.startswith((*starts, "_")):
                result.append(f"names {node.name}")
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef | ast.ClassDef) and "bpy.context" in ast.unparse(node):
            result.append("uses the context while it is imported")
    code = ast.unparse(tree)
    result += [what for what, pattern in FORBIDDEN.items() if re.search(pattern, code)]
    result += [f"{there} is never taken back" for there, back in PAIRS.items() if there in code and back not in code]
    return result


def test_no_module_would_be_sent_back(files):
    for name, text in files.items():
        assert not name.endswith(".py") or not complaints(text), name
    assert [name for name, text in files.items() if "import socket" in text] == ["live/sockets.py"]
    assert "bpy.app.online_access" in files["live/sockets.py"]


def test_the_manifest_is_as_the_site_wants_it(files, extension_zip):
    manifest = tomllib.loads(files[MANIFEST.name])
    assert len(manifest["tagline"]) <= 64
    assert manifest["tagline"][-1].isalnum()
    assert re.fullmatch(r"[^<>]+ <[^@<>\s]+@[^@<>\s]+\.[a-z]+>", manifest["maintainer"])
    assert manifest["website"].startswith("https://")
    assert all(re.fullmatch(r"SPDX:GPL-[23]\.0-or-later", licence) for licence in manifest["license"])
    assert "Blender" not in manifest["name"]
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])
    assert set(manifest["permissions"]) == {"files", "network"}
    assert extension_zip.stat().st_size < LARGEST
