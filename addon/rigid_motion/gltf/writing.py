"""Accessors that are added to a document, in views that grow with them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .accessors import KINDS
from .documents import Json

TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}

COMPONENT_TYPES = {kind.lstrip("<"): number for number, kind in KINDS.items()}

ALIGNED = 4
"""Bytes: where numbers begin."""


class GrowingView:
    """A view behind all that a document has, and its bytes, which are to be put into a buffer.

    Parameters
    ----------
    json : dict
        The document, to whose lists views and accessors are added.
    more : int
        What else is to be said of the view, such as its target.
    """

    def __init__(self, json: Json, **more: int) -> None:
        self.accessors, views = (json.setdefault(name, []) for name in ("accessors", "bufferViews"))
        self.number = len(views)
        self.json: Json = {"buffer": 0, **more}
        views.append(self.json)
        self.data = bytearray()
        self._known: dict[tuple[str, int, bytes], int] = {}

    def add(self, numbers: np.ndarray, *, bounds: bool = False) -> int:
        """Return the number of an accessor of these (count, columns), the same where there is one already.

        Whole numbers with a sign are normalised ones.
        """
        kind, content = numbers.dtype.str.lstrip("<|"), numbers.tobytes()
        known = (kind, numbers.shape[1], content)
        if known not in self._known:
            accessor = self.placed(content) | {"componentType": COMPONENT_TYPES[kind]}
            accessor |= {"normalized": True} if numbers.dtype.kind == "i" else {}
            accessor |= {"count": len(numbers), "type": TYPES[numbers.shape[1]]}
            if bounds:
                accessor |= {"min": numbers.min(axis=0).tolist(), "max": numbers.max(axis=0).tolist()}
            self._known[known] = len(self.accessors)
            self.accessors.append(accessor)
        return self._known[known]

    def placed(self, content: bytes) -> Json:
        """Return what an accessor says of where these bytes are, which come behind the others."""
        self.data += bytes(-len(self.data) % ALIGNED)
        offset = len(self.data)
        self.data += content
        return {"bufferView": self.number} | ({"byteOffset": offset} if offset else {})


def in_one_buffer(views: Iterable[GrowingView]) -> bytes:
    """Return the bytes of views one after the other, which know their places in them from then on."""
    data = bytearray()
    for view in views:
        data += bytes(-len(data) % ALIGNED)
        view.json |= {"byteOffset": len(data), "byteLength": len(view.data)}
        data += view.data
    return bytes(data)
