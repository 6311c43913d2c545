"""Tests of the options of compare.py, its help and its examples."""

import re
import shlex

import pytest

from rigid_motion.motion import MODES
from rigid_motion_batch.cli import compare
from tests.scripts.comparing import ROOT, run


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


def test_the_help_names_every_mode_there_is(capsys):
    with pytest.raises(SystemExit):
        run("--help")
    said = " ".join(capsys.readouterr().out.partition("--modes MODE")[2].partition("--output")[0].split())
    assert [mode for mode in (*MODES, "all") if mode not in said] == []


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
