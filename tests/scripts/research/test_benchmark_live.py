"""The benchmark of live in-betweens: its scenes are what it says, and its pages follow from what was measured."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from research import benchmark_live
from research.live_benchmark.baking import long_bakes
from research.live_benchmark.everyday import everyday
from research.live_benchmark.rigs import RigSize, add_skin, edits, rig_of, rigs
from research.live_benchmark.scenes import MODE, MOTIONS, NativeBaking, Size, scene_of, set_modes
from research.live_benchmark.shots import KEY, SAMPLE, choosing, file_sizes, samples_of, shot, shots, what_is_left
from research.live_benchmark.turns import against, judged, told, told_in_ms
from rigid_motion import animation
from rigid_motion.animation import channelbag_of, read_poses

SMALL = Size(3, 5, 40)
SMALL_RIG = RigSize(12, 5, 40, vertices=400)


@pytest.fixture
def live_file(empty_file):
    animation.register()
    yield
    animation.set_enabled(True)
    animation.unregister()


def tables(lines) -> dict[str, list[list[str]]]:
    """The cells of each table's rows, by the heading above it; every row is as wide as its head."""
    found: dict[str, list[list[str]]] = {}
    for line in lines:
        assert "nan" not in line
        if line.startswith("## "):
            heading = line.removeprefix("## ")
            found[heading] = []
        elif line.startswith("|"):
            found[heading].append([cell.strip() for cell in line.strip("|").split("|")])
    for rows in found.values():
        assert {len(row) for row in rows} == {len(rows[0])}
        del rows[:2]
    return found


@pytest.mark.usefixtures("live_file")
def test_everyday_work_is_told_for_quaternions_and_euler_angles():
    size = Size(3, 10, 40)
    found = tables(everyday(size, 1))
    assert list(found) == [f"{size}, turned by QUATERNION", f"{size}, turned by XYZ"]
    for rows in found.values():
        assert [row[0] for row in rows] == [
            "one key edited, and the view updated",
            "another object moved",
            "all frames played",
            "all in-betweens anew",
            "all in-betweens anew",
        ]


@pytest.mark.usefixtures("live_file")
def test_choosing_a_mode_is_told_beside_native_baking_and_its_goal():
    found = tables(choosing(SMALL, 1))
    assert list(found) == [f"A mode for {SMALL}, turned by QUATERNION", f"A mode for {SMALL}, turned by XYZ"]
    for chosen, updated in found.values():
        assert chosen[0] == "`set_mode` for all in one call"
        assert chosen[2].startswith("`bake_action_objects`: ")
        assert chosen[4] == "at most 0.2 s: met"
        assert updated[0] == "the same, and the view updated"


@pytest.mark.usefixtures("live_file")
def test_shots_are_told_for_every_motion_and_rotation_mode():
    found = tables(shots(SMALL, 1))
    assert list(found) == [
        f"A shot of {SMALL}, turned by {rotation_mode}, {motion}"
        for motion in MOTIONS
        for rotation_mode in ("QUATERNION", "XYZ")
    ]


@pytest.mark.usefixtures("live_file")
def test_a_shot_tells_the_ratios_of_what_stands_beside_them(monkeypatch):
    sizes = iter(((100_000, 1_000_000), (390_000, 6_100_000), (780_000, 24_400_000)))
    monkeypatch.setattr("research.live_benchmark.shots.file_sizes", lambda: next(sizes))
    page = list(shot(SMALL, "QUATERNION", "about general axes", 3))
    (rows,) = tables(page).values()
    assert [row[0] for row in rows] == [
        "`set_mode` for all in one call",
        "the same, and the view updated",
        "the view updated after an edit of each",
        *["the file, compressed"] * 2,
        *["the file, not compressed"] * 2,
    ]
    edit = rows[2]
    assert "Blender's own update" in edit[2]
    assert edit[4].startswith("at most 3: ")
    assert [row[1:] for row in rows[3:]] == [
        ["0.39 MB", "without modes: 0.10 MB", "3.9 times as large", "at most 6: met"],
        ["0.39 MB", "baked by `bake_action_objects`: 0.78 MB", "0.50 times as large", ""],
        ["6.10 MB", "without modes: 1.00 MB", "6.1 times as large", "at most 4: missed"],
        ["6.10 MB", "baked by `bake_action_objects`: 24.40 MB", "0.25 times as large", ""],
    ]


@pytest.mark.usefixtures("live_file")
@pytest.mark.parametrize(
    ("rotation_mode", "motion", "components"),
    [
        ("QUATERNION", "about general axes", 7),
        ("XYZ", "about general axes", 6),
        ("QUATERNION", "in a plane", 4),
        ("XYZ", "in a plane", 3),
    ],
)
def test_a_planar_motion_has_samples_of_fewer_components(rotation_mode, motion, components):
    objects = scene_of(SMALL, rotation_mode, MOTIONS[motion])
    assert samples_of(objects) == []
    set_modes(objects, MODE)
    assert samples_of(objects) == [SMALL.frames] * components * SMALL.objects


@pytest.mark.usefixtures("live_file")
def test_a_file_is_larger_by_its_samples_and_keys():
    (obj,) = scene_of(Size(1, 2, 5001), "QUATERNION")
    plain = file_sizes()[1]
    set_modes([obj], MODE)
    assert file_sizes()[1] - plain == pytest.approx(7 * 5001 * SAMPLE, rel=0.02)
    set_modes([obj], "BLENDER")
    channelbag_of(obj).fcurves.find("location").keyframe_points.add(10_000)
    assert file_sizes()[1] - plain == pytest.approx(10_000 * KEY, rel=0.02)


def test_what_is_left_follows_from_the_samples():
    lines = what_is_left(Size(10, 20, 1000), [1000] * 70, (500_000, 1_220_000), (80_000, 100_000), refresh=0.008)
    text = " ".join(lines)
    assert max(map(len, lines)) <= 120
    assert "here 7 of each object" in text
    assert "16 bytes in Blender's file format: they are 1.12 MB of the 1.22 MB" in text
    assert "Compressed, a sample takes 6.0 bytes" in text
    assert "20 keys of 72 bytes" in text
    # 400 000 bytes, of which 100 000 are no samples, at 16 bytes for 10 000 poses.
    assert "room for the samples of 1.9 components" in text
    assert "0.80 ms an object" in text


@pytest.mark.usefixtures("live_file")
def test_long_bakes_are_told_beside_each_other():
    found = tables(long_bakes((Size(1, 5, 50), Size(1, 5, 100)), 2))
    (rows,) = found.values()
    assert [row[0] for row in rows] == ["50 frames", "100 frames", "100 frames beside 50"]
    assert rows[0][4] == rows[1][4] == "at most 5 s: met"
    assert rows[2][4].startswith("at most 2.2: ")


@pytest.mark.usefixtures("live_file")
def test_native_baking_keys_what_is_shown_and_gives_it_back():
    objects = scene_of(SMALL, "QUATERNION")
    set_modes(objects, MODE)
    actions = [obj.animation_data.action for obj in objects]
    frames = np.arange(1, SMALL.frames + 1)
    shown = read_poses(objects[1], frames)
    native = NativeBaking(objects, range(1, SMALL.frames + 1))
    animation.set_enabled(False)
    native.bake()
    fcurve = channelbag_of(objects[1]).fcurves.find("location", index=2)
    assert len(fcurve.keyframe_points) == SMALL.frames
    objects[1].delta_location, objects[1].delta_rotation_quaternion = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(read_poses(objects[1], frames).positions, shown.positions, atol=1e-5)
    native.restore()
    assert [obj.animation_data.action for obj in objects] == actions
    np.testing.assert_allclose(read_poses(objects[1], frames).positions, shown.positions, atol=1e-6)


@pytest.mark.usefixtures("live_file")
def test_rigs_are_told_beside_native_work_and_their_goals():
    (rows,) = tables(rigs(SMALL_RIG, 1)).values()
    told_of = [(row[0], row[4].partition(":")[0]) for row in rows]
    assert told_of == [
        *[("one bone edited, and the view updated", "at most 3 ms")] * 2,
        ("one bone edited of a rig without modes, and the view updated", "at most 3 ms"),
        ("all in-betweens anew", "at least 50"),
        ("a mode chosen for all bones, and the view updated", ""),
        ("a key of each bone edited, and the view updated", ""),
        ("samples between frames after an edit, for all bones", ""),
        ("all frames played, bare armature", "at most 2"),
        ("all frames played, skin of 400 vertices", "at most 1.3"),
    ]


@pytest.mark.usefixtures("live_file")
def test_an_edit_of_a_bone_is_measured_with_modes_and_without():
    rig = rig_of(SMALL_RIG)
    bones = list(rig.pose.bones)
    seconds = edits(rig, bones[:1], 2, 1)
    assert {name: len(rounds) for name, rounds in seconds.items()} == dict.fromkeys(
        ("without", "native", "live", "paused"), 2
    )
    assert {bone.rigid_motion.mode for bone in bones} == {MODE}
    assert animation.refresh() == 0


@pytest.mark.usefixtures("live_file")
def test_the_rig_is_chains_of_bones_and_its_skin_follows_two_for_each_vertex():
    rig = rig_of(SMALL_RIG)
    roots = [bone for bone in rig.data.bones if bone.parent is None]
    assert [len(root.children_recursive) for root in roots] == [9, 1]
    assert len(channelbag_of(rig).fcurves) == 12 * 7
    skin = add_skin(rig, SMALL_RIG.vertices)
    assert len(skin.data.vertices) == SMALL_RIG.vertices
    for vertex in skin.data.vertices:
        assert len(vertex.groups) == 2
        assert sum(group.weight for group in vertex.groups) == pytest.approx(1.0)
    still = np.array([vertex.co for vertex in skin.data.vertices])
    moved = skin.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices
    assert np.linalg.norm(np.array([vertex.co for vertex in moved]) - still, axis=1).min() > 1e-3


@pytest.mark.usefixtures("live_file")
def test_native_baking_of_bones_keys_what_they_show():
    rig = rig_of(SMALL_RIG)
    bone = rig.pose.bones["Bone 3"]
    set_modes([bone], MODE)
    shown = shown_matrices(bone)
    native = NativeBaking([rig], range(1, SMALL_RIG.frames + 1), every_channel=True, of_bones=True)
    animation.set_enabled(False)
    native.bake()
    fcurve = channelbag_of(rig).fcurves.find(bone.path_from_id("location"), index=2)
    assert len(fcurve.keyframe_points) == SMALL_RIG.frames
    bone.constraints[0].mute = True
    np.testing.assert_allclose(shown_matrices(bone), shown, atol=1e-5)
    bone.constraints[0].mute = False
    native.restore()
    # The baking leaves scales behind that are 1 but for rounding.
    np.testing.assert_allclose(shown_matrices(bone), shown, atol=1e-5)


def shown_matrices(bone) -> np.ndarray:
    """Where a bone is on every frame, in the space of its armature (frames, 4, 4)."""
    found = []
    for frame in range(1, SMALL_RIG.frames + 1):
        bpy.context.scene.frame_set(frame)
        found.append(np.array(bone.matrix))
    return np.array(found)


def test_figures_are_judged_by_their_goals():
    assert judged(50.0, 50, at_least=True) == "at least 50: met"
    assert judged(49.9, 50, at_least=True) == "at least 50: missed"
    assert told_in_ms([0.003, 0.001, 0.002]) == "2.00 (1.00)"
    assert judged(2.2, 2.2) == "at most 2.2: met"
    assert judged(0.21, 0.2, " s") == "at most 0.2 s: missed"
    assert told([0.3, 0.1, 0.2]) == "0.200 s (0.100)"
    assert told([0.25]) == "0.250 s"
    assert against([0.1], [0.4]) == "4.0 times faster"
    assert against([0.4], [0.1]) == "4.0 times as long"


def test_the_command_goes_through_the_sections_that_it_is_asked_for(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(benchmark_live, "CHOOSING", SMALL)
    monkeypatch.setattr(benchmark_live, "LONG", (Size(1, 5, 50), Size(1, 5, 100)))
    page = tmp_path / "page.md"
    assert benchmark_live.main(["--rounds", "1", "--only", "choosing", "baking", "--output", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "`python scripts/research benchmark_live --rounds 1 --only choosing baking`" in text
    assert [line for line in text.splitlines() if line.startswith("## ")] == [
        f"## A mode for {SMALL}, turned by QUATERNION",
        f"## A mode for {SMALL}, turned by XYZ",
        "## Baking one object with 5 keys",
    ]
    assert "50 and 100 frames of one object ..." in capsys.readouterr().err
