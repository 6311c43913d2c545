"""Languages: every text that a user sees has a translation, every translation is of such a text, and they fit."""

from __future__ import annotations

import ast
import re
import string
from pathlib import Path

import pytest
from babel.messages.pofile import read_po

from rigid_motion import translations
from tests.translations.shown_texts import MARKS, messages, parsed, sentences, sources, texts_of

pytestmark = [pytest.mark.blender, pytest.mark.once]

LANGUAGES = translations.languages()
GERMAN = LANGUAGES["de"]

UNSEEN = {
    *(" Live", " Original", " to ", " passing", "Pass To", "rigid_motion ", "Rigid Motion", "Object Transforms"),
    *(" Base", " Layer", "Rigid Motion Base", "Rigid Motion Layer"),
    "list[FewerKeys | FewerRuns] | Refused",
}
"""Names in files, and a type."""


@pytest.fixture
def shown(extension) -> set[tuple[str, str]]:
    return messages()


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_text_has_a_translation(shown, language):
    assert shown - LANGUAGES[language].keys() == set()


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_translation_is_of_a_text_that_is_shown(shown, language):
    assert LANGUAGES[language].keys() - shown == set()


def test_no_literal_goes_around_the_translation(shown):
    known = texts_of(shown) | UNSEEN
    missed = [
        f"{path.name}:{line}: {text}"
        for path in sources()
        for line, text in sentences(parsed(path))
        if text not in known and "gl_Position" not in text and "fragColor" not in text
    ]
    assert missed == []


def test_what_is_marked_is_a_literal_or_a_name_for_one():
    for path in sources():
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in MARKS:
                assert not isinstance(node.args[0], ast.JoinedStr | ast.BinOp), f"{path.name}:{node.lineno}"


def fields(text: str) -> list[tuple[str, str]]:
    """The placeholders of a text, with how their values are written."""
    return sorted((name, form) for _, name, form, _ in string.Formatter().parse(text) if name is not None)


def ending(text: str) -> str:
    """The punctuation and the spaces that a text ends with; a closing bracket or quote counts no more than a word."""
    return text[len(text.rstrip(" .:;,!?")) :]


def beginning(text: str) -> str:
    return text[: len(text) - len(text.lstrip(" .:;,"))]


def test_translations_fit_their_texts():
    for (_, english), translation in (item for texts in LANGUAGES.values() for item in texts.items()):
        assert translation.strip(), english
        assert fields(translation) == fields(english)
        assert ending(translation) == ending(english)
        assert beginning(translation) == beginning(english)
        assert translation.count("„") == translation.count("“")
        assert "  " not in translation


@pytest.mark.parametrize("language", LANGUAGES)
def test_files_are_read_as_other_programs_read_them(language):
    """Babel refuses what is no gettext file."""
    file = Path(translations.__file__).with_name(f"{language}.po")
    text = file.read_text(encoding="utf-8")
    catalog = read_po(text.splitlines(keepends=True), abort_invalid=True)
    assert {(entry.context or "*", entry.id): entry.string for entry in catalog if entry.id} == LANGUAGES[language]
    # A text that is translated twice is one entry in both.
    assert len(re.findall("^msgid ", text, re.MULTILINE)) == 1 + len(LANGUAGES[language])


def test_escapes_are_read_and_what_is_not_translated_or_only_guessed_is_left_out():
    po = r"""
msgid "The \"long\" text"
msgstr "Der „lange“ Text"
msgid "Not yet"
msgstr ""
#, fuzzy
msgid "Guessed"
msgstr "Geraten"
#~ msgid "Gone"
#~ msgstr "Weg"
"""
    assert translations.read(po) == {("*", 'The "long" text'): "Der „lange“ Text"}


def test_what_the_texts_call_things_is_what_they_are_called():
    names = {german for (context, _), german in GERMAN.items() if context == "Operator"}
    names |= {"Live-Aktualisierung", "Delta-Transformation", "Rigid Motion"}
    of_blender = {"Generated", "Gegenstand", "Lokale Position"}
    for german in GERMAN.values():
        for quoted in (part.partition("“")[0] for part in german.split("„")[1:]):
            assert quoted in names | of_blender, quoted
