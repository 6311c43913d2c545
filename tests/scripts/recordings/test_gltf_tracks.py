"""Tracks of glTF animations made straight: what is kept in other ways than floats, and what is damaged."""

import numpy as np
import pytest

from rigid_motion.gltf.accessors import numbers
from rigid_motion.gltf.documents import Document
from rigid_motion_batch.recordings.gltf import WIDEST, straightened
from tests.scripts.recordings.glbs import turning

WAYS = {5126: np.float32, 5122: np.int16, 5120: np.int8, 5123: np.uint16}


def turn(component: int, stride: int) -> tuple[dict, bytes]:
    """A track of a quarter turn within a second, its quaternions kept in one of the ways that there are."""
    kind = np.dtype(WAYS[component])
    quaternions = turning(np.arange(2.0), np.array([0.0, np.pi / 2]))
    numbers = quaternions if kind.kind == "f" else np.rint(quaternions * np.iinfo(kind).max)
    rows = np.zeros((2, stride), dtype=np.uint8)
    rows[:, : 4 * kind.itemsize] = numbers.astype(kind).view(np.uint8).reshape(2, -1)
    data = np.array([0.0, 1.0], dtype=np.float32).tobytes() + rows.tobytes()
    document = {
        "animations": [
            {
                "samplers": [{"input": 0, "output": 1}],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
            }
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR"},
            {"bufferView": 1, "componentType": component, "count": 2, "type": "VEC4", "normalized": True},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 8},
            {"buffer": 0, "byteOffset": 8, "byteLength": 2 * stride, "byteStride": stride},
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    return document, data


@pytest.mark.parametrize("component", WAYS)
@pytest.mark.parametrize("more", [0, 8])
def test_a_wide_turn_is_even_however_its_numbers_are_kept(component: int, more: int) -> None:
    document, data = turn(component, 4 * np.dtype(WAYS[component]).itemsize + more)
    made, times = straightened(Document(document, (data,)))
    count = int(np.ceil(np.pi / 2 / WIDEST))
    np.testing.assert_allclose(times, np.arange(1, count) / count, rtol=1e-6)
    sampler = document["animations"][0]["samplers"][0]
    result = [numbers(made, sampler["input"])[:, 0], numbers(made, sampler["output"])]
    np.testing.assert_allclose(result[0], np.arange(count + 1) / count, rtol=1e-6)
    expected = turning(result[0], result[0] * np.pi / 2)
    np.testing.assert_allclose(result[1], expected, atol=0.01 if component == 5120 else 1e-4)
    assert document["buffers"][-1]["byteLength"] == len(made.buffers[-1])
