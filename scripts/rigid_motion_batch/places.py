"""Paths of the program's own files: in a checkout, or where pip installed them."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parent

_ROOT = PACKAGE.parents[1]
CHECKOUT = _ROOT if (_ROOT / "addon" / "rigid_motion" / "__init__.py").is_file() else None
"""The root of the checkout that contains this file; None if pip installed it."""

EXTENSION = CHECKOUT / "addon" / "rigid_motion" if CHECKOUT else PACKAGE.with_name("rigid_motion")
ASSETS = CHECKOUT / "assets" if CHECKOUT else PACKAGE / "assets"
MANIFEST = (CHECKOUT or EXTENSION) / "blender_manifest.toml"
LICENSE = (CHECKOUT or EXTENSION) / "LICENSE"


def install_command(extra: str, command: str) -> str:
    """Return the command that installs an extra: bootstrap.py in a checkout, otherwise pip."""
    return f"`python scripts/bootstrap.py {command}`" if CHECKOUT else f"`pip install 'rigid-motion[{extra}]'`"


def output_folder(name: str) -> Path:
    """Return the default output folder of a command: in `renders/` of the checkout, or of the current folder."""
    return (CHECKOUT or Path.cwd()) / "renders" / name


def from_here(place: Path) -> Path:
    """Return a path relative to the checkout's root, if that is the current folder; otherwise the path itself.

    Records with relative names stay valid if the checkout is moved.
    """
    here = Path.cwd()
    return place.relative_to(here) if here == CHECKOUT and place.is_relative_to(here) else place


def place_of(name: str) -> Path:
    """Return the file or folder of a part of the program: "rigid_motion/motion", or "analysis" in this package."""
    return EXTENSION.parent / name if name.startswith(f"{EXTENSION.name}/") else PACKAGE / name


@cache
def manifest() -> dict[str, Any]:
    """Return the content of the extension's manifest: its name, its version."""
    return tomllib.loads(MANIFEST.read_text(encoding="utf-8"))
