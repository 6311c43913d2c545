"""Plans follow the differences of channels on every frame, whatever these are: here they are written out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion.animation.evaluation.spans import Span
from rigid_motion.animation.terms import planning
from rigid_motion.animation.terms.carriers import Term, evaluate

LOCATION, ROTATION = 0, 4


@dataclass
class Written:
    """A source whose differences are the same function of frames in each row that a span has."""

    spans: list[Span]
    difference: Callable[[np.ndarray], np.ndarray]
    native: float = 0.0
    order: str | None = None


@pytest.fixture(autouse=True, scope="module")
def written():
    """Plan from what is written out here, and not from keys."""

    def channel_differences(sources, frames):
        result = []
        for source, times in zip(sources, frames, strict=True):
            assert np.all(np.diff(times) > 0.0)
            rows = sorted({row for span in source.spans for row in span.rows})
            difference = np.zeros((10, len(times)))
            difference[rows] = source.difference(times)
            result.append((difference, np.full((10, len(times)), source.native)))
        return result

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(planning, "spans", lambda source: source.spans)
        patched.setattr(planning, "channel_differences", channel_differences)
        yield


def span(first: float, last: float, breaks: tuple = (), rows: tuple = (LOCATION,), keys: tuple = (True, True)) -> Span:
    return Span(rows, first, last, *keys, breaks)


def planned(*spans: Span, difference, native: float = 0.0) -> dict[int, list[Term]]:
    (terms,) = planning.plan([Written(list(spans), difference, native)])
    return terms


def frames_in(first: float, last: float, step: float) -> np.ndarray:
    """The frames strictly inside, in single precision."""
    frames = np.unique(np.float32(np.arange(np.ceil(first / step), last / step) * step)).astype(float)
    return frames[(frames > first) & (frames < last)]


def error(terms: list[Term], difference, first: float, last: float, step: float = 1 / 16) -> float:
    frames = frames_in(first, last, step)
    return abs(evaluate(terms, frames) - difference(frames)).max()


def hump(frames: np.ndarray) -> np.ndarray:
    return 0.3 * np.sin(np.pi * (frames - 1.0) / 20.0)


def test_smooth_differences_take_two_terms_a_row():
    terms = planned(span(1.0, 21.0, rows=(LOCATION, ROTATION)), difference=hump)
    assert {row: len(of_row) for row, of_row in terms.items()} == {LOCATION: 2, ROTATION: 2}
    assert error(terms[LOCATION], hump, 1.0, 21.0) <= planning.LOCATION_TOLERANCE
    assert error(terms[ROTATION], hump, 1.0, 21.0) <= planning.TOLERANCE


def test_rows_below_the_tolerance_are_left_out():
    assert planned(span(1.0, 21.0), difference=lambda frames: 1e-5 * hump(frames)) == {}
    assert planned(span(1.0, 21.0), difference=lambda frames: 1e-3 * hump(frames), native=4000.0) == {}
    assert planned(difference=hump) == {}
    assert planning.plan([]) == []


def test_large_values_need_no_more_than_their_own_precision():
    terms = planned(span(1.0, 21.0), difference=hump, native=1000.0)
    fine = planned(span(1.0, 21.0), difference=hump)
    assert 1e-7 < error(terms[LOCATION], hump, 1.0, 21.0) <= 1e-4
    assert len(terms[LOCATION][0].coefficients) < len(fine[LOCATION][0].coefficients)


def bounce(frames: np.ndarray) -> np.ndarray:
    return hump(frames) * abs(frames - 7.28)


def test_a_span_is_split_at_its_breaks():
    terms = planned(span(1.0, 21.0, (7.28,)), difference=bounce)[LOCATION]
    assert error(terms, bounce, 1.0, 21.0) <= planning.LOCATION_TOLERANCE
    assert sorted({round(term.first, 2) for term in terms}) == [1.0, 7.28]
    assert len(terms) <= 6


def test_breaks_that_are_none_split_nothing():
    assert len(planned(span(1.0, 21.0, (7.28, 9.0)), difference=hump)[LOCATION]) == 2


@pytest.mark.parametrize(
    "steep",
    [
        bounce,
        lambda frames: np.sqrt(abs(frames - 1.0)) * (21.0 - frames) / 20,
        lambda frames: np.sqrt(abs(21.0 - frames)) * (frames - 1.0) / 20,
        lambda frames: np.cbrt(frames - 11.0) * hump(frames),
        lambda frames: 0.1 * np.sin(3.0 * frames) + 0.1,
    ],
)
@pytest.mark.parametrize("ends", [(1.0, 21.0), (1.25, 20.6)])
def test_what_no_polynomial_follows_is_exact_on_eighths_of_frames(steep, ends):
    terms = planned(span(*ends), difference=steep)[LOCATION]
    assert error(terms, steep, *ends, step=0.125) <= planning.LOCATION_TOLERANCE
    inner = {term.first for term in terms if term.first > ends[0] + 0.01}
    assert all(
        np.float32(first) == np.nextafter(np.float32(round(8.0 * first) / 8.0), np.float32(np.inf)) for first in inner
    )


def test_each_row_is_split_on_its_own():
    def difference(frames: np.ndarray) -> np.ndarray:
        return np.stack([hump(frames), bounce(frames)])

    terms = planned(span(1.0, 21.0, (7.28,), rows=(LOCATION, ROTATION)), difference=difference)
    assert len(terms[LOCATION]) == 2
    assert len({term.first for term in terms[ROTATION]}) == 2


def test_angles_are_split_together():
    """Several of them turn alike, and one row's must be of the same as the others' are."""

    def difference(frames: np.ndarray) -> np.ndarray:
        return np.stack([hump(frames), bounce(frames), np.zeros_like(frames)])

    angles = (ROTATION, ROTATION + 1, ROTATION + 2)
    terms = planning.plan([Written([span(1.0, 21.0, (7.28,), rows=angles)], difference, order="XYZ")])[0]
    assert len({term.first for term in terms[ROTATION]}) == 2
    assert error(terms[ROTATION], hump, 1.0, 21.0) <= planning.TOLERANCE
    assert ROTATION + 2 not in terms


def test_nothing_is_added_at_keys_and_no_more_than_once_between():
    ends = (1.0, 21.0, 33.5, 3000.0)
    keys = ((False, True), (True, False), (False, False))
    pieces = [span(*both, keys=of_both) for *both, of_both in zip(ends[:-1], ends[1:], keys, strict=True)]
    terms = planned(*pieces, difference=lambda frames: np.ones_like(frames))[LOCATION]

    def beside(frame: float) -> list[float]:
        single, far = np.float32(frame), np.float32(np.inf)
        around = np.array([np.nextafter(single, -far), single, np.nextafter(single, far)])
        return evaluate(terms, around).round(5).tolist()

    assert beside(21.0) == [1.0, 0.0, 1.0]
    assert beside(33.5) == [1.0, 1.0, 1.0]
    assert beside(1.0) == [0.0, 1.0, 1.0]
    assert beside(3000.0) == [1.0, 1.0, 0.0]


def test_the_earlier_of_two_pieces_has_the_frame_between():
    terms = planned(span(1.0, 21.0), difference=bounce)[LOCATION]
    ranges = sorted({term[:2] for term in terms})
    for (_, last), (first, _) in pairwise(ranges):
        assert np.float32(first) == np.nextafter(np.float32(last), np.float32(np.inf))


def test_terms_are_in_order_of_time():
    terms = planned(*(span(20.0 * n + 1, 20.0 * n + 21) for n in range(6)), difference=bounce)[LOCATION]
    assert [term.first for term in terms] == sorted(term.first for term in terms)


def test_spans_of_other_rows_may_lie_across():
    spans = [span(1.0, 21.0), span(5.0, 12.0, rows=(ROTATION,)), span(12.0, 30.0, rows=(ROTATION,))]
    terms = planned(*spans, difference=hump)
    assert error(terms[LOCATION], hump, 1.0, 21.0) <= planning.LOCATION_TOLERANCE
    for first, last in ((5.0, 12.0), (12.0, 30.0)):
        assert error(terms[ROTATION], hump, first, last) <= planning.TOLERANCE


def test_plans_do_not_depend_on_other_sources():
    sources = [Written([span(1.0, 21.0 + n)], difference, n) for n in range(3) for difference in (hump, bounce)]
    together = planning.plan(sources)
    assert together == planning.plan(sources)
    for source, terms in zip(sources, together, strict=True):
        (alone,) = planning.plan([source])
        assert [term[:2] for term in alone[LOCATION]] == [term[:2] for term in terms[LOCATION]]


@pytest.mark.parametrize(
    "ends", [(2e6, 3e6), (-3e6, -2e6), (5.0, float(np.nextafter(np.float32(5.0), np.float32(6.0))))]
)
def test_spans_where_there_is_no_frame_take_no_terms(ends):
    assert planned(span(*ends), difference=np.ones_like) == {}


def test_ranges_end_where_those_of_blender_do():
    terms = planned(span(1048500.0, 2e6), difference=lambda frames: 1e-3 * np.ones_like(frames))[LOCATION]
    assert max(term.last for term in terms) <= planning.LAST_FRAME


@given(
    first=st.integers(-2000, 20_000),
    length=st.sampled_from([3, 20, 100]),
    rate=st.floats(0.1, 30.0),
    phase=st.floats(0.0, 6.0),
    shift=st.sampled_from([0.0, 0.5, 0.3]),
)
def test_waves_of_up_to_ten_radians_a_frame_are_followed(first, length, rate, phase, shift):
    begin, end = np.float32([first + shift, first + shift + length]).astype(float)

    def wave(frames: np.ndarray) -> np.ndarray:
        return 0.2 * np.sin(rate * (frames - begin) / length + phase)

    terms = planned(span(begin, end), difference=wave)[LOCATION]
    assert error(terms, wave, begin, end) <= planning.LOCATION_TOLERANCE
