"""Tests of `reduce.py --report`: a page of all files, in which glTF files play before and after."""

import json
import re
import time
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigid_motion_batch.cli import reduce
from rigid_motion_batch.keying import views
from rigid_motion_batch.report.reduced import write_reduced
from tests.gltf.making import walk
from tests.gltf.player import File, eighths, off
from tests.scripts.reducing import listed, run, write_csv, write_still
from tests.scripts.report.chromium import browser
from tests.scripts.report.javascript import read_by_viewer, require

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]

HOSTILE = "a</script><img src=x onerror='broken = 1'>{{ 7 * 7 }}"
HOSTILE_FILE = HOSTILE.replace("/", "\N{DIVISION SLASH}")


def clips_in(page: Path) -> list[dict[str, Any]]:
    """Return the data of the clips that a page can play."""
    text = page.read_text(encoding="utf-8")
    return [json.loads(data) for data in re.findall(r'id="clip-\d+">(.*)</script>', text)]


def played(clip: dict[str, Any]) -> dict[str, Any]:
    """Return a clip as the viewer reads it: times, errors, keys, and positions of points before and after."""
    at = "[...choice.moments].map((t) => poseAt(recording, choice, t, {}, 1).places)".format
    parts = {
        "times": "choice.times",
        "moments": "choice.moments",
        "before": at("null"),
        "after": at("choice.motions[1]"),
        "errors": "choice.motions.map((one) => one.errors[0])",
        "keys": "choice.motions.map((one) => one.keys)",
    }
    return read_by_viewer(clip, f"{{ {', '.join(f'{name}: {value}' for name, value in parts.items())} }}")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of clips, one of them unreadable and one without motion."""
    clips = tmp_path / "clips"
    (clips / "more").mkdir(parents=True)
    walk(joints=8).write(clips / "walk.glb")
    hostile = walk(joints=3, seconds=1.0)
    hostile.json["animations"][0]["name"] = HOSTILE
    for node in hostile.json["nodes"]:
        node["name"] = HOSTILE
    hostile.write(clips / "more" / f"{HOSTILE_FILE}.glb")
    (clips / "bad.glb").write_text("no glTF")
    write_still(clips / "still.glb")
    return clips


def test_the_page_has_all_files_and_is_the_last_path(folder, tmp_path, capsys):
    write_csv(folder / "hand.csv")
    small = tmp_path / "small"
    assert run(folder, "--output", small, "--report", "--tolerance", "2mm") == 1
    page = small / "report.html"
    assert capsys.readouterr().out.splitlines()[-1] == str(page)
    text = page.read_text(encoding="utf-8")
    table = text[text.index('id="overview"') :]
    rows = re.findall(r'scope="row">(?:<a[^>]*>)?(.*?)(?:</a>)?</th>.*?<td class="words says">(.*?)</td>', table, re.S)
    names = ["walk.glb", f"more/{HOSTILE_FILE}.glb", "hand.csv", "bad.glb", "still.glb"]
    assert [unescape(name) for name, _ in rows] == names
    states = [state.partition("<")[0] for _, state in rows]
    assert states == ["written", "written", "written", "failed", "left alone"]
    assert "this is not glTF" in rows[3][1]
    assert "Of 5 files 1 failed, 1 left alone" in text
    assert "1 file written as .blend files or tables: only GLB files play here" in text
    assert HOSTILE not in text
    assert "<img" not in text
    assert [clip["name"] for clip in clips_in(page)] == ["walk.glb: Take0", f"more/{HOSTILE_FILE}.glb: {HOSTILE}"]
    sizes = [sum((place / name).stat().st_size for name in names) for place, names in (
        (folder, ("walk.glb", f"more/{HOSTILE_FILE}.glb")),
        (small, ("walk-reduced.glb", f"more/{HOSTILE_FILE}-reduced.glb")),
    )]  # fmt: skip
    assert "<b>{:,} to {:,} bytes</b>".format(*sizes).replace(",", "\u202f") in text


@pytest.mark.parametrize("joints", [8, 2])
def test_what_the_page_shows_is_what_the_files_show(joints, tmp_path):
    source = walk(joints=joints).write(tmp_path / "walk.glb")
    assert run(source, "--report", "--tolerance", "2mm", "--radius", "0.03") == 0
    made = tmp_path / "walk-reduced.glb"
    (clip,) = clips_in(tmp_path / "report.html")
    shown, before, after = played(clip), File(source), File(made)
    times = eighths(np.union1d(before.moments(0), after.moments(0)))
    np.testing.assert_allclose(shown["times"], times, atol=2e-6)
    largest = off(before, after, 0, 0.03).error
    assert max(shown["errors"][0]) == 0.0
    assert 0.98 * largest < max(shown["errors"][1]) / 1e3 < 1.02 * largest
    for keys, file in zip(shown["keys"], (before, after), strict=True):
        np.testing.assert_allclose(keys, file.moments(0), atol=2e-6)
    seen = {
        which: np.array(shown[which]).reshape(len(shown["moments"]), -1, 3)[:, :joints] for which in ("before", "after")
    }
    assert (len(shown["before"][0]) > 3 * joints) == (joints < 8), "a few nodes have axes"
    origin = None
    for which, file in (("before", before), ("after", after)):
        x, y, z = np.moveaxis(file.worlds(0, np.array(shown["moments"]))[:, :, :3, 3].swapaxes(0, 1), -1, 0)
        truth = np.stack((x, -z, y), axis=-1)
        origin = seen[which][0, 0] - truth[0, 0] if origin is None else origin
        np.testing.assert_allclose(seen[which] - origin, truth, atol=4e-4)


def test_run_again_the_page_has_what_was_done_before_as_well(folder, tmp_path, capsys):
    (folder / "bad.glb").unlink()
    small = tmp_path / "small"
    assert run(folder, "--output", small, "--report") == 0
    first = clips_in(small / "report.html")
    walk(joints=4, seconds=0.5).write(folder / "new.glb")
    capsys.readouterr()
    assert run(folder, "--output", small, "--report") == 0
    assert "2 files already reduced" in capsys.readouterr().err
    again = clips_in(small / "report.html")
    assert len(again) == 3
    assert all(clip in again for clip in first)
    assert listed(small) == ["more", "new-reduced.glb", "report.html", "walk-reduced.glb"]


def test_a_page_that_is_not_its_own_is_not_replaced(folder, tmp_path, capsys):
    (folder / "report.html").write_text("mine")
    with pytest.raises(SystemExit) as ended:
        run(folder, "--report")
    assert ended.value.code == 2
    assert "report.html is there already: add --overwrite, or another --output" in capsys.readouterr().err
    assert not (folder / "walk-reduced.glb").exists()
    assert run(folder, "--report", "--overwrite") == 1
    assert (folder / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    with pytest.raises(SystemExit):
        reduce.main([str(folder), "--report", "--dry-run"])
    assert "--dry-run writes none" in capsys.readouterr().err


def test_a_page_is_written_where_nothing_was_reduced(folder, tmp_path):
    assert run(folder / "still.glb", "--output", tmp_path / "out", "--report") == 0
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Nothing was reduced." in text
    assert "no animation moves a node" in text


def test_of_key_poses_no_tolerance_is_said(tmp_path):
    source = walk(joints=8).write(tmp_path / "walk.glb")
    assert run(source, "--report", "--key-poses", "4") == 0
    assert "<small>of " not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_of_a_long_clip_fewer_moments_are_looked_at(tmp_path, monkeypatch):
    monkeypatch.setattr(views, "MOST_MOMENTS", 100)
    monkeypatch.setattr(views, "MAX_POSES", 20)
    source = walk(joints=8).write(tmp_path / "walk.glb")
    assert run(source, "--report", "--tolerance", "2mm") == 0
    shown = played(*clips_in(tmp_path / "report.html"))
    assert len(shown["times"]) == len(File(source).moments(0))
    assert len(shown["moments"]) <= 21
    assert np.argmax(shown["errors"][1]) in np.searchsorted(shown["times"], np.array(shown["moments"]) - 1e-6)


def test_an_error_that_is_larger_between_frames_is_said(tmp_path):
    source = walk(joints=8).write(tmp_path / "walk.glb")
    assert run(source, "--report", "--tolerance", "2mm") == 0
    page = tmp_path / "report.html"
    assert " at frames" not in page.read_text(encoding="utf-8")
    (view,) = views.read_views(views.place_of_views(tmp_path / "walk-reduced.glb"))
    worst = view["choices"][0]["worst"]
    clip = {"name": "Take0", "keys_before": 9, "keys_after": 5, "error": worst / 4, "where": "", "reason": ""}
    fate = {"source": str(source), "state": "written", "written": ["x"], "reason": "", "clips": [clip]}
    write_reduced(page, [(fate, [view])], "Rigid Motion", "reduce walk.glb --curves")
    assert f"{1e3 * worst:.3g} mm between them." in page.read_text(encoding="utf-8")


def test_in_a_browser_both_play_side_by_side(folder, tmp_path):
    require()
    small = tmp_path / "small"
    assert run(folder, "--output", small, "--report", "--tolerance", "2mm") == 1
    text = "document.getElementById({!r}).textContent"
    with browser() as page:
        page.open((small / "report.html").as_uri(), width=390, dark=True)
        page.settle()
        lanes = page.run("[...document.querySelectorAll('#lanes div')].map((one) => one.firstChild.textContent)")
        assert lanes == ["Before", "After"]
        worst = page.run("document.querySelector('#modes tr:last-child .worst').textContent")
        assert worst == page.run("document.querySelector('#modes tr:last-child .live').textContent")
        page.run("document.getElementById('play').click()")
        begun = page.run(text.format("now"))
        time.sleep(0.5)
        assert page.run(text.format("now")) != begun
        page.run("document.querySelectorAll('#overview tbody a')[1].click()")
        page.settle()
        assert page.run("document.getElementById('play').ariaPressed") == "true"
        assert page.run("decodeURIComponent(location.hash)").startswith(f"#more/{HOSTILE_FILE}.glb")
        assert page.run("document.querySelector('input[name=clip]:checked').value") == "1"
        assert page.run("[document.documentElement.scrollWidth <= innerWidth, typeof broken]") == [True, "undefined"]
        assert page.problems == []
        assert [request for request in page.requests if not request.startswith((small.as_uri(), "data:"))] == []
