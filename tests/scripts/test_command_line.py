"""Tests of the arguments of a script, in Python and in Blender, and of the command that a report shows."""

import sys

import pytest

from rigid_motion_batch.command_line import as_typed, own_arguments


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
