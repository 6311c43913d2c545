"""Rendering of pages: templates, style and scripts combined into one file with no requests and no other script."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
from markupsafe import Markup

from rigid_motion_batch.files import replacing

from .numbers import digits

HERE = Path(__file__).parent

SCRIPTS = ("data", "mathematics", "state", "pointers", "drawing", "view", "chart", "tables", "page")
"""The modules of the viewer, each after the modules it imports."""


def write_page(path: Path, template: str, context: Mapping[str, Any]) -> None:
    """Render a template with a context to a file."""
    with replacing(path) as stream:
        stream.reconfigure(errors="backslashreplace")  # File names may not be valid text.
        stream.writelines(_environment().get_template(template).generate(context))


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE / "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.globals |= {
        "address": address,
        "hash": lambda text: base64.b64encode(hashlib.sha256(text.encode()).digest()).decode(),
    }
    environment.filters |= {"digits": digits}
    return environment


def address(clip: str, choice: str, seconds: float | None = None) -> str:
    """Return the link to a moment of a clip in a page, as the script's `addressOf` writes it."""
    moment = "" if seconds is None else f",{max(seconds, 0.0):.3f}"
    return f"#{quote(clip, safe='')},{quote(choice, safe='')}{moment}"


def style() -> Markup:
    """Return the CSS of all pages."""
    return Markup((HERE / "templates" / "page.css").read_text(encoding="utf-8"))


@cache
def script_of(names: tuple[str, ...]) -> Markup:
    """Return the modules as one script, without the imports and exports between them."""
    texts = []
    for name in names:
        text = (HERE / "viewer" / f"{name}.js").read_text(encoding="utf-8")
        text = re.sub(r"^import .*?;\n", "", text, flags=re.MULTILINE | re.DOTALL)
        texts.append(re.sub(r"^export ", "", text, flags=re.MULTILINE))
    return Markup("\n".join(texts))


@cache
def shaders() -> dict[str, list[str]]:
    """Return the sources of each shader program: vertex shader, fragment shader."""
    text = (HERE / "viewer" / "shaders.glsl").read_text(encoding="utf-8")
    parts = re.split(r"^//// (\w+)\n", text, flags=re.MULTILINE)[1:]
    return {name: sources.split("----\n") for name, sources in zip(parts[::2], parts[1::2], strict=True)}
