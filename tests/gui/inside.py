"""What Blender runs when it was started for a scenario: install the extension, do the scenario, report, and quit.

    blender --factory-startup --enable-event-simulate --python tests/gui/inside.py -- SCENARIO ZIP PICTURES RESULT

SCENARIO is a module of tests/gui/scenarios/, ZIP the extension, PICTURES a folder, RESULT a file for the outcome: JSON
with "blender", its version, and "failure", a text or null.
"""

from __future__ import annotations

import importlib
import json
import sys
import traceback
from pathlib import Path

import bpy

sys.path[:0] = [str(Path(__file__).resolve().parents[2] / folder) for folder in ("", "addon", "scripts")]

from tests.gui.driver import QUICK, Hand, run

SECONDS = 180.0
"""What one scenario may take, in a Blender that draws without a graphics card."""


def main(name: str, package: str, pictures: str, result: str) -> None:
    """Start a scenario; Blender goes on with it once this returns."""

    def done(failure: str | None) -> None:
        beside = Path(f"{result}.part")
        beside.write_text(json.dumps({"blender": bpy.app.version_string, "failure": failure}), encoding="utf-8")
        beside.replace(result)
        bpy.ops.wm.quit_blender()

    try:
        _settle(Path(result).parent)
        bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)
        hand = Hand(Path(pictures))
        run(importlib.import_module(f"tests.gui.scenarios.{name}").scenario(hand), hand, SECONDS, done)
    except Exception:
        done(traceback.format_exc())


def _settle(temporary: Path) -> None:
    """Let nothing pop up, move by itself, be drawn for longer than it takes to work with, or be written elsewhere."""
    preferences = bpy.context.preferences
    preferences.system.viewport_aa = QUICK
    preferences.view.show_splash = False
    preferences.view.smooth_view = 0
    preferences.view.use_save_prompt = False
    preferences.filepaths.use_auto_save_temporary_files = False
    preferences.filepaths.temporary_directory = str(temporary)


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :])
