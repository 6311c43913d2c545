"""What is seen of a glTF file with fewer keys: no vertex is off by more than promised, and nothing else is touched.

`tests.gltf.player` plays both files, `tests.gltf.random_files` makes them; `failing` are files that broke this before.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.gltf import GltfError, Options, Report, reduce_file
from tests.gltf.player import File, off
from tests.gltf.random_files import VENDOR, Choice, choices
from tests.thoroughness import tried

FAILING = Path(__file__).parent / "failing"

ULP = 2.0**-23
"""Of what is seen far out: files keep single precision, in which one place is so far from the next."""

NARROW = 0.035
"""What has no size keeps within an angle: two degrees, at one metre."""


def tried_on(path: Path, tolerance: float | None) -> tuple[File, File, Report]:
    """A file before and after, and what is said of it; by the default tolerance where that is refused as too large."""
    output = path.with_name("reduced.glb")
    try:
        report = reduce_file(path, output, Options(tolerance))
    except GltfError as error:
        if tolerance is None or "tenth" not in error.problem:
            raise
        report = reduce_file(path, output, Options())
    return File(path), File(output), report


def largest_coordinate(file: File, clip: int) -> float:
    return max(np.abs(places).max() for places in file.points(clip, file.moments(clip)).values())


def keeps_to(report: Report, before: File, after: File) -> None:
    """Every clip shows within the tolerance what it showed, and no more than is said."""
    said = {clip.number: clip.error for clip in report.clips}
    assert len(after.json["animations"]) == len(before.json["animations"])
    for clip, animation in enumerate(before.json["animations"]):
        assert after.json["animations"][clip].get("name") == animation.get("name")
        error = off(before, after, clip)
        rounding = ULP * largest_coordinate(before, clip)
        assert error.error <= report.tolerance * (1.0 + 1e-6) + rounding, error
        assert error.error <= said.get(clip, 0.0) * (1.0 + 1e-6) + rounding, error
        assert lasts(after, clip) == lasts(before, clip)


def turns_within_an_angle(report: Report, before: File, after: File) -> None:
    """Frames without a mesh on them are within the tolerance around, or within an angle where nothing has a size."""
    if not before.has_meshes():
        radius = 0.03 / 1.7 * report.size or 1.0
        for clip in range(len(before.json["animations"])):
            error = off(before, after, clip, radius)
            rounding = ULP * largest_coordinate(before, clip)
            assert error.error <= (report.tolerance * (1.0 + 1e-6) if report.size else NARROW) + rounding, error


def lasts(file: File, clip: int) -> tuple[float, float]:
    """The first and the last time of a clip, whatever it moves."""
    samplers = file.json["animations"][clip]["samplers"]
    times = np.concatenate([file.numbers(sampler["input"])[:, 0] for sampler in samplers] or [np.zeros(1)])
    return float(times.min()), float(times.max())


def channels_stay(before: File, after: File) -> None:
    """What goes is at rest, is not moved by another clip, and is in a file with meshes."""
    clips = [before.tracks(clip) for clip in range(len(before.json["animations"]))]
    for clip, tracks in enumerate(clips):
        for node, path in tracks.keys() - after.tracks(clip).keys():
            assert before.has_meshes(), (clip, node, path)
            assert not any((node, path) in others for number, others in enumerate(clips) if number != clip)


def named(part: Any, inside: bool = False) -> Iterator[int]:
    """Accessors that extensions name that are unknown."""
    if isinstance(part, dict):
        for name, below in part.items():
            yield from named(below, inside or name == VENDOR)
    elif isinstance(part, list):
        for below in part:
            yield from named(below, inside)
    elif inside:
        yield part


def all_else_stays(before: File, after: File) -> None:
    """Meshes, skins, instances and what unknown extensions name are the same numbers; the rest of the JSON is equal."""
    left = [_content(file, file.json) for file in (before, after)]
    assert left[0] == left[1]
    for number in named(before.json):
        assert np.array_equal(after.stored(number), before.stored(number))
        assert after.json["accessors"][number]["type"] == before.json["accessors"][number]["type"]


def _content(file: File, part: Any, name: str = "") -> Any:
    """JSON with the numbers that accessors stand for, but for that of animations."""
    if isinstance(part, dict):
        if name in ("attributes", "targets"):
            return {key: _numbers(file, number) for key, number in part.items()}
        skipped = ("accessors", "bufferViews", "buffers", "animations")
        return {key: _content(file, below, key) for key, below in part.items() if key not in skipped}
    if isinstance(part, list):
        return [_content(file, below, name) for below in part]
    return _numbers(file, part) if name in ("indices", "inverseBindMatrices") else part


def _numbers(file: File, number: int) -> tuple[str, bytes]:
    stored = file.stored(number)
    return stored.dtype.str, stored.tobytes()


def holds(path: Path, tolerance: float | None) -> Report:
    before, after, report = tried_on(path, tolerance)
    keeps_to(report, before, after)
    turns_within_an_angle(report, before, after)
    channels_stay(before, after)
    all_else_stays(before, after)
    assert path.with_name("reduced.glb").stat().st_size <= path.stat().st_size
    return report


@settings(max_examples=tried(300), deadline=None)
@given(choices(), st.none() | st.floats(-4.0, -1.2))
def test_no_vertex_of_any_file_is_off_by_more_than_the_tolerance(tmp_path_factory, choice: Choice, share):
    """Tolerances are shares of the size of what is seen, as tens to a power."""
    path = choice.made().write(tmp_path_factory.mktemp("random") / "made.glb")
    holds(path, None if share is None else 10.0 ** (share + choice.exponent))


SOON = {
    "cubic_weights_blink": None,
    "cubic_weights_ease": None,
}
"""Tolerances of those that are not tried at a millimetre."""

ALONE = ("pointer_only", "static", "tiny")
"""What is left alone: nothing moves, or all is smaller than the tolerance."""


@pytest.mark.parametrize("path", sorted(FAILING.glob("*.glb")), ids=lambda path: path.stem)
def test_files_that_failed_hold(tmp_path, path):
    given = tmp_path / path.name
    given.write_bytes(path.read_bytes())
    if path.stem == "duplicate_times_cut":
        with pytest.raises(GltfError, match="times"):
            reduce_file(given, tmp_path / "reduced.glb", Options(1e-3))
        return
    report = holds(given, SOON.get(path.stem, 1e-3))
    if path.stem in ALONE:
        assert not any(clip.tracks for clip in report.clips)
