"""Meshopt streams and filters are read and written as by the meshoptimizer library."""

import numpy as np
import pytest

from rigid_motion.gltf import attribute_streams, index_streams
from rigid_motion.gltf.attribute_streams import encoded, encoded_size
from rigid_motion.gltf.filters import UNDO_BY_FILTER
from tests.gltf import meshopt_library
from tests.gltf.meshopt_library import LIBRARY

# Only the newest Blender has the library.
pytestmark = pytest.mark.once
needs_library = pytest.mark.skipif(not LIBRARY, reason="the library is in Blender from 5.2 on")


def elements_of(count: int, stride: int, wide: int) -> np.ndarray:
    random = np.random.default_rng(count + stride + wide)
    steps = random.integers(-wide, wide + 1, (count, stride)) * (random.random((count, stride)) < 0.3)
    return np.cumsum(steps, axis=0).astype(np.uint8)


@pytest.mark.parametrize("count", [1, 16, 17, 257, 1000])
@pytest.mark.parametrize("stride", [4, 12, 256])
@pytest.mark.parametrize("wide", [0, 6, 255])
def test_elements_come_back_as_they_were(count: int, stride: int, wide: int) -> None:
    elements = elements_of(count, stride, wide)
    stream = encoded(elements)
    streams = [stream]
    assert len(stream) == encoded_size(elements)
    if LIBRARY:
        own = meshopt_library.attributes(elements, 0)
        assert len(stream) <= len(own)
        assert np.array_equal(meshopt_library.decoded(stream, count, stride), elements)
        streams += [own, meshopt_library.attributes(elements, 1)]
    for some in streams:
        assert np.array_equal(attribute_streams.decoded(some, count, stride), elements)


@needs_library
@pytest.mark.parametrize("kind", ["<u2", "<u4", "<f4"])
def test_channels_of_two_and_of_four_bytes_are_read(kind: str) -> None:
    """The library chooses the packing of channels by their content."""
    random = np.random.default_rng(1)
    numbers = np.cumsum(random.normal(size=(700, 4)), axis=0) * 1000.0
    elements = np.ascontiguousarray(numbers.astype(kind)).view(np.uint8)
    stream = meshopt_library.attributes(elements, 1)
    modes = set(stream[-elements.shape[1] // 4 :])
    assert modes != {0}
    assert np.array_equal(attribute_streams.decoded(stream, *elements.shape), elements)


@needs_library
@pytest.mark.parametrize("stride", [2, 4])
@pytest.mark.parametrize("shuffled", [False, True])
def test_triangles_and_indices_come_back(stride: int, shuffled: bool) -> None:
    """Triangles may come back rotated, with their corners in the same cyclic order."""
    random, side = np.random.default_rng(2), np.arange(40 * 39).reshape(40, 39)
    corners = np.stack(
        (side[:-1, :-1], side[1:, :-1], side[:-1, 1:], side[:-1, 1:], side[1:, :-1], side[1:, 1:]), axis=-1
    )
    triangles = corners.reshape(-1, 3)
    triangles = random.permutation(random.permutation(triangles.max() + 1)[triangles]) if shuffled else triangles
    given = triangles.ravel()
    for are_triangles in (True, False):
        stream = meshopt_library.indices(given, are_triangles=are_triangles)
        decoded = index_streams.decoded_triangles if are_triangles else index_streams.decoded_indices
        result = decoded(stream, len(given), stride).view(f"<u{stride}").ravel()
        if are_triangles:
            first = np.argmin(result.reshape(-1, 3), axis=1)[:, None]
            result = np.take_along_axis(result.reshape(-1, 3), (first + np.arange(3)) % 3, axis=1)
            first = np.argmin(triangles, axis=1)[:, None]
            assert np.array_equal(result, np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1))
        else:
            assert np.array_equal(result, given)


@needs_library
@pytest.mark.parametrize(
    ("name", "own", "stride", "bits"),
    [
        ("OCTAHEDRAL", "Oct", 4, 8),
        ("OCTAHEDRAL", "Oct", 4, 5),
        ("OCTAHEDRAL", "Oct", 8, 12),
        ("QUATERNION", "Quat", 8, 16),
        ("QUATERNION", "Quat", 8, 7),
        ("EXPONENTIAL", "Exp", 16, 15),
        ("COLOR", "Color", 4, 8),
        ("COLOR", "Color", 4, 6),
        ("COLOR", "Color", 8, 12),
    ],
)
def test_filters_are_undone_as_by_the_library(name: str, own: str, stride: int, bits: int) -> None:
    """Few integers differ, by 1: the library computes in single precision."""
    numbers = np.random.default_rng(3).normal(size=(1000, 4))
    numbers /= np.linalg.norm(numbers[:, : 4 if own == "Quat" else 3], axis=1, keepdims=True)
    numbers[:, 3] = numbers[:, 3] if own in ("Quat", "Exp") else 0.0
    elements = meshopt_library.filtered(own, np.abs(numbers) if own == "Color" else numbers, stride, bits)
    expected = meshopt_library.undone(own, elements)
    result = UNDO_BY_FILTER[name][1](elements)
    kind = {"Exp": "<f4", "Color": f"<u{stride // 4}"}.get(own, f"<i{stride // 4}")
    off = np.abs(result.astype(np.float64) - expected.view(kind).astype(np.float64).reshape(result.shape))
    assert off.max() <= (0 if own == "Exp" else 1)
    assert (off > 0).mean() < 0.01


@pytest.mark.slow
def test_damaged_streams_end_in_an_error_or_in_other_numbers() -> None:
    random = np.random.default_rng(5)
    known = [(attribute_streams.decoded, encoded(elements_of(100, 8, 40)), 100, 8)]
    if LIBRARY:
        given = random.integers(0, 500, 600)
        known += [
            (attribute_streams.decoded, meshopt_library.attributes(elements_of(100, 8, 40), 1), 100, 8),
            (index_streams.decoded_triangles, meshopt_library.indices(given, are_triangles=True), 600, 4),
            (index_streams.decoded_indices, meshopt_library.indices(given, are_triangles=False), 600, 4),
        ]
    refused = 0
    for decoded, stream, count, stride in known:
        for _ in range(300):
            data = bytearray(stream)
            for place in random.integers(len(data), size=3):
                data[place] = random.integers(256)
            try:
                assert decoded(bytes(data[: len(data) - random.integers(0, 2)]), count, stride).shape == (count, stride)
            except (IndexError, KeyError, ValueError):
                refused += 1
    assert refused > 100
