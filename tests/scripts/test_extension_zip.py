"""Tests of the zip that users install: contents, rules of extensions.blender.org, installation, use and removal.

Source of the rules: "Guidelines" and "Canned Responses" of the moderators,
https://developer.blender.org/docs/features/extensions/, and Blender's manual, "Creating Extensions".
"""

import ast
import json
import re
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from rigid_motion_batch.cli import build_extension
from rigid_motion_batch.places import EXTENSION, LICENSE, MANIFEST
from tests.scripts.processes import run_python

LIFE_OF_AN_EXTENSION = """
import importlib, json, pkgutil, sys
import bpy

MODULE = "bl_ext.user_default.rigid_motion"
extensions, preferences = bpy.ops.extensions, bpy.context.preferences


def traces():
    # What an extension can leave behind in Blender: classes, properties of its own, handlers, timers and modules.
    lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
    handlers = [str(handler) for one in lists if isinstance(one, list) for handler in one]
    own = [name for kind in (bpy.types.Object, bpy.types.Action, bpy.types.Scene, bpy.types.WindowManager)
           for name in dir(kind)]
    return sorted([*dir(bpy.types), *own, *handlers])


extensions.package_install_files(filepath=sys.argv[1], repo="user_default", enable_on_install=True)
bpy.ops.preferences.addon_disable(module=MODULE)
before = traces()
bpy.ops.preferences.addon_enable(module=MODULE)
package = sys.modules[MODULE]
modules = [importlib.import_module(found.name) for found in pkgutil.walk_packages(package.__path__, MODULE + ".")]
seen = {
    "enabled": MODULE in preferences.addons,
    "files": [package.__file__, *(module.__file__ for module in modules)],
    "from the checkout": [name for name in sys.modules if name.split(".")[0] in ("rigid_motion", "rigid_motion_batch")],
}
bpy.ops.preferences.addon_disable(module=MODULE)
seen["disabled"] = MODULE not in preferences.addons
seen["left behind"] = sorted(set(traces()) - set(before))
bpy.ops.preferences.addon_enable(module=MODULE)
repositories = [repository.module for repository in preferences.extensions.repos]
extensions.package_uninstall(repo_index=repositories.index("user_default"), pkg_id="rigid_motion")
seen["uninstalled"] = MODULE not in preferences.addons
print(json.dumps(seen))
"""


def test_the_zip_holds_the_modules_the_manifest_and_the_licence_as_they_are_and_nothing_else(extension_zip):
    sources = {path.name: path for path in (MANIFEST, LICENSE)}
    for kind in ("*.py", "*.po", "*.json"):
        sources |= {path.relative_to(EXTENSION).as_posix(): path for path in EXTENSION.rglob(kind)}
    with zipfile.ZipFile(extension_zip) as package:
        assert sorted(package.namelist()) == sorted(sources)
        for name, source in sources.items():
            assert package.read(name) == source.read_bytes(), name


def test_what_blender_refuses_is_reported_in_its_words_and_the_old_zip_stays(tmp_path, monkeypatch, capsys):
    package, manifest = tmp_path / "package", tmp_path / "blender_manifest.toml"
    package.mkdir()
    (package / "__init__.py").touch()
    manifest.write_text('schema_version = "1.0.0"\nid = "rigid_motion"\n')
    old = tmp_path / "dist" / "rigid_motion-0.1.0.zip"
    old.parent.mkdir()
    old.write_text("old")
    monkeypatch.setattr(build_extension, "EXTENSION", package)
    monkeypatch.setattr(build_extension, "OTHER_FILES", (manifest, LICENSE))
    assert build_extension.main(["--output", str(old.parent)]) == 2
    assert 'missing "tagline"' in capsys.readouterr().err
    assert {path.name: path.read_text() for path in old.parent.iterdir()} == {old.name: "old"}


def test_it_installs_enables_disables_and_uninstalls_without_a_word_of_complaint(extension_zip, files, tmp_path):
    script = tmp_path / "life.py"
    script.write_text(LIFE_OF_AN_EXTENSION, encoding="utf-8")
    user = tmp_path / "user"
    done = run_python(script, extension_zip, BLENDER_USER_RESOURCES=str(user))
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    seen = json.loads(done.stdout.strip().splitlines()[-1])
    installed = user / "extensions" / "user_default" / "rigid_motion"
    assert {Path(file).relative_to(installed).as_posix() for file in seen.pop("files")} == {
        name for name in files if name.endswith(".py")
    }
    assert not installed.exists()
    nothing = {"left behind": [], "from the checkout": []}
    assert seen == {"enabled": True, "disabled": True, "uninstalled": True, **nothing}


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


@pytest.mark.any_blender
def test_no_module_would_be_sent_back(files):
    for name, text in files.items():
        assert not name.endswith(".py") or not complaints(text), name
    assert [name for name, text in files.items() if "import socket" in text] == ["live/sockets.py"]
    assert "bpy.app.online_access" in files["live/sockets.py"]


@pytest.mark.any_blender
def test_the_manifest_is_as_the_site_wants_it(files, extension_zip):
    manifest = tomllib.loads(files[MANIFEST.name])
    assert len(manifest["tagline"]) <= 64
    assert manifest["tagline"][-1].isalnum()
    assert re.fullmatch(r"[^<>]+ <[^@<>\s]+@[^@<>\s]+\.[a-z]+>", manifest["maintainer"])
    assert manifest["website"].startswith("https://")
    assert all(re.fullmatch(r"SPDX:GPL-[23]\.0-or-later", licence) for licence in manifest["license"])
    assert "Blender" not in manifest["name"]
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])
    assert extension_zip.name == f"rigid_motion-{manifest['version']}.zip"
    assert set(manifest["permissions"]) == {"files", "network"}
    assert extension_zip.stat().st_size < LARGEST
