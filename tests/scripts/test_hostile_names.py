"""Tests of hostile names of files and bodies: they do no harm in the output folder or in the report."""

import re
import unicodedata
from pathlib import Path

import pytest

from rigid_motion_batch.recordings import TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.clip_reading import DEVICES, NOT_FOLDERS, folder_names
from tests.scripts.recordings.written_layouts import PLAIN

FORMULAS = "=+-@\t\r"
"""Characters that spreadsheets take for the start of a formula."""

PLAIN_NAMES = r"""
.. . ../../../../escaped ..\..\escaped /etc/escaped C:\escaped \\host\escaped a/../b <script>alert(1)</script>
</script><b> ]]> ${title} $style {}{0}%s%n javascript:alert(1) %2e%2e%2f &lt; =1+1 +1 -2+3 @SUM(1) --no-video
-rf con NUL.txt com1 lpt9.tar.gz aux. report.html metrics.csv .parts _ Hand hand HAND hand. hand_ hand-2
"""

NAMES = (
    *PLAIN_NAMES.split(),
    *("<img src=x onerror=alert(1)>", "\"><svg onload='x'>", "<!-- clips -->", "<!-- films -->", "=cmd|' /C calc'!A0"),
    *("`touch escaped`", "$(rm -r .)", "COM\u00b9", "\x1b[2J\x07", "a\nb", "a\r\n\r\nb", "a\0b", "\u202egpj.exe"),
    *("\u200b", "\ufeff", "\udcff", " ", "", "end. ", "\U0001f600", "\U0001f468\u200d\U0001f469"),
    *("x" * 300, "\u00fc" * 300, "\U00020000" * 300, "\u0301" * 300, "x" * 200, "\u00fc" * 110, "\U00020000" * 60),
    *("\ub208", unicodedata.normalize("NFD", "\ub208")),
)

FILE_NAMES = tuple(
    name for name in NAMES if name and not set(name) & set("/\0") and len(name.encode(errors="replace")) <= 240
)
"""The names that Linux allows for files."""


def test_names_of_folders_are_legal_and_different_everywhere() -> None:
    names = folder_names([*NAMES, *NAMES])
    assert len({unicodedata.normalize("NFC", name).casefold() for name in names}) == len(names)
    for name in names:
        assert re.fullmatch(r"[\w.-]+", name)
        assert len(name.encode()) <= 255
        assert name[-1] != "."
        assert name[0] not in FORMULAS + "._"
        assert name.casefold() not in NOT_FOLDERS
        assert name.casefold().split(".")[0] not in DEVICES


def test_a_good_name_stays_as_it_is() -> None:
    good = ["hand", "Take 3".replace(" ", "_"), "\u00fcbung-2.final", "\u624b", "console", "com10", "2024-05-01_a"]
    assert folder_names(good) == good


@pytest.mark.parametrize("name", FILE_NAMES)
def test_a_file_of_any_name_is_read_or_refused_in_one_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"{name}.csv"
    try:
        path.write_text(PLAIN.replace("\n0.0,", "\nzero,", 1), encoding="utf-8")
    except (OSError, ValueError):
        pytest.xfail("this system has no files of that name")
    with pytest.raises(TrajectoryError, match="t is 'zero', not a number; delete this line if it is damaged") as caught:
        read_trajectories(str(path))
    assert str(caught.value).isprintable()
    path.write_text(PLAIN, encoding="utf-8")
    assert len(read_trajectories(str(path)).trajectories) == 1
