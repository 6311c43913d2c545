"""Script for a Blender that runs one scenario: install the extension, run the scenario, report, and quit.

    blender --factory-startup --enable-event-simulate --python tests/gui/inside.py -- SCENARIO ZIP PICTURES RESULT

SCENARIO is a module of tests/gui/scenarios/, ZIP the extension, PICTURES a folder, RESULT a JSON file for the outcome:
"blender", its version, and "failure", a text or null.
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
"""Time limit of a scenario, in a Blender that draws without a graphics card."""


def main(name: str, package: str, pictures: str, result: str) -> None:
    """Start a scenario; Blender continues it once this returns."""

    def done(failure: str | None) -> None:
        beside = Path(f"{result}.part")
        beside.write_text(json.dumps({"blender": bpy.app.version_string, "failure": failure}), encoding="utf-8")
        beside.replace(result)
        bpy.ops.wm.quit_blender()

    try:
        _simplify_preferences(Path(result).parent)
        bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)
        hand = Hand(Path(pictures))
        run(importlib.import_module(f"tests.gui.scenarios.{name}").scenario(hand), hand, SECONDS, done)
    except Exception:
        done(traceback.format_exc())


def _simplify_preferences(temporary: Path) -> None:
    """Turn off pop-ups and animations of the interface, draw quickly, and keep files in a temporary folder."""
    preferences = bpy.context.preferences
    preferences.system.viewport_aa = QUICK
    preferences.view.show_splash = False
    preferences.view.smooth_view = 0
    preferences.view.use_save_prompt = False
    preferences.filepaths.use_auto_save_temporary_files = False
    preferences.filepaths.temporary_directory = str(temporary)


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :])
