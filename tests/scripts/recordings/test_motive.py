"""Motive's CSV exports, in the shapes that versions 1.21 to 1.25 of the format have."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion_batch.recordings import read_trajectories

SETTINGS = (
    "Format Version,1.23,Take Name,Take 3,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
    "Total Exported Frames,3,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global"
)
BODY = ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]
AXES = ["X", "Y", "Z", "W", "X", "Y", "Z", ""]


def export(settings: str = SETTINGS, labels: bool = True, parents: bool = False) -> str:
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
    recording = read_trajectories(write("take.csv", export(labels=labels, parents=parents)) + ":*")
    drill, head = recording.trajectories
    assert (drill.name, head.name) == ("Drill", "Head, left")
    assert drill.metres_per_unit == 0.001
    inches = export(SETTINGS.replace("Millimeters", "Inches"))
    assert read_trajectories(write("take.csv", inches)).trajectories[0].metres_per_unit == 0.0254
    np.testing.assert_array_equal(drill.times, [0.0, 0.008333, 0.016667])
    np.testing.assert_array_equal(drill.poses.positions, [[0, 20, 30], [1, 20, 30], [2, 20, 30]])
    np.testing.assert_array_equal(drill.poses.quaternions[:, 1], [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(drill.poses.quaternions[0], [0.9, 0.0, 0.2, 0.3])
    np.testing.assert_array_equal(head.poses.quaternions[2], [-0.5, 0.5, 0.5, 0.5])


@pytest.mark.parametrize("order", ["XYZ", "ZYX", "YZX", ""], ids=str)
def test_euler_angles_are_turns_about_the_turned_axes(write, order: str) -> None:
    """Those about X, Y and Z where the settings say nothing, and there is no W."""
    kind = f"Rotation Type,{order}," if order else ""
    order = order or "XYZ"
    text = "\n".join(
        [
            SETTINGS.replace("Rotation Type,Quaternion,", kind),
            ",Type" + ",Rigid Body" * 6,
            ",Name" + ",Drill" * 6,
            ",ID" + ",B1" * 6,
            "," + ",Rotation" * 3 + ",Position" * 3,
            "Frame,Time (Seconds)," + ",".join(order) + ",X,Y,Z",
            "0,0.0,10,20,30,1,2,3",
            "1,0.1,40,50,60,1,2,3",
        ]
    )
    (drill,) = read_trajectories(write("take.csv", text)).trajectories
    expected = Rotation.from_euler(order, [[10, 20, 30], [40, 50, 60]], degrees=True).as_quat()[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(drill.poses.quaternions, expected, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        (SETTINGS, 1, "the rows that say what the columns are end too early"),
        ("\n".join(export().split("\n")[:5]), 5, "the rows that say what the columns are end too early"),
        ("\n".join(export().split("\n")[:7]), None, "'Drill' has 0 samples"),
        (
            export().replace("Rigid Body Marker", "Marker").replace("Rigid Body", "Bone"),
            None,
            "no rigid body, only Marker, Bone",
        ),
        (export(SETTINGS.replace("Millimeters", "Cubits")), 1, "Length Units is 'Cubits'"),
        (export(SETTINGS.replace("Quaternion", "Matrix")), 1, "Rotation Type is 'Matrix'"),
        (export(SETTINGS.replace("Quaternion", "XYZ")).replace("X,Y,Z,W", "X,Y,Q,W"), 7, "'Drill' has no column rotat"),
        (export().replace("Time (Seconds),X,Y,Z,X,Y,Z,W", "Time,X,Y,Z,X,Y,Z,V"), 7, "'Drill' has no column rotation W"),
        (export().replace("0.1,0.2,0.3,0.9", "0.1,?,0.3,0.9"), 9, "Drill rotation y is '?', not a number"),
        (export() + "3,0.025,1\n", 11, "3 columns where"),
        (export() + "3,0.025" + ",1" * 99 + "\n", 11, "101 columns where 31 have a name"),
        (export().replace("Head, left", "x" * 200_000), 4, "this line is no header"),
    ],
)
def test_a_wrong_file_is_told_with_its_line(write, refusal, text: str, line: int | None, problem: str) -> None:
    told_line, message = refusal(write("take.csv", text))
    assert message.startswith(problem)
    assert told_line == line
