"""Tests of damaged FBX and glTF files: each is read, or refused in one line, or at worst crashes its own process."""

import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest

from tests.blank import blank
from tests.scripts.recordings.mutations import in_place, mutated
from tests.scripts.recordings.skeletons import body, export, skinned
from tests.scripts.recordings.test_fuzz import Reader, read_and_fill_in
from tests.thoroughness import THOROUGH

bpy = pytest.importorskip("bpy")

CASES = int(os.environ.get("RIGID_MOTION_FUZZ", "200" if THOROUGH else "40"))
FIRST = int(os.environ.get("RIGID_MOTION_FUZZ_FROM", "0"))


def zero_run(content: bytes, chance: Random) -> bytes:
    first, length = chance.randrange(len(content)), chance.choice((1, 4, 64, 4096))
    return content[:first] + bytes(min(length, len(content) - first)) + content[first + length :]


def change_a_length(content: bytes, chance: Random) -> bytes:
    """Change four bytes that may be a length, an offset or a count."""
    place = chance.choice((8, 12, 27, 31, chance.randrange(len(content))))
    if place + 4 > len(content):
        return content
    (old,) = struct.unpack_from("<I", content, place)
    new = chance.choice((0, 1, old + 1, old - 1, 2 * old, 2**31, 2**32 - 1, chance.randrange(2**32))) % 2**32
    return content[:place] + struct.pack("<I", new) + content[place + 4 :]


Damage = Callable[[bytes, Random], bytes]

FBX: tuple[Damage, ...] = (in_place, in_place, in_place, zero_run, change_a_length, mutated)
GLB: tuple[Damage, ...] = (in_place, zero_run, change_a_length, mutated)


@pytest.fixture
def reader() -> Iterator[Reader]:
    one = Reader("test_damaged_bodies", "read_alone")
    yield one
    one.close()


def read_alone(source: str, number: int) -> bool:
    """Return whether the file holds a recording that a mode can interpolate; no data-blocks are left behind."""
    readable = read_and_fill_in(source, number)
    assert not [block for block in bpy.data.user_map() if block.name.startswith(("Body", "Skin", "Importing"))]
    return readable


@pytest.mark.parametrize(("ending", "kinds"), [(".fbx", FBX), pytest.param(".glb", GLB, marks=pytest.mark.any_blender)])
def test_a_damaged_file_is_refused_or_read_or_the_end_of_a_process_but_never_an_error_of_ours(
    tmp_path: Path, reader: Reader, ending: str, kinds: tuple[Damage, ...]
) -> None:
    blank()
    skinned(body())
    sound, path = export(tmp_path / f"sound{ending}"), tmp_path / f"damaged{ending}"
    content, answers = sound.read_bytes(), []
    for number in range(FIRST, FIRST + CASES):
        chance = Random(f"{ending} {number}")
        path.write_bytes(chance.choice(kinds)(content, chance))
        answer = reader.read(f"{path}{':*' if number % 3 == 0 else ''}", number)
        assert answer in (True, False, "crash"), f"case {number} of {ending}: {answer}"
        answers.append(answer)
    assert {True, False} <= set(answers)
    assert answers.count("crash") <= len(answers) // 10, "how many there are is Blender's affair, but they are rare"
    assert reader.read(str(sound), 0) is True
