"""Radii: numbers, and tables with a line for each joint; what is wrong is told with the file and the line."""

import os
import re
import string
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_motion_batch.analysis.radii import JOINT, MOST_BYTES, Radii, read_radii
from rigid_motion_batch.rows import line_of


@pytest.fixture
def table(tmp_path: Path) -> Callable[[str | bytes], str]:
    def _table(content: str | bytes) -> str:
        path = tmp_path / "radii.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return str(path)

    return _table


@pytest.mark.parametrize("text", ["0.05", " 0.05 ", "5e-2"])
def test_a_number_is_the_radius_of_everything(text: str) -> None:
    radii = read_radii(text)
    assert radii == Radii(0.05, 0.05)
    assert radii.of(["Hand", "Foot"]).tolist() == [0.05, 0.05]
    assert radii.unknown(["Hand"]) == []


@pytest.mark.parametrize(
    "content",
    [
        "joint,radius_m\nHand,0.08\nHead,0.12\n",
        "\ufeffJoint,Radius_m\r\nHand,0.08\r\nHead,0.12",
        'radius_m,note,joint\n0.08,"a, b",Hand\n\n,,\n0.12,,Head\n',
        'joint, radius_m\n Hand , 0.08\n"Head",1.2e-1\n',
        "joint,radius_m\rHand,0.08\rHead,0.12\r",
    ],
)
def test_a_table_is_radii_of_joints_by_name(table: Callable[[str], str], content: str) -> None:
    radii = read_radii(table(content))
    assert radii == Radii(named=(("Hand", 0.08), ("Head", 0.12)))
    assert radii.of(["Head", "Foot", "Hand", "hand"]).tolist() == [0.12, JOINT, 0.08, JOINT]
    assert radii.unknown(["Head", "Foot"]) == ["Hand"]


NAMES = st.text(
    st.sampled_from(string.ascii_letters + string.digits + " ,;\"'\n\r\t:<>=+|\u2028\x85\x1c\u00fc\u624b"), max_size=12
)


@given(
    named=st.dictionaries(NAMES, st.floats(1e-3, 10.0), min_size=1, max_size=5).filter(
        lambda named: len({name.strip() for name in named}) == len(named)
    )
)
def test_joints_of_any_name_have_their_radius(tmp_path_factory, named):
    path = tmp_path_factory.getbasetemp() / f"radii-{os.getpid()}.csv"
    lines = [line_of(("joint", "radius_m")), *map(line_of, named.items())]
    path.write_text("".join(lines), encoding="utf-8", newline="")
    radii = read_radii(str(path))
    np.testing.assert_array_equal(radii.of(list(named)), list(named.values()))
    assert radii.unknown(named) == []


@pytest.mark.parametrize(
    ("content", "line", "problem"),
    [
        ("", 1, "the columns joint and radius_m are needed, and it has none"),
        ("joint;radius_m\nHand;0.1\n", 1, "the columns joint and radius_m are needed, and it has joint;radius_m"),
        ("joint,radius\nHand,0.1\n", 1, "the columns joint and radius_m are needed, and it has joint,radius"),
        ("joint,radius_m\nHand,0.1\nHead\n", 3, "1 cells where 2 are expected"),
        ("joint,radius_m\nHand,0.1\n\nHead,0,1\nHand,0.2\n", 4, "'0' is no number of metres above 0"),
        ("joint,radius_m\nHand,0.1\n\nHand,0.2\n", 4, "the joint 'Hand' comes a second time; leave one"),
        ('joint,radius_m\n"two\nlines",0.1\nHead,big\n', 4, "'big' is no number of metres above 0"),
        ("joint,radius_m\rHand,0.1\rHead,-1\r", 3, "'-1' is no number of metres above 0"),
        *(
            (f"joint,radius_m\nHand,{number}\n", 2, f"{number!r} is no number of metres above 0")
            for number in ("", "0", "-0.1", "nan", "inf", "-inf", "0.1 m", "10cm", "0x1")
        ),
        ("a\x1b[2J\n", 1, "the columns joint and radius_m are needed, and it has a\\x1b[2j"),
    ],
)
def test_what_is_wrong_is_told_with_the_file_and_the_line(table, content, line, problem):
    path = table(content)
    with pytest.raises(ValueError, match=re.escape(problem)) as caught:
        read_radii(path)
    assert str(caught.value) == f"{path}:{line}: {problem}"


def test_a_table_that_is_too_large_or_has_an_endless_cell_is_refused(table: Callable[[str], str]) -> None:
    with pytest.raises(ValueError, match="bytes are no table of radii"):
        read_radii(table("joint,radius_m\n" + "x" * MOST_BYTES))
    with pytest.raises(ValueError, match="this is no CSV"):
        read_radii(table("joint,radius_m\n" + "x" * (MOST_BYTES // 2)))


@pytest.mark.parametrize(
    "text", ["", "0", "-1", "nan", "inf", "10km", "-3cm", "no such.csv", ".", "a\0b", "x" * 5000, "*"]
)
def test_what_is_neither_a_number_nor_a_table_is_told(text: str) -> None:
    with pytest.raises(ValueError, match=r"is neither a length above 0, such as 3cm or 0\.03, nor a table"):
        read_radii(text)


def test_a_name_from_a_table_of_ours_is_the_joint_that_was_meant(tmp_path: Path) -> None:
    (tmp_path / "radii.csv").write_text("joint,radius_m\n'=1+1,0.2\n'quoted',0.3\n", encoding="utf-8")
    assert list(read_radii(str(tmp_path / "radii.csv")).of(["=1+1", "'quoted'", "other"])) == [0.2, 0.3, JOINT]


@pytest.mark.parametrize("text", ["0.03", "3cm", "3 cm", "30mm", "0.03m", "3e-2m"])
def test_a_radius_may_have_its_unit(text: str) -> None:
    assert read_radii(text).joint == pytest.approx(0.03)
