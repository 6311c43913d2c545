"""Tests of options on the command line: refused with a way out, in Python and in Blender, and the printed examples."""

import re
import shlex
import sys
from importlib import import_module

import pytest

from rigid_motion_batch.cli import compare
from rigid_motion_batch.command_line import as_typed, own_arguments
from tests.scripts.comparing import ROOT, run

REFUSED = {
    "compare": [
        (["--rates", "0"], "rate"),
        (["--modes", "hermite"], "lerp_slerp"),
        (["--radius", "-1"], "above 0"),
        (["--resolution", "161x90"], "even"),
        (["--fps", "0"], "1 to 240"),
        (["--deviation", "0.5"], "give 1 to 1000"),
        (["--output", ""], "'' is not a folder"),
        (["--jobs", "-1"], "not a number of processes"),
        (["--fit"], "--fit is for keys that are chosen by the motion: add --tolerance or --budget"),
        (["--modes", "motor_splin"], "did you mean motor_spline?"),
        (["--tolerence", "5mm"], "did you mean --tolerance?"),
        (["--tolerance", "5mm", "--budget", "10"], "--budget: not allowed with argument --tolerance"),
        (["--tolerance", "5 inches"], "give a length such as 5mm"),
        (["--budget", "5mm"], "give numbers such as 5,7.5,10"),
    ],
    "reduce": [
        ([], "INPUT"),
        (["a.blend", "--tolerance", "5 apples"], "is not a tolerance; give a length such as 5mm"),
        (["a.blend", "--keys", "1"], "--keys"),
        (["a.blend", "--keys", "5", "--tolerance", "5mm"], "--keys"),
        (["a.blend", "--radius", "0"], "is not a length above 0, such as 3cm or 0.03"),
        (["a.glb", "b.glb", "--output", "c.glb"], "--output c.glb is a file, and there may be several results"),
        (["a.csv", "--output", "b.glb"], "add --glb, and a.csv becomes a GLB file"),
        (["a.glb", "--output", "b.blend"], "a.glb becomes a .glb file here: name such a one"),
        (["a.blend", "--mode", "BLENDER"], "invalid choice"),
        (["a.blend", "--mode", "dq_sclerp", "--curves"], "--curves and --mode exclude one another"),
        (["a.csv", "--fps", "29.97"], "is not a number of frames a second; give a whole number from 1 to 240"),
        (["a.csv", "--degrees"], "--degrees is for Euler angles"),
        (["a.csv", "--in-place"], "--in-place is for .blend files, and a.csv is none"),
        (["a.csv", "--objects", "Hand"], "name one body of a recording with FILE:BODY"),
        (["a.blend", "--in-place", "--output", "x"], "give one of them"),
        (["shot.blend", ""], "'' is not a file: a variable of a script may be empty"),
        (["shot.blend", "--output", ""], "'' is not a folder"),
        (["--glb", "shot.blend", "--mode", "dq_sclerp"], "--mode is for .blend files, and --glb writes others"),
        (["--glb", "shot.blend", "--in-place"], "--in-place is for .blend files, and --glb writes others"),
        (["--glb", "walk.fbx", "--start", "1"], "with --glb Blender imports walk.fbx whole"),
        (["--glb", "walk.gltf"], "walk.gltf is reduced to a .gltf file: do it without --glb"),
    ],
    "bake": [
        ([], "FILE.blend"),
        (["a.blend", "--step", "0"], "is not a number of frames; give 0.01 to 1000000"),
        (["a.blend", "--objects", ","], "name an object"),
        (["a.blend", "--unbake", "--step", "2"], "--step is for baking"),
        (["a.blend", "--in-place", "--output", "x"], "give one of them"),
        (["a.blend", "--output", __file__], "a.blend becomes a .blend file here: name such a one"),
        (["a.blend", "b.blend", "--output", __file__], "is a file, and there may be several results: give a folder"),
    ],
    "stream": [
        (["send", "hand.csv", "--room", "a/*"], "not a name for a room"),
        (["send", "hand.csv", "--room", "r", "--user", "a/b"], "not a name for a user"),
        (["send", "hand.csv", "--room", "r", "--tolerance", "5 parsecs"], "5 parsecs"),
        (["send", "hand.csv", "--room", "r", "--delay", "9"], "not a number of seconds"),
        (["receive", "--room", "r", "--output", "shown.txt"], "one that ends in .csv, .bvh"),
        (["receive", "--room", "r", "--to-blender", "39539"], "not an address"),
        (["send", "a.csv", "--from-vmc", "39539", "--room", "studio"], "and not both"),
        (["send", "--room", "studio"], "give recordings, or --from-vmc"),
        (["send", "a.csv", "--to-vmc", "127.0.0.1:1", "--room", "studio"], "without a room"),
        (["send", "a.csv"], "give --room NAME"),
        (["receive", "--room", "studio", "--to-vmc", "192.0.2.1:39540"], "give --network as well"),
        (["receive", "--room", "studio", "--clean", "--mode", "motor_spline"], "give --clean without it"),
    ],
}
"""Command to pairs of arguments and required text of the message."""


@pytest.mark.parametrize(
    ("command", "arguments", "complaint"), [(command, *row) for command, rows in REFUSED.items() for row in rows]
)
def test_a_wrong_option_ends_with_code_2_and_a_way_out(command, arguments, complaint, capsys):
    with pytest.raises(SystemExit) as ended:
        import_module(f"rigid_motion_batch.cli.{command}").main(arguments)
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err


@pytest.mark.parametrize(
    ("started", "own"),
    [
        (["scripts/bake.py", "shot.blend", "--unbake"], ["shot.blend", "--unbake"]),
        (["bake.py"], []),
        (
            ["/bin/blender", "--background", "--python", "bake.py", "--", "shot.blend", "--unbake"],
            ["shot.blend", "--unbake"],
        ),
        (["/bin/blender", "--background", "--python", "bake.py"], []),
    ],
)
def test_in_python_all_are_and_in_blender_those_behind_two_dashes(monkeypatch, started, own):
    monkeypatch.setattr(sys, "argv", started)
    assert own_arguments("/checkout/scripts/bake.py") == own


def test_a_command_is_as_one_would_type_it():
    assert as_typed("compare.py", ["a b.csv", "--rates", "5"], ["a b.csv"]) == "compare.py 'a b.csv' --rates 5"


def test_of_a_command_with_very_many_inputs_the_first_are_told_and_every_option():
    inputs = [f"{number}.csv" for number in range(1000)]
    typed = as_typed("compare.py", ["--rates", "5", *inputs, "--no-video"], inputs)
    assert typed.startswith("compare.py --rates 5 0.csv 1.csv ")
    assert typed.endswith(" --no-video # and 988 more")
    assert len(typed) < 200


@pytest.mark.parametrize(
    ("arguments", "folders"),
    [
        (["--rates", "5,7.5,5.0,05"], ["5", "7.5"]),
        (["--budget", "10.0,10"], ["budget-10.0"]),
        (["--tolerance", "5mm,0.5cm,0.005m,0.005"], ["tolerance-5mm", "tolerance-0.005"]),
    ],
)
def test_the_same_amount_written_in_two_ways_is_one_choice(arguments, folders):
    assert [choice.name for choice in compare.parse(arguments).choices] == folders


EXAMPLE = re.compile(r"^ +python scripts/(?:compare\.py|bootstrap\.py compare)(?P<arguments>.*)$", re.MULTILINE)
"""A line of a page, or of the help, that calls the program."""


@pytest.mark.parametrize("page", ["--help", "README.md", "docs/comparing.md", "docs/farm.md"])
def test_the_printed_examples_work_as_printed(page, capsys):
    if page == "--help":
        with pytest.raises(SystemExit):
            run("--help")
    else:
        print((ROOT / page).read_text(encoding="utf-8"))
    examples = EXAMPLE.findall(capsys.readouterr().out)
    assert examples
    for example in examples:
        options = compare.parse(shlex.split(example, comments=True))
        assert options.choices
