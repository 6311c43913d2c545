"""The arguments that are meant for a script, whoever runs it."""

from __future__ import annotations

import sys

import pytest

from scripts.command_line import own_arguments


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
