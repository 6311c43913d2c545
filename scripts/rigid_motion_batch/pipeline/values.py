"""Values as JSON and arrays, and back: dataclasses of numbers, text, tuples, mappings, arrays and other dataclasses.

A dataclass becomes an object with its module and name under "$". Arrays go into an .npz next to the JSON.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, MutableMapping
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, get_origin

import numpy as np

T = TypeVar("T")

CLASS, ARRAY = "$", "array"


def plain(value: Any, arrays: MutableMapping[str, Any] | None = None) -> Any:
    """Return a dataclass or NumPy number as plain data, for `json.dumps(..., default=plain)`.

    NumPy arrays go into `arrays`, each under a number; without `arrays`, an array raises TypeError.
    """
    if is_dataclass(value):
        kind: type = type(value)
        content = {field.name: getattr(value, field.name) for field in fields(kind) if field.init}
        return {CLASS: f"{kind.__module__}:{kind.__qualname__}", **content}
    if getattr(value, "ndim", None) == 0:
        return value.item()
    if arrays is None or not hasattr(value, "dtype"):
        raise TypeError(f"{type(value).__name__} is not a value for JSON")
    name = str(len(arrays))
    arrays[name] = value
    return {ARRAY: name}


def write(stem: Path, value: Any) -> None:
    """Write a value to STEM.json, and its arrays, if any, to STEM.npz."""
    arrays: dict[str, Any] = {}
    stem.with_suffix(".json").write_text(json.dumps(value, default=partial(plain, arrays=arrays)), encoding="utf-8")
    if arrays:
        np.savez(stem.with_suffix(".npz"), **arrays)


def read(kind: type[T], stem: Path) -> T:
    """Read a value of this type that `write` has written, with lists as tuples.

    Raises OSError, ValueError or KeyError if the file is damaged, or names a class that is not loaded or no dataclass.
    """
    arrays: dict[str, Any] = {}
    if stem.with_suffix(".npz").exists():
        with np.load(stem.with_suffix(".npz"), allow_pickle=False) as stored:
            arrays = dict(stored)
    value = _value(json.loads(stem.with_suffix(".json").read_bytes()), arrays)
    if not isinstance(value, get_origin(kind) or kind):
        raise ValueError(f"{stem}: a {type(value).__name__} is no {kind.__name__}")
    return value


def _value(content: Any, arrays: Mapping[str, Any]) -> Any:
    """Return the value of content read from JSON."""
    if isinstance(content, list):
        return tuple(_value(item, arrays) for item in content)
    if not isinstance(content, dict):
        return content
    if content.keys() == {ARRAY}:
        return arrays[content[ARRAY]]
    content = {name: _value(inner, arrays) for name, inner in content.items()}
    if CLASS not in content:
        return content
    module, _, name = content.pop(CLASS).partition(":")
    kind = getattr(sys.modules.get(module), name, None)  # Reading loads no modules: the reader has loaded the class.
    if not (isinstance(kind, type) and is_dataclass(kind)):
        raise ValueError(f"{module}:{name} is not a class of values")
    return kind(**content)
