"""The zip, by what reviewers of extensions.blender.org send back; and each of those rules, by a zip that breaks it."""

from __future__ import annotations

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import bpy
import pytest

from rigid_motion_batch.places import MANIFEST
from tests.scripts import listing_rules
from tests.scripts.listing_rules import RULES, Files

SCRIPTS = Path(bpy.utils.system_resource("SCRIPTS"))

LARGEST = 1_000_000
"""Bytes: it is code, and no more."""


@pytest.fixture(scope="module")
def files(extension_zip) -> Files:
    with zipfile.ZipFile(extension_zip) as package:
        return {name: package.read(name) for name in package.namelist()}


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_zip_keeps_the_rule(rule, files):
    assert list(rule(files)) == []


BROKEN = [
    ("network_in_one_module", "import urllib.request"),
    ("network_in_one_module", "def fetch():\n    from http import client"),
    ("network_in_one_module", "import socket"),
    ("no_processes_and_no_threads", "import threading\nthreading.Thread(target=print).start()"),
    ("no_processes_and_no_threads", "from subprocess import run"),
    ("no_debug_code", "breakpoint()"),
    ("no_debug_code", "import pdb"),
    ("no_debug_code", "if __name__ == '__main__':\n    register()"),
    ("no_print", "def draw(self, context):\n    print(context)"),
    ("imports_are_relative", "import rigid_motion.motion"),
    ("imports_are_relative", "from scipy import spatial"),
    ("no_other_way_to_load_code", "import sys\nsys.path.append('libraries')"),
    ("no_other_way_to_load_code", "import sys\ndel sys.modules['other']"),
    ("no_other_way_to_load_code", "import importlib"),
    ("no_other_way_to_load_code", "exec('1')"),
    ("permissions_are_those_that_are_used", "bpy.context.window_manager.clipboard = ''"),
    ("its_own_folder_is_left_alone", "HERE = __file__"),
    ("named_by_its_package", "class Preferences(bpy.types.AddonPreferences):\n    bl_idname = 'rigid_motion'"),
    ("named_by_its_package", "EXTENSION = __name__"),
    ("no_bl_info", "bl_info = {'name': 'Rigid Motion'}"),
    ("no_use_of_data_while_imported", "SCENE = bpy.context.scene"),
    ("no_use_of_data_while_imported", "for obj in bpy.data.objects:\n    pass"),
    ("what_is_registered_is_unregistered", "def register():\n    pass"),
    ("what_is_registered_is_unregistered", "bpy.utils.register_class(Panel)"),
    ("what_is_registered_is_unregistered", "bpy.app.timers.register(look, first_interval=0.0)"),
    ("what_is_registered_is_unregistered", "bpy.app.translations.register(__package__, {})"),
    ("what_is_registered_is_unregistered", "getattr(bpy.app.handlers, name).append(handler)"),
    ("what_is_registered_is_unregistered", "bpy.types.Scene.motion = PointerProperty(type=Motion)"),
    ("names_follow_blenders_rule", "class BakeOperator(bpy.types.Operator):\n    pass"),
    ("names_follow_blenders_rule", "class RIGID_MOTION_OT_x(bpy.types.Operator):\n    bl_idname = 'object.x'"),
    ("code_is_in_english", "länge = 1"),
]
"""Rules, and code that breaks them."""


def test_every_rule_for_code_is_shown_to_fail():
    others = {"nothing_is_left_over", "the_manifest_is_as_the_site_wants_it"}
    assert {name for name, _ in BROKEN} | others == {rule.__name__ for rule in RULES}


@pytest.mark.parametrize(("rule", "code"), BROKEN)
def test_code_that_breaks_a_rule_is_found(rule, code, files):
    (complaint, *_) = getattr(listing_rules, rule)({**files, "ui/added.py": code.encode()})
    assert complaint.startswith("ui/added.py")


@pytest.mark.parametrize(
    "name", ["__pycache__/a.cpython-311.pyc", "scene.blend1", ".gitignore", "wheels/numpy-2.0.whl", "ui/.DS_Store"]
)
def test_what_is_left_behind_is_found(name, files):
    assert list(listing_rules.nothing_is_left_over({**files, name: b""})) == [f"{name} was left behind"]


def test_a_zip_without_manifest_or_licence_is_found():
    assert len(list(listing_rules.nothing_is_left_over({"__init__.py": b""}))) == 2


@pytest.mark.parametrize("code", ["open('settings.json', 'w')", "from pathlib import Path", "import socket"])
def test_what_is_used_without_its_permission_is_found(code):
    manifest = MANIFEST.read_text(encoding="utf-8").partition("[permissions]")[0]
    files = {MANIFEST.name: manifest.encode(), "ui/added.py": code.encode()}
    (complaint,) = listing_rules.permissions_are_those_that_are_used(files)
    assert complaint.startswith("ui/added.py")


def test_a_permission_that_is_not_used_is_found(files):
    asking = files[MANIFEST.name] + b'camera = "To look around"\n'
    found = list(listing_rules.permissions_are_those_that_are_used({**files, MANIFEST.name: asking}))
    assert found == ["the permission for camera is asked for, and not used"]


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("tagline", "Moves objects."),
        ("tagline", "x" * 65),
        ("maintainer", "Rigid Motion contributors"),
        ("website", ""),
        ("license", ["SPDX:MIT"]),
        ("name", "Rigid Motion for Blender"),
        ("version", "1.0"),
    ],
)
def test_a_manifest_that_the_site_does_not_want_is_found(entry, value, files):
    manifest = tomllib.loads(files[MANIFEST.name].decode()) | {entry: value}
    text = "\n".join(f"{name} = {value!r}" for name, value in manifest.items() if name != "permissions").encode()
    assert len(list(listing_rules.the_manifest_is_as_the_site_wants_it({MANIFEST.name: text}))) == 1


def test_the_zip_is_small(extension_zip):
    assert extension_zip.stat().st_size < LARGEST


@pytest.mark.parametrize(("tag", "is_taken"), [("Animation", True), ("Interpolation", False)])
def test_blender_takes_the_tags_that_are_in_its_list(tag, is_taken, tmp_path):
    manifest = MANIFEST.read_text(encoding="utf-8")
    (tmp_path / MANIFEST.name).write_text(manifest.replace("Rigging", tag).replace('"Animation", ', ""))
    (tmp_path / "__init__.py").touch()
    tool = SCRIPTS / "addons_core/bl_pkg/cli/blender_ext.py"
    tags = SCRIPTS / "modules/_bpy_internal/extensions/tags.py"
    command = [sys.executable, str(tool), "validate", str(tmp_path), f"--valid-tags={tags}"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode == 0) == is_taken, done.stdout + done.stderr
