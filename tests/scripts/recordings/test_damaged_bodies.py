"""Tests of damaged FBX, glTF and .blend files: each is read, or refused in one line, or crashes its own process."""

import os
import struct
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from random import Random

import pytest

from tests.blank import blank
from tests.scripts.recordings.blends import body, export, skinned
from tests.scripts.recordings.mutations import in_place, mutated
from tests.scripts.recordings.test_fuzz import BONE, FIRST, PATIENCE, find_bpy_itself, read_and_fill_in
from tests.thoroughness import THOROUGH

bpy = pytest.importorskip("bpy")

CASES = int(os.environ.get("RIGID_MOTION_FUZZ", "200" if THOROUGH else "40"))


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
BLEND: tuple[Damage, ...] = (in_place, in_place, in_place, in_place, mutated)


def read_alone(source: str, number: int) -> bool:
    """Return whether the file holds a recording that a mode can interpolate; no data-blocks are left behind."""
    with suppress(ImportError):  # Windows limits no process.
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + 3 * PATIENCE, resource.RLIM_INFINITY))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        readable = read_and_fill_in(source, number)
    assert not [block for block in bpy.data.user_map() if block.name.startswith(("Body", "Skin", "Importing"))]
    return readable


@pytest.fixture
def read() -> Iterator[Callable[[str, int], bool | None]]:
    """A function that reads files in a process of its own: whether one held a recording, or None after a crash."""
    pool: ProcessPoolExecutor | None = None

    def _read(source: str, number: int) -> bool | None:
        nonlocal pool
        pool = pool or ProcessPoolExecutor(1, get_context("spawn"), initializer=find_bpy_itself)
        try:
            return pool.submit(read_alone, source, number).result()
        except BrokenProcessPool:
            pool = None
            return None

    yield _read
    if pool:
        pool.shutdown()


@pytest.mark.parametrize(
    ("ending", "kinds"),
    [
        (".fbx", FBX),
        pytest.param(".glb", GLB, marks=pytest.mark.any_blender),
        pytest.param(".blend", BLEND, marks=pytest.mark.slow),
    ],
)
def test_a_damaged_file_is_refused_or_read_or_the_end_of_a_process_but_never_an_error_of_ours(
    tmp_path: Path, read: Callable[[str, int], bool | None], ending: str, kinds: tuple[Damage, ...]
) -> None:
    blank()
    skinned(body())
    sound, path = export(tmp_path / f"sound{ending}"), tmp_path / f"damaged{ending}"
    content, answers = sound.read_bytes(), []
    for number in range(FIRST, FIRST + CASES):
        chance = Random(f"{ending} {number}")
        path.write_bytes(chance.choice(kinds)(content, chance))
        try:
            answers.append(read(f"{path}{('', ':*', BONE)[number % 3]}", number))
        except Exception as error:
            error.add_note(f"case {number} of {ending}: {path}")
            raise
    assert {True, False} <= {*answers}
    # How many there are is Blender's affair: of .blend files about 1 in 100 with 5.2, 1 in 6 with 5.0.
    assert answers.count(None) <= len(answers) // 10 or ending == ".blend"
    for of_it in ("", ":*", BONE):
        assert read(f"{sound}{of_it}", 0) is True
