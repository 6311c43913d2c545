"""Make the pictures of the extension's page on extensions.blender.org: listing/icon.png and listing/featured.png.

This needs Blender's Python module and Matplotlib. Look at both pictures before you commit them, also at small size.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ASSETS = Path(__file__).resolve().parent
sys.path[:0] = [str(ASSETS.parent / folder) for folder in ("addon", "scripts")]

import bpy  # noqa: F401 - mathutils comes with it

from research.making import listing

PICTURES = {"icon": listing.icon, "featured": listing.featured}


def main(arguments: list[str] | None = None) -> None:
    """Render the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=PICTURES, help="one of them (default: both)")
    parser.add_argument("--output", type=Path, default=ASSETS / "listing", metavar="FOLDER", help="where to")
    options = parser.parse_args(arguments)
    for name in (options.only,) if options.only else PICTURES:
        path = options.output / f"{name}.png"
        PICTURES[name](path)
        print(f"{path}  {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
