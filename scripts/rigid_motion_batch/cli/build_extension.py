"""Build the zip that animators install, with the builder that comes with Blender, and let Blender validate it.

What goes in is the package rigid_motion, blender_manifest.toml and LICENSE, and nothing else. Two runs give the same
bytes.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any, cast

from rigid_motion_batch.command_line import complain, parser_of, path_line, program_of
from rigid_motion_batch.system_libraries import require_blender

SCRIPT = "build_extension.py"
PROGRAM = program_of(SCRIPT)

from rigid_motion_batch.files import written_beside
from rigid_motion_batch.places import CHECKOUT, EXTENSION, LICENSE, MANIFEST

EPILOG = """
examples:
  python scripts/build_extension.py
  python scripts/build_extension.py --output ~/Desktop

It writes OUTPUT/rigid_motion-VERSION.zip, VERSION as in blender_manifest.toml; the last line it prints is that path.
To install it: drag it into a Blender window, or Edit > Preferences > Get Extensions > Install from Disk.
Exit code: 0 done, 2 it could not be built, or Blender calls it invalid.
"""

OTHER_FILES = (MANIFEST, LICENSE)
"""Files that go into the zip next to the package."""

ZIP_EPOCH = (1980, 1, 1, 0, 0, 0)
"""The timestamp of every file in the zip, the earliest that a zip can hold: every build gives the same bytes."""


class BuildError(Exception):
    """The reason why there is no zip, as a message for the user."""


def build(folder: Path) -> Path:
    """Make a validated zip of the extension in `folder`, and return its path.

    Raises
    ------
    BuildError
        If a part of the extension is missing, or Blender's builder or validator refuses it.
    OSError
        If the folder cannot be written.
    """
    with tempfile.TemporaryDirectory() as temporary:
        staged, built = Path(temporary) / "staged", Path(temporary) / "built.zip"
        _stage(staged)
        _blender_ext("build", "--source-dir", str(staged), "--output-filepath", str(built))
        manifest = tomllib.loads((staged / MANIFEST.name).read_text(encoding="utf-8"))
        package = folder / f"{manifest['id']}-{manifest['version']}.zip"
        with written_beside(package) as beside:
            _repack(built, beside)
            _blender_ext("validate", str(beside))
    return package


def _stage(folder: Path) -> None:
    """Lay out the files of the extension as they will be in the zip."""
    try:
        shutil.copytree(EXTENSION, folder, ignore=shutil.ignore_patterns("__pycache__", "py.typed"))
        for path in OTHER_FILES:
            shutil.copy(path, folder)
    except FileNotFoundError as error:
        raise BuildError(f"{error.filename} is missing; `git checkout` brings it back") from error


def _blender_ext(*arguments: str) -> None:
    """Run Blender's own command for extensions as Blender runs it, with the tags that Blender knows."""
    import bpy

    scripts = Path(cast(Any, bpy.utils).system_resource("SCRIPTS"))
    tool = scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    tags = scripts / "modules" / "_bpy_internal" / "extensions" / "tags.py"
    command = [sys.executable, str(tool), *arguments, f"--valid-tags={tags}"]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace")
    if done.returncode != 0:
        raise BuildError(f"Blender {bpy.app.version_string} refuses the extension:\n{done.stdout}{done.stderr}".strip())


def _repack(built: Path, package: Path) -> None:
    """Write the same files sorted by name, with one timestamp and one mode, to leave out what a file system adds."""
    with (
        zipfile.ZipFile(built) as source,
        zipfile.ZipFile(package, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as target,
    ):
        for name in sorted(source.namelist()):
            entry = zipfile.ZipInfo(name, ZIP_EPOCH)
            entry.create_system, entry.external_attr = 3, 0o644 << 16  # Unix, also when built on Windows
            entry.compress_type = zipfile.ZIP_DEFLATED
            target.writestr(entry, source.read(name))


def main(arguments: list[str]) -> int:
    """Build, and return the exit code."""
    parser = parser_of(SCRIPT, __doc__, EPILOG)
    parser.add_argument(
        "--output", type=Path, default=(CHECKOUT or Path()) / "dist", metavar="DIR", help="folder to write to (dist)"
    )
    options = parser.parse_args(arguments)
    require_blender(SCRIPT)
    try:
        package = build(options.output.expanduser())
    except BuildError as error:
        complain(PROGRAM, error)
        return 2
    except OSError as error:
        complain(PROGRAM, error, options.output)
        return 2
    print(path_line(package))
    return 0
