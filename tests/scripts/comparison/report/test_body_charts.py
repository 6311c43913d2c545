"""Charts of whole bodies: well-formed, true to the numbers, and safe whatever joints are called."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion.motion import Poses
from rigid_motion_batch.analysis.bodies import reconstruct_body
from rigid_motion_batch.analysis.body_metrics import MeasuredBody, measure_modes
from rigid_motion_batch.analysis.choices import Tolerance, Uniform
from rigid_motion_batch.comparison.report.body_charts import (
    LONGEST_NAME,
    MOST_ROWS,
    SHADES,
    body_charts,
    body_curves,
    heat_map_alone,
    short_names,
)
from rigid_motion_batch.comparison.report.markup import Markup
from rigid_motion_batch.palette import ERROR_COLOURS, NEARLY_ALL
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.figures import Figure
from tests.scripts.comparison.bodies import JOINTS, still_body, swinging_body

MODES = ("lerp_slerp", "dq_sclerp", "cga_slerp", "motor_spline")

HOSTILE = (
    'a,b"c',
    "two\nlines",
    "</title></svg><script>alert(1)</script>",
    "x" * 300,
    " ",
    "\0\x1b[2J\udcff",
    "' onload='alert(1)",
    "<!-- ${title} ]]> &amp;",
)


def measured(clip: Clip | None = None, modes: tuple[str, ...] = MODES) -> MeasuredBody:
    return measure_modes(reconstruct_body(clip or swinging_body(), Uniform("5"), modes, 0.03), 0.03)


def tree_of(markup: Markup) -> ElementTree.Element:
    """It has to be well-formed XML for that."""
    return ElementTree.fromstring(markup)


def having(tree: ElementTree.Element, name: str, value: str = "") -> list[ElementTree.Element]:
    """Elements of this name, or class."""
    return [one for one in tree.iter(name) if not value or value in one.get("class", "").split()]


@pytest.fixture(scope="module")
def found() -> MeasuredBody:
    return measured()


@pytest.fixture(scope="module")
def tree(found: MeasuredBody) -> ElementTree.Element:
    return tree_of(body_charts(found))


# -- names ------------------------------------------------------------------------------------------------------------


def test_hostile_names_are_text_and_change_nothing_else() -> None:
    plain, hostile = (tree_of(body_charts(measured(swinging_body(joints=joints)))) for joints in (JOINTS, HOSTILE))
    assert [(one.tag, sorted(one.attrib)) for one in plain.iter()] == [
        (one.tag, sorted(one.attrib)) for one in hostile.iter()
    ]
    # XML has no control characters, and makes blanks of ends of lines in attributes.
    shown = [re.sub("[\0\x1b\udcff]", "\ufffd", name) for name in HOSTILE]
    rows = [row for table in having(hostile, "tbody") for row in table]
    assert [row[0].text for row in rows] == shown
    assert [row[0].get("data-value") for row in rows] == [name.replace("\n", " ") for name in shown]
    titles = [one.text.rpartition(": ")[0] for one in hostile.iter("title") if "mm at most" in one.text]
    assert titles == shown * (len(titles) // len(shown))
    curves = body_curves(measured(swinging_body(joints=HOSTILE)))
    assert curves == body_curves(measured())


@given(names=st.lists(st.text(max_size=20), min_size=len(JOINTS), max_size=len(JOINTS), unique=True))
def test_joints_may_be_called_anything(found: MeasuredBody, names: list[str]) -> None:
    figure = replace(found.made.clip.figure, joints=tuple(names))
    clip = replace(found.made.clip, figure=figure)
    rows = tuple(replace(row, joint=names[JOINTS.index(row.joint)]) for row in found.joints)
    named = replace(found, made=replace(found.made, clip=clip), joints=rows)
    assert len(list(tree_of(body_charts(named)).iter())) == len(list(tree_of(body_charts(found)).iter()))


def test_a_namespace_that_all_joints_have_is_left_out() -> None:
    assert short_names(["mixamorig:Hips", "mixamorig:Head"]) == ["Hips", "Head"]
    assert short_names(["a:b:Hips", "a:b:Head"]) == ["Hips", "Head"]
    assert short_names(["a:Hips", "b:Head"]) == ["a:Hips", "b:Head"]
    assert short_names(["Hips", "a:Head"]) == ["Hips", "a:Head"]
    assert short_names(["Hips", "Head"]) == ["Hips", "Head"]


def test_a_long_name_is_cut_off_beside_the_heat_map_and_whole_under_the_pointer() -> None:
    long = "x" * (LONGEST_NAME + 1)
    found = measured(swinging_body(joints=(long, *JOINTS[1:])))
    (heat, *_) = having(tree_of(body_charts(found)), "svg", "heat")
    assert next(heat.iter("text")).text == "x" * (LONGEST_NAME - 1) + "\u2026"
    assert [title.text for title in heat.iter("title")][1].startswith(f"{long}: ")


# -- heat maps --------------------------------------------------------------------------------------------------------


def cells_of(heat: ElementTree.Element, rows: int, columns: int) -> np.ndarray:
    """The colour of each cell of a heat map, shape (rows, columns), as a viewer draws it."""
    inner = next(one for one in heat if one.tag == "svg")
    assert inner.get("viewBox") == f"0 0 {columns} {rows}"
    ground, *paths = inner.iter("path")
    cells = np.full((rows, columns), ground.get("fill"))
    for path in paths:
        runs = re.findall(r"M(\d+) (\d+)h(\d+)v1h-(\d+)z", path.get("d"))
        assert "".join(f"M{left} {row}h{run}v1h-{back}z" for left, row, run, back in runs) == path.get("d")
        for left, row, run, back in np.array(runs, dtype=int).tolist():
            assert run == back > 0
            assert (cells[row, left : left + run] == ground.get("fill")).all(), "a cell has one colour"
            cells[row, left : left + run] = path.get("fill")
    return cells


def test_every_cell_of_a_heat_map_has_the_colour_of_its_error(found: MeasuredBody, tree: ElementTree.Element) -> None:
    heats = having(tree, "svg", "heat")
    assert len(heats) == len(found.groups)
    errors = [found.modes[group[0]].by_joint for group in found.groups]
    top = max(np.quantile(own, NEARLY_ALL) for own in errors)
    by_colour: dict[str, int] = {}
    for heat, own in zip(heats, errors, strict=True):
        shades = np.minimum(np.floor(own / top * SHADES), SHADES - 1).astype(int)
        for shade, colour in zip(shades.ravel().tolist(), cells_of(heat, *own.shape).ravel().tolist(), strict=True):
            assert by_colour.setdefault(colour, shade) == shade
    assert len(by_colour) == len(set(by_colour.values()))
    assert by_colour[ERROR_COLOURS[0].lower()] == 0
    assert by_colour[ERROR_COLOURS[-1].lower()] == SHADES - 1


def test_the_largest_error_of_a_joint_is_told_under_the_pointer(found: MeasuredBody, tree: ElementTree.Element) -> None:
    for heat, group in zip(having(tree, "svg", "heat"), found.groups, strict=True):
        told = [title.text for title in heat.iter("title")][1:]
        largest = 1e3 * found.modes[group[0]].by_joint.max(axis=1)
        for text, joint, error in zip(told, JOINTS, largest, strict=True):
            name, number = re.fullmatch(r"(.+): ([\d.]+) mm at most", text).groups()
            assert name == joint
            assert float(number) == pytest.approx(error, rel=0.006)


def many(joints: int) -> Clip:
    """A chain of so many joints, each of which turns."""
    clip = swinging_body(seconds=0.5)
    turning = clip.poses.quaternions[JOINTS.index("Arm")]
    positions = np.tile((0.0, 2.0, 0.0), (joints, len(clip.times), 1))
    poses = Poses(positions, np.tile(turning, (joints, 1, 1)))
    names = tuple(f"Joint {number}" for number in range(joints))
    rest = Poses(positions[:, 0], np.eye(4)[[0] * joints])
    return replace(clip, poses=poses, figure=Figure(names, np.arange(joints) - 1, rest, positions[:, 0]))


@pytest.mark.parametrize("joints", [1, MOST_ROWS, MOST_ROWS + 1])
def test_more_joints_than_there_is_room_for_names_have_thin_rows_without(joints: int) -> None:
    markup = tree_of(body_charts(measured(many(joints), ("lerp_slerp",))))
    (heat,) = having(markup, "svg", "heat")
    named = [text for text in heat.iter("text") if (text.text or "").startswith("Joint")]
    assert len(named) == (joints if joints <= MOST_ROWS else 0)
    assert float(heat.get("height")) < 11 * MOST_ROWS + 30
    assert len(having(markup, "tr")) == joints + 1


# -- pictures of the body ---------------------------------------------------------------------------------------------


def numbers_of(picture: ElementTree.Element) -> np.ndarray:
    """The corners of all bones, shape (n, 2)."""
    paths = " ".join(path.get("d") for path in picture.iter("path"))
    return np.array(re.findall(r"[ML](-?\d+) (-?\d+)", paths), dtype=float)


def test_the_body_is_shown_at_its_worst_moment_with_a_ring_around_the_joint(
    found: MeasuredBody, tree: ElementTree.Element
) -> None:
    pictures = having(tree, "svg", "stick-figure")
    assert len(pictures) == len(found.groups)
    windows = {picture.get("viewBox") for picture in pictures}
    assert len(windows) == 1, "all of one scale"
    _, _, width, height = map(float, windows.pop().split())
    for picture, group in zip(pictures, found.groups, strict=True):
        joint, _, error = found.modes[group[0]].worst
        (title,) = picture.iter("title")
        name, number = re.search(r": (.+) ([\d.]+) mm at [\d.]+ s", title.text).groups()
        assert name == JOINTS[joint]
        assert float(number) == pytest.approx(1e3 * error, rel=0.006)
        corners = numbers_of(picture)
        (ring,) = having(picture, "circle", "ring")
        at = float(ring.get("cx")), float(ring.get("cy"))
        assert np.abs(corners - at).sum(axis=1).min() == 0.0, "it is around the end of a bone"
        assert (np.abs(corners) <= (width / 2 + 1, height / 2 + 1)).all()
        # The head is above the foot.
        assert corners[:, 1].max() > 0.0 > corners[:, 1].min()
        assert len(having(picture, "path", "bone")) >= len(JOINTS) - 2
        assert len(having(picture, "path", "ghost")) == 1


@pytest.mark.parametrize(
    "squeezed", [(1, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0, 0), (1e-12, 1, 1e-12), (1e9, 1, 1)], ids=str
)
def test_flat_thin_and_huge_bodies_have_pictures_too(squeezed: tuple[float, float, float]) -> None:
    clip = swinging_body()
    poses = Poses(clip.poses.positions * squeezed, clip.poses.quaternions * 0.0 + (1.0, 0.0, 0.0, 0.0))
    figure = replace(clip.figure, tails=clip.figure.tails * 0.0)
    found = measured(replace(clip, poses=poses, figure=figure), ("lerp_slerp",))
    (picture,) = having(tree_of(body_charts(found)), "svg", "stick-figure")
    _, _, width, height = map(float, picture.get("viewBox").split())
    assert 0.09 <= width / height <= 1e10
    assert (np.abs(numbers_of(picture)) <= (width / 2 + 1, height / 2 + 1)).all()


def test_a_body_without_errors_is_all_in_the_first_colour() -> None:
    markup = body_charts(measured(still_body(), ("lerp_slerp",)))
    assert set(re.findall(r'(?:fill|stroke)="(#[0-9a-f]{6})"', markup)) == {ERROR_COLOURS[0].lower()}


# -- numbers and curves -----------------------------------------------------------------------------------------------


def test_the_table_has_the_numbers_of_every_joint_under_every_motion(
    found: MeasuredBody, tree: ElementTree.Element
) -> None:
    (body,) = having(tree, "tbody")
    for row, joint in zip(body, JOINTS, strict=True):
        cells = [float(cell.get("data-value")) for cell in row[1:]]
        rows = [one for group in found.groups for one in found.joints if (one.joint, one.mode) == (joint, group[0])]
        assert cells == [1e3 * value for one in rows for value in (one.rms_shell_m, one.max_shell_m)]


def test_the_curves_are_of_the_worst_joint_at_each_moment(found: MeasuredBody) -> None:
    tree = tree_of(f"<div>{body_curves(found)}</div>")
    words = "".join(tree.itertext())
    assert "error of the worst joint (mm)" in words
    drawn = [path for path in tree.iter() if path.get("class") == "curve"]
    assert len(drawn) == len(found.groups)
    own = reconstruct_body(swinging_body(), Tolerance("2cm"), MODES, 0.03)
    body_curves(measure_modes(own, 0.03))


def test_the_heat_map_of_a_mode_alone_is_a_picture_of_its_own(found: MeasuredBody, tree: ElementTree.Element) -> None:
    alone = ElementTree.fromstring(heat_map_alone(found, "cga_slerp", 700))
    assert alone.tag == "{http://www.w3.org/2000/svg}svg"
    assert alone.get("width") == "700"
    with_mode = next(place for place, group in enumerate(found.groups) if "cga_slerp" in group)
    in_report = [one.get("d") for one in having(tree, "svg", "heat")[with_mode].iter("path")]
    assert [one.get("d") for one in alone.iter("{http://www.w3.org/2000/svg}path")] == in_report
