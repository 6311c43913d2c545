"""Damaged FBX and glTF files: each is refused in one line or read, in a process that may be lost, and only that."""

import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import astuple
from pathlib import Path
from random import Random

import numpy as np
import pytest

from rigid_motion_batch.analysis.choices import Radii, Uniform
from rigid_motion_batch.analysis.results import clip_result
from rigid_motion_batch.recordings.clips import Clip
from tests.blank import blank
from tests.scripts.clips.recordings import compare_clip
from tests.scripts.recordings.mutations import in_place, mutated
from tests.scripts.recordings.skeletons import body, export, skinned
from tests.scripts.recordings.test_fuzz import Reader, clips_or_refusal
from tests.thoroughness import THOROUGH

bpy = pytest.importorskip("bpy")

CASES = int(os.environ.get("RIGID_MOTION_FUZZ", "1000" if THOROUGH else "40"))
FIRST = int(os.environ.get("RIGID_MOTION_FUZZ_FROM", "0"))


def zero_run(content: bytes, chance: Random) -> bytes:
    first, length = chance.randrange(len(content)), chance.choice((1, 4, 64, 4096))
    return content[:first] + bytes(min(length, len(content) - first)) + content[first + length :]


def change_a_length(content: bytes, chance: Random) -> bytes:
    """Four bytes that may be a length, an offset or a number of something are another."""
    place = chance.choice((8, 12, 27, 31, chance.randrange(len(content))))
    if place + 4 > len(content):
        return content
    (old,) = struct.unpack_from("<I", content, place)
    new = chance.choice((0, 1, old + 1, old - 1, 2 * old, 2**31, 2**32 - 1, chance.randrange(2**32))) % 2**32
    return content[:place] + struct.pack("<I", new) + content[place + 4 :]


Damage = Callable[[bytes, Random], bytes]

FBX: tuple[Damage, ...] = (in_place, in_place, in_place, zero_run, change_a_length, mutated)
GLB: tuple[Damage, ...] = (in_place, zero_run, change_a_length, mutated)


def assert_can_be_shown(clip: Clip) -> None:
    """Measured by the program, with numbers that are some, in tables and in all that a page shows."""
    result = compare_clip(clip, Uniform("5"), ("lerp_slerp",), Radii())
    if result is not None:
        for row in (*result.rows, *result.joints):
            assert all(np.isfinite(cell) for cell in astuple(row) if isinstance(cell, float)), row
        assert np.isfinite(clip_result(clip, [result]).truth.positions).all()
        for motion in result.motions:
            assert np.isfinite(motion.poses.positions).all()
            assert np.isfinite(motion.errors).all()


@pytest.fixture
def reader() -> Iterator[Reader]:
    one = Reader("test_damaged_bodies", "read_and_place")
    yield one
    one.close()


def read_and_place(source: str, _: int) -> bool:
    """Whether there is a recording, all of whose joints are somewhere; else there has to be a refusal in one line."""
    clips = clips_or_refusal(source)
    if clips is None:
        return False
    assert not [block for block in bpy.data.user_map() if block.name.startswith(("Body", "Skin", "Importing"))]
    for clip in clips:
        poses = clip.poses if clip.rest_body is None else clip.rest_body.skeleton.in_root_space(clip.poses)
        assert np.isfinite(poses.positions).all()
        assert np.allclose(np.linalg.norm(poses.quaternions, axis=-1), 1.0)
        if clip.rest_body is not None:
            assert_can_be_shown(clip)
    return True


@pytest.mark.parametrize(("ending", "kinds"), [(".fbx", FBX), (".glb", GLB)])
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
