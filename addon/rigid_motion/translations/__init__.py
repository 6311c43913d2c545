"""Translations of the extension's texts, as Blender takes them: by locale, context and English text.

A language is a gettext file here, named after its locale: `de.po`. Code has English texts alone: Blender translates
labels, tooltips and reports by itself; what is put together of parts is marked by its `pgettext` functions.
"""

from __future__ import annotations

import json
import re
from importlib.resources import files

import bpy

OWNER = (__package__ or "").rpartition(".")[0]
"""Whose translations they are, as Blender keeps them: the extension's."""

DEFAULT = "*"
"""Blender's name of the context of texts without one."""

_STRING = r'"(?:\\.|[^"\\\n])*"'
_STRINGS = rf"((?:{_STRING}\s*)+)"
_ENTRY = re.compile(
    r"^(#,.*\n)?(?:#\|.*\n)*" + rf"(?:msgctxt\s+{_STRINGS})?msgid\s+{_STRINGS}msgstr\s+{_STRINGS}", re.MULTILINE
)

Texts = dict[tuple[str, str], str]
"""Translations by context and English text."""


def languages() -> dict[str, Texts]:
    """Return the texts of all languages, by locale."""
    catalogs = (file for file in files(__package__).iterdir() if file.name.endswith(".po"))
    return {file.name.removesuffix(".po"): read(file.read_text("utf-8")) for file in catalogs}


def read(po: str) -> Texts:
    """Return the texts of a gettext file, without those that have no translation yet or only a fuzzy one."""
    texts = {}
    for flags, *parts in _ENTRY.findall(po):
        context, english, translation = map(_joined, parts)
        if english and translation and "fuzzy" not in flags:
            texts[context or DEFAULT, english] = translation
    return texts


def _joined(strings: str) -> str:
    """Join strings on lines of their own, with their escapes resolved."""
    return "".join(map(json.loads, re.findall(_STRING, strings)))


def register() -> None:
    bpy.app.translations.register(OWNER, languages())


def unregister() -> None:
    bpy.app.translations.unregister(OWNER)
