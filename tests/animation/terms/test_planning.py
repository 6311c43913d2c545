"""Planned terms follow any difference of channels on every frame. The differences are written as functions here."""

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
from rigid_motion.animation.terms.carriers import Term
from tests.animation.terms.test_carriers import error, evaluate

pytestmark = pytest.mark.any_blender

LOCATION, ROTATION = 0, 4


@dataclass
class Written:
    """A source whose difference is the same function of frames in each row of its spans."""

    spans: list[Span]
    difference: Callable[[np.ndarray], np.ndarray]
    native: float = 0.0


@pytest.fixture(autouse=True, scope="module")
def written():
    """Plan from the differences written here instead of keys."""

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


def off(terms: list[Term], difference, first: float = 1.0, last: float = 21.0, step: float = 1 / 16) -> float:
    """Return the largest error of terms, on frames strictly inside."""
    frames = np.float32(np.arange(np.ceil(first / step), last / step) * step)
    return error(terms, difference, frames[(frames > first) & (frames < last)])


def hump(frames: np.ndarray) -> np.ndarray:
    return 0.3 * np.sin(np.pi * (frames - 1.0) / 20.0)


def test_values_need_no_more_than_their_own_precision_and_rows_below_the_tolerance_nothing():
    large, fine = (planned(span(1.0, 21.0), difference=hump, native=native)[LOCATION] for native in (1000.0, 0.0))
    assert 1e-7 < off(large, hump) <= 1e-4
    assert len(large[0].coefficients) < len(fine[0].coefficients)
    assert planned(span(1.0, 21.0), difference=lambda frames: 1e-5 * hump(frames)) == {}
    assert planned(span(1.0, 21.0), difference=lambda frames: 1e-3 * hump(frames), native=4000.0) == {}
    assert planned(difference=hump) == {}
    assert planning.plan([]) == []


def bounce(frames: np.ndarray) -> np.ndarray:
    return hump(frames) * abs(frames - 7.28)


EIGHTHS, SIXTEENTHS = 1 / 8, 1 / 16
FOLLOWED: dict[str, tuple] = {
    "breaks that are none": (hump, (7.28, 9.0), SIXTEENTHS, 2),
    "a break": (bounce, (7.28,), SIXTEENTHS, 6),
    "a break that is not told": (bounce, (), EIGHTHS, 99),
    "a steep beginning": (lambda frames: np.sqrt(abs(frames - 1.0)) * (21.0 - frames) / 20, (), EIGHTHS, 99),
    "a steep end": (lambda frames: np.sqrt(abs(21.0 - frames)) * (frames - 1.0) / 20, (), EIGHTHS, 99),
    "steep between": (lambda frames: np.cbrt(frames - 11.0) * hump(frames), (), EIGHTHS, 99),
}
"""A difference and its breaks, the frames on which terms must follow it, and the maximum number of terms."""


@pytest.mark.parametrize("ends", [(1.0, 21.0), (1.25, 20.6)])
@pytest.mark.parametrize("what", FOLLOWED)
def test_differences_are_followed_by_pieces_in_order_of_time_whatever_is_planned_along_with_them(what, ends):
    difference, breaks, step, most = FOLLOWED[what]
    sources = [Written([span(*ends, breaks)], difference), *(Written([span(1.0, 22.0)], hump, n) for n in range(2))]
    terms, *others = [plan[LOCATION] for plan in planning.plan(sources)]
    assert [terms, *others] == [plan[LOCATION] for plan in planning.plan(sources)]
    ranges = [term[:2] for term in terms]
    assert ranges == [term[:2] for term in planned(*sources[0].spans, difference=difference)[LOCATION]]
    assert off(terms, difference, *ends, step=step) <= planning.LOCATION_TOLERANCE
    assert len(terms) <= most
    assert ranges == sorted(ranges)
    for (_, last), (first, _) in pairwise(sorted(set(ranges))):
        assert first == after(last), "the earlier of two pieces has the frame between"
        assert last in np.float32(breaks) or 8.0 * last % 1.0 == 0.0


def after(frame: float) -> np.float32:
    return np.nextafter(np.float32(frame), np.float32(np.inf))


def test_parts_are_split_at_breaks_each_on_its_own():
    """Different angles can give the same rotation, so all rows of a rotation must use the same set of angles."""

    def difference(frames: np.ndarray) -> np.ndarray:
        return np.stack([hump(frames), hump(frames), bounce(frames), np.zeros_like(frames)])

    rows = (LOCATION, ROTATION, ROTATION + 1, ROTATION + 2)
    terms = planned(span(1.0, 21.0, (7.28,), rows=rows), difference=difference)
    assert len(terms[LOCATION]) == 2
    for row, wanted in ((ROTATION, hump), (ROTATION + 1, bounce)):
        assert off(terms[row], wanted) <= planning.ROTATION_SCALE_TOLERANCE
        assert sorted({round(term.first, 2) for term in terms[row]}) == [1.0, 7.28]
        assert len(terms[row]) <= 6
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


def test_spans_take_terms_on_frames_that_blender_has():
    for ends in ((2e6, 3e6), (-3e6, -2e6), (5.0, float(np.nextafter(np.float32(5.0), np.float32(6.0))))):
        assert planned(span(*ends), difference=np.ones_like) == {}
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
    assert off(terms, wave, begin, end) <= planning.LOCATION_TOLERANCE
