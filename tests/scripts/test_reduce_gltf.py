"""`reduce.py` gives glTF files back as they are, with fewer keys, and needs no Blender for that."""

import os
import re
import subprocess
import sys

import numpy as np

from rigid_motion_batch.cli import reduce
from rigid_motion_batch.keying import gltf_files
from tests.gltf.making import Making, walk
from tests.gltf.player import File, off
from tests.scripts.reducing import listed

WITHOUT_BLENDER = """
import sys
sys.modules["bpy"] = None
from rigid_motion_batch.cli import reduce
from rigid_motion_batch.keying import gltf_files
sys.exit(reduce.main(sys.argv[1:]))
"""


def run(*arguments: object) -> int:
    return reduce.main([str(argument) for argument in arguments])


def test_no_blender_is_needed(tmp_path):
    source = walk().write(tmp_path / "walk.glb")
    command = [sys.executable, "-c", WITHOUT_BLENDER, str(source), "--tolerance", "2mm", "--radius", "0.03"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
    made = tmp_path / "walk-reduced.glb"
    assert (done.returncode, done.stdout) == (0, f"{made}\n")
    told = re.search(
        r"Take0: reduced, (\d+) -> (\d+) keys, (\d+) -> (\d+) bytes, (\S+) mm off at most \(2 mm allowed\)", done.stderr
    )
    assert told is not None
    before, after, size_before, size_after = map(int, told.groups()[:4])
    assert after < before
    assert size_after < size_before
    assert off(File(source), File(made), 0, 0.03).error <= 1e-3 * float(told[5]) + 1e-5
    assert float(told[5]) <= 2.0
    assert re.search(r"walk\.glb: 1\.5 m large", done.stderr)
    assert "1 clip reduced; 1 file: 1 written." in done.stderr


def test_a_file_in_another_unit_is_told_from_its_size(tmp_path, capsys):
    source = walk(unit=100.0).write(tmp_path / "walk.glb")
    assert run(source, "--tolerance", "2mm") == 0
    assert "150 m large in this file: if these are centimetres, give --tolerance 0.2" in capsys.readouterr().err


def test_a_tolerance_that_is_too_large_is_refused_and_nothing_is_written(tmp_path, capsys):
    source = walk(unit=0.01).write(tmp_path / "walk.glb")
    assert run(source, "--tolerance", "2mm") == 2
    assert "a tolerance of 0.002 m is more than a tenth of the size, which is 0.015 m" in capsys.readouterr().err
    assert listed(tmp_path) == ["walk.glb"]


def test_a_gltf_finds_its_files_from_another_folder(tmp_path):
    made = walk()
    made.json["images"] = [{"uri": "skin%20a.png"}]
    (tmp_path / "skin a.png").write_bytes(b"some")
    source = made.write(tmp_path / "walk.gltf")
    assert run(source, "--output", tmp_path / "out", "--tolerance", "2mm") == 0
    assert listed(tmp_path / "out") == ["skin a.png", "walk-reduced.bin", "walk-reduced.gltf"]
    assert off(File(source), File(tmp_path / "out" / "walk-reduced.gltf"), 0, 0.0).error <= 2e-3


def test_what_is_written_takes_no_name_of_what_stays(tmp_path):
    made = walk()
    made.json["images"] = [{"uri": "Walk-reduced.bin"}]
    (tmp_path / "Walk-reduced.bin").write_bytes(b"skin")
    source, out = made.write(tmp_path / "walk.gltf"), tmp_path / "out"
    assert run(source, "--output", out, "--tolerance", "2mm") == 0
    assert listed(out) == ["Walk-reduced.bin", "_walk-reduced.bin", "walk-reduced.gltf"]
    assert (out / "Walk-reduced.bin").read_bytes() == b"skin"
    assert off(File(source), File(out / "walk-reduced.gltf"), 0, 0.0) <= 2e-3


def test_links_out_of_the_folder_are_not_followed(tmp_path, capsys):
    made, folder = walk(), tmp_path / "in"
    folder.mkdir()
    names = ["skin.png", "deep/hat.png", "../secret.png", "deep/shoe.png"]
    made.json["images"] = [{"uri": name} for name in names]
    (tmp_path / "secret.png").write_bytes(b"secret")
    (folder / "deep").mkdir()
    (folder / "deep" / "hat.png").write_bytes(b"hat")
    (folder / "skin.png").symlink_to(tmp_path / "secret.png")
    (folder / "deep" / "shoe.png").symlink_to("hat.png")
    source, out = made.write(folder / "walk.gltf"), tmp_path / "out"
    assert run(source, "--output", out, "--tolerance", "2mm") == 0
    assert (listed(out), listed(out / "deep")) == (
        ["deep", "walk-reduced.bin", "walk-reduced.gltf"],
        ["hat.png", "shoe.png"],
    )
    said = capsys.readouterr().err
    for name in ("../secret.png", "skin.png"):
        assert f"walk.gltf: {name} is outside of the folder of the file; left out" in said
    buffer = folder / "walk 0.bin"
    buffer.rename(tmp_path / "walk.bin")
    buffer.symlink_to(tmp_path / "walk.bin")
    assert run(source) == 2
    assert "buffer 0 is outside of its folder ('walk%200.bin'); export it as .glb" in capsys.readouterr().err


def test_names_of_clips_do_nothing_to_the_terminal(tmp_path, capsys):
    made = walk()
    made.json["animations"][0]["name"] = "a\nb\x1b[2J"
    assert run(made.write(tmp_path / "walk.glb")) == 0
    said = capsys.readouterr().err
    assert "\x1b" not in said
    assert "a\nb" not in said


def test_a_file_whose_clips_need_their_keys_is_left_alone(tmp_path, capsys):
    made = Making()
    made.json["nodes"] = [{}]
    made.channel(0, "translation", made.times([0.0, 1.0, 2.0]), np.eye(3))
    assert run(made.write(tmp_path / "walk.glb")) == 0
    said = capsys.readouterr()
    assert "Take0: stays as it was, 3 keys in 48 bytes: fewer keys would take more bytes" in said.err
    assert "nothing could be reduced; left alone" in said.err
    assert (said.out, listed(tmp_path)) == ("", ["walk.glb"])


def test_key_poses_are_so_many_frames_of_all_joints(tmp_path):
    source = walk().write(tmp_path / "walk.glb")
    assert run(source, "--key-poses", "9") == 0
    assert len(File(tmp_path / "walk-reduced.glb").moments(0)) == 9


def test_a_file_that_vanishes_while_it_is_read_is_said(tmp_path, monkeypatch, capsys):
    source = walk().write(tmp_path / "walk.glb")
    before = gltf_files.reduced

    def vanishing(*arguments: object) -> object:
        source.unlink()
        return before(*arguments)

    monkeypatch.setattr(gltf_files, "reduced", vanishing)
    assert run(source, "--tolerance", "2mm") == 1
    said = capsys.readouterr().err
    assert "walk.glb: this file changed while it was read; run the same command again" in said
    assert "Traceback" not in said
