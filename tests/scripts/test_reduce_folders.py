"""Tests of reduce.py on folders and many files: selection of files, parallel processes, and repeated runs."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.cli import reduce
from tests.gltf.making import walk
from tests.scripts.bvh_bodies import write_body
from tests.scripts.processes import ROOT, run_python, start
from tests.scripts.reducing import listed, object_file, run, write_csv, write_still

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]

KILL = "os.kill(os.getpid(), signal.SIGKILL)"

ON_LINUX = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes where Linux has them")


def glb(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    return walk(joints=2, seconds=1.0).write(path)


def last_line(capsys: pytest.CaptureFixture[str]) -> str:
    return capsys.readouterr().err.splitlines()[-1]


def test_a_folder_stands_for_all_that_is_in_it_but_for_links_and_the_results_lie_as_it_does(tmp_path, capsys):
    shots = tmp_path / "shots"
    for name in ("walk.glb", "b/run.glb", "b/c/Turn.GLB", ".hidden/no.glb", "b/.no.glb", "walk-reduced.glb"):
        glb(shots / name)
    write_csv(shots / "b" / "hand.csv")
    (shots / "readme.txt").write_text("no recording")
    glb(tmp_path / "other" / "run.glb")
    (shots / "folder").symlink_to(tmp_path / "other")
    (shots / "file.glb").symlink_to(tmp_path / "other" / "run.glb")
    (shots / "up").symlink_to(shots)
    assert run(shots, "--output", tmp_path / "out") == 0
    made = ["b/c/Turn-reduced.glb", "b/hand-keys.csv", "b/run-reduced.glb", "walk-reduced.glb"]
    assert capsys.readouterr().out.splitlines() == [str(tmp_path / "out" / name) for name in made]
    names = [".hidden", "b", "file.glb", "folder", "readme.txt", "up", "walk-reduced.glb", "walk.glb"]
    assert listed(shots) == names
    assert listed(tmp_path / "other") == ["run.glb"]


def test_what_was_written_is_no_input_by_whatever_name(tmp_path, capsys):
    glb(tmp_path / "walk.glb")
    write_csv(tmp_path / "hand.csv")
    assert run(tmp_path / "walk.glb", "--output", tmp_path / "small.glb") == 0
    for _ in range(2):
        assert run(tmp_path) == 0
    assert listed(tmp_path) == ["hand-keys.csv", "hand.csv", "small.glb", "walk-reduced.glb", "walk.glb"]
    capsys.readouterr()
    assert run(*sorted(tmp_path.glob("*.csv"))) == 0, "as a shell names them the next time"
    assert last_line(capsys).endswith("; 1 file already reduced.")


def test_a_folder_with_nothing_in_it_is_told_in_a_line(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert run(tmp_path / "empty") == 2
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith(f"{tmp_path / 'empty'}: there is nothing to be done in this folder: name one with .blend")
    assert len(said) == 2
    glb(tmp_path / "walk.glb")
    assert run(tmp_path / "walk.glb", tmp_path / "empty") == 1
    assert (tmp_path / "walk-reduced.glb").is_file()


def test_what_does_not_move_is_left_alone_in_a_folder(tmp_path, capsys):
    write_still(tmp_path / "prop.glb")
    write_body(tmp_path / "statue.bvh", moves=False)
    (tmp_path / "shots.csv").write_text("shot,artist\n010,Ann\n", encoding="utf-8")
    glb(tmp_path / "walk.glb")
    assert run(tmp_path) == 0
    said = capsys.readouterr().err
    assert f"{tmp_path / 'prop.glb'}: no animation moves a node; left alone, nothing is written" in said
    assert f"{tmp_path / 'shots.csv'}: no column has a known name (found shot, artist); left alone" in said
    assert f"{tmp_path / 'statue.bvh'}: nothing of this body moves; left alone" in said
    assert said.endswith("; 3 files left alone.\n")
    assert run(tmp_path / "shots.csv") == 2, "by its name it is a mistake"
    assert run(tmp_path / "prop.glb", "--output", tmp_path / "small.glb") == 0, "there is nothing to be done to it"
    assert last_line(capsys) == "Nothing reduced; 1 file left alone."
    assert not (tmp_path / "small.glb").exists()


@pytest.mark.parametrize(
    ("make", "name", "options"),
    [
        (glb, "small.glb", ()),
        (lambda path: object_file(path.with_suffix(".blend")), "small.blend", ()),
        (lambda path: write_body(path.with_name("body.bvh")), "small.blend", ()),
        (lambda path: write_body(path.with_name("body.bvh")), "small.glb", ("--glb",)),
    ],
)
def test_the_output_of_one_input_may_be_a_file(tmp_path, make, name, options):
    source = make(tmp_path / "in.glb")
    assert run(source, *options, "--output", tmp_path / "new" / name) == 0
    assert listed(tmp_path / "new") == [name]


@pytest.mark.parametrize(("name", "way_out"), [("a.blend", "or add --blend"), ("a.csv", "name that with --output")])
def test_a_name_that_does_not_fit_the_recording_is_refused(tmp_path, capsys, name, way_out):
    body, hand = write_body(tmp_path / "body.bvh"), tmp_path / "hand.csv"
    write_csv(hand)
    assert run(body if name == "a.csv" else hand, "--output", tmp_path / "new" / name) == 1
    assert way_out in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_what_is_done_is_not_done_again(tmp_path, capsys):
    write_csv(tmp_path / "hand.csv")
    glb(tmp_path / "walk.glb")
    object_file(tmp_path / "shot.blend")
    assert run(tmp_path) == 0
    capsys.readouterr()
    names = ["hand-keys.csv", "shot-reduced.blend", "walk-reduced.glb"]
    before = [(tmp_path / name).stat().st_mtime_ns for name in names]
    assert run(tmp_path, "--overwrite") == 0
    said = capsys.readouterr()
    assert f"{tmp_path / 'hand.csv'}: already reduced: {tmp_path / 'hand-keys.csv'}" in said.err.splitlines()
    assert said.err.endswith("Nothing reduced; 3 files already reduced.\n")
    assert said.out.splitlines() == [str(tmp_path / name) for name in names]
    assert [(tmp_path / name).stat().st_mtime_ns for name in names] == before


def test_another_input_or_option_is_another_result_which_takes_the_place_of_ours(tmp_path, capsys):
    source, made = glb(tmp_path / "walk.glb"), tmp_path / "walk-reduced.glb"
    assert run(source) == 0
    first = made.read_bytes()
    assert run(source, "--tolerance", "2cm") == 0
    second = made.read_bytes()
    assert len(second) < len(first)
    walk(joints=3).write(source)
    assert run(source, "--tolerance", "2cm") == 0
    assert made.read_bytes() not in (first, second)
    made.unlink()
    capsys.readouterr()
    assert run(source, "--tolerance", "2cm") == 0
    assert last_line(capsys).startswith("1 clip reduced, ")


def test_what_was_edited_since_or_made_of_another_stays(tmp_path, capsys):
    source, made = glb(tmp_path / "walk.glb"), tmp_path / "walk-reduced.glb"
    assert run(source) == 0
    made.write_bytes(edited := made.read_bytes() + b"edited")
    assert run(source) == 1
    assert f"{made} is there already: add --overwrite, or another --output" in capsys.readouterr().err
    assert made.read_bytes() == edited
    assert run(source, "--overwrite") == 0
    before = made.read_bytes()
    other = glb(tmp_path / "b" / "walk.glb")
    assert run(other, "--tolerance", "2cm", "--output", tmp_path) == 1
    assert made.read_bytes() == before


def test_a_folder_may_be_moved_with_its_results(tmp_path, capsys):
    glb(tmp_path / "shots" / "a" / "walk.glb")
    assert run(tmp_path / "shots") == 0
    (tmp_path / "shots").rename(tmp_path / "moved")
    assert run(tmp_path / "moved") == 0
    assert last_line(capsys).endswith("; 1 file already reduced.")


def test_a_damaged_record_does_no_harm(tmp_path):
    source = glb(tmp_path / "walk.glb")
    assert run(source) == 0
    record = tmp_path / ".rigid-motion" / "keyed.jsonl"
    record.write_text('{"source": 3, "key"\n[]\n{"source": "walk.glb", "key": {}, "written": 3}\n')
    assert run(source) == 1, "whose it is nobody knows"
    assert run(source, "--overwrite") == 0


def test_processes_do_the_same_as_one_and_a_bad_file_stops_nobody(tmp_path):
    for name in "abcd":
        glb(tmp_path / "in" / f"{name}.glb")
    (tmp_path / "in" / "bad.glb").write_bytes(b"glTF, but no more")
    write_csv(tmp_path / "in" / "hand.csv")
    assert run(tmp_path / "in", "--output", tmp_path / "one") == 1
    done = run_python(ROOT / "scripts" / "reduce.py", "in", "--output", "two", "--jobs", "2", cwd=tmp_path)
    assert done.returncode == 1
    made = ["a-reduced.glb", "b-reduced.glb", "c-reduced.glb", "d-reduced.glb", "hand-keys.csv"]
    assert done.stdout.splitlines() == [str(Path("two", name)) for name in made]
    assert listed(tmp_path / "two") == listed(tmp_path / "one") == made
    for name in made:
        assert (tmp_path / "two" / name).read_bytes() == (tmp_path / "one" / name).read_bytes()
    lines = done.stderr.splitlines()
    bad = Path("in", "bad.glb")
    done = r"1 object and 4 clips of 5 files reduced; at most .* mm off \(.*\)"
    assert re.fullmatch(rf"{done}; 1 file failed \({re.escape(str(bad))}\)\.", lines[-1])
    own = [
        [place for place, line in enumerate(lines) if line.startswith(str(Path("in", f"{name}.glb")))]
        for name in "abcd"
    ]
    for places in own:
        assert places == list(range(places[0], places[0] + len(places))), "what is said of a file stands together"


def test_blenders_own_python_does_one_after_the_other(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pebble", None)
    paths = [str(glb(tmp_path / f"{name}.glb")) for name in ("a", "b")]
    assert reduce.main([*paths, "--jobs", "2"]) == 2
    assert "; leave it out, and inputs are done one by one" in capsys.readouterr().err
    assert reduce.main(paths) == 0
    assert last_line(capsys).startswith("2 clips of 2 files reduced, ")


@ON_LINUX
def test_a_killed_worker_costs_its_file_alone(tmp_path):
    for name in ("a", "slow", "z"):
        glb(tmp_path / f"{name}.glb")
    # Killed while the result is moved into place: part of it exists already.
    run = start(tmp_path, "reduce.py", ".", "--jobs", "2", where="slow-reduced.glb", act=KILL)
    printed, said, _ = run.end()
    assert run.process.returncode == 1, said
    assert printed.split() == ["a-reduced.glb", "z-reduced.glb"]
    assert "slow.glb: its process died (SIGKILL, perhaps for want of memory): leave it out" in said
    assert re.fullmatch(r"2 clips of 2 files reduced, .*; 1 file failed\.", said.splitlines()[-1])
    names = ["a-reduced.glb", "a.glb", "slow.glb", "stuck", "z-reduced.glb", "z.glb"]
    assert listed(tmp_path) == names
    assert list(run.temporary.iterdir()) == []


def test_a_gltf_is_done_again_where_one_of_its_files_has_changed(tmp_path, capsys):
    made = walk(joints=2, seconds=1.0)
    made.json["images"] = [{"uri": "skin.png"}]
    (tmp_path / "skin.png").write_bytes(b"some")
    for name in ("a", "b"):
        made.write(tmp_path / f"{name}.gltf")
    out = tmp_path / "out"
    assert run(tmp_path, "--output", out) == 0, "both have the same image"
    assert listed(out) == ["a-reduced.bin", "a-reduced.gltf", "b-reduced.bin", "b-reduced.gltf", "skin.png"]
    values = np.frombuffer((tmp_path / "a 0.bin").read_bytes(), dtype="<f4").copy()
    values[-5:] *= 0.5
    (tmp_path / "a 0.bin").write_bytes(values.tobytes())
    capsys.readouterr()
    assert run(tmp_path, "--output", out) == 0
    assert last_line(capsys).endswith("; 1 file already reduced.")
    (out / "b-reduced.bin").unlink()
    assert run(tmp_path, "--output", out) == 0
    assert (out / "b-reduced.bin").is_file()
