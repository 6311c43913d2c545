"""Tests of inspecting: the reported contents are right, and every problem comes with a way out."""

import json

import numpy as np
import pytest

from rigid_motion_batch.cli.inspect import main
from rigid_motion_batch.recordings import ReadingOptions
from rigid_motion_batch.recordings.inspecting import inspect
from tests.scripts.recordings.layouts import csv

HEADER = "t,x,y,z,qx,qy,qz,qw"


def log(rows: int = 300, scale: float = 1.0, up: int = 1, header: str = HEADER) -> str:
    """Return a CSV log of a hand that swings 1 m above the floor, and turns about x by 90 degrees per second."""
    times = np.arange(rows) / 90.0
    places = 0.2 * np.cos(3 * times), 1.0 + 0.3 * np.sin(2 * times), 0.3 * np.sin(3 * times)
    half, still = np.pi / 4.0 * times, 0.0 * times
    return csv(header, times, scale * np.roll(places, up - 1, axis=0).T, np.sin(half), still, still, np.cos(half))


def test_what_jitters_is_measured_and_spikes_are_named(write, capsys) -> None:
    numbers = np.loadtxt(log().splitlines()[1:], delimiter=",")
    numbers[:, 1:4] += np.random.default_rng(1).normal(size=(300, 3)) * 0.0004
    numbers[90, 1] += 0.05
    source = write("hand.csv", csv(HEADER, numbers))
    found = inspect(source).contents[0].jitter
    assert found.position == pytest.approx(0.0004, rel=0.15)
    assert found.rotation == 0.0
    assert found.spikes == (1.0,)
    assert main([source]) == 0
    assert "spikes or repeat the one before: at 1 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("header", "scale", "options", "metres", "name", "known_from"),
    [
        (HEADER, 1.0, {}, 1.0, "metres", "assumed, where the file says nothing else"),
        ("t,x_cm,y_cm,z_cm,qx,qy,qz,qw", 100.0, {}, 0.01, "centimetres", "as the file says"),
        (HEADER, 39.37, {"scale": 0.0254}, 0.0254, "inches", "as --scale says"),
        ("t,x_mm,y_mm,z_mm,qx,qy,qz,qw", 2.0, {"scale": 0.5}, 0.5, "units of 0.5 m", "as --scale says"),
    ],
)
def test_the_unit_comes_with_where_it_is_from(write, header, scale, options, metres, name, known_from) -> None:
    result = inspect(write("hand.csv", log(scale=scale, header=header)), options=ReadingOptions(**options))
    unit = result.contents[0].unit
    assert (unit.metres, unit.name, unit.known_from) == (metres, name, known_from)
    assert result.contents[0].size.extent == pytest.approx((0.4, 0.6, 0.6), abs=2e-3)


@pytest.mark.parametrize(("up", "matching"), [(1, ("opengl", "unity")), (2, ())])
def test_the_axis_that_is_up_speaks_for_other_axes(write, up: int, matching: tuple[str, ...]) -> None:
    result = inspect(write("hand.csv", log(up=up)))
    assert result.contents[0].up == "xyz"[up]
    assert (result.axes.name, result.axes.known_from, result.axes.others) == ("blender", "assumed", matching)
    given = inspect(write("hand.csv", log(up=up)), axes="unity").axes
    assert (given.name, given.known_from) == ("unity", "as --axes says")
    assert given.others == (() if up == 1 else ("blender", "ros", "unreal"))


def test_all_devices_of_a_log_are_described_and_those_without_poses_named(write) -> None:
    rows = log(60).splitlines()
    text = "\n".join([f"device,{rows[0]}", *(f"{side},{row}" for row in rows[1:] for side in ("left", "right"))])
    source = write("log.csv", f"{text}\nspare,9,,,,,,,\n")
    result = inspect(source)
    assert result.bodies == ("left", "right", "spare")
    assert [content.name for content in result.contents] == ["left", "right"]
    assert result.unreadable[0][0] == "spare"
    assert [content.name for content in inspect(f"{source}:RIGHT").contents] == ["right"]


def test_the_command_says_it_in_words(write, capsys) -> None:
    text = "\n".join([line for row, line in enumerate(log(scale=100.0).splitlines()) if not 90 < row < 130])
    source = write("hand.csv", text)
    assert main([source, "--scale", "0.01", "--axes", "UNITY"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{source}: CSV with named columns, 31.3 KB"
    said = "\n".join(line[13:] if line[2:13].strip() == "" else line for line in lines[1:])
    for expected in (
        "  axes       unity (left-handed, y up, z forward), as --axes says",
        "  body       hand",
        "    samples  261 in 3.322 s",
        "    rate     90 a second, even: intervals from 11.1 to 444 ms, 1 gap",
        "    lengths  centimetres, as --scale says",
        "    motion   0.4 x 0.6 x 0.6 m along x, y, z; 2.89 m of path; mostly below 1.08 m/s and 90",
        "degrees/s; turns up to 180 degrees away from its first pose",
        "    repaired left gaps as they are",
        "    warning  no samples from 0.99 s to 1.43 s: no error is measured there",
        "-> take a part without it: --start and --end",
    ):
        assert expected in said, said


def test_the_exit_code_says_how_many_could_be_read(write, capsys) -> None:
    good, bad = write("hand.csv", log()), write("bad.csv", "x")
    assert main([good, bad]) == 1
    assert "bad.csv:1: no column named" in capsys.readouterr().err
    assert main([bad]) == 2
    assert main([good, bad, "--json"]) == 1
    result = json.loads(capsys.readouterr().out)
    (hand,) = result[0]["contents"]
    assert hand["timing"] | {"samples": 300, "even": True, "gaps": 0} == hand["timing"]
    assert (hand["joints"], hand["scaled"], hand["repairs"], hand["warnings"]) == ([], False, [], [])
    assert "no column named" in result[1]["error"]
