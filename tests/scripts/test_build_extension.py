"""Tests of the zip that users install: its contents, and its installation, use and removal in every Blender."""

import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

from rigid_motion_batch.cli import build_extension
from rigid_motion_batch.places import EXTENSION, LICENSE

ROOT = Path(__file__).resolve().parents[2]

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


def run(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess:
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, env=os.environ | environment)


def names(package: Path) -> list[str]:
    with zipfile.ZipFile(package) as opened:
        return opened.namelist()


def test_the_zip_holds_the_modules_the_manifest_and_the_licence_and_nothing_else(extension_zip):
    files = {
        path.relative_to(EXTENSION).as_posix() for kind in ("*.py", "*.po", "*.json") for path in EXTENSION.rglob(kind)
    }
    assert set(names(extension_zip)) == files | {"blender_manifest.toml", "LICENSE"}
    assert len(names(extension_zip)) == len(set(names(extension_zip)))


def test_the_files_are_those_of_the_checkout(extension_zip):
    with zipfile.ZipFile(extension_zip) as package:
        for name in package.namelist():
            source = EXTENSION / name if (EXTENSION / name).is_file() else ROOT / name
            assert package.read(name) == source.read_bytes(), name


def test_the_name_says_which_version(extension_zip):
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert extension_zip.name == f"rigid_motion-{manifest['version']}.zip"


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


def test_it_installs_enables_disables_and_uninstalls_without_a_word_of_complaint(extension_zip, tmp_path):
    script = tmp_path / "life.py"
    script.write_text(LIFE_OF_AN_EXTENSION, encoding="utf-8")
    user = tmp_path / "user"
    done = run(script, extension_zip, BLENDER_USER_RESOURCES=str(user))
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    seen = json.loads(done.stdout.strip().splitlines()[-1])
    installed = user / "extensions" / "user_default" / "rigid_motion"
    assert {Path(file).relative_to(installed).as_posix() for file in seen["files"]} == {
        name for name in names(extension_zip) if name.endswith(".py")
    }
    assert seen["enabled"]
    assert seen["disabled"]
    assert seen["uninstalled"]
    assert not installed.exists()
    assert seen["left behind"] == []
    assert seen["from the checkout"] == []
