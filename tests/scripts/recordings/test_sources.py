"""Tests of sources and options of the user: files, bodies in them, messages about the rest, and options as JSON."""

import json
import os
import re
import socket
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

from rigid_motion_batch.command_line import Parser
from rigid_motion_batch.recordings import ReadingOptions, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.options import add_reading_options, reading_options
from rigid_motion_batch.recordings.reading import ENDINGS, FORMATS, OTHER_FORMATS, files_of, split_source
from rigid_motion_batch.recordings.recordings import unique
from tests.scripts.bvh_bodies import bvh_text

CSV = "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("body", [None, "Drill", "*", "mixamorig:Hips", "", "C:\\x", "a/b"])
@pytest.mark.parametrize(
    "name",
    [
        "take.csv",
        pytest.param("take.csv:10:30.csv", marks=pytest.mark.skipif(sys.platform == "win32", reason="no such names")),
    ],
)
def test_what_follows_the_file_and_a_colon_is_the_body(folder: Path, name: str, body: str | None) -> None:
    (folder / "take.csv").write_text(CSV)
    (folder / name).write_text(CSV)
    assert split_source(name if body is None else f"{name}:{body}") == (Path(name), body)
    assert split_source("take.csv:10") == (Path("take.csv"), "10")


@pytest.mark.skipif(sys.platform == "win32", reason="imitates a Windows path elsewhere")
@pytest.mark.parametrize("name", ["C:\\x\\take.csv", "c:/x/take.csv"])
def test_the_letter_of_a_windows_drive_is_no_file(folder: Path, name: str) -> None:
    (folder / name[0]).write_text(CSV)
    with pytest.raises(TrajectoryError, match="no such file"):
        split_source(name)
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(CSV)
    assert split_source(name) == (Path(name), None)
    assert split_source(f"{name}:Drill") == (Path(name), "Drill")


MISSING = dict.fromkeys(["gone.csv", "gone.csv:Drill", "", ":", ":Drill", "C:\\gone.csv", "a\0b.csv", "x" * 5000], "")
NEARLY = dict.fromkeys(["han.csv", "Hand.CVS", "{folder}/hand.cvs", "hnad.csv:left"], ": did you mean hand.csv?")


@pytest.mark.parametrize(("source", "told"), (MISSING | NEARLY).items())
def test_a_missing_file_is_told_with_the_one_that_is_nearly_it(folder: Path, source: str, told: str) -> None:
    (folder / "hand.csv").write_text(CSV)
    (folder / "hand.cvs.txt~").write_text(CSV)
    with pytest.raises(TrajectoryError, match=re.escape(f"no such file{told}; check the path")) as caught:
        read_trajectories(source.replace("{folder}", str(folder)))
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(sys.platform == "win32", reason="no such files there")
@pytest.mark.parametrize("body", ["", ":left", ":*"])
def test_what_is_no_file_is_told_and_never_opened(folder: Path, body: str) -> None:
    os.mkfifo("pipe.csv")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket.csv")
        Path("circle.csv").symlink_to("circle.csv")
        Path("dangling.csv").symlink_to("gone.csv")
        no_file = "this is a pipe or a device, not a file; write what comes out of it to a file, and name that"
        told = dict.fromkeys(("pipe.csv", "socket.csv", "/dev/zero"), no_file)
        for path, gone in (("circle.csv", "circle.csv"), ("dangling.csv", "gone.csv")):
            told[path] = f"this is a symbolic link to '{gone}', where nothing is; name the file itself"
        for path, problem in told.items():
            with pytest.raises(TrajectoryError, match=f"^{path}: {problem}"):
                read_trajectories(f"{path}{body}")


def test_an_unknown_extension_is_answered_with_the_known_ones(write, refusal) -> None:
    _, message = refusal(write("take.mov", "moov"))
    assert message.startswith("unknown extension '.mov'; known are .csv, ")
    assert all(extension in message for known in FORMATS for extension in known.extensions)
    assert (
        refusal(write("take.USD", "PXR-USDC"))[1] == "unknown extension '.USD'; open it in Blender, and name the .blend"
    )
    assert not {*" ".join(OTHER_FORMATS).split()} & {*ENDINGS}


def test_a_file_that_may_not_be_read_is_told(write, refusal, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    path = write("walk.bvh", bvh_text())
    monkeypatch.setattr(Path, "open", refuse)
    assert refusal(path)[1] == "this file cannot be read (Permission denied); check its permissions"


def test_names_that_occur_twice_are_numbered_around_those_there_are() -> None:
    assert unique(["Hand", "Hand", "Hand.001", "Hand"]) == ["Hand", "Hand.002", "Hand.001", "Hand.003"]


def test_a_file_of_blender_says_where_there_is_none(write, refusal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "bpy", None)
    assert refusal(write("scene.blend", b"BLENDER"))[1] == "this needs Blender; run it in Blender, or pip install bpy"


def test_a_folder_stands_for_the_recordings_in_it(tmp_path):
    for name in ("b.bvh", "a.CSV", "notes.md", "c.glb"):
        (tmp_path / name).write_text("")
    (tmp_path / "deeper.csv").mkdir()
    assert files_of(str(tmp_path)) == [str(tmp_path / name) for name in ("a.CSV", "b.bvh", "c.glb")]
    assert files_of(str(tmp_path / "b.bvh")) == [str(tmp_path / "b.bvh")]
    assert files_of(str(tmp_path / "deeper.csv")) == [str(tmp_path / "deeper.csv")]
    assert files_of("nothing:Body") == ["nothing:Body"]
    assert files_of("\0") == ["\0"]


SAID = ["--columns", "t=when, x=a,device=who", "--time-unit", "ms", "--scale", "0.01", "--euler", "zxy", "--degrees"]
MEANT = ReadingOptions((("t", "when"), ("x", "a"), ("device", "who")), "ms", 0.01, "zxy", True)


def parsed(*arguments: str) -> ReadingOptions:
    parser = Parser()
    add_reading_options(parser)
    return reading_options(parser.parse_args(arguments))


@pytest.mark.parametrize(("said", "meant"), [(SAID, MEANT), ((), ReadingOptions())])
def test_a_command_line_says_all_of_them_and_they_are_the_same_after_a_journey_as_json(said, meant):
    assert parsed(*said) == ReadingOptions(**json.loads(json.dumps(asdict(meant)))) == meant


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--columns", "when"], "'when' names no columns; write t=timestamp_ms,x=pos_x,..."),
        (["--columns", "q=a"], "a column cannot mean 'q'; known are t, x, y, z, qw, qx, qy, qz, rx, ry, rz, scale, de"),
        (["--columns", "t=a,t=b"], "two columns for t; name one"),
        (["--time-unit", "min"], "invalid choice: 'min'"),
        (["--scale", "0"], "a unit cannot be 0.0 metres long; give a number such as 0.01 for centimetres"),
        (["--scale", "cm"], "a unit cannot be nan metres long"),
        (["--euler", "XYX"], "'XYX' is not an order of Euler angles; give the three axes once each, in capitals (YXZ)"),
        (["--frame-rate", "0"], "there cannot be 0.0 frames a second; give a number such as 90"),
        (["--start", "-1"], "--start cannot be -1.0: give seconds after the first sample, such as 2.5"),
        (["--end", "0"], "--end 0 leaves nothing: it must be later than --start 0"),
        (["--start", "3", "--end", "2.5"], "--end 2.5 leaves nothing: it must be later than --start 3"),
        (["--time-unit", "ms", "--frame-rate", "90"], "--time-unit and --frame-rate exclude one another"),
    ],
)
def test_what_cannot_be_meant_is_refused_at_once(capsys, arguments, told):
    with pytest.raises((SystemExit, ValueError)) as ended:
        parsed(*arguments)
    assert told in f"{capsys.readouterr().err}{ended.value}"
