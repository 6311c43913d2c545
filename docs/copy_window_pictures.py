"""Copy the screenshots that these pages show from the output of the window tests.

    BLENDER=/path/to/blender python scripts/bootstrap.py test tests/gui
    python docs/copy_window_pictures.py

A page that shows window/SCENARIO/NAME.png gets renders/gui/SCENARIO/NAME.png. Look at each before you commit it.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
TAKEN = DOCS.parent / "renders" / "gui"


def main() -> int:
    """Copy the pictures that pages show, and return the exit code: 1 if a picture is missing."""
    pages = [page.read_text(encoding="utf-8") for page in sorted(DOCS.glob("*.md"))]
    shown = sorted({name for page in pages for name in re.findall(r"\(window/([\w/-]+\.png)\)", page)})
    missing = [name for name in shown if not (TAKEN / name).is_file()]
    if missing:
        print(f"Not in {TAKEN}, so run the window tests first: {', '.join(missing)}", file=sys.stderr)
        return 1
    for name in shown:
        target = DOCS / "window" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(TAKEN / name, target)
        print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
