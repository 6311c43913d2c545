"""Tests of bake.py on problems: broken files, paths that cannot be written, and interruption."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from rigid_motion_batch import supervising
from tests.full_disk import disk_full_after
from tests.scripts.baking import baked_name, frames_of_keys, one_object_file, open_again, run, with_version
from tests.scripts.processes import ROOT, run_python
from tests.scripts.reducing import listed

PR_CAPBSET_DROP, CAPABILITIES = 24, (1, 2)
"""See prctl(2) and capabilities(7): the capabilities by which root on Linux ignores file permissions."""


def run_without_privileges(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run bake.py as a user who is bound by file permissions, even if root runs the tests."""

    def give_up() -> None:
        if os.geteuid() == 0:
            for capability in CAPABILITIES:
                ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)

    line = [sys.executable, ROOT / "scripts" / "bake.py", *arguments]
    return subprocess.run(line, capture_output=True, text=True, timeout=60, preexec_fn=give_up)


def cut(path: Path) -> None:
    path.write_bytes(one_object_file(path).read_bytes()[:50_000])


def newer(path: Path) -> None:
    with_version(one_object_file(path, compress=False), "999", "9999")


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda path: path.write_text("not Blender's"), "this is not a .blend file"),
        (Path.touch, "this is not a .blend file, it is empty"),
        (cut, "Blender cannot read this file, which looks damaged"),
        (newer, "and this is"),
        (Path.mkdir, "there is nothing to be done in this folder"),
        (os.mkfifo, "this is not a file on a disk"),
        (lambda path: None, "this cannot be opened (No such file or directory)"),
    ],
    ids=["text", "empty", "cut off", "newer", "folder", "pipe", "missing"],
)
def test_a_file_that_cannot_be_read_is_named_and_the_others_go_on(tmp_path, capfd, make, problem):
    bad, good = tmp_path / "bad.blend", one_object_file(tmp_path / "good.blend")
    make(bad)
    capfd.readouterr()
    assert run(bad, good) == 1
    said = capfd.readouterr()
    (line,) = (line for line in said.err.splitlines() if "bad.blend" in line)
    assert line.startswith(f"{bad}: ")
    assert problem in line
    assert said.out == f"{baked_name(good)}\n"
    assert run(bad) == 2
    assert not baked_name(bad).exists()


@pytest.mark.any_blender
@pytest.mark.parametrize(("dry", "below"), [((), "new/folders"), (("--dry-run",), "")])
def test_a_read_only_folder_is_named_by_its_own_name_and_before_the_work(tmp_path, dry, below):
    path, folder = one_object_file(tmp_path / "shot.blend"), tmp_path / "read-only"
    folder.mkdir(mode=0o500)
    done = run_without_privileges(path, "--output", folder / below, *dry)
    output = folder / below / "shot-baked.blend"
    problem = (
        f"{path}: {output} cannot be written, for {folder} is read-only: allow it, or write elsewhere with --output"
    )
    assert problem in done.stderr.splitlines()
    assert (done.returncode, done.stdout, os.listdir(folder)) == (1, "", [])
    assert ": baked" not in done.stderr


@pytest.mark.parametrize("options", [(), ("--in-place",)])
def test_a_name_that_is_too_long_for_the_result_is_told(tmp_path, capsys, options):
    made = one_object_file(tmp_path / "shot.blend")
    path = made.rename(tmp_path / f"{'ü' * 124}x.blend")  # With -baked or a 1 appended, the name is too long.
    assert len(os.fsencode(path.name)) == 255
    capsys.readouterr()
    assert run(path, *options) == 1
    *_, line, _ = capsys.readouterr().err.splitlines()
    assert line.endswith("could not be written (File name too long): write elsewhere with --output")
    assert listed(tmp_path) == [path.name]


@pytest.mark.parametrize(
    ("options", "compress"), [((), True), (("--overwrite",), False), (("--in-place",), True), (("--in-place",), False)]
)
def test_on_a_full_disk_nothing_is_written_and_what_is_there_stays(tmp_path, capsys, options, compress):
    path = one_object_file(tmp_path / "shot.blend", compress=compress)
    if options == ("--overwrite",):
        baked_name(path).write_text("precious")
    before = {item.name: item.read_bytes() for item in tmp_path.iterdir()}
    capsys.readouterr()
    with disk_full_after(path.stat().st_size // 2):
        assert run(path, *options) == 1
    said = capsys.readouterr()
    output = path if options == ("--in-place",) else baked_name(path)
    assert f"{path}: {output} could not be written (it broke off half-way, the disk may be full)" in said.err
    assert said.out == ""
    assert {item.name: item.read_bytes() for item in tmp_path.iterdir()} == before


def test_a_link_is_saved_through_in_place_and_the_file_before_kept(tmp_path, capsys):
    (tmp_path / "real").mkdir()
    real, link = one_object_file(tmp_path / "real" / "shot.blend"), tmp_path / "link.blend"
    before = real.read_bytes()
    link.symlink_to(real)
    capsys.readouterr()
    assert run(link, "--in-place") == 0
    assert capsys.readouterr().out == f"{link}\n"
    assert link.is_symlink()
    assert listed(tmp_path / "real") == ["shot.blend", "shot.blend1"]
    assert (tmp_path / "real" / "shot.blend1").read_bytes() == before
    open_again(real)
    assert len(frames_of_keys(bpy.data.objects["Tool"])) == 40


@pytest.mark.any_blender
def test_what_is_in_the_way_of_the_output_is_named_and_left_alone(tmp_path, capsys):
    path = one_object_file(tmp_path / "shot.blend")
    baked_name(path).mkdir()
    (tmp_path / "file").touch()
    assert run(path, "--overwrite") == 1
    assert f"{path}: {baked_name(path)} is a folder: rename it" in capsys.readouterr().err
    assert run(path, "--output", tmp_path / "file" / "folder") == 1
    said = capsys.readouterr().err
    assert f"{path}: {tmp_path / 'file'} is a file, and " in said
    assert said.endswith("Nothing baked; 1 file failed.\n")
    assert listed(tmp_path) == ["file", "shot-baked.blend", "shot.blend"]


@pytest.mark.any_blender
def test_ctrl_c_while_blender_is_loaded_ends_it_at_once(tmp_path):
    path = one_object_file(tmp_path / "shot.blend")
    beside = tmp_path / "modules"
    beside.mkdir()
    in_the_place_of_blender = "import signal, time\nsignal.raise_signal(signal.SIGINT)\ntime.sleep(30)\n"
    (beside / "bpy.py").write_text(in_the_place_of_blender)
    done = run_python(ROOT / "scripts" / "bake.py", path, PYTHONPATH=str(beside))
    assert (done.returncode, done.stdout, done.stderr) == (130, "", f"{supervising.STOPPED_TEXT}\n")
