"""glTF and GLB files: reading and writing the JSON, the buffers and other GLB chunks unchanged.

Only the places of bytes are interpreted. Unknown chunks, members and nulls stay. External files are read only from the
folder of the document and below.
Source: the glTF 2.0 specification, Khronos 2021, sections 3.6 and 4.
"""

from __future__ import annotations

import base64
import json
import math
import ntpath
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from os.path import isfile
from pathlib import Path, PureWindowsPath
from typing import Any
from urllib.parse import quote, unquote

import numpy as np

MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"

MOST_VALUES = 2**22
"""Most values in the JSON: a hundred times as many as a body with thousands of joints needs."""

MOST_TEXT = 2**30
"""Most bytes of the JSON, which may contain whole buffers."""

DEEPEST_JSON = 128
"""Most levels of nested lists and objects in the JSON: a plain document has ten."""

MOST_BYTES = 2**32 - 1
"""Most bytes of a GLB, which stores its length in 32 bits."""

MOST_CHUNKS = 1000

MAX_WHOLE_NUMBER = 2**53
"""Integers must be below this."""

EXPORT_AGAIN = "export it again"

Json = dict[str, Any]


class GltfError(ValueError):
    """An error in a file or a request, in one line, and what to do about it."""

    def __init__(self, problem: str, way_out: str = EXPORT_AGAIN) -> None:
        super().__init__(f"{problem}; {way_out}")
        self.problem, self.way_out = problem, way_out


@contextmanager
def damage_refused() -> Iterator[None]:
    """Raise a `GltfError` in place of the other errors that a damaged document leads to in the block."""
    try:
        yield
    except GltfError:
        raise
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise GltfError(f"this glTF is damaged ({' '.join(str(error).split())[:80]})") from error


@dataclass(frozen=True)
class FileBytes:
    """Bytes of a file, read when `bytes` is called on them. Slices are FileBytes as well."""

    path: Path
    first: int
    end: int

    @classmethod
    def of(cls, path: Path) -> FileBytes:
        """Return all bytes of a file."""
        return cls(path, 0, path.stat().st_size)

    def __len__(self) -> int:
        return self.end - self.first

    def __getitem__(self, part: slice) -> FileBytes:
        first, end, _ = part.indices(len(self))
        return replace(self, first=self.first + first, end=self.first + max(first, end))

    def __bytes__(self) -> bytes:
        with self.path.open("rb") as file:
            file.seek(self.first)
            content = file.read(len(self))
        if len(content) < len(self):
            raise GltfError(f"{self.path.name} has become shorter while it was read", "do it again")
        return content


Chunk = tuple[bytes, bytes | FileBytes]
"""A chunk of a GLB: its kind and content."""


@dataclass(frozen=True, eq=False)
class Document:
    """A glTF document and its bytes.

    Parameters
    ----------
    json : dict
        As in the file.
    buffers : tuple of bytes, FileBytes or None
        Content of each buffer; None for a placeholder of compressed data.
    chunks : tuple of (bytes, bytes or FileBytes), optional
        Kinds and contents of all chunks of a GLB, in order. None for a .gltf file.
    changed : frozenset of int
        Buffers that differ from their files.
    original : int, optional
        Bytes of all files that the document was read from, if unchanged.
    """

    json: Json
    buffers: tuple[bytes | FileBytes | None, ...]
    chunks: tuple[Chunk, ...] | None = None
    changed: frozenset[int] = frozenset()
    original: int | None = None

    @cached_property
    def size(self) -> int:
        """Bytes of the document and its buffers, as they were read or else as they will be written."""
        if self.original is not None:
            return self.original
        text = as_text(self.json)
        parts = () if self.chunks is None else self._glb_chunks(text)
        return size_beside(self.json, self.buffers) + (12 + sum(map(_chunk_size, parts)) if parts else len(text))

    def files(self, name: str) -> dict[str, bytes]:
        """Return the files to write when the document is saved as `name`: file contents by name.

        Changed buffers get files of their own, named after the document.
        """
        beside, buffers, taken = {}, [], {file.casefold() for file in self._external_names()}
        for number, (buffer, data) in enumerate(zip(objects(self.json, "buffers"), self.buffers, strict=True)):
            if number in self.changed and data is not None and "uri" in buffer and not is_data(buffer["uri"]):
                file = f"{Path(name).stem}{number or ''}.bin"
                while file.casefold() in taken:
                    file = f"_{file}"
                beside[file], buffer = bytes(data), {**buffer, "uri": quote(file)}
            buffers.append(buffer)
        document = {**self.json, "buffers": buffers} if beside else self.json
        text = as_text(document)
        if self.chunks is None:
            return beside | {name: text}
        parts = self._glb_chunks(text)
        length = 12 + sum(map(_chunk_size, parts))
        if length > MOST_BYTES:
            raise GltfError(f"{length} bytes are more than a GLB can hold", "export it as .gltf, with files beside it")
        return beside | {name: b"".join((struct.pack("<4sII", MAGIC, 2, length), *map(_chunk, parts)))}

    def _glb_chunks(self, text: bytes) -> list[Chunk]:
        """Return the chunks of a GLB with this JSON."""
        # Content of the first buffer, if it is inside the GLB.
        first = objects(self.json, "buffers")[:1]
        binary = self.buffers[0] if first and "uri" not in first[0] else None
        parts: list[Chunk] = [(JSON_CHUNK, text)]
        for kind, content in self.chunks or ():
            if kind == BINARY_CHUNK and binary is not None:
                content, binary = binary, None
            if kind != JSON_CHUNK:
                parts.append((kind, content))
        return parts if binary is None else [parts[0], (BINARY_CHUNK, binary), *parts[1:]]

    def reread(self) -> Document:
        """Return the document as it would be read after writing."""
        name = "file.gltf" if self.chunks is None else "file.glb"
        return _document(self.files(name)[name], lambda number, _: self.buffers[number])

    def companions(self, folder: Path) -> dict[str, Path | None]:
        """Return the paths of unchanged external files that the document names, by name.

        The path is None for a file outside the folder and its subfolders.
        """
        paths = {name: place_inside(folder, name) for name in self._external_names()}
        return {name: path for name, path in paths.items() if path is None or isfile(path)}

    def _external_names(self) -> list[str]:
        """Return the names of unchanged external files."""
        buffers = [buffer for number, buffer in enumerate(objects(self.json, "buffers")) if number not in self.changed]
        uris = [part.get("uri") for part in (*buffers, *objects(self.json, "images"))]
        return sorted({unquote(uri) for uri in uris if isinstance(uri, str) and not is_data(uri) and "://" not in uri})


def read_document(path: Path, *, in_memory: bool = False) -> Document:
    """Read a .glb or .gltf file; bytes of buffers are read when needed.

    With `in_memory` the whole file is read at once, for a file that will not stay in place.

    Raises
    ------
    GltfError
        If data is damaged, too large, missing or outside the folder.
    OSError
        If the file cannot be read.
    """
    content = path.read_bytes() if in_memory else FileBytes.of(path)
    return _document(content, lambda number, uri: FileBytes.of(file_of(path.parent, number, uri)))


def _document(content: bytes | FileBytes, file: Callable[[int, object], bytes | FileBytes | None]) -> Document:
    """Return a document; `file` returns the content of an external buffer, given its number and URI."""
    chunks = chunks_of(content) if bytes(content[:4]) == MAGIC else None
    document = parsed(bytes(content if chunks is None else next(data for kind, data in chunks if kind == JSON_CHUNK)))
    binary = next((data for kind, data in chunks or () if kind == BINARY_CHUNK), None)
    buffers = [
        _buffer_content(file, number, buffer, binary if number == 0 else None)
        for number, buffer in enumerate(objects(document, "buffers"))
    ]
    return Document(document, tuple(buffers), chunks, original=len(content) + size_beside(document, buffers))


def chunks_of(content: bytes | FileBytes) -> tuple[Chunk, ...]:
    """Return the kinds and contents of all chunks of a GLB file, including the JSON."""
    result: list[Chunk] = []
    offset, whole = 12, len(content)
    if whole >= offset:
        version, length = struct.unpack("<II", bytes(content[4:12]))
        if version != 2:
            raise GltfError(f"this is GLB {version}, and 2 is known", "export it as glTF 2.0")
        if length > whole:
            raise GltfError(f"{whole} of {length} bytes are here", "copy the file again, or export it again")
        whole = length
    while offset + 8 <= whole:
        if len(result) == MOST_CHUNKS:
            raise GltfError(f"this GLB has more than {MOST_CHUNKS} parts")
        length, kind = struct.unpack("<I4s", bytes(content[offset : offset + 8]))
        offset += 8
        if offset + length > whole:
            raise GltfError("a part of this file is longer than the whole")
        result.append((kind, content[offset : offset + length]))
        offset += length
    if JSON_CHUNK not in [kind for kind, _ in result]:
        raise GltfError("this GLB holds no JSON")
    return tuple(result)


def parsed(text: bytes) -> Json:
    """Return the JSON object of a document."""
    values = sum(map(text.count, (b",", b"[", b"{")))
    for count, most, kind in ((values, MOST_VALUES, "values"), (len(text), MOST_TEXT, "bytes")):
        if count > most:
            raise GltfError(
                f"{count} {kind} of JSON are more than the {most} that are read",
                "export the body without the rest of its scene",
            )
    if (depth := _depth(text)) > DEEPEST_JSON:
        raise GltfError(
            f"its JSON has {depth} lists and objects in one another, more than the {DEEPEST_JSON} that are read",
            "export it without its custom properties",
        )
    try:
        document = json.loads(text.decode("utf-8-sig"), parse_float=_finite_number, parse_constant=_finite_number)
    except (RecursionError, ValueError) as error:
        raise GltfError(f"this is not glTF (its JSON cannot be read: {' '.join(str(error).split())[:80]})") from None
    if not isinstance(document, dict):
        raise GltfError("this is not glTF (its JSON is not an object)")
    return document


def bytes_of(document: Document) -> int:
    """Return the total number of bytes in the buffers of a document."""
    return sum(len(data) for data in document.buffers if data is not None)


def objects(parent: Json, name: str) -> list[Json]:
    """Return the objects of a list in the document; empty if there is no list."""
    result = parent.get(name)
    if result is None:
        return []
    if not isinstance(result, list) or not all(isinstance(entry, dict) for entry in result):
        raise GltfError(f"{name} is not a list of objects")
    return result


def entry(parent: Json, name: str, number: Any) -> Json:
    """Return an object by its number in a list of the document."""
    result = parent.get(name, [])
    is_number = isinstance(number, int) and not isinstance(number, bool)
    if not isinstance(result, list) or not is_number or not 0 <= number < len(result):
        objects(parent, name)
        raise GltfError(f"{name} has no entry {shown(number)}, which something in the file names")
    return result[number] if isinstance(result[number], dict) else objects(parent, name)[number]


def _depth(text: bytes) -> int:
    """Return the deepest nesting of lists and objects in a JSON text."""
    outside = re.sub(rb'"[^"]*"', b"", text.replace(rb"\\", b"").replace(rb"\"", b""))
    signs = np.frombuffer(outside, dtype=np.uint8) & ~np.uint8(ord("[") ^ ord("{"))
    steps = (signs == ord("[")).astype(np.int8) - (signs == ord("]")).astype(np.int8)
    return int(np.cumsum(steps[steps != 0]).max(initial=0))


def whole(parent: Json, name: str, default: int | None = None, least: int = 0) -> int:
    """Return a member that must be an integer of at least `least`."""
    number = parent.get(name, default)
    if isinstance(number, float) and number.is_integer():
        number = int(number)
    if not isinstance(number, int) or isinstance(number, bool) or not least <= number < MAX_WHOLE_NUMBER:
        raise GltfError(f"{name} is {shown(number)}, and has to be a whole number from {least} on")
    return number


def shown(value: object) -> str:
    """Return a value of a file for use in a message: short, on one line."""
    return repr(value)[:60]


def is_data(uri: object) -> bool:
    return isinstance(uri, str) and uri[:5].lower() == "data:"


def bytes_of_uri(uri: str) -> bytes:
    """Return the content of a data URI. Raises ValueError if it is not base64."""
    head, _, data = uri.partition(",")
    if not head.endswith(";base64"):
        raise ValueError("not in base64")
    return base64.b64decode(data)


def size_beside(json: Json, buffers: Sequence[bytes | FileBytes | None]) -> int:
    """Return the total bytes of external buffers."""
    described = zip(objects(json, "buffers"), buffers, strict=True)
    return sum(len(data) for buffer, data in described if data and "uri" in buffer and not is_data(buffer["uri"]))


def place_inside(folder: Path, name: str) -> Path | None:
    """Return where a path leads, following links; None if that is outside the folder, by the rules of any system."""
    if ":" in name or PureWindowsPath(name).anchor or ntpath.normpath(name).split("\\")[0] == "..":
        return None
    try:
        path = (folder / name).resolve()
        return path if path.is_relative_to(folder.resolve()) else None
    except (OSError, RuntimeError, ValueError):  # Circular links, or names that no system allows.
        return None


def file_of(folder: Path, number: int, uri: object) -> Path:
    """Return the path of a buffer's file.

    Raises
    ------
    GltfError
        If the path is outside the folder, or is not a file.
    """
    path = place_inside(folder, unquote(uri)) if isinstance(uri, str) else None
    if path is None:
        raise GltfError(
            f"buffer {number} is outside of its folder ({shown(uri)})", "export it as .glb, which is one file"
        )
    if not isfile(path):
        raise GltfError(
            f"buffer {number}, {shown(unquote(str(uri)))}, is not there",
            "bring that file along, or export it as .glb, which is one file",
        )
    return path


def data_uri(data: bytes) -> str:
    return f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"


def as_text(document: Json) -> bytes:
    try:
        return json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    except UnicodeEncodeError:  # Surrogate halves, which JSON can only contain as escaped numbers.
        return json.dumps(document, allow_nan=False, separators=(",", ":")).encode()


def _buffer_content(
    file: Callable[[int, object], bytes | FileBytes | None],
    number: int,
    buffer: Json,
    binary: bytes | FileBytes | None,
) -> bytes | FileBytes | None:
    uri, length = buffer.get("uri"), whole(buffer, "byteLength", least=1)
    if uri is None:
        data = binary
    elif is_data(uri):
        try:
            data = bytes_of_uri(uri)
        except ValueError:
            raise GltfError(f"buffer {number} is text that is not in base64") from None
    else:
        data = file(number, uri)
    if data is None:
        return None
    if len(data) < length:
        raise GltfError(f"buffer {number} has {len(data)} of {length} bytes", "copy the file again, or export it again")
    return data[:length]


def _chunk(part: Chunk) -> bytes:
    kind, content = part[0], bytes(part[1])
    content += (b" " if kind == JSON_CHUNK else b"\0") * (-len(content) % 4)
    return struct.pack("<I4s", len(content), kind) + content


def _chunk_size(part: Chunk) -> int:
    return 8 + -(-len(part[1]) // 4) * 4


def _finite_number(text: str) -> float:
    number = float(text) if text[-1:].isdigit() else math.nan
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is not a number")
    return number
