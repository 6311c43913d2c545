"""Where the program's own files are: in a checkout, or where pip has put them."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parent

_ROOT = PACKAGE.parents[1]
CHECKOUT = _ROOT if (_ROOT / "addon" / "rigid_motion" / "__init__.py").is_file() else None
"""The root of the checkout that this is in; None where pip has installed it."""

EXTENSION = CHECKOUT / "addon" / "rigid_motion" if CHECKOUT else PACKAGE.with_name("rigid_motion")
ASSETS = CHECKOUT / "assets" if CHECKOUT else PACKAGE / "assets"
MANIFEST = (CHECKOUT or EXTENSION) / "blender_manifest.toml"
LICENSE = (CHECKOUT or EXTENSION) / "LICENSE"


def brings(extra: str, command: str) -> str:
    """Return what installs an extra: in a checkout a command does by itself, and elsewhere pip."""
    return f"`python scripts/bootstrap.py {command}`" if CHECKOUT else f"`pip install 'rigid-motion[{extra}]'`"


def output_folder(name: str) -> Path:
    """Return where a command writes unless requested otherwise: `renders/` of the checkout,
    or of the current folder.
    """
    return (CHECKOUT or Path.cwd()) / "renders" / name


def from_here(place: Path) -> Path:
    """Return a path as it counts from the root of the checkout, where that is the current folder;
    otherwise the path itself.

    What is kept by such names serves a checkout that was moved.
    """
    here = Path.cwd()
    return place.relative_to(here) if here == CHECKOUT and place.is_relative_to(here) else place


def place_of(name: str) -> Path:
    """Return the file or folder of a part of the program: "rigid_motion/motion", or "analysis" of this package."""
    return EXTENSION.parent / name if name.startswith(f"{EXTENSION.name}/") else PACKAGE / name


@cache
def manifest() -> dict[str, Any]:
    """Return what the extension's manifest says: its name, its version."""
    return tomllib.loads(MANIFEST.read_text(encoding="utf-8"))
