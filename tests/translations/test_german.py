"""German: every text that a user sees has a translation, every translation is of such a text, and they fit."""

from __future__ import annotations

import ast
import string

import pytest

from rigid_motion.translations import LANGUAGES
from rigid_motion.translations.german import BY_CONTEXT, LABELS, NOTES, REFUSALS, REPORTS, TOOLTIPS
from tests.translations.shown_texts import MARKS, marked_or_drawn, messages, parsed, sentences, sources, texts_of

GERMAN = LANGUAGES["de_DE"]

UNSEEN = {
    "How many samples a frame the in-betweens have",
    "How far off they are between samples, in Blender's units",
    "Whether in-betweens are exact between frames, by a constraint, and not in delta transforms",
    "Rigid Motion Rest",
    # Names in files and in Blender's own interface
    " Live",
    "Rigid Motion",
    "Object Transforms",
    "Object Mode",
    "Graph Editor",
    # A part of the name of a mode, by which its algebra is looked up
    "Dual Quaternion",
    # Parts of a sentence that stand for what is meant, before it is translated as a whole
    "objects and bones",
    "an object",
    "a bone",
    "Object > ",
    "Pose > ",
    # Descriptions of properties that are kept in files and never drawn
    "What the constraint of a bone is called, where that is not its usual name",
    "Whether the manual frame range was set for samples that lie behind the keys",
    "Whether samples lie outside of the keys that they are for, within those of others or not",
    "Whether in-betweens of bones have one sample a frame, until more are needed",
    "It has keys for in-betweens too",
    "It has few of the keys",
    "How far the reduced motion is off where it is furthest, in Blender's units",
    "On how many frames any bone of the rig has keys",
    "How many keys all channels had together",
    "How many keys all channels have together",
    "The tolerance that was offered last, for as long as nobody sets another",
    "How far what stands on the ground slid there",
    "How far it slides there with fewer keys",
    "The mode that was chosen before there was an Action to keep it",
    "The constraints that it was given. Who takes one off does so on purpose",
    "The name that Actions have records of the bone under. Where it has another, it was renamed",
    "Which components of them, as bits",
    "Whether bones have modes, or constraints for them",
    "Whether the constraints of bones show nothing, for as long as the rig is in Edit Mode",
    "File Filter",
    "Files that the dialog shows",
    "The rig that the table is for",
    # For the log, and for those who call the program from Python
    "In-betweens could not be brought up to date",
    "neither an object nor a pose bone: ",
    "Keys are not in memory as expected, and are read by Blender's own functions, which takes longer",
    "The paths could not be drawn",
    "What came over the network cannot be shown",
    "What is selected cannot be sent",
    "The transform on the screen cannot be shown",
    "a mode for keyframes can look one key behind and ahead of a segment: see with_neighbours",
    ": rotation by axis and angle cannot be baked; set its rotation mode to Quaternion first",
    " frames do not fit poses of shape ",
    "interpolation: LINEAR or CONSTANT, not ",
    "list[FewerKeys] | Refused",
}
"""Literals with words that no user reads in the interface."""


@pytest.fixture
def shown(extension) -> set[tuple[str, str]]:
    return messages()


def test_every_text_has_a_translation(shown):
    assert shown - GERMAN.keys() == set()


def test_every_translation_is_of_a_text_that_is_shown(shown):
    assert GERMAN.keys() - shown == set()


def test_a_text_that_is_new_would_be_missed(shown):
    (found,) = marked_or_drawn(ast.parse('layout.label(text="New in this version")'))
    assert found not in GERMAN
    (found,) = marked_or_drawn(ast.parse('raise Refused(rpt_("{name} is new").format(name=name))'))
    assert found not in GERMAN


def test_no_literal_goes_around_the_translation(shown):
    known = texts_of(shown) | UNSEEN
    missed = [
        f"{path.name}:{line}: {text}"
        for path in sources()
        for line, text in sentences(parsed(path))
        if text not in known and "gl_Position" not in text and "fragColor" not in text
    ]
    assert missed == []


def test_what_is_called_unseen_is_in_the_code():
    assert {text for path in sources() for _, text in sentences(parsed(path))} >= UNSEEN


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


@pytest.mark.parametrize(("english", "german"), sorted((text, german) for (_, text), german in GERMAN.items()))
def test_a_translation_fits_its_text(english, german):
    assert german.strip()
    assert fields(german) == fields(english)
    assert ending(german) == ending(english)
    assert beginning(german) == beginning(english)
    assert german.count("„") == german.count("“")
    assert "  " not in german


@pytest.mark.parametrize(
    ("english", "german"),
    [("{count} keys", "{keys} Schlüsselbilder"), ("{frame:g}", "{frame}"), ("Bake...", "Backen"), (", keys", "Keys")],
)
def test_a_translation_that_does_not_fit_is_found(english, german):
    with pytest.raises(AssertionError):
        test_a_translation_fits_its_text(english, german)


def test_no_text_is_translated_twice():
    assert sum(len(texts) for texts in BY_CONTEXT.values()) == len(GERMAN)
    assert sum(map(len, (LABELS, NOTES, REFUSALS, REPORTS, TOOLTIPS))) == len(BY_CONTEXT["*"])


def test_what_the_texts_call_things_is_what_they_are_called():
    names = {german for (context, _), german in GERMAN.items() if context == "Operator"}
    names |= {"Live-Aktualisierung", "Delta-Transformation", "Rigid Motion"}
    of_blender = {"Generated", "Gegenstand", "Lokale Position"}
    for german in GERMAN.values():
        for quoted in (part.partition("“")[0] for part in german.split("„")[1:]):
            assert quoted in names | of_blender, quoted
