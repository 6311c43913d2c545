"""Tests of reading options: they are checked at once, and survive a journey as JSON in a task."""

import json
from dataclasses import asdict

import pytest

from rigid_motion_batch.command_line import Parser
from rigid_motion_batch.recordings import ReadingOptions
from rigid_motion_batch.recordings.options import add_reading_options, reading_options

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
