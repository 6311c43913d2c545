from __future__ import annotations

from xml.etree import ElementTree

from rigid_motion_batch.comparison.report.markup import element, escape, join


def test_a_string_is_text_and_an_element_is_markup() -> None:
    assert element("p", "a < b", element("b", "&")) == "<p>a &lt; b<b>&amp;</b></p>"


def test_nothing_gets_out_of_an_attribute() -> None:
    assert element("a", href='"><script>') == '<a href="&quot;&gt;&lt;script&gt;"></a>'


def test_attributes_have_their_names_from_python() -> None:
    assert element("p", class_="x", data_y=1, hidden=True, id=None, lang=False) == '<p class="x" data-y="1" hidden></p>'


def test_lists_stand_for_their_items_and_none_for_nothing() -> None:
    assert join(["a", None, [1, 2.5], ("&",)]) == "a12.5&amp;"


def test_what_is_no_character_is_replaced_so_that_the_page_stays_well_formed() -> None:
    undecodable = b"clip\xff\x00\x1b".decode("utf-8", "surrogateescape")
    assert escape(undecodable) == "clip\ufffd\ufffd\ufffd"
    ElementTree.fromstring(element("p", undecodable).encode())
