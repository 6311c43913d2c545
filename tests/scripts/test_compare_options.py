"""Options of compare.py: what is refused, amounts that are the same, and the help and its examples."""

import re
import shlex

import pytest

from rigid_motion.motion import MODES
from rigid_motion_batch.cli import compare
from tests.scripts.comparing import ROOT, exit_code, run


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--rates", "0"], "rate"),
        (["--rates", "../../x"], "rate"),
        (["--rates", "1e3"], "rate"),
        (["--rates", ""], "rate"),
        (["--modes", "bezier"], "lerp_slerp"),
        (["--radius", "-1"], "above 0"),
        (["--slow-motion", "nan"], "above 0"),
        (["--resolution", "161x90"], "even"),
        (["--resolution", "big"], "1280x720"),
        (["--fps", "0"], "1 to 240"),
        (["--axes", "maya"], "unity"),
        (["--output", ""], "'' is no folder"),
        (["--output", "a\0b"], "is no folder"),
        (["--jobs", "-1"], "no number of processes"),
        (["--jobs", "many"], "no number of processes"),
        (["--decimate", "uniform", "--tolerance", "5mm"], "leave out --decimate uniform"),
        (["--decimate", "uniform", "--budget", "10"], "leave out --decimate uniform"),
        (["--fit"], "--fit is for keys that are chosen by the motion: add --tolerance, --budget or --decimate"),
        (["--modes", "motor_splin"], "did you mean motor_spline?"),
        (["--tolerence", "5mm"], "did you mean --tolerance?"),
        (["--axes", "untiy"], "did you mean unity?"),
        (["--decimate", "adaptive", "--tolerance", "5mm", "--budget", "10"], "exclude one another"),
        (["--decimate", "adaptive", "--tolerance", "5 inches"], "give a length such as 5mm"),
        (["--decimate", "adaptive", "--tolerance", "0"], "give a length such as 5mm"),
        (["--decimate", "adaptive", "--tolerance", ","], "give a length such as 5mm"),
        (["--decimate", "adaptive", "--budget", "5mm"], "give numbers such as 5,7.5,10"),
        (["--decimate", "cleverly"], "adaptive"),
        (["--columns", "when"], "write t=timestamp_ms,x=pos_x,..."),
        (["--degrees"], "--degrees is for Euler angles: add their order"),
    ],
)
def test_a_wrong_option_ends_with_code_2_and_a_way_out(arguments, complaint, capsys):
    assert exit_code(*arguments) == 2
    assert complaint in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("t,x,y,z\n1,2,3,4\n", "qx"),
        ("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,zero,0,0,0,0,1\n", ":3:"),
        ("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0\n", "0 usable poses"),
        ("", "line.csv"),
    ],
)
def test_a_wrong_file_ends_with_code_2_and_one_line(tmp_path, capsys, content, complaint):
    path = tmp_path / "line.csv"
    path.write_text(content)
    assert run(path, "--no-video", "--output", tmp_path / "out") == 2
    said = [line for line in capsys.readouterr().err.splitlines() if "compare.py:" in line]
    assert len(said) == 1
    assert complaint in said[0]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "folders"),
    [
        (["--rates", "5,7.5,5.0,05"], ["5", "7.5"]),
        (["--decimate", "adaptive", "--budget", "10.0,10"], ["budget-10.0"]),
        (["--decimate", "adaptive", "--tolerance", "5mm,0.5cm,0.005m,0.005"], ["tolerance-5mm", "tolerance-0.005"]),
    ],
)
def test_the_same_amount_written_in_two_ways_is_one_choice(arguments, folders):
    assert [choice.name for choice in compare.parse(arguments).choices] == folders


def test_the_help_names_every_mode_there_is(capsys):
    assert exit_code("--help") == 0
    said = " ".join(capsys.readouterr().out.partition("--modes MODE")[2].partition("--output")[0].split())
    assert [mode for mode in (*MODES, "all", "best_of") if mode not in said] == []


EXAMPLE = re.compile(
    r"^ +(?:blender --background --python scripts/compare\.py --"
    r"|python scripts/(?:compare\.py|bootstrap\.py compare))(?P<arguments>.*)$",
    re.MULTILINE,
)
"""A line of a page, or of the help, that calls the program."""


@pytest.mark.parametrize("page", ["--help", "README.md", "docs/comparing.md", "docs/farm.md"])
def test_the_printed_examples_work_as_printed(page, capsys):
    if page == "--help":
        assert exit_code("--help") == 0
    else:
        print((ROOT / page).read_text(encoding="utf-8"))
    examples = EXAMPLE.findall(capsys.readouterr().out)
    assert examples
    for example in examples:
        options = compare.parse(shlex.split(example, comments=True))
        assert options.choices


@pytest.mark.parametrize("modes", ["best_of", "best_of,dq_sclerp"])
def test_the_best_of_fewer_than_two_modes_is_refused(modes, capsys):
    assert exit_code("--modes", modes) == 2
    assert "best_of chooses among the other modes that are named: name two or more, or all,best_of" in (
        capsys.readouterr().err
    )
