"""The kinds of what is moved. A kind is one row here, and one in `writers.table`."""

from __future__ import annotations

from functools import lru_cache

import bpy

from .bones import BoneTransform
from .objects import ExactObjectTransform, ObjectTransform
from .transform import Transform

KINDS: tuple[type[Transform], ...] = (BoneTransform, ObjectTransform, ExactObjectTransform)


def transform_of(carrier: bpy.types.Object | bpy.types.PoseBone | Transform) -> Transform:
    """Return the transform of something that Blender has, where it is none already."""
    if isinstance(carrier, Transform):
        return carrier
    for kind in KINDS:
        if isinstance(carrier, kind.carrier_type):
            return kind.of(carrier)
    raise TypeError(f"neither an object nor a pose bone: {carrier!r}")


@lru_cache(maxsize=65536)
def kind_of(prefix: str) -> type[Transform] | None:
    """Return the kind of what data paths that begin so lead to, None where no kind has such paths."""
    return next((kind for kind in KINDS if kind.has_prefix(prefix)), None)


def is_part(prefix: str) -> bool:
    """Return whether data paths that begin so lead to a part of a data-block."""
    kind = kind_of(prefix)
    return kind is not None and kind.is_part
