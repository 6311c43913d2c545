"""What reviewers of extensions.blender.org look for in a zip, as rules that say where it is not so.

Source: "Guidelines" and "Canned Responses" of the moderators, https://developer.blender.org/docs/features/extensions/,
and Blender's manual, "Creating Extensions". Each rule takes the files of a zip by their names, and yields complaints.
"""

from __future__ import annotations

import ast
import functools
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator
from pathlib import PurePosixPath

Files = dict[str, bytes]
Rule = Callable[[Files], Iterable[str]]

MANIFEST = "blender_manifest.toml"

OF_BLENDER = {
    *("addon_utils", "blf", "bpy", "bpy_extras", "gpu", "gpu_extras", "mathutils", "numpy", "rna_keymap_ui"),
}
"""Modules that come with Blender, beside Python's own."""

NETWORK = {"asyncio", "ftplib", "http", "imaplib", "requests", "smtplib", "socket", "socketserver", "ssl", "urllib"}
SOCKETS = "live/sockets.py"
"""What opens them."""

PROCESSES = {"concurrent", "ctypes", "multiprocessing", "pty", "signal", "subprocess", "_thread"}

STARTING = ("threading.Thread", "threading.Timer", "Thread", "Timer")
"""What starts a thread; a handler may ask which one it is called on."""
LOADING = {"ensurepip", "imp", "importlib", "pip", "pkgutil", "runpy", "site", "zipimport"}
FILES = {"fileinput", "glob", "io", "os", "pathlib", "pickle", "shelve", "shutil", "sqlite3", "tempfile"}
DEBUGGING = {"cProfile", "code", "debugpy", "faulthandler", "pdb", "profile", "trace", "tracemalloc"}

LEFT_BEHIND = {"__pycache__", ".git", ".DS_Store", "Thumbs.db", ".idea", ".vscode"}
"""Names of files and folders that tools leave."""

LEFT_OVER = (".pyc", ".pyo", ".blend1", ".blend2", ".blend@", ".orig", ".rej", ".bak", ".swp", ".log", ".whl", ".zip")

PAIRS = {
    "register_class": "unregister_class",
    "register_manual_map": "unregister_manual_map",
    "draw_handler_add": "draw_handler_remove",
    "append": "remove",
}
"""What Blender is given, and what takes it back. `append` counts on Blender's own types and handlers alone."""


@functools.cache
def parsed(content: bytes) -> ast.Module:
    return ast.parse(content)


def modules(files: Files) -> Iterator[tuple[str, ast.Module]]:
    for name, content in files.items():
        if name.endswith(".py"):
            yield name, parsed(content)


def nodes(files: Files, *kinds: type) -> Iterator[tuple[str, ast.AST]]:
    for name, tree in modules(files):
        for node in ast.walk(tree):
            if isinstance(node, kinds):
                yield name, node


def dotted(node: ast.AST) -> str:
    """A name with its attributes, "bpy.app.timers"; "" for what is no plain name."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        owner = dotted(node.value)
        return f"{owner}.{node.attr}" if owner else ""
    return ""


def called(files: Files) -> Iterator[tuple[str, ast.Call, str]]:
    for name, node in nodes(files, ast.Call):
        yield name, node, dotted(node.func) or getattr(node.func, "attr", "")


def imports(files: Files) -> Iterator[tuple[str, int, str]]:
    """The modules that are imported by absolute names: file, line, and the first part of the name."""
    for name, node in nodes(files, ast.Import, ast.ImportFrom):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield name, node.lineno, alias.name.partition(".")[0]
        elif node.level == 0:
            yield name, node.lineno, node.module.partition(".")[0]


def without(forbidden: set[str], files: Files) -> Iterator[str]:
    for name, line, module in imports(files):
        if module in forbidden:
            yield f"{name}:{line} imports {module}"


def network_in_one_module(files: Files) -> Iterable[str]:
    """Only one module has a way to the network, and it is nothing but UDP; it asks whether Blender may go online."""
    yield from without(NETWORK, {name: content for name, content in files.items() if name != SOCKETS})
    yield from without(NETWORK - {"socket"}, files)
    if SOCKETS in files and b"bpy.app.online_access" not in files[SOCKETS]:
        yield f"{SOCKETS} does not ask whether Blender may go online"


def no_processes_and_no_threads(files: Files) -> Iterator[str]:
    yield from without(PROCESSES, files)
    for name, node, function in called(files):
        if function in STARTING:
            yield f"{name}:{node.lineno} starts a thread"


def no_debug_code(files: Files) -> Iterator[str]:
    yield from without(DEBUGGING, files)
    for name, node, function in called(files):
        if function in ("breakpoint", "sys.exit", "exit", "quit"):
            yield f"{name}:{node.lineno} calls {function}"
    for name, node in nodes(files, ast.Compare):
        if dotted(node.left) == "__name__":
            yield f"{name}:{node.lineno} runs something of its own where it is started as a script"


def no_print(files: Files) -> Iterator[str]:
    for name, node, function in called(files):
        if function in ("print", "pprint", "sys.stdout.write", "sys.stderr.write", "traceback.print_exc"):
            yield f"{name}:{node.lineno} calls {function}"


def imports_are_relative(files: Files) -> Iterator[str]:
    for name, line, module in imports(files):
        if module not in sys.stdlib_module_names and module not in OF_BLENDER:
            yield f"{name}:{line} imports {module}, which neither Python nor Blender has"


def no_other_way_to_load_code(files: Files) -> Iterator[str]:
    yield from without(LOADING, files)
    for name, node in nodes(files, ast.Attribute):
        if dotted(node) in ("sys.path", "sys.modules", "sys.meta_path"):
            yield f"{name}:{node.lineno} uses {dotted(node)}"
    for name, node, function in called(files):
        if function in ("eval", "exec", "compile", "__import__", "bpy.utils.execfile"):
            yield f"{name}:{node.lineno} calls {function}"


def permissions_are_those_that_are_used(files: Files) -> Iterator[str]:
    """No file is read or written, so none has to be asked for; nor the clipboard, a camera or a microphone."""
    asked = set(tomllib.loads(files[MANIFEST].decode()).get("permissions", {}))
    used = set()
    for name, line, module in imports(files):
        if module in FILES:
            used.add(("files", f"{name}:{line} imports {module}"))
        if module in NETWORK:
            used.add(("network", f"{name}:{line} imports {module}"))
    for name, node, function in called(files):
        if function.rpartition(".")[2] in ("open", "read_text", "write_text", "write_bytes", "mkdir", "abspath"):
            used.add(("files", f"{name}:{node.lineno} calls {function}"))
    for name, node in nodes(files, ast.Attribute):
        if node.attr == "clipboard":
            used.add(("clipboard", f"{name}:{node.lineno} uses the clipboard"))
    for permission, where in sorted(used):
        if permission not in asked:
            yield f"{where}, without the permission for {permission}"
    for permission in sorted(asked - {permission for permission, _ in used}):
        yield f"the permission for {permission} is asked for, and not used"


def its_own_folder_is_left_alone(files: Files) -> Iterator[str]:
    for name, node in nodes(files, ast.Name):
        if node.id == "__file__":
            yield f"{name}:{node.lineno} uses __file__"


def named_by_its_package(files: Files) -> Iterator[str]:
    """Preferences go by the package, which has another name in each repository of extensions."""
    for name, node in nodes(files, ast.Name):
        if node.id == "__name__":
            yield f"{name}:{node.lineno} uses __name__, where extensions have __package__"
    for name, node in nodes(files, ast.ClassDef):
        if "bpy.types.AddonPreferences" in map(dotted, node.bases):
            for statement in node.body:
                own = isinstance(statement, ast.Assign) and dotted(statement.targets[0]) == "bl_idname"
                if own and isinstance(statement.value, ast.Constant):
                    yield f"{name}:{statement.lineno} writes out the bl_idname of the preferences"


def no_bl_info(files: Files) -> Iterator[str]:
    for name, node in nodes(files, ast.Name):
        if node.id == "bl_info":
            yield f"{name}:{node.lineno} has bl_info, which the manifest is for"


def no_use_of_data_while_imported(files: Files) -> Iterator[str]:
    """While extensions are switched on, Blender has neither a context nor data."""
    for name, tree in modules(files):
        for statement in tree.body:
            if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                continue
            for node in ast.walk(statement):
                if dotted(node).startswith(("bpy.context.", "bpy.data.", "bpy.ops.")):
                    yield f"{name}:{node.lineno} uses {dotted(node)} while it is imported"


def what_is_registered_is_unregistered(files: Files) -> Iterator[str]:
    for name, tree in modules(files):
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        if ("register" in functions) != ("unregister" in functions):
            yield f"{name} has one of register and unregister, and not the other"
        uses = [one for one in called({name: files[name]}) if is_of_blender(one[1], one[2])]
        found = {function.rpartition(".")[2] for _, _, function in uses}
        for there, back in PAIRS.items():
            if there in found and back not in found:
                yield f"{name} calls {there}, and never {back}"
        uses_of_app = {function for _, _, function in uses if function.startswith("bpy.app.")}
        for there in sorted(function for function in uses_of_app if function.endswith(".register")):
            if there.replace(".register", ".unregister") not in uses_of_app:
                yield f"{name} calls {there}, and never takes it back"
        types = [node for node in ast.walk(tree) if isinstance(node, ast.Assign | ast.Delete)]
        given, taken = (
            {dotted(target) for node in types if isinstance(node, kind) for target in node.targets}
            for kind in (ast.Assign, ast.Delete)
        )
        for target in sorted(given - taken):
            if target.startswith("bpy.types."):
                yield f"{name} sets {target}, and never deletes it"


def is_of_blender(node: ast.Call, function: str) -> bool:
    """Whether a call is on Blender's side; a list has `append` too."""
    if function.rpartition(".")[2] not in ("append", "remove"):
        return True
    owner = ast.unparse(node.func.value) if isinstance(node.func, ast.Attribute) else ""
    return "bpy.types" in owner or "bpy.app.handlers" in owner


def names_follow_blenders_rule(files: Files) -> Iterator[str]:
    """CATEGORY_XX_name: what others register is not replaced by accident."""
    identity = tomllib.loads(files[MANIFEST].decode())["id"]
    kinds = {"bpy.types.Operator": "OT", "bpy.types.Menu": "MT", "bpy.types.Panel": "PT", "bpy.types.UIList": "UL"}
    for name, node in nodes(files, ast.ClassDef):
        for base in map(dotted, node.bases):
            if base in kinds and not node.name.startswith(f"{identity.upper()}_{kinds[base]}_"):
                yield f"{name}:{node.lineno} names a {base.rpartition('.')[2]} {node.name}"
        if "bpy.types.Operator" in map(dotted, node.bases):
            for statement in node.body:
                if isinstance(statement, ast.Assign) and dotted(statement.targets[0]) == "bl_idname":
                    operator = ast.literal_eval(statement.value)
                    if not operator.startswith(f"{identity}."):
                        yield f"{name}:{statement.lineno} has the operator {operator}"


def code_is_in_english(files: Files) -> Iterator[str]:
    """Other letters are in translations alone, and in names of people."""
    people = ("Mørken",)
    for name, content in files.items():
        if "translations/" in name or not name.endswith(".py"):
            continue
        text = content.decode()
        for person in people:
            text = text.replace(person, "")
        for letter in sorted({letter for letter in text if letter.isalpha() and not letter.isascii()}):
            yield f"{name} has the letter {letter}"


def nothing_is_left_over(files: Files) -> Iterator[str]:
    for name in files:
        parts = PurePosixPath(name).parts
        if LEFT_BEHIND & set(parts) or any(part.startswith(".") for part in parts) or name.endswith(LEFT_OVER):
            yield f"{name} was left behind"
    if MANIFEST not in files:
        yield f"there is no {MANIFEST} at the top"
    if not any(PurePosixPath(name).stem == "LICENSE" for name in files):
        yield "there is no licence"


def the_manifest_is_as_the_site_wants_it(files: Files) -> Iterator[str]:
    manifest = tomllib.loads(files[MANIFEST].decode())
    tagline = manifest["tagline"]
    if len(tagline) > 64:
        yield f"the tagline has {len(tagline)} characters, of at most 64"
    if not tagline[-1].isalnum():
        yield f"the tagline ends with {tagline[-1]!r}"
    if not re.fullmatch(r"[^<>]+ <[^@<>\s]+@[^@<>\s]+\.[a-z]+>", manifest["maintainer"]):
        yield f"the maintainer is not given as Name <mail>: {manifest['maintainer']}"
    if not str(manifest.get("website", "")).startswith("https://"):
        yield "there is no website"
    if not all(re.fullmatch(r"SPDX:GPL-[23]\.0-or-later", licence) for licence in manifest["license"]):
        yield f"the licence is {manifest['license']}"
    if "Blender" in manifest["name"]:
        yield "the name has the trademark Blender in it"
    if not re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"]):
        yield f"the version is {manifest['version']}"


RULES: tuple[Rule, ...] = (
    network_in_one_module,
    no_processes_and_no_threads,
    no_debug_code,
    no_print,
    imports_are_relative,
    no_other_way_to_load_code,
    permissions_are_those_that_are_used,
    its_own_folder_is_left_alone,
    named_by_its_package,
    no_bl_info,
    no_use_of_data_while_imported,
    what_is_registered_is_unregistered,
    names_follow_blenders_rule,
    code_is_in_english,
    nothing_is_left_over,
    the_manifest_is_as_the_site_wants_it,
)
