"""Tests of the whole checkout: one style, one version everywhere, release notes of tags, and layered imports."""

import ast
import itertools
import re
import runpy
import subprocess
import sys
import tomllib
from collections import defaultdict
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager

import rigid_motion

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "addon" / "rigid_motion"

BLENDER = {"bpy", "bpy_extras", "mathutils"}

FLOORS = {
    "motion": {"numpy"},
    "gltf": {"numpy"},
    "streams": {"numpy"},
    "animation": {"numpy", *BLENDER},
    "live": {"numpy", *BLENDER},
    "ui": {"numpy", *BLENDER, "addon_utils", "blf", "gpu", "gpu_extras", "rna_keymap_ui"},
    "translations": BLENDER,
}
"""The modules that each layer of the extension may import, besides the standard library and the layers below."""

GROUND = {"blender", "handlers"}
"""Modules below all layers, which import none of them."""


def imported(path: Path) -> set[str]:
    """Return the top-level names of all modules that a file imports, "." for its own package."""
    result = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            result |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            result.add("." * node.level + (node.module or "").split(".")[0])
    return result


@pytest.mark.once
@pytest.mark.parametrize("command", [["check"], ["format", "--check"]], ids=["lint", "format"])
def test_style(command):
    done = subprocess.run([sys.executable, "-m", "ruff", *command, str(ROOT)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_commits_are_checked_with_the_ruff_that_is_tested():
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]
    (pinned,) = (group for group in groups["test"] if group.startswith("ruff=="))
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    assert re.findall(r"ruff==[\d.]+", hooks) == [pinned] * 2


def test_one_version_everywhere():
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert ProjectMetadata(str(ROOT), PluginManager()).version == manifest["version"]
    assert rigid_motion.__version__ == manifest["version"]
    assert f"## {manifest['version']}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_blenders_that_are_tested_are_named_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    tested = project["tool"]["rigid-motion"]["blender"]
    installed = [f"bpy=={versions[0]}; python_version == '{python}'" for python, versions in tested.items()]
    extras = project["project"]["optional-dependencies"]
    assert extras["blender"] == [*installed, *extras["compare"]]
    workflow = (ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8")
    pairs = {(version, python) for python, versions in tested.items() for version in versions}
    assert {*re.findall(r'blender: "(.+?)", python: "(.+?)"', workflow)} == pairs
    newest = [*tested.values()][-1][0]
    assert re.findall(r'blender: "(.+?)", .*thorough', workflow) == [newest]
    for page in ("README.md", "CHANGELOG.md", "docs/index.md", "docs/animators.md"):
        named = re.search(
            r"Blender\S* (4\.5 LTS(?:,| or| and| LTS| [\d.]+)+)", (ROOT / page).read_text(encoding="utf-8")
        )[1]
        assert {*re.findall(r"\d+\.\d+", named)} == {version.rpartition(".")[0] for version, _ in pairs}, page


RELEASED = "# Changelog\n\n## 1.2.0 - 2026-12-01\n\n- New\n\n## 1.1.0 - 2026-11-01\n\n- Old\n"


@pytest.mark.parametrize(
    ("tag", "changelog", "said"),
    [
        ("v1.1.0", RELEASED, "has version 1.2.0: tag v1.2.0"),
        ("v1.2.0", RELEASED.replace("2026-12-01", "unreleased"), "## 1.2.0 - YYYY-MM-DD"),
        ("v1.2.0", RELEASED.replace("- New\n\n", ""), "## 1.2.0 - YYYY-MM-DD"),
    ],
    ids=["another version", "no day", "no entry"],
)
def test_a_tag_is_released_with_what_the_changelog_says_of_it_or_refused(tag, changelog, said):
    notes_of = runpy.run_path(str(ROOT / ".ci" / "release_notes.py"))["notes_of"]
    manifest = 'version = "1.2.0"'
    assert notes_of("v1.2.0", manifest, RELEASED) == "- New\n"
    with pytest.raises(ValueError, match=re.escape(said)):
        notes_of(tag, manifest, changelog)


@pytest.mark.parametrize("floor", FLOORS)
def test_the_extension_imports_downwards_and_nothing_else(floor):
    below = {*GROUND, *itertools.takewhile(lambda name: name != floor, FLOORS)}
    for path in (PACKAGE / floor).rglob("*.py"):
        # This number of dots is the layer itself; one more leads out of it.
        depth = len(path.relative_to(PACKAGE / floor).parts)
        for name in imported(path):
            known = name in FLOORS[floor] or name in sys.stdlib_module_names
            dots = len(name) - len(name.lstrip("."))
            inside = 1 <= dots <= depth
            lower = (dots == depth + 1 and name.lstrip(".") in below) or (name == ".." and floor == "ui")
            assert known or inside or lower, f"{path.relative_to(ROOT)} imports {name}"


ROOMS_OF_NUMBERS = {"fcurves", "evaluation"}
"""The packages of `animation` that need no Blender, like `motion`."""


@pytest.mark.once
def test_rooms_import_one_another_in_no_ring_and_those_of_numbers_need_no_blender():
    rooms = defaultdict(set)
    for path in (PACKAGE / "animation").glob("*/*.py"):
        others = {name for name in imported(path) if not re.fullmatch(r"\.\w*", name)} - sys.stdlib_module_names
        rooms[path.parent.name] |= {name[2:] for name in others if re.fullmatch(r"\.\.\w+", name)}
        if path.parent.name in ROOMS_OF_NUMBERS:
            assert others <= {"numpy", "...motion", *(f"..{room}" for room in ROOMS_OF_NUMBERS)}, path
    TopologicalSorter(rooms).prepare()


def is_numeric(value: ast.expr) -> bool:
    """Return whether an expression is a number, or an array or tuple of numbers, as far as its syntax tells."""
    calls = [ast.unparse(part.func) for part in ast.walk(value) if isinstance(part, ast.Call)]
    of_numbers = all(re.match(r"(np|math)\.|(float|int|len|max|min|range|round|tuple)$", call) for call in calls)
    others = ast.Subscript, ast.Dict, ast.JoinedStr, ast.comprehension
    numbers = [part.value for part in ast.walk(value) if isinstance(part, ast.Constant)]
    plain = all(isinstance(number, (int, float)) and not isinstance(number, bool) for number in numbers)
    return bool(numbers) and plain and of_numbers and not any(isinstance(part, others) for part in ast.walk(value))


@pytest.mark.once
def test_numbers_have_names_that_say_what_they_measure():
    single = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {name.id}"
        for folder in ("addon", "scripts")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value and is_numeric(node.value)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        for name in ast.walk(target)
        if isinstance(name, ast.Name) and name.id.isupper() and "_" not in name.id.strip("_")
    ]
    assert not single, "a number with a name of one word: say what it measures, and its unit"
