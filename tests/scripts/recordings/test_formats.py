"""Motive's CSV exports, and what is said of wrong files of any text format."""

import json

import numpy as np
import pytest

from rigid_motion_batch.recordings import read_trajectories
from tests.scripts.recordings.layouts import OTHERS, RAW


def broken(**changes: object) -> str:
    """A recording of A-Frame, of which the third pose of the first device is another."""
    content = json.loads(OTHERS["A-Frame"].text)
    content["left"]["poses"][2].update(changes)
    return json.dumps(content)


MOTIVE_SETTINGS = (
    "Format Version,1.23,Take Name,Take 3,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
    "Total Exported Frames,3,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global"
)
BODY = ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]
AXES = ["X", "Y", "Z", "W", "X", "Y", "Z", ""]


def motive(settings: str = MOTIVE_SETTINGS, labels: bool = True, parents: bool = False) -> str:
    """A take with a marker, two rigid bodies and a bone; the second body is lost in the middle frame."""

    def header(label: str, *cells: str) -> str:
        return ",".join(["", label if labels else "", *cells])

    rows = [
        settings,
        "",
        header("Type", *["Marker"] * 3, *["Rigid Body"] * 16, *["Rigid Body Marker"] * 3, *["Bone"] * 7),
        header("Name", *["Drill:1"] * 3, *["Drill"] * 8, *['"Head, left"'] * 8, *["Drill:1"] * 3, *["Hip"] * 7),
        header("ID", *["A1"] * 3, *["B1"] * 8, *["B2"] * 8, *["B1"] * 3, *["C1"] * 7),
        *([header("Parent", *[""] * 29)] if parents else []),
        header("", *["Position"] * 3, *BODY, *BODY, *["Position"] * 3, *BODY[:7]),
        ",".join(["Frame", "Time (Seconds)" if labels else "Time", *"XYZ", *AXES, *AXES, *"XYZ", *AXES[:7]]),
    ]
    for frame in range(3):
        marker = ["7", "7", "7"]
        drill = [f"0.{frame}", "0.2", "0.3", "0.9", f"{frame}", "20", "30", "0.001"]
        head = [""] * 8 if frame == 1 else ["0.5", "0.5", "0.5", "-0.5", "1", "2", f"{frame}", "0.001"]
        rows.append(",".join([f"{frame}", f"{frame / 120:.6f}", *marker, *drill, *head, "", "", "", *["8"] * 7]))
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize("labels", [True, False])
@pytest.mark.parametrize("parents", [True, False])
def test_the_rigid_bodies_are_found_among_markers_and_bones(write, labels: bool, parents: bool) -> None:
    recording = read_trajectories(write("take.csv", motive(labels=labels, parents=parents)) + ":*")
    drill, head = recording.trajectories
    assert (drill.name, head.name) == ("Drill", "Head, left")
    assert drill.metres_per_unit == 0.001
    inches = motive(MOTIVE_SETTINGS.replace("Millimeters", "Inches"))
    assert read_trajectories(write("take.csv", inches)).trajectories[0].metres_per_unit == 0.0254
    np.testing.assert_array_equal(drill.times, [0.0, 0.008333, 0.016667])
    np.testing.assert_array_equal(drill.poses.positions, [[0, 20, 30], [1, 20, 30], [2, 20, 30]])
    np.testing.assert_array_equal(drill.poses.quaternions[:, 1], [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(drill.poses.quaternions[0], [0.9, 0.0, 0.2, 0.3])
    np.testing.assert_array_equal(head.poses.quaternions[2], [-0.5, 0.5, 0.5, 0.5])


def test_bones_are_taken_by_name_beside_rigid_bodies_and_where_there_are_no_others(write) -> None:
    path = write("take.csv", motive())
    (hip,) = read_trajectories(f"{path}:Hip").trajectories
    np.testing.assert_array_equal(hip.poses.positions, np.full((3, 3), 8.0))
    bones = read_trajectories(write("take.csv", motive().replace("Rigid Body", "Marker"))).trajectories
    assert [bone.name for bone in bones] == ["Hip"]
    local = motive().replace("Space,Global", "Space,Local")
    assert "Coordinate Space: Global" in str(read_trajectories(write("take.csv", local)).trajectories[0].warnings)


TUM_COMMENTS = "# ground truth trajectory\n# file: 'dataset.bag'\n# timestamp tx ty tz qx qy qz qw\n"
TUM_ROWS = "1305031098.6659 1.3 0.6 1.6 0.6132 0.5962 -0.3311 -0.3986\n1305031098.6758 1.4 0.7 1.7 0.1 0.2 0.3 0.4\n"


WRONG = {
    "hand.json": [
        ("", 1, "this is not JSON"),
        ('{"poses":\n[}', 2, "this is not JSON"),
        ('{"poses": [%s]}' % ("9" * 5000), None, "this JSON cannot be a recording"),
        ('{"camera": 1, "left": {"events": []}}', None, "this JSON holds no poses"),
        (broken(position={"x": 1, "y": 2}), None, "pose 2 of 'left' has no number position.z"),
        (broken(timestamp=10**400), None, "pose 2 of 'left' has no number timestamp"),
    ],
    "take.csv": [
        (MOTIVE_SETTINGS, 1, "the rows that say what the columns are end too early"),
        (
            motive().replace("Rigid Body Marker", "Marker").replace("Rigid Body", "Marker").replace("Bone", "Marker"),
            None,
            "no rigid body, only Marker",
        ),
        (motive(MOTIVE_SETTINGS.replace("Millimeters", "Cubits")), 1, "Length Units is 'Cubits'"),
        (motive(MOTIVE_SETTINGS.replace("Quaternion", "Matrix")), 1, "Rotation Type is 'Matrix'"),
        (
            motive(MOTIVE_SETTINGS.replace("Quaternion", "XYZ")).replace("X,Y,Z,W", "X,Y,Q,W"),
            7,
            "no column named rx, ry, rz for 'Drill'",
        ),
        (motive() + "3,0.025" + ",1" * 99 + "\n", 11, "101 columns where 31 have a name"),
        (motive().replace("Head, left", "x" * 200_000), 4, "this line is not a header"),
        (motive().replace("Rigid Body", "").replace("Marker", "").replace("Bone", ""), 7, "no rigid body in this take"),
        (
            "Time,Position,Rotation\n0,(0, 0, 0),(0, 0, 0, 1)\n.1,(0, 0),(0, 0, 0, 1)\n",
            3,
            "6 columns where 8 are needed",
        ),
    ],
    "vicon.csv": [
        (
            "Trajectories\n100\n,,a:b\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n",
            None,
            "no table of Objects or Segments in it",
        ),
        ("Objects\nfast\n", 1, "no column has a known name (found Objects)"),
        ("Objects\n0\n,,A\nFrame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ\n", 2, "the rate is '0'; say it: --frame-rate 100"),
    ],
    "body.tsv": [
        ("NO_OF_FRAMES\t9\nNO_OF_BODIES\t1\n", None, "no line names the columns X, Y, Z; export 6D data with Include"),
        ("NO_OF_FRAMES\t9\nNO_OF_BODIES\t1\nX\tY\tZ\n", 1, "the rate is ''; say it: --frame-rate 100"),
    ],
    "poses.json": [
        ('[{"t": 0, "position": [1, 2, 3]}]', None, "positions only, and rotations are needed (found "),
        (
            '[{"t": 0, "pos": [1, 2, 3], "quat": [1, 0, 0, 0]}, {"t": 1}]',
            None,
            "pose 1 of 'poses' has no number pos[0]",
        ),
        (
            '{"frames": [{"file_path": "a.png", "transform_matrix": 1}]}',
            None,
            "this JSON holds no poses; it takes a list",
        ),
    ],
    "kitti.txt": [
        (str(RAW["KITTI"].text), None, "poses without times; say how many frames a second it has: --frame-rate 90"),
    ],
    "images.txt": [("#   POINTS2D[] as (X, Y)\n", None, "no column of time, only one that counts frames")],
    "walk.tum": [
        ("0 1 2 3 4 5 6\n", 1, "7 numbers in a row, which are not known poses; write a first line of names"),
        (f"{TUM_COMMENTS}0 1 2 3 0 0 0 1\n0.1 1 2\n", 5, "3 columns where 8 are needed"),
        (f"{TUM_COMMENTS}0 1 2 3 0 0 0 1 9\n", 4, "9 columns where 8 have a name"),
        ("0 1 2 3\n0.1 1 2 3\n", 1, "positions only, and rotations are needed; write t x y z qx qy qz qw"),
        (f"{TUM_ROWS}1,2,3\n", 3, "1 columns where 8 are needed"),
    ],
}
"""Contents of files of these names, the line that is wrong, and what is said of it."""


@pytest.mark.parametrize(
    ("name", "text", "line", "problem"), [(name, *row) for name, rows in WRONG.items() for row in rows]
)
def test_a_wrong_file_is_told_with_its_line(write, refusal, name, text, line, problem):
    told_line, message = refusal(write(name, text))
    assert message.startswith(problem)
    assert told_line == line
