"""Values as JSON and arrays, and back: dataclasses of numbers, text, tuples, mappings, arrays and one another.

A dataclass becomes an object with its module and name under "$". Arrays go into an .npz beside the JSON.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, MutableMapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_origin

T = TypeVar("T")

CLASS, ARRAY = "$", "array"


def to_plain(value: Any, arrays: MutableMapping[str, Any] | None = None) -> Any:
    """Return a value as plain data for JSON.

    Parameters
    ----------
    value : dataclass, list, tuple, mapping with text for keys, number, text or None
    arrays : mapping, optional
        Takes the NumPy arrays, each under a number; without it there may be none.
    """
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if is_dataclass(value):
        kind: type = type(value)
        content = {name: to_plain(getattr(value, name), arrays) for name in _names(kind)}
        return {CLASS: f"{kind.__module__}:{kind.__qualname__}", **content}
    if isinstance(value, Mapping):
        return {name: to_plain(inner, arrays) for name, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_plain(inner, arrays) for inner in value]
    if hasattr(value, "dtype"):
        if value.ndim == 0:
            return value.item()
        if arrays is not None:
            name = str(len(arrays))
            arrays[name] = value
            return {ARRAY: name}
    raise TypeError(f"{type(value).__name__} is no value for JSON")


def from_plain(plain: Any, arrays: Mapping[str, Any] | None = None) -> Any:
    """Return the value of `to_plain`, lists as tuples. ValueError for a class not loaded, or no dataclass."""
    if isinstance(plain, list):
        return tuple(from_plain(inner, arrays) for inner in plain)
    if not isinstance(plain, dict):
        return plain
    if plain.keys() == {ARRAY}:
        return (arrays or {})[plain[ARRAY]]
    content = {name: from_plain(inner, arrays) for name, inner in plain.items() if name != CLASS}
    return _class_named(plain[CLASS])(**content) if CLASS in plain else content


def write(stem: Path, value: Any) -> None:
    """Write a value to STEM.json, and its arrays, if it has any, to STEM.npz."""
    arrays: dict[str, Any] = {}
    plain = to_plain(value, arrays)
    stem.with_suffix(".json").write_text(json.dumps(plain), encoding="utf-8")
    if arrays:
        import numpy as np

        np.savez(stem.with_suffix(".npz"), **arrays)


def read(kind: type[T], stem: Path) -> T:
    """Read a value of this type that was written. Raises OSError, ValueError or KeyError where it is damaged."""
    arrays: dict[str, Any] = {}
    if stem.with_suffix(".npz").exists():
        import numpy as np

        with np.load(stem.with_suffix(".npz"), allow_pickle=False) as stored:
            arrays = dict(stored)
    value = from_plain(json.loads(stem.with_suffix(".json").read_text(encoding="utf-8")), arrays)
    if not isinstance(value, get_origin(kind) or kind):
        raise ValueError(f"{stem}: a {type(value).__name__} is no {kind.__name__}")
    return value


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if field.init)


def _class_named(name: str) -> type:
    """Return a class by its module and name. What asks for a value has loaded its class: a file loads nothing."""
    module, _, kind = name.partition(":")
    result = getattr(sys.modules.get(module), kind, None)
    if not (isinstance(result, type) and is_dataclass(result)):
        raise ValueError(f"{name} is no class of values")
    return result
