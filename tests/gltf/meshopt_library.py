"""Reference library for tests of the codec: meshoptimizer from the Blender module, from Blender 5.2 on.

`LIBRARY` is None if it is missing.
"""

import ctypes
from importlib.util import find_spec
from pathlib import Path

import numpy as np

PLACE = Path(spec.origin).parent / "lib" / "libmeshoptimizer.so" if (spec := find_spec("bpy")) else Path()
LIBRARY = ctypes.CDLL(str(PLACE)) if PLACE.is_file() else None

SIZE = ctypes.c_size_t


def _place(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def _encoded(name: str, given: np.ndarray, bound: int, *more: int) -> bytes:
    function, result = getattr(LIBRARY, f"meshopt_{name}"), ctypes.create_string_buffer(bound)
    function.restype = SIZE
    length = function(result, SIZE(bound), _place(given), *map(SIZE, more))
    assert length
    return result.raw[:length]


def attributes(elements: np.ndarray, version: int) -> bytes:
    """Return the stream of elements (count, stride) of bytes."""
    LIBRARY.meshopt_encodeVertexVersion(version)
    return _encoded("encodeVertexBuffer", np.ascontiguousarray(elements), 2 * elements.size + 2000, *elements.shape)


def indices(given: np.ndarray, *, are_triangles: bool) -> bytes:
    LIBRARY.meshopt_encodeIndexVersion(1)
    name = "encodeIndexBuffer" if are_triangles else "encodeIndexSequence"
    return _encoded(name, given.astype("<u4"), 8 * len(given) + 100, len(given))


def decoded(stream: bytes, count: int, stride: int) -> np.ndarray:
    """Return the elements of a stream, shape (count, stride)."""
    result = np.empty((count, stride), np.uint8)
    data = np.frombuffer(stream, np.uint8)
    assert (
        LIBRARY.meshopt_decodeVertexBuffer(_place(result), SIZE(count), SIZE(stride), _place(data), SIZE(len(data)))
        == 0
    )
    return result


def filtered(name: str, numbers: np.ndarray, stride: int, bits: int) -> np.ndarray:
    """Return the library's elements for floats, with `bits` bits, shape (count, stride)."""
    result, function = np.zeros((len(numbers), stride), np.uint8), getattr(LIBRARY, f"meshopt_encodeFilter{name}")
    more = (3,) if name == "Exp" else ()  # Every number with an exponent of its own.
    given = np.ascontiguousarray(numbers, dtype=np.float32)
    function(_place(result), SIZE(len(numbers)), SIZE(stride), ctypes.c_int(bits), _place(given), *more)
    return result


def undone(name: str, elements: np.ndarray) -> np.ndarray:
    """Return the bytes that the library restores from filtered elements."""
    result = elements.copy()
    getattr(LIBRARY, f"meshopt_decodeFilter{name}")(_place(result), *map(SIZE, elements.shape))
    return result
