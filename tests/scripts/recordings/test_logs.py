"""Tests of logs in common spellings: each reads as the recorded motion, or the error says what to do."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion_batch.recordings import ReadingOptions, read_clips, read_trajectories
from tests.scripts.recordings import logs
from tests.scripts.recordings.logs import MOTIONS, assert_is_the_motion, log, names, spellings
from tests.thoroughness import tried


def read_one(source: str, **options: object) -> object:
    (trajectory,) = read_trajectories(source, ReadingOptions(**options)).trajectories
    return trajectory


def test_columns_may_be_named_one_by_one(write) -> None:
    source = write("take.csv", log(["when", "a", "b", "c", "d", "e", "f", "g"]))
    named = zip(("t", "x", "y", "z", "qx", "qy", "qz", "qw"), ("When", "a", "b", "c", "d", "e", "f", "g"), strict=True)
    assert_is_the_motion(read_one(source, columns=tuple(named)), MOTIONS["left"])


def euler_log(header: Sequence[str], order: str, degrees: bool) -> str:
    motion = MOTIONS["left"]
    angles = motion.turns.as_euler(order, degrees=degrees)
    by_axis = angles[:, np.argsort(list(order.lower()))]
    rows = zip(logs.time_texts("s", 0), logs.pose_texts(motion, 1.0, by_axis), strict=True)
    return logs.written(header, [[time, *pose] for time, pose in rows])


def test_roll_pitch_and_yaw_are_read_where_it_is_said_which_is_which(write, refusal) -> None:
    source = write("take.csv", euler_log(["t", "x", "y", "z", "roll", "pitch", "yaw"], "ZYX", False))
    which = [("rx", "roll"), ("ry", "pitch"), ("rz", "yaw")]
    assert_is_the_motion(read_one(source, euler="ZYX", columns=which), MOTIONS["left"])
    _, message = refusal(source, euler="ZYX")
    assert "--columns rx=roll,ry=pitch,rz=yaw in ROS" in message


def test_quaternions_are_read_beside_euler_angles_unless_these_are_asked_for(write) -> None:
    rows = "0,0,0,0,0,0,0,1,90,0,0\n.1,0,0,0,0,0,0,1,90,0,0\n"
    source = write("take.csv", "t,x,y,z,qx,qy,qz,qw,euler_x,euler_y,euler_z\n" + rows)
    np.testing.assert_array_equal(read_one(source).poses.quaternions[0], [1, 0, 0, 0])
    turned = read_one(source, euler="XYZ", degrees=True).poses.quaternions[0]
    np.testing.assert_allclose(turned, [0.5**0.5, 0.5**0.5, 0, 0])


def test_degrees_that_could_be_radians_are_told(write) -> None:
    source = write("take.csv", euler_log(names("t", "{}", "rot_{}", "xyz"), "XYZ", False))
    (warning,) = read_one(source, euler="XYZ", degrees=True).warnings
    assert str(warning).endswith("radians need no --degrees")


def long_log(device: str, header: Sequence[str] = ("t", "x", "y", "z", "qx", "qy", "qz", "qw"), unit: str = "s") -> str:
    """Return a log of two devices in alternating rows, named in a column."""
    lines = [log(header, unit, side=side).splitlines()[1:] for side in MOTIONS]
    rows = [f"{row},{side}" for both in zip(*lines, strict=True) for row, side in zip(both, MOTIONS, strict=True)]
    return "\n".join([f"{','.join(header)},{device}", *rows])


@pytest.mark.parametrize("name", ["log.csv", "log.tum"])
def test_devices_that_nothing_tells_apart_are_refused_with_the_columns_there_are(write, refusal, name: str) -> None:
    rows = [line.rpartition(",")[0] for line in long_log("who").splitlines()]
    text = "\n".join(rows) if name == "log.csv" else "# " + "\n".join(rows).replace(",", " ")
    _, message = refusal(write(name, text))
    assert re.match(
        r"\d+ of 48 samples jump from one place to another and back, at [\d.]+ m/s: these are several", message
    )
    result = "--columns device=NAME (found t, x, y, z, qx, qy, qz, qw), or split the file"
    assert message.endswith(result if name == "log.csv" else "; write a file for each")


def test_a_column_that_is_named_for_devices_and_is_none_is_refused(write, refusal) -> None:
    rows = "".join(f"{number},0.1,0,0,0,0,0,0,1\n" for number in range(1200))
    source = write("log.csv", f"id,t,x,y,z,qx,qy,qz,qw\n{rows}")
    _, message = refusal(source, columns=[("device", "id"), ("t", "t")])
    assert message.startswith("more than 1000 different values in the column of devices; name another with --columns")


@pytest.mark.parametrize(
    ("header", "options", "told"),
    [
        ("when,a,b,c,d,e,f,g", {}, "no column has a known name (found when, a, b, c, d, e, f, g); known are t, time, "),
        ("frame,x,y,z,qx,qy,qz,qw", {}, "no column of time, only one that counts frames ('frame'); say how many frame"),
        ("t,left_x,left_y,left_z,button", {}, "positions only, and rotations are needed (found t, left_x, left_y, lef"),
        ("t,x,x,y,z,qx,qy,qz,qw", {}, "two columns mean x ('x'); say which with --columns x=NAME, or rename or"),
        ("t,Position,Rotation", {}, "rotations are Euler angles here (Rotation.x, Rotation.y, Rotation.z), and their"),
        ("t,x,y,z,rx,ry,rz", {}, "rotations are Euler angles here (rx, ry, rz), and their order is not said; say it:"),
        ("t,x,y,z,qx,qy,qz,qw", {"euler": "XYZ"}, "no column named rx, ry, rz (found t, x, y, z, qx, qy, qz, qw); kn"),
        ("t,x,y,z,qx,qy,qz,qw", {"columns": [("t", "when")]}, "no column is named 'when'; --columns t=NAME takes one "),
        ("t [min],x,y,z,qx,qy,qz,qw", {}, "'min' is not a known unit of time; --time-unit s, ms, us, ns"),
        ("t,x [furlong],y,z,qx,qy,qz,qw", {}, "'furlong' is not a known unit of length; say how many metres it "),
    ],
)
def test_a_refusal_says_what_was_found_what_is_known_and_what_helps(write, refusal, header, options, told):
    row = "0,(0, 0, 0),(30, 0, 0)" if "Position" in header else ",".join("0" for _ in header.split(","))
    line, message = refusal(write("take.csv", f"{header}\n{row}\n"), **options)
    assert message.startswith(told)
    assert line == 1
    if "known are" in message:
        assert (
            "known are t, time, timestamp_ms; x, px, pos_x, position.x; qw, rot_w, rotation.w; or --columns" in message
        )


def test_angles_that_are_no_radians_are_refused(write, refusal) -> None:
    rows = "0,0,0,0,359,0,0\n.1,0,0,0,1,0,0\n"
    source = write("take.csv", f"t,x,y,z,rx,ry,rz\n{rows}")
    read_one(write("said.csv", f"t,x,y,z,rx_rad,ry_rad,rz_rad\n{rows}"), euler="XYZ")
    assert refusal(source, euler="XYZ")[1].startswith("angles go up to 359, which are not radians; say so: --degrees;")


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ({"columns": [("t", "t")]}, "take.bvh"),
        ({"euler": "XYZ"}, "take.bvh"),
        ({"time_unit": "ms"}, "take.csv"),
    ],
)
def test_an_option_that_means_nothing_to_a_format_is_refused(write, refusal, given: dict, name: str) -> None:
    option, label = next(iter(given)).replace("_", "-"), "BVH" if name.endswith("bvh") else "Motive CSV"
    text = f"--{option} means nothing to {label}; leave it out, as its files say that themselves"
    assert refusal(write(name, "Format Version,1.23\n"), **given)[1] == text


def test_clocks_that_run_at_different_speeds_are_asked_for(write, refusal) -> None:
    rows = "".join(f"{row / 90},{row / 45},0,0,0,0,0,0,1\n" for row in range(9))
    source = write("take.csv", f"time,clock,x,y,z,qx,qy,qz,qw\n{rows}")
    _, message = refusal(source)
    assert message.startswith("two columns mean t and disagree ('time' lasts ")
    assert message.endswith("say which with --columns t=NAME")
    np.testing.assert_allclose(read_one(source, columns=[("t", "clock")]).times, np.arange(9) / 45.0)


@pytest.mark.parametrize(
    ("rotation", "why"),
    [
        ("left_y,left_rx,left_ry,left_rz", "its rotations are Euler angles, for --euler"),
        ("left_qx,left_qy,left_qz,left_qw", "it has no column y"),
    ],
)
def test_a_body_that_lacks_something_is_named(write, rotation: str, why: str) -> None:
    header = f"t,x,y,z,qx,qy,qz,qw,left_x,left_z,{rotation}"
    one = read_one(write("take.csv", header + "\n0,0,0,0,0,0,0,1,0,0,0,0,0,0\n.1,0,0,0,0,0,0,1,0,0,0,0,0,0\n"))
    assert one.remark == f"'left' is left out, as {why}"


def test_bodies_that_share_no_rows_have_their_own_and_nothing_is_lost(write) -> None:
    header = names("t", "{}", "q{}", prefixes=[f"{side}_" for side in MOTIONS])
    rows = [log(names("t", "{}", "q{}"), side=side).splitlines()[1:] for side in MOTIONS]
    lines = [
        line for left, right in zip(*rows, strict=True) for line in (left + "," * 7, right.replace(",", "," * 8, 1))
    ]
    source = write("take.csv", "\n".join([",".join(header), *lines]))
    for clip in read_clips([f"{source}:*"])[0]:
        assert len(clip.times) == logs.COUNT
        assert clip.repairs == ()


@st.composite
def loggers(draw: st.DrawFn) -> tuple[str, ReadingOptions, str, int]:
    """Return a log of both motions in a random spelling, the options to read it, its unit of time and its start."""
    unit = draw(st.sampled_from(list(logs.TIMES)))
    start = draw(st.sampled_from([0, logs.EPOCH]))
    length = draw(st.sampled_from(list(logs.LENGTHS)))
    position = draw(st.sampled_from(spellings(logs.POSITIONS))) + draw(st.sampled_from(spellings(logs.LENGTHS[length])))
    said: dict[str, object] = {"scale": logs.METRES[length]} if position.endswith(("}", "position")) else {}
    order = draw(st.sampled_from([None, "YXZ", "ZYX", "zxy"]))
    angle = draw(st.sampled_from(list(logs.ANGLES)))
    if order:
        suffix = draw(st.sampled_from(["", *spellings(logs.ANGLES[angle])]))
        rotation, axes = draw(st.sampled_from(spellings(logs.EULERS))) + suffix, "xyz"
        said |= {"euler": order, "degrees": angle == "deg"}
    else:
        rotation, axes = draw(st.sampled_from(spellings(logs.QUATERNIONS))), "xyzw"

    def columns_of(side: str, prefix: str) -> dict[str, list[str]]:
        motion = MOTIONS[side]
        turns = motion.turns.as_quat()
        if order:
            by_turn = motion.turns.as_euler(order, degrees=angle == "deg")
            turns = by_turn[:, np.argsort(list(order.lower()))]
        header = names("", position, rotation, axes, prefixes=[prefix])[1:]
        cells = logs.pose_texts(motion, logs.METRES[length], turns)
        return {name: [row[place] for row in cells] for place, name in enumerate(header)}

    time = draw(st.sampled_from(spellings(logs.TIMES[unit])))
    times = {time: logs.time_texts(unit, start)}
    if time in ("t", "T", "time", "Time", "timestamp", "TimeStamp", "ts", "elapsed time"):
        said["time_unit"] = unit
    if draw(st.booleans(), label="a body has columns of its own"):
        columns = times | columns_of("left", "left_") | columns_of("right", "right_")
    else:
        device = draw(st.sampled_from(spellings(logs.DEVICES)))
        both = [times | columns_of(side, "") | {device: [side] * logs.COUNT} for side in MOTIONS]
        columns = {
            name: [cell for pair in zip(*(item[name] for item in both), strict=True) for cell in pair]
            for name in both[0]
        }
    for extra in draw(st.lists(st.sampled_from(spellings(logs.EXTRAS)), unique=True, max_size=3)):
        columns[extra] = ["0.5"] * len(columns[time])
    header, rows = logs.named({name: columns[name] for name in draw(st.permutations(list(columns)))})
    separator = draw(st.sampled_from([",", ";", "\t"]))
    text = logs.written(header, rows, separator)
    if separator == ";" and draw(st.booleans()) and "." not in "".join(header):
        text = text.replace(".", ",")
    return text, ReadingOptions(**said), unit, start


@settings(max_examples=tried(100))
@given(loggers())
def test_any_spelling_any_unit_any_order_and_any_layout_is_the_motion(tmp_path_factory, logger):
    text, options, unit, start = logger
    path = Path(tmp_path_factory.getbasetemp()) / "logger.csv"
    path.write_text(text, encoding="utf-8")
    trajectories = read_trajectories(f"{path}:*", options).trajectories
    assert {trajectory.name for trajectory in trajectories} == set(MOTIONS)
    for trajectory in trajectories:
        assert_is_the_motion(trajectory, MOTIONS[trajectory.name], start=start, unit=unit)
