"""Spacing of ticks and axes on a path, in a view from above of a given scale: the line stays visible."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.ui.overlay.points import MIN_TICK_DISTANCE_PX, TICK_GAP, DrawnPath, on_screen, readable

pytestmark = pytest.mark.any_blender

SIZE = (1000.0, 500.0)


def straight(frames: int, places: np.ndarray | None = None, *, mode: bool = False, keys: tuple = (0, -1)) -> DrawnPath:
    """Return a path along x with a tick on each of its frames, one unit long in all, or with these places."""
    at = np.arange(1.0, frames + 1.0)
    line = np.zeros((frames, 3))
    line[:, 0] = np.linspace(0.0, 1.0, frames) if places is None else places
    return DrawnPath(
        frames=at,
        native=line,
        desired=line if mode else None,
        key_frames=at[list(keys)],
        keys=line[list(keys)],
        selected=np.zeros(len(keys), dtype=bool),
        tick_frames=at,
        native_ticks=line,
        desired_ticks=line if mode else None,
        axis_frames=at,
        axes=np.repeat(line[:, None, None], 3, axis=1).repeat(2, axis=2),
    )


def view(width: float) -> np.ndarray:
    """Return an orthographic projection in which a unit is `width` pixels wide."""
    return np.diag((2.0 * width / SIZE[0], 2.0 * width / SIZE[1], 0.0, 1.0))


def ticks(path: DrawnPath, width: float, **options: object) -> np.ndarray:
    """Return the frames of the ticks that are drawn."""
    return path.tick_frames[readable(path, view(width), SIZE, **options).native_ticks]


def test_behind_the_viewer_there_is_no_place_on_the_screen():
    projection = np.eye(4)[[0, 1, 2, 2]]
    assert np.isnan(on_screen(np.array([[0.0, 0.0, -1.0]]), projection, SIZE)).all()


@pytest.mark.parametrize(("gap", "step"), [(TICK_GAP, 1), (TICK_GAP / 2, 2), (TICK_GAP / 3, 5), (TICK_GAP / 8, 10)])
def test_the_shorter_a_path_the_fewer_ticks_and_all_are_evenly_timed(gap, step):
    result = ticks(straight(101), 100 * gap)
    assert (np.diff(result) == step).all()
    assert (result % step == 0.0).all()
    assert len(result) >= 100 // step - 2


def test_a_path_that_is_seen_as_a_dot_has_no_ticks():
    assert not len(ticks(straight(41), 3.0))
    assert not len(ticks(straight(41, np.zeros(41)), 1000.0))


def test_no_tick_touches_another_or_a_key_where_the_object_slows_down():
    eased = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 61))
    path = straight(61, eased)
    chosen = readable(path, view(900.0), SIZE).native_ticks
    drawn = 900.0 * eased[chosen]
    assert (np.diff(drawn) >= MIN_TICK_DISTANCE_PX).all()
    assert drawn.min() >= MIN_TICK_DISTANCE_PX
    assert drawn.max() <= 900.0 - MIN_TICK_DISTANCE_PX
    # In the middle, where the object is fast, there is a tick on every frame.
    assert chosen[20:40].all()


def test_on_a_screen_of_twice_the_resolution_it_is_the_same():
    one = readable(straight(41), view(200.0), SIZE)
    two = readable(straight(41), view(200.0), (2 * SIZE[0], 2 * SIZE[1]), 2.0)
    assert (one.native_ticks == two.native_ticks).all()


def test_ticks_that_somebody_asked_for_are_all_there():
    assert len(ticks(straight(41), 3.0, every_tick=True)) == 41
