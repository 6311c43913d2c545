"""Tests of Motive's CSV exports, and of the errors for wrong files of all text formats."""

import json

import numpy as np
import pytest

from rigid_motion_batch.recordings import read_trajectories
from tests.scripts.recordings.layouts import OTHERS, RAW
from tests.scripts.recordings.optical_layouts import OPTICAL

MOTIVE = str(OPTICAL["Motive"].text)


def test_of_motive_bones_are_taken_by_name_and_poses_in_the_space_of_a_parent_are_told(write) -> None:
    both = MOTIVE.replace("Meters\n", "Meters,Coordinate Space,Local\n").splitlines()
    rows = {2: "Bone", 3: "Hip", 4: "7", 5: None, 6: None}
    for row, name in rows.items():
        cells = both[row].split(",")
        both[row] += "," + ",".join(cells[2:9] if name is None else [name] * 7)
    both[7:] = [line + "," + ",".join(line.split(",")[2:9]) for line in both[7:]]
    source = write("take.csv", "\n".join(both))
    (hip,), (tool,) = (read_trajectories(f"{source}{body}").trajectories for body in (":Hip", ""))
    assert (hip.name, tool.name) == ("Hip", "Tool")
    np.testing.assert_array_equal(hip.poses.positions, tool.poses.positions)
    assert "Coordinate Space: Global" in str(tool.warnings)


def broken(**changes: object) -> str:
    """Return an A-Frame recording with changes to the third pose of the first device."""
    content = json.loads(OTHERS["A-Frame"].text)
    content["left"]["poses"][2].update(changes)
    return json.dumps(content)


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
        (MOTIVE.splitlines()[0], 1, "the rows that say what the columns are end too early"),
        (MOTIVE.replace("Rigid Body", "Marker"), None, "no rigid body, only Marker"),
        (MOTIVE.replace("Meters", "Cubits"), 1, "Length Units is 'Cubits'"),
        (MOTIVE.replace("Quaternion", "Matrix"), 1, "Rotation Type is 'Matrix'"),
        (MOTIVE.replace("Quaternion", "XYZ").replace("X,Y,Z,W", "X,Y,Q,W"), 7, "no column named rx, ry, rz for 'Tool'"),
        (MOTIVE + "3,0.025" + ",1" * 99 + "\n", 32, "101 columns where 10 have a name"),
        (MOTIVE.replace(",Tool", ',"Tool', 1).replace("Tool", "x" * 200_000, 1), 4, "this line is not a header"),
        (MOTIVE.replace("Rigid Body", "").replace("Marker", ""), 7, "no rigid body in this take"),
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
"""File names and contents, the line that is wrong, and the error message."""


@pytest.mark.parametrize(
    ("name", "text", "line", "problem"), [(name, *row) for name, rows in WRONG.items() for row in rows]
)
def test_a_wrong_file_is_told_with_its_line(write, refusal, name, text, line, problem):
    told_line, message = refusal(write(name, text))
    assert message.startswith(problem)
    assert told_line == line
