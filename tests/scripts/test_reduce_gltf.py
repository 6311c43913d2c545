"""Tests of `reduce.py` on glTF files: it returns them with fewer keys, otherwise unchanged, and without Blender."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.gltf import Document, Options, Report, reduced
from rigid_motion.gltf.rewriting import Amount
from rigid_motion_batch.keying import gltf_files
from tests.gltf.making import Making, walk
from tests.gltf.player import File, off
from tests.scripts.comparing import run_without_blender
from tests.scripts.reducing import listed, run, write_csv

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]


def test_no_blender_is_needed(tmp_path):
    source = walk().write(tmp_path / "walk.glb")
    done = run_without_blender("reduce", source, "--tolerance", "2mm", "--radius", "0.03")
    made = tmp_path / "walk-reduced.glb"
    assert (done.returncode, done.stdout) == (0, f"{made}\n")
    told = re.search(
        r"Take0: reduced, (\d+) -> (\d+) keys, (\d+) -> (\d+) bytes, (\S+) mm off at most \(2 mm allowed\), "
        r'node "Joint\d" at \S+ s\n',
        done.stderr,
    )
    assert told is not None
    before, after, size_before, size_after = map(int, told.groups()[:4])
    assert after < before
    assert size_after < size_before
    assert off(File(source), File(made), 0, 0.03).error <= 1e-3 * float(told[5]) + 1e-5
    assert float(told[5]) <= 2.0
    assert re.search(r"walk\.glb: 1\.5 m large", done.stderr)
    size = f"{made.stat().st_size:,}".replace(",", " ")
    worst = rf'{told[5]} mm off \(Take0, node "Joint\d" at \S+ s\)'
    last = rf"1 clip reduced, \d\d \d\d\d to {size} bytes; at most {worst}\."
    assert re.fullmatch(last, done.stderr.splitlines()[-1])
    write_csv(tmp_path / "hand.csv")
    assert run_without_blender("reduce", tmp_path / "hand.csv").returncode == 0, "nor for tables"
    assert (tmp_path / "hand-keys.csv").exists()


def test_a_file_in_another_unit_is_told_from_its_size(tmp_path, capsys):
    source = walk(joints=8, unit=100.0).write(tmp_path / "walk.glb")
    assert run(source, "--tolerance", "2mm") == 0
    assert "210 m large in this file: if these are centimetres, give --tolerance 0.2" in capsys.readouterr().err
    assert run(walk(joints=3, unit=100.0).write(tmp_path / "prop.glb"), "--tolerance", "2mm") == 0
    assert "60 m large\n" in capsys.readouterr().err, "a prop may have any size"


def test_a_tolerance_that_is_too_large_leaves_the_file_alone(tmp_path, capsys):
    source = walk(unit=0.01).write(tmp_path / "walk.glb")
    assert run(source, "--tolerance", "2mm") == 0
    assert "a tolerance of 0.002 m is more than a tenth of the size, which is 0.015 m" in capsys.readouterr().err
    assert listed(tmp_path) == ["walk.glb"]


def test_what_is_written_takes_no_name_of_what_stays(tmp_path):
    made = walk(joints=2)
    made.json["images"] = [{"uri": "Walk-reduced.bin"}]
    (tmp_path / "Walk-reduced.bin").write_bytes(b"skin")
    source, out = made.write(tmp_path / "walk.gltf"), tmp_path / "out"
    assert run(source, "--output", out, "--tolerance", "2mm") == 0
    assert listed(out) == ["Walk-reduced.bin", "_walk-reduced.bin", "walk-reduced.gltf"]
    assert (out / "Walk-reduced.bin").read_bytes() == b"skin"
    assert off(File(source), File(out / "walk-reduced.gltf"), 0).error <= 2e-3


def test_links_out_of_the_folder_are_not_followed(tmp_path, capsys):
    made, folder = walk(joints=2), tmp_path / "in"
    folder.mkdir()
    names = ["skin.png", "deep/hat%20a.png", "../secret.png", "deep/shoe.png"]
    made.json["images"] = [{"uri": name} for name in names]
    (tmp_path / "secret.png").write_bytes(b"secret")
    (folder / "deep").mkdir()
    (folder / "deep" / "hat a.png").write_bytes(b"hat")
    (folder / "skin.png").symlink_to(tmp_path / "secret.png")
    (folder / "deep" / "shoe.png").symlink_to("hat a.png")
    source, out = made.write(folder / "walk.gltf"), tmp_path / "out"
    assert run(source, "--output", out, "--tolerance", "2mm") == 0
    assert (listed(out), listed(out / "deep")) == (
        ["deep", "walk-reduced.bin", "walk-reduced.gltf"],
        ["hat a.png", "shoe.png"],
    )
    said = capsys.readouterr().err
    for name in ("../secret.png", "skin.png"):
        assert f"walk.gltf: {name} is outside of the folder of the file; left out" in said
    buffer = folder / "walk 0.bin"
    buffer.rename(tmp_path / "walk.bin")
    buffer.symlink_to(tmp_path / "walk.bin")
    assert run(source) == 2
    assert "buffer 0 is outside of its folder ('walk%200.bin'); export it as .glb" in capsys.readouterr().err


def test_a_file_whose_clips_need_their_keys_is_left_alone(tmp_path, capsys):
    made = Making()
    made.json["nodes"] = [{}]
    made.channel(0, "translation", made.times([0.0, 1.0, 2.0]), np.eye(3))
    made.json["animations"][0]["name"] = "a\nb\x1b[2J"
    assert run(made.write(tmp_path / "walk.glb")) == 0
    said = capsys.readouterr()
    assert "a\\nb\\x1b[2J: stays as it was, 3 keys in 48 bytes: fewer keys would take more bytes" in said.err
    assert "no clip would become smaller; left alone" in said.err
    assert (said.out, listed(tmp_path)) == ("", ["walk.glb"])


def test_key_poses_are_so_many_frames_of_all_joints(tmp_path):
    source = walk(joints=2).write(tmp_path / "walk.glb")
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


@pytest.mark.parametrize("ending", [".vrm", ".VRMA"])
def test_avatars_and_their_animations_are_glb_files_and_keep_their_ending(tmp_path, capsys, ending):
    source = walk(joints=2, seconds=1.0).write(tmp_path / "walk.glb").rename(tmp_path / f"walk{ending}")
    assert run(source) == run(tmp_path, "--output", tmp_path / "out") == 0
    assert run(source, "--output", tmp_path / f"named{ending}") == 0
    made = f"walk-reduced{ending.lower()}"
    assert listed(tmp_path) == sorted([f"walk{ending}", made, f"named{ending}", "out"])
    assert listed(tmp_path / "out") == [made]


def test_what_became_of_each_input_is_printed_as_json(tmp_path, capsys):
    source, bad, still = walk().write(tmp_path / "walk.glb"), tmp_path / "bad.glb", tmp_path / "still.gltf"
    bad.write_bytes(b"glTF, but no more")
    still.write_text('{"asset": {"version": "2.0"}}')
    assert run(source, bad, still, "--json", "--tolerance", "2mm") == 1
    made = tmp_path / "walk-reduced.glb"
    said = capsys.readouterr()
    printed = json.loads(said.out)
    first, second, third = map(dict, printed)
    (clip,) = first.pop("clips")
    assert first.pop("bytes_before") > first["bytes_after"]
    assert first == {
        "source": str(source),
        "state": "written",
        "written": [str(made)],
        "reason": "",
        "size": pytest.approx(1.5),
        "tolerance": 0.002,
        "bytes_after": made.stat().st_size,
    }
    assert (clip["name"], clip["reason"]) == ("Take0", "")
    assert clip["keys_after"] < clip["keys_before"]
    assert 0.0 < clip["error"] <= 0.002
    assert re.fullmatch(r'node "Joint\d" at \S+ s', clip["where"])
    assert (second["state"], second["written"], second["clips"]) == ("failed", [], [])
    assert second["reason"] in said.err
    assert (third["state"], third["reason"]) == ("left alone", "no animation moves a node")
    assert run(source, bad, still, "--json", "--tolerance", "2mm") == 1
    assert json.loads(capsys.readouterr().out) == [printed[0] | {"state": "already written"}, *printed[1:]]


def test_more_keys_in_fewer_bytes_are_not_called_reduced(tmp_path, monkeypatch, capsys):
    def stored(document: Document, options: Options) -> Report:
        made = reduced(document, options)
        return replace(made, clips=(replace(made.clips[0], before=Amount(96, 3000), after=Amount(137, 2000)),))

    monkeypatch.setattr(gltf_files, "reduced", stored)
    assert run(walk(joints=2).write(tmp_path / "walk.glb")) == 0
    assert "Take0: stored in fewer bytes, 96 -> 137 keys, 3000 -> 2000 bytes, " in capsys.readouterr().err


def test_which_channels_are_kept_is_asked_for_and_who_reduces_again_is_told_that_errors_add_up(tmp_path, capsys):
    made, again, channels = walk(joints=2), tmp_path / "again.glb", {}
    positions = made.accessor(0.1 * np.eye(3, dtype="<f4"))
    made.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": positions}}]}]
    made.json["nodes"][1]["mesh"] = 0
    source = made.write(tmp_path / "walk.glb")
    for kept in ("needed", "all"):
        assert run(source, "--channels", kept, "--tolerance", "5mm", "--output", tmp_path / f"{kept}.glb") == 0
        channels[kept] = len(File(tmp_path / f"{kept}.glb").json["animations"][0]["channels"])
    assert channels["needed"] < channels["all"]
    shutil.copy(tmp_path / "all.glb", again)
    assert run(again, "--tolerance", "1cm") == 0
    said = capsys.readouterr().err
    assert "again.glb: reduced before within 5 mm: errors add up; reduce the original instead\n" in said
