"""References to accessors and buffer views in a glTF document: known places, and numbers that may be references.

Unknown extensions may refer to them in their own way. Any integer in their content may be the number of an accessor or
a view, so with such extensions nothing is renumbered, and anything with such a number keeps all of its bytes. If such
an extension names a buffer, no bytes are removed. `extras` contain no references: they belong to applications.
Source: the registry of glTF extensions, Khronos 2025.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from .documents import Json, objects
from .tracks import moves_node

INSTANCING_EXTENSION = "EXT_mesh_gpu_instancing"

KNOWN_REFERENCES = re.compile(
    "KHR_(?:materials_.*|texture_(?:transform|basisu)|lights_punctual|mesh_quantization|animation_pointer|xmp|xmp_json_ld"
    "|node_(?:visibility|selectability|hoverability)|draco_mesh_compression|meshopt_compression|techniques_webgl)"
    f"|EXT_(?:texture_(?:webp|avif)|lights_image_based|meshopt_compression)|{INSTANCING_EXTENSION}"
    "|MSFT_(?:lod|texture_dds|packing_.*)|FB_ngon_encoding|VRM"
    "|VRMC_(?:vrm|vrm_animation|node_constraint|springBone|springBone_extended_collider|materials_.*)"
)
"""Extensions that refer to accessors only by `INSTANCING_EXTENSION`, and to views only as `bufferView`."""

NO_ANIMATION = -1
"""Stands for any user of an accessor other than animation channels that move nodes."""

NUMBER_PATTERN = re.compile(r"(?<!\d)\d{1,9}(?!\d)")

Slot = tuple[Json, str]
"""A place with a reference: its container and key."""


def sampler_slots(json: Json) -> Iterator[Slot]:
    """Yield all places in animations that name an accessor."""
    for animation in objects(json, "animations"):
        for sampler in objects(animation, "samplers"):
            yield from ((sampler, key) for key in ("input", "output"))


def other_slots(json: Json) -> Iterator[Slot]:
    """Yield all other known places that name an accessor."""
    for mesh in objects(json, "meshes"):
        for primitive in objects(mesh, "primitives"):
            if "indices" in primitive:
                yield primitive, "indices"
            for attributes in (primitive.get("attributes") or {}, *objects(primitive, "targets")):
                yield from ((attributes, name) for name in attributes)
    for skin in objects(json, "skins"):
        if "inverseBindMatrices" in skin:
            yield skin, "inverseBindMatrices"
    for node in objects(json, "nodes"):
        attributes = node.get("extensions", {}).get(INSTANCING_EXTENSION, {}).get("attributes", {})
        yield from ((attributes, name) for name in attributes)


def view_slots(json: Json) -> Iterator[Slot]:
    """Yield all places that name a view, including in extensions: all known ones use the same key."""
    waiting: list[Any] = [json]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            if isinstance(part.get("bufferView"), int):
                yield part, "bufferView"
            waiting += [below for name, below in part.items() if name != "extras"]
        elif isinstance(part, list):
            waiting += part


def unknown(part: Any) -> Iterator[Any]:
    """Yield the contents of unknown extensions."""
    waiting = [part]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            extensions = part.get("extensions")
            extensions = extensions if isinstance(extensions, dict) else {}
            waiting += [below for name, below in part.items() if name not in ("extensions", "extras")]
            waiting += [content for name, content in extensions.items() if KNOWN_REFERENCES.fullmatch(name)]
            yield from (content for name, content in extensions.items() if not KNOWN_REFERENCES.fullmatch(name))
        elif isinstance(part, list):
            waiting += part


class References:
    """Users of the accessors of a document, and the numbers that must not change."""

    def __init__(self, json: Json) -> None:
        self.unclear: set[int] = set()
        """Numbers in unknown extensions: they may be accessors, views, or something else."""
        self.buffers_are_named = False
        """Whether an unknown extension names a buffer."""
        self._collect_numbers(list(unknown(json)))
        self.users: dict[int, set[int]] = defaultdict(set)
        """By accessor number: the animations whose tracks may be replaced, and NO_ANIMATION for other users."""
        for container, key in other_slots(json):
            self.users[container[key]].add(NO_ANIMATION)
        for number in self.unclear:
            self.users[number].add(NO_ANIMATION)
        for number, animation in enumerate(objects(json, "animations")):
            samplers, channels = objects(animation, "samplers"), objects(animation, "channels")
            stay = {channel.get("sampler") for channel in channels if not moves_node(channel["target"])}
            for sampler_number, sampler in enumerate(samplers):
                for key in ("input", "output"):
                    self.users[sampler[key]].add(number)
                    if sampler_number in stay:
                        self.users[sampler[key]].add(NO_ANIMATION)

    def _collect_numbers(self, waiting: list[Any]) -> None:
        while waiting:
            part = waiting.pop()
            if isinstance(part, dict):
                self.buffers_are_named |= "buffer" in part
                waiting += [*part.keys(), *part.values()]
            elif isinstance(part, list):
                waiting += part
            elif isinstance(part, str):
                self.unclear.update(map(int, NUMBER_PATTERN.findall(part)))
            elif isinstance(part, (int, float)) and not isinstance(part, bool) and part == int(part):
                self.unclear.add(int(part))
