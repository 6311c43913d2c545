"""What the extension says in other languages, given to Blender in its own way: by locale, context and English text.

A language is a package here with a dictionary `TEXTS`, and a row in `LANGUAGES`. Code has English texts alone: Blender
translates labels, tooltips and reports by itself; what is put together of parts is marked by its `pgettext` functions.
"""

from __future__ import annotations

import bpy

from . import german

LANGUAGES = {"de_DE": german.TEXTS}
"""By Blender's name of the locale: the translation of each text, by its context and the English."""

OWNER = __package__.rpartition(".")[0]
"""Whose translations they are, as Blender keeps them: the extension's."""


def register() -> None:
    bpy.app.translations.register(OWNER, LANGUAGES)


def unregister() -> None:
    bpy.app.translations.unregister(OWNER)
