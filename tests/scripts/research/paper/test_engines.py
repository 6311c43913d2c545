"""The sequence diagram says what the table of modes says."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import pytest

from research.paper import engines
from research.paper.streaming import PACKINGS
from rigid_motion.motion import MODES
from rigid_motion.motion.modes import Mode

SVG = "{http://www.w3.org/2000/svg}"


def words_of(drawing: str) -> list[str]:
    return ["".join(text.itertext()) for text in ElementTree.fromstring(drawing).iter(f"{SVG}text")]


def test_every_engine_of_the_table_is_named_with_its_label():
    words = words_of(engines.draw())
    for mode, row in MODES.items():
        assert f"{mode}  {row.label}" in words


def test_modes_stand_under_the_algebra_that_they_are_written_out_in():
    assert sorted(mode for modes in engines.engines().values() for mode in modes) == sorted(MODES)
    assert engines.engines()["dual_quaternions"] == ("dq_sclerp",)
    words = words_of(engines.draw())
    places = [words.index(f"[{engines.ENGINES[algebra].title}]") for algebra in engines.engines()]
    assert places == sorted(places)
    for (algebra, modes), start, end in zip(engines.engines().items(), places, [*places[1:], len(words)], strict=True):
        assert all(start < words.index(f"{mode}  {MODES[mode].label}") < end for mode in modes), algebra


def test_a_mode_that_is_added_to_the_table_is_drawn(monkeypatch: pytest.MonkeyPatch):
    def reference(first, second, u):
        raise NotImplementedError

    reference.__module__ = "rigid_motion.motion.algebras.octonions"
    added: Mode = replace(MODES["dq_sclerp"], label="Octonions", reference=reference)
    monkeypatch.setitem(MODES, "octo", added)
    words = words_of(engines.draw())
    assert "octo  Octonions" in words
    assert "[octonions]" in words


def test_the_bytes_are_those_of_the_packing():
    assert f"update: v, q ({PACKINGS['double'].size} bytes)" in words_of(engines.draw())


def test_it_has_colours_for_light_and_for_dark_and_nothing_from_elsewhere():
    drawing = engines.draw()
    assert "prefers-color-scheme:dark" in drawing
    assert "<script" not in drawing
    assert "href" not in drawing


def test_all_words_are_within_the_drawing():
    root = ElementTree.fromstring(engines.draw())
    height = float(root.get("height"))
    for text in root.iter(f"{SVG}text"):
        words, anchor = "".join(text.itertext()), text.get("text-anchor", "start")
        # Letters of 12 are 6.6 wide on average in any usual typeface.
        width = 6.6 * len(words)
        left = float(text.get("x")) - (width / 2.0 if anchor == "middle" else 0.0)
        assert left >= 0.0
        assert left + width <= engines.WIDTH + 12, words
        assert 0.0 < float(text.get("y")) < height
