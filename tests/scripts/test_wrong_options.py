"""Tests of wrong options: each is refused by a line that says what to give instead, with exit code 2."""

from importlib import import_module

import pytest

REFUSED = {
    "compare": [
        (["--rates", "0"], "rate"),
        (["--modes", "hermite"], "lerp_slerp"),
        (["--radius", "-1"], "above 0"),
        (["--resolution", "161x90"], "even"),
        (["--fps", "0"], "1 to 240"),
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
