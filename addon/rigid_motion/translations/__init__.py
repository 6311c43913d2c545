"""Translations of the extension's texts, registered with Blender by locale, context and English text.

Each language is a gettext file here, named after its locale: `de.po`. The code has English texts alone. Blender
translates labels, tooltips and reports by itself; texts assembled from parts are marked by its `pgettext` functions.
"""

from __future__ import annotations

import json
import re
from importlib.resources import files

import bpy

OWNER = (__package__ or "").rpartition(".")[0]
"""The owner of the translations, as registered with Blender: the extension."""

DEFAULT = "*"
"""Blender's context for texts without one."""

_STRING = r'"(?:\\.|[^"\\\n])*"'
_STRINGS = rf"((?:{_STRING}\s*)+)"
_ENTRY = re.compile(
    r"^(#,.*\n)?(?:#\|.*\n)*" + rf"(?:msgctxt\s+{_STRINGS})?msgid\s+{_STRINGS}msgstr\s+{_STRINGS}", re.MULTILINE
)

Texts = dict[tuple[str, str], str]
"""Translations by context and English text."""


def languages() -> dict[str, Texts]:
    """Return the translations of all languages, by locale."""
    catalogs = (file for file in files(__package__).iterdir() if file.name.endswith(".po"))
    return {file.name.removesuffix(".po"): read(file.read_text("utf-8")) for file in catalogs}


def read(po: str) -> Texts:
    """Return the translations in a gettext file, without missing and fuzzy ones."""
    texts = {}
    for flags, *parts in _ENTRY.findall(po):
        context, english, translation = map(_joined, parts)
        if english and translation and "fuzzy" not in flags:
            texts[context or DEFAULT, english] = translation
    return texts


def _joined(strings: str) -> str:
    """Join the strings of several lines, with their escapes resolved."""
    return "".join(map(json.loads, re.findall(_STRING, strings)))


def register() -> None:
    bpy.app.translations.register(OWNER, languages())


def unregister() -> None:
    bpy.app.translations.unregister(OWNER)
