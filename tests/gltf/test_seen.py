"""Visible geometry after key reduction: no vertex moves by more than the tolerance, and nothing else changes.

`tests.gltf.player` plays both files, `tests.gltf.random_files` makes them; `failing` has files that failed before.
"""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rigid_motion.gltf import Options, Report, errors, reduce_file
from tests.gltf.player import REST, File, Track, eighths, moved_target, off, shown
from tests.gltf.random_files import VENDOR, Choice, choices
from tests.thoroughness import tried

FAILING = Path(__file__).parent / "failing"

ULP = 2.0**-23
"""Relative rounding of far coordinates: the spacing of single-precision numbers near 1."""

NOTE = "rigid_motion"
"""Key in the asset's extras that reduced files may have."""

TURN = np.radians(0.5)
"""Angle that limits rotations if nothing has a size."""


def clips_of(file: File) -> list[dict[str, Any]]:
    return file.json.get("animations", [])


def largest_coordinate(file: File, clip: int) -> float:
    return max(np.abs(places).max() for places in file.points(clip, file.moments(clip)).values())


def keeps_to(report: Report, before: File, after: File) -> None:
    """Check that every clip stays within the tolerance, and within its reported error.

    So do frames of nodes, in files without meshes; they stay within an angle if nothing has a size.
    """
    said = {clip.number: clip.error for clip in report.clips}
    radius = 0.0 if before.has_meshes() else 0.03 / 1.7 * report.size or 1.0
    assert len(clips_of(after)) == len(clips_of(before))
    for clip, animation in enumerate(clips_of(before)):
        assert clips_of(after)[clip].get("name") == animation.get("name")
        assert lasts(after, clip) == lasts(before, clip)
        for around in {0.0, radius}:
            error = off(before, after, clip, around)
            rounding = ULP * largest_coordinate(before, clip) + (TURN if around and not report.size else 0.0)
            assert error.error <= report.tolerance * (1.0 + 1e-6) + rounding, error
            assert around or error.error <= said.get(clip, 0.0) * (1.0 + 1e-6) + rounding, error


def lasts(file: File, clip: int) -> tuple[float, float]:
    """Return the first and last time of a clip, over all of its channels."""
    samplers = file.json["animations"][clip]["samplers"]
    times = np.concatenate([file.numbers(sampler["input"])[:, 0] for sampler in samplers] or [np.zeros(1)])
    return float(times.min()), float(times.max())


def channels_stay(before: File, after: File) -> None:
    """Check that removed channels are of nodes, in files with meshes, and at rest in all other clips."""
    clips = [before.tracks(clip) for clip in range(len(clips_of(before)))]
    for clip, tracks in enumerate(clips):
        assert other_channels(after, clip) == other_channels(before, clip)
        for node, path in tracks.keys() - after.tracks(clip).keys():
            assert before.has_meshes(), (clip, node, path)
            for track in (other[node, path] for other in clips if other is not tracks and (node, path) in other):
                assert rests(before, node, path, track), (clip, node, path)


def other_channels(file: File, clip: int) -> list[tuple[Any, ...]]:
    """Return the targets of channels that move no node, with their times and values."""
    animation = clips_of(file)[clip]
    channels = [channel for channel in animation["channels"] if moved_target(channel["target"]) is None]
    samplers = [animation["samplers"][channel["sampler"]] for channel in channels]
    return [
        (channel["target"], *(file.numbers(sampler[name]).tolist() for name in ("input", "output")))
        for channel, sampler in zip(channels, samplers, strict=True)
    ]


def rests(file: File, node: int, path: str, track: Track) -> bool:
    """Whether a track shows the rest value of its node, to single precision."""
    described = file.json["nodes"][node]
    weights = file.json["meshes"][described["mesh"]].get("weights") if "mesh" in described else None
    rest, at = described.get(path, REST.get(path, weights)), eighths(track[1])
    return np.allclose(shown(*track, at, path == "rotation"), rest, atol=1e-6)


def named(part: Any, inside: bool = False) -> Iterator[int]:
    """Yield the accessors that unknown extensions name."""
    if isinstance(part, dict):
        for name, below in part.items():
            yield from named(below, inside or name == VENDOR)
    elif isinstance(part, list):
        for below in part:
            yield from named(below, inside)
    elif inside:
        yield part


def all_else_stays(before: File, after: File) -> None:
    """Check that meshes, skins, instances and data of unknown extensions are the same, and the other JSON is equal."""
    assert _content(after, after.json) == _content(before, before.json)
    for number in named(before.json):
        assert np.array_equal(after.stored(number), before.stored(number))
        assert after.json["accessors"][number]["type"] == before.json["accessors"][number]["type"]


def _content(file: File, part: Any, name: str = "") -> Any:
    """Return JSON with the content of accessors in place of their numbers, without animations."""
    if isinstance(part, dict):
        if name in ("attributes", "targets"):
            return {key: _numbers(file, number) for key, number in part.items()}
        skipped = ("accessors", "bufferViews", "buffers", "animations", NOTE)
        if name == "asset" and not part.get("extras", {}).keys() - {NOTE}:
            skipped += ("extras",)
        return {key: _content(file, below, key) for key, below in part.items() if key not in skipped}
    if isinstance(part, list):
        return [_content(file, below, name) for below in part]
    if isinstance(part, float) and name in (*REST, "matrix") and str(np.float32(part)) == str(part):
        return float(np.float32(part))  # Shortened to the digits that single precision needs.
    return _numbers(file, part) if name in ("indices", "inverseBindMatrices") else part


def _numbers(file: File, number: int) -> tuple[str, bytes]:
    stored = file.stored(number)
    return stored.dtype.str, stored.tobytes()


def holds(path: Path, tolerance: float | None, **more: bool) -> Report:
    output = path.with_name("reduced.glb")
    report = reduce_file(path, output, Options(tolerance, **more))
    before, after = File(path), File(output)
    keeps_to(report, before, after)
    channels_stay(before, after)
    all_else_stays(before, after)
    assert output.stat().st_size <= path.stat().st_size
    return report


GROWS_BETWEEN_KEYS = Choice(
    seed=127,
    tree="one place",
    joints=2,
    rest="zero",
    shows=("mesh", "skin", "sword"),
    moves=("rotation", "scale"),
    motion="still",
    interpolation="wild",
    keys=5,
    shared="samplers",
)
"""The geometry moved by morph targets grows by a spline between its keys."""


@settings(max_examples=tried(200), deadline=None)
@given(choices(), st.none() | st.floats(-4.0, -1.2), st.booleans(), st.sampled_from((12, errors.STRETCH_SAMPLES)))
@example(GROWS_BETWEEN_KEYS, None, False, errors.STRETCH_SAMPLES)
def test_no_vertex_of_any_file_is_off_by_more_than_the_tolerance(
    tmp_path_factory, choice: Choice, share: float | None, shared: bool, stretch: int
):
    """Tolerances are powers of ten times the size of the geometry; the default if that is too much."""
    path = choice.made().write(tmp_path_factory.mktemp("random") / "made.glb")
    with mock.patch.object(errors, "STRETCH_SAMPLES", stretch):
        report = holds(path, None if share is None else 10.0 ** (share + choice.exponent), shared=shared)
        if share is not None and not report.clips:
            holds(path, None, shared=shared)


DEFAULT = ("cubic_weights_blink", "cubic_weights_ease")
"""Files reduced with the default tolerance; the others use a millimetre."""

LEFT_ALONE = ("cubic_weights_blink", "cubic_weights_ease", "pointer_only", "small_weights", "static", "tiny")
"""Files where no track moves a node, all is hardly larger than the tolerance, or other keys would take more bytes."""


@pytest.mark.parametrize("path", sorted(FAILING.glob("*.glb")), ids=lambda path: path.stem)
def test_files_that_broke_promises_keep_them(tmp_path, path):
    own = Path(shutil.copy(path, tmp_path))
    report = holds(own, None if path.stem in DEFAULT else 1e-3)
    assert (path.stem in LEFT_ALONE) == bool(report.left_alone)
    if report.left_alone:
        assert (tmp_path / "reduced.glb").read_bytes() == own.read_bytes()


@pytest.mark.parametrize("name", ["skinned_sword", "long_skin_small_motion", "switch_clips", "rest_thousandth_spawn"])
def test_files_that_broke_promises_become_smaller(tmp_path, name):
    report = reduce_file(FAILING / f"{name}.glb", tmp_path / "reduced.glb", Options())
    assert report.after < 0.8 * report.before
