"""Fuzz tests of readers: a damaged file is refused in one line, or becomes a recording that modes can interpolate.

RIGID_MOTION_FUZZ=20000 tries that many damaged files of each format, instead of the few that an ordinary run has time
for. A failure names its case; RIGID_MOTION_FUZZ_FROM begins there.
"""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random

import numpy as np
import pytest

from rigid_motion.motion import MODES, interpolate, measure, reduce_keys
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.recordings import ReadingOptions, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.options import AS_THE_FILE_SAYS
from tests.scripts.recordings.layouts import LAYOUTS
from tests.scripts.recordings.mutations import in_place, mutated
from tests.scripts.recordings.optical_layouts import OPTICAL
from tests.scripts.recordings.seeds import bvh
from tests.thoroughness import tried

CASES = int(os.environ.get("RIGID_MOTION_FUZZ", tried(400)))
BLENDS = int(os.environ.get("RIGID_MOTION_FUZZ", "40"))
FIRST = int(os.environ.get("RIGID_MOTION_FUZZ_FROM", "0"))

FILLED_IN = max(1, CASES // 400)
"""One in this many cases is also interpolated, which takes longer than reading."""

PATIENCE = 20
"""Limit of processor time for one small file, in seconds."""

LONGEST_ERROR = 2000
"""The most characters of an error message, without the path."""

BONE = ":Rig/Hand"
"""Suffix of a source that requests a bone."""

WHAT_IS_WRONG = re.compile(rf"(:\d+|:\*|{BONE})?: .+; .+")
"""The form of an error message after the path."""

ROOT = Path(__file__).parents[3]


def read_and_fill_in(source: str, number: int, options: ReadingOptions = AS_THE_FILE_SAYS) -> bool:
    """Return whether the file holds a recording; any outcome other than that or a refusal in one line is an error."""
    try:
        recording = read_trajectories(source, options)
        clips = [make_clip(trajectory, source, trajectory.name, "blender") for trajectory in recording.trajectories]
    except TrajectoryError as error:
        assert_is_one_line(str(error), source)
        return False
    assert recording.note.isprintable()
    if number % FILLED_IN:
        return True
    mode = list(MODES)[number // FILLED_IN % len(MODES)]
    for clip in clips:
        between = np.linspace(clip.times[0], clip.times[-1], 20)
        poses = interpolate(clip.times, clip.poses, between, mode)
        assert np.isfinite(poses.positions).all()
        assert np.isfinite(poses.quaternions).all()
        ends = [0, len(clip.times) - 1]
        shown = interpolate(clip.times[ends], clip.poses[..., ends], clip.times, mode)
        assert np.isfinite(measure(clip.times, shown, clip.poses).shell).all()
        if clip.rest_body is not None:
            made = reconstruct(clip, Uniform("5"), (mode,), 0.03)
            if made is not None:
                assert np.isfinite(measured(made).rows[0].rms_shell_m)
        elif len(clip.times) < 50:
            assert len(reduce_keys(clip.times, clip.poses, mode, tolerance=0.01)) >= 2
    return True


def assert_is_one_line(message: str, source: str) -> None:
    path = source.removesuffix(":*").removesuffix(BONE)
    assert message.startswith(path)
    assert WHAT_IS_WRONG.fullmatch(message, len(path)), f"not of the form FILE:LINE: problem; way out: {message!r}"
    assert message.isprintable()
    assert len(message) < LONGEST_ERROR + 3 * len(path)


def fuzz(folder: Path, ending: str, sound: bytes, cases: int, options: ReadingOptions = AS_THE_FILE_SAYS) -> int:
    """Read damaged files, and return how many could still be read."""
    path, readable = folder / f"take{ending}", 0
    for number in range(FIRST, FIRST + cases):
        chance = Random(f"{ending} {number}")
        path.write_bytes(mutated(sound, chance))
        source = f"{path}{chance.choice(('', ':*'))}"
        started = time.process_time()
        try:
            readable += read_and_fill_in(source, number, options)
        except Exception as error:
            error.add_note(f"case {number} of {ending}: {path}")
            raise
        assert time.process_time() - started < PATIENCE, f"case {number} of {ending}: {path}"
    return readable


@pytest.mark.any_blender
def test_a_damaged_bvh_is_refused_in_one_line_or_can_be_filled_in(tmp_path: Path) -> None:
    readable = fuzz(tmp_path, ".bvh", bvh().encode(), CASES)
    assert 0 < readable < CASES, "damage that is always or never noticed tells little"


@pytest.mark.any_blender
@pytest.mark.parametrize("name", [*LAYOUTS, *OPTICAL])
def test_damage_to_any_layout_is_refused_in_one_line_or_can_be_filled_in(tmp_path: Path, name: str) -> None:
    layout = (LAYOUTS | OPTICAL)[name]
    fuzz(tmp_path, f".{layout.name}", layout.text.encode(), CASES // 10, ReadingOptions(**layout.said))


READER = """
import json, os, resource, sys, time, warnings
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
import bpy
from tests.scripts.recordings.%s import %s as read
warnings.simplefilter("error", RuntimeWarning)
for line in sys.stdin:
    number, source = json.loads(line)
    resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + %d, resource.RLIM_INFINITY))
    try:
        answer = read(source, number)
    except Exception as error:
        answer = f"{type(error).__name__}: {error}"
    print(json.dumps(answer), file=answers, flush=True)
os._exit(0)
"""


class Reader:
    """A separate process that reads files with Blender, and restarts after a damaged file has crashed it."""

    def __init__(self, module: str = "test_fuzz", function: str = "read_and_fill_in") -> None:
        self._code = READER % (module, function, 3 * PATIENCE)
        self._process: subprocess.Popen[str] | None = None

    def read(self, source: str, number: int) -> bool | str:
        """Return whether the file held a recording, or what went wrong."""
        if self._process is None:
            command = [sys.executable, "-c", self._code]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
            self._process = subprocess.Popen(command, cwd=ROOT, text=True, **pipes)
        try:
            print(json.dumps([number, source]), file=self._process.stdin, flush=True)
            answer = self._process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if answer:
            return json.loads(answer)
        self.close()
        return "crash"

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


@pytest.fixture
def reader() -> Iterator[Reader]:
    one = Reader()
    yield one
    one.close()


@pytest.fixture
def animated_blend(tmp_path: Path) -> Path:
    """An uncompressed .blend file with a moving object and a moving bone."""
    bpy = pytest.importorskip("bpy")
    from tests.scripts.recordings.blends import empty, key, rig

    bpy.ops.wm.read_factory_settings(use_empty=True)
    drill = empty("Drill")
    arm = rig("Rig", {"Arm": ((0, 0, 0), (0, 1, 0), None), "Hand": ((0, 1, 0), (0, 2, 0), "Arm")})
    for frame in (1, 5, 9):
        key(drill, frame, location=(frame, 0.5, 1.0))
        key(arm.pose.bones["Arm"], frame, rotation_euler=(0.1 * frame, 0.5, 1.0))
    path = tmp_path / "sound.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return path


@pytest.mark.slow
def test_a_damaged_blend_is_refused_or_read_or_the_end_of_a_process_but_never_an_error_of_ours(
    tmp_path: Path, animated_blend: Path, reader: Reader
) -> None:
    content, path = animated_blend.read_bytes(), tmp_path / "damaged.blend"
    answers = []
    for number in range(FIRST, FIRST + BLENDS):
        chance = Random(f".blend {number}")
        path.write_bytes((mutated if number % 5 == 0 else in_place)(content, chance))
        answer = reader.read(f"{path}{':*' if number % 2 else BONE}", number)
        assert answer in (True, False, "crash"), f"case {number} of .blend: {answer}"
        answers.append(answer)
    # The share of crashes depends on Blender: about 1 in 100 with 5.2, 1 in 6 with 5.0.
    assert True in answers
    assert False in answers
    assert reader.read(f"{animated_blend}:*", 0) is True
    assert reader.read(f"{animated_blend}{BONE}", 0) is True
