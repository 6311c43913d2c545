"""Tests of reduce.py on .blend files, as users run it: its results, the files that it leaves alone, its messages."""

import json
from pathlib import Path

import bpy
import pytest

from rigid_motion import animation
from rigid_motion_batch.keying import blend_files, recordings
from tests.animation.scenes import new_object
from tests.scripts.baking import extension, frames_of_keys, open_again, save
from tests.scripts.bvh_bodies import write_body
from tests.scripts.reducing import (
    FRAMES,
    ROUNDING,
    displacement,
    listed,
    object_file,
    played,
    reduced_name,
    rig_file,
    run,
    write_csv,
)

pytestmark = pytest.mark.any_blender


def test_a_tolerance_in_metres_is_that_in_a_scene_of_centimetres(tmp_path):
    path = object_file(tmp_path / "shot.blend")
    bpy.context.scene.unit_settings.scale_length = 0.01
    save(path)
    assert run(path, "--tolerance", "0.05mm", "--radius", 1e-3) == 0
    off = displacement(played(reduced_name(path), "Tool"), played(path, "Tool"))
    assert 1e-3 < off <= 5e-3 + ROUNDING, "5 thousandths of a centimetre"


def test_bones_that_follow_constraints_are_named_and_what_hangs_on_them(tmp_path, capsys):
    path = rig_file(tmp_path / "shot.blend")
    bpy.data.objects["Rig"].pose.bones["Arm"].constraints.new("COPY_ROTATION").target = new_object("Target")
    save(path)
    assert run(path, "--tolerance", "5mm") == 0
    said = capsys.readouterr().err
    assert "; not guaranteed for bones that follow constraints or drivers, or their children: Arm, Hand\n" in said


def test_key_poses_are_few_and_on_the_same_frames_for_all_bones(tmp_path, capsys):
    path = rig_file(tmp_path / "shot.blend")
    assert run(path, "--shared") == 0
    assert "(12 mm allowed)" in capsys.readouterr().err
    open_again(reduced_name(path))
    frames = [frames_of_keys(bone) for bone in bpy.data.objects["Rig"].pose.bones]
    assert frames[0] == frames[1] == frames[2]
    assert len(frames[0]) < len(FRAMES)


def test_the_dense_keys_are_left_out_where_that_is_asked_for(tmp_path):
    path = object_file(tmp_path / "shot.blend")
    assert run(path, "--discard") == 0
    with extension():
        open_again(reduced_name(path))
        assert not animation.is_reduced(bpy.data.objects["Tool"])
        assert [action.name for action in bpy.data.actions] == [bpy.data.objects["Tool"].animation_data.action.name]


def test_what_needs_its_keys_is_left_alone_and_nothing_is_wrong(tmp_path, capsys):
    path = object_file(tmp_path / "shot.blend")
    assert run(path, "--tolerance", "0.00001mm") == 0
    said = capsys.readouterr().err
    assert f"Tool is left as it is: needs its {len(FRAMES)} keys to stay within the tolerance: allow a larger" in said
    assert "nothing to be reduced; left alone" in said
    assert listed(tmp_path) == ["shot.blend"]


def test_what_is_asked_for_by_name_and_has_no_keys_is_told_why(tmp_path, capsys):
    path = object_file(tmp_path / "shot.blend")
    still = new_object("Still")
    still.constraints.new("COPY_LOCATION").target = bpy.data.objects["Tool"]
    save(path)
    assert run(path, "--objects", "Still") == 1
    assert "Still: not reduced: has at most two keys of location, rotation or scale" in capsys.readouterr().err
    assert not reduced_name(path).exists()


def test_without_a_tolerance_a_rig_of_any_size_begins_with_one_that_fits_it(tmp_path):
    path = rig_file(tmp_path / "shot.blend")
    bpy.data.objects["Rig"].scale = (200.0,) * 3
    save(path)
    assert run(path) == 0
    open_again(reduced_name(path))
    assert sum(len(frames_of_keys(bone)) for bone in bpy.data.objects["Rig"].pose.bones) < 3 * len(FRAMES) / 2


def test_a_dry_run_says_all_also_as_json_and_writes_nothing(tmp_path, capsys):
    shot, hand, body = rig_file(tmp_path / "shot.blend"), tmp_path / "hand.csv", write_body(tmp_path / "body.bvh")
    write_csv(hand)
    before = listed(tmp_path)
    capsys.readouterr()
    assert run(shot, hand, body, "--json", "--dry-run", "--tolerance", "5mm") == 0
    assert listed(tmp_path) == before
    said = capsys.readouterr()
    assert said.err.count("would be reduced, ") == 3
    told = json.loads(said.out)
    made = ["shot-reduced.blend", "hand-keys.csv", "body-keys.blend"]
    assert [entry["written"] for entry in told] == [[str(tmp_path / name)] for name in made]
    assert all(f"would be written to {tmp_path / name}" in said.err for name in made)
    clips = [clip for entry in told for clip in entry["clips"]]
    assert [clip["name"] for clip in clips] == ["Rig: 3 bones", "hand", "body"]
    assert all(clip["keys_after"] < clip["keys_before"] and 0.0 < clip["error"] <= 0.005 for clip in clips)
    worst = max(clips, key=lambda clip: clip["error"])["error"]
    assert f"to be reduced; at most {1e3 * worst:.3g} mm off (" in said.err.splitlines()[-1]


# Files that are left alone, and exit codes


def test_what_cannot_be_read_is_named_and_the_others_are_done(tmp_path, capsys):
    good = tmp_path / "hand.csv"
    write_csv(good)
    damaged = tmp_path / "damaged.blend"
    damaged.write_bytes(b"BLENDER, but no more")
    body = write_body(tmp_path / "body.bvh")
    assert run(tmp_path / "gone.csv", damaged, f"{body}:Nose", good) == 1
    said = capsys.readouterr().err
    assert f"{tmp_path / 'gone.csv'}: no such file" in said
    assert f"{damaged}: Blender cannot read this file" in said
    assert f"{body}: no body named 'Nose'; it holds Hips, LeftHand, Head" in said
    assert (tmp_path / "hand-keys.csv").is_file()
    assert run(tmp_path / "gone.csv", damaged, f"{body}:Nose") == 2


def test_a_recording_is_not_written_over_one_that_is_to_be_read_or_was_just_written(tmp_path, capsys):
    for name in ("hand", "hand-keys"):
        write_csv(tmp_path / f"{name}.csv")
    before = (tmp_path / "hand-keys.csv").read_bytes()
    assert run(tmp_path / "hand.csv", tmp_path / "hand-keys.csv", "--overwrite") == 1
    assert "which is to be read too" in capsys.readouterr().err
    assert (tmp_path / "hand-keys.csv").read_bytes() == before
    other = tmp_path / "other" / "hand.csv"
    other.parent.mkdir()
    write_csv(other)
    assert run(tmp_path / "hand.csv", other, "--output", tmp_path, "--overwrite") == 1
    assert f"{tmp_path / 'hand.csv'} is written to {tmp_path / 'hand-keys.csv'} too" in capsys.readouterr().err


def test_a_recording_that_is_named_twice_is_done_once(tmp_path, capsys, monkeypatch):
    write_csv(tmp_path / "hand.csv")
    (tmp_path / "link.csv").symlink_to("hand.csv")
    monkeypatch.chdir(tmp_path)
    assert run("hand.csv", "./hand.csv", tmp_path / "hand.csv", "link.csv", tmp_path) == 0
    assert capsys.readouterr().out == "hand-keys.csv\n"


@pytest.mark.parametrize("kind", ["blend", "table"])
def test_what_another_run_has_written_meanwhile_stays(tmp_path, capsys, monkeypatch, kind):
    if kind == "table":
        write_csv(tmp_path / "hand.csv")
        source, result = tmp_path / "hand.csv", tmp_path / "hand-keys.csv"
        place, step = recordings, "Reconstruction"
    else:
        source = object_file(tmp_path / "shot.blend")
        result, place, step = reduced_name(source), blend_files, "save_copy"
    real = getattr(place, step)

    def write_first(*arguments: object, **options: object) -> object:
        result.write_text("of the other run")
        return real(*arguments, **options)

    monkeypatch.setattr(place, step, write_first)
    capsys.readouterr()
    assert run(source) == 1
    said = capsys.readouterr()
    problem = "has come there meanwhile, from another run perhaps: add --overwrite, or another --output"
    assert f"{source}: {result} {problem}" in said.err.splitlines()
    assert said.out == ""
    assert result.read_text() == "of the other run"
    assert listed(tmp_path) == sorted([source.name, result.name])
    result.unlink()
    assert run(source, "--overwrite") == 0
    assert result.stat().st_size > 1000


def test_a_file_that_was_saved_meanwhile_is_not_replaced_in_place(tmp_path, capsys, monkeypatch):
    path, real = object_file(tmp_path / "shot.blend"), blend_files.save_copy

    def save_first(written: Path, **options: bool) -> None:
        path.write_bytes(b"saved by an animator")
        real(written, **options)

    monkeypatch.setattr(blend_files, "save_copy", save_first)
    assert run(path, "--in-place") == 1
    assert f"{path}: it was changed while this program was at it" in capsys.readouterr().err
    assert [(item.name, item.read_bytes()) for item in tmp_path.iterdir()] == [(path.name, b"saved by an animator")]
