"""Values as JSON and arrays, and back: dataclasses of numbers, text, arrays and one another, by their types.

A dataclass becomes an object with its class's name under "$", so that a field which may have one of several classes
gets the right one. Arrays go into an .npz beside the JSON.
"""

from __future__ import annotations

import json
import types
from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

T = TypeVar("T")


def to_plain(value: Any, arrays: MutableMapping[str, Any] | None = None) -> Any:
    """A value as plain data for JSON.

    Parameters
    ----------
    value : dataclass, list, tuple, mapping with text for keys, enum, path, number, text or None
    arrays : mapping, optional
        Takes the NumPy arrays, each under a number; without it there may be none.
    """
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, (int, float)):
        return int(value) if isinstance(value, int) else float(value)
    if is_dataclass(value):
        content = {name: to_plain(getattr(value, name), arrays) for name in _names(type(value))}
        return {"$": type(value).__name__, **content}
    if isinstance(value, Mapping):
        return {str(name): to_plain(inner, arrays) for name, inner in value.items()}
    if isinstance(value, (list, tuple, frozenset)):
        return [to_plain(inner, arrays) for inner in (sorted(value) if isinstance(value, frozenset) else value)]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "dtype"):
        if value.ndim == 0:
            return value.item()
        if arrays is not None:
            name = str(len(arrays))
            arrays[name] = value
            return {"array": name}
    raise TypeError(f"{type(value).__name__} is no value for JSON")


def from_plain(kind: Any, plain: Any, arrays: Mapping[str, Any] | None = None) -> Any:
    """The value of `to_plain`, whose type is `kind`: a class, or what an annotation of a field says."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any or plain is None:
        return plain
    if origin in (Union, types.UnionType):
        return from_plain(_member(inner, plain), plain, arrays)
    if isinstance(plain, dict) and plain.keys() == {"array"}:
        return arrays[plain["array"]]
    if isinstance(plain, dict) and "$" in plain:
        found = _class_named(plain["$"], kind)
        hints = _hints(found)
        return found(**{name: from_plain(hints[name], inner, arrays) for name, inner in plain.items() if name != "$"})
    if isinstance(plain, dict):
        of_values = inner[1] if len(inner) == 2 else Any
        return {name: from_plain(of_values, value, arrays) for name, value in plain.items()}
    if isinstance(plain, list):
        if origin is tuple and inner and inner[-1] is not Ellipsis:
            return tuple(from_plain(one, value, arrays) for one, value in zip(inner, plain, strict=True))
        of_values, into = (inner[0] if inner else Any), (kind if origin is None else origin)
        return (into if into in (list, frozenset) else tuple)(from_plain(of_values, value, arrays) for value in plain)
    return kind(plain) if isinstance(kind, type) and issubclass(kind, (Enum, Path, float)) else plain


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
    plain = json.loads(stem.with_suffix(".json").read_text(encoding="utf-8"))
    if not stem.with_suffix(".npz").exists():
        return from_plain(kind, plain)
    import numpy as np

    with np.load(stem.with_suffix(".npz"), allow_pickle=False) as arrays:
        return from_plain(kind, plain, arrays)


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if field.init)


_hints = cache(get_type_hints)


def _member(members: tuple[Any, ...], plain: Any) -> Any:
    """Which of the types of a union a value has."""
    some = [one for one in members if one is not type(None)]
    if isinstance(plain, dict) and "$" in plain:
        return next(one for one in some if any(found.__name__ == plain["$"] for found in _classes(one)))
    kinds = {list: (list, tuple, frozenset), dict: (dict, Mapping)}.get(type(plain), (type(plain),))
    return next((one for one in some if (get_origin(one) or one) in kinds), some[0])


def _class_named(name: str, kind: Any) -> type:
    found = next((one for one in _classes(kind) if one.__name__ == name), None)
    if found is None:
        raise ValueError(f"{name} is no {getattr(kind, '__name__', kind)}")
    return found


def _classes(kind: Any) -> Iterator[type]:
    """A class and those derived from it."""
    if isinstance(kind, type):
        yield kind
        for derived in kind.__subclasses__():
            yield from _classes(derived)
