import os

import bpy
import pytest

from rigid_motion_batch.scenes.film import join_pieces, render_film, render_piece, save_blend
from rigid_motion_batch.scenes.scene import build_scene
from rigid_motion_batch.scenes.settings import SceneSettings
from tests.full_disk import disk_full_after
from tests.scripts.clips.recordings import reconstruct, swinging_clip

SETTINGS = SceneSettings(resolution=(160, 90), fps=10)


@pytest.fixture
def scene():
    return build_scene(reconstruct(swinging_clip(seconds=0.8), "5", ("lerp_slerp", "dq_sclerp")), SETTINGS)


def handlers() -> dict[str, list]:
    lists = ((name, getattr(bpy.app.handlers, name)) for name in dir(bpy.app.handlers))
    return {name: list(kind) for name, kind in lists if isinstance(kind, list)}


def test_the_film_has_every_frame_and_is_what_browsers_play_and_nothing_else_is_left_or_said(scene, tmp_path, capfd):
    film, seen, before = tmp_path / "clip" / "10" / "comparison.mp4", [], handlers()
    render_film(scene, film, lambda done, total: seen.append((done, total)))
    assert capfd.readouterr().out == ""
    assert handlers() == before
    assert scene.render.filepath == "//comparison.mp4"
    assert [path.name for path in film.parent.iterdir()] == ["comparison.mp4"]
    assert seen == [(done, 9) for done in range(1, 10)]
    data = film.read_bytes()
    assert data[4:8] == b"ftyp"
    profile = data[data.index(b"avcC") + 5]
    assert profile in (66, 77, 100)  # Baseline, Main, High: all have 8 bits and 4:2:0.
    movie = bpy.data.movieclips.load(str(film))
    assert movie.frame_duration == scene.frame_end == 9
    assert tuple(movie.size) == (160, 90)


def test_a_saved_stage_tells_nothing_of_the_machine(scene, tmp_path):
    save_blend(tmp_path / "comparison.blend")
    assert bpy.utils.blend_paths(absolute=False) == []


def test_a_film_that_cannot_be_rendered_leaves_the_old_one(scene, tmp_path):
    film = tmp_path / "comparison.mp4"
    film.write_bytes(b"the film of yesterday")
    scene.camera = None
    with pytest.raises(RuntimeError):
        render_film(scene, film)
    assert film.read_bytes() == b"the film of yesterday"
    assert os.listdir(tmp_path) == ["comparison.mp4"]


def test_a_stage_that_breaks_off_leaves_nothing_and_the_reason(scene, tmp_path):
    with disk_full_after(10_000), pytest.raises(OSError, match="may be full") as raised:
        save_blend(tmp_path / "comparison.blend")
    assert raised.value.filename == str(tmp_path / "comparison.blend")
    assert os.listdir(tmp_path) == []


def test_a_film_that_was_rendered_in_pieces_is_the_same_to_the_bit(scene, tmp_path):
    blend = tmp_path / "comparison.blend"
    save_blend(blend)
    render_film(scene, tmp_path / "whole.mp4")
    seen = []
    pieces = {tmp_path / "1.mkv": (1, 4), tmp_path / "5.mkv": (5, 5), tmp_path / "6.mkv": (6, 9)}
    for path, (first, last) in pieces.items():
        render_piece(blend, first, last, path, lambda done, total: seen.append((done, total)))
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4), (1, 1), (1, 4), (2, 4), (3, 4), (4, 4)]
    join_pieces(blend, list(pieces), tmp_path / "joined.mp4")
    assert (tmp_path / "joined.mp4").read_bytes() == (tmp_path / "whole.mp4").read_bytes()
