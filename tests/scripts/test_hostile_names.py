"""Files and bodies with hostile names: all they can do is be called so, in the output folder and in the report."""

import csv
import json
import re
import sys
import unicodedata
from collections.abc import Callable, Sequence
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

from rigid_motion_batch.cli import compare
from rigid_motion_batch.pipeline.comparison import ON_ONE_PAGE
from rigid_motion_batch.recordings import TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.clip_reading import DEVICES, NOT_FOLDERS, folder_names
from tests.scripts.recordings.seeds import SEEDS

FORMULAS = "=+-@\t\r"
"""What spreadsheets take for the beginning of a formula."""

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
"""Those that Linux allows for files."""

MOTION = json.loads(SEEDS[".json"][1])


def in_one_file(folder: Path, names: Sequence[str]) -> list[str]:
    """A recording with bodies of these names."""
    path = folder / ("'&<i>$.json" if sys.platform != "win32" else "'&$.json")
    path.write_text(json.dumps(dict.fromkeys(names, MOTION)), encoding="utf-8")
    return [f"{path}:*"]


def in_a_file_each(folder: Path, names: Sequence[str]) -> list[str]:
    """A recording of each of these names."""
    paths = [folder / f"{name}.json" for name in names]
    for path in paths:
        path.write_text(json.dumps(MOTION), encoding="utf-8")
    return list(map(str, paths))


class Structure(HTMLParser):
    """A page without its words: tags with the names of their attributes, and what stands in scripts and styles."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, tuple[str, ...]]] = []
        self.code: list[str] = []
        self.links: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, tuple(name for name, _ in attributes)))
        self.is_data = ("type", "application/json") in attributes
        self.links += [value or "" for name, value in attributes if name in ("href", "src")]

    def handle_endtag(self, tag: str) -> None:
        self.tags.append((f"/{tag}", ()))

    def handle_comment(self, data: str) -> None:
        self.tags.append((f"<!--{data}", ()))

    def handle_data(self, data: str) -> None:
        if self.cdata_elem and not self.is_data:  # Names are in the data.
            self.code.append(data)


def compared(folder: Path, write: Callable[[Path, Sequence[str]], list[str]], names: Sequence[str]) -> Path:
    """Compare recordings that are called so, and return the output folder."""
    sources, output = folder / "sources", folder / "output"
    sources.mkdir(parents=True)
    given = write(sources, names)
    before = set(sources.iterdir())
    asked = ["--no-video", "--rates", "20", "--modes", "lerp_slerp,dq_sclerp", "--output", str(output)]
    assert compare.main(["--jobs", "0", *given, *asked]) == 0
    assert set(sources.iterdir()) == before
    assert set(folder.iterdir()) == {sources, output}
    return output


@pytest.mark.slow
@pytest.mark.parametrize(
    ("write", "names"),
    [
        pytest.param(in_one_file, NAMES[:20], id="bodies on one page"),
        pytest.param(in_one_file, NAMES, id="bodies with a page each"),
        pytest.param(
            in_a_file_each,
            FILE_NAMES,
            id="files",
            marks=pytest.mark.skipif(sys.platform != "linux", reason="elsewhere files cannot be called so"),
        ),
    ],
)
def test_a_comparison_stays_in_its_folder_and_names_do_not_change_its_report(tmp_path, write, names):
    plain = compared(tmp_path / "plain", write, [f"body {number}" for number in range(len(names))])
    output = compared(tmp_path / "hostile", write, names)
    assert {path.name for path in tmp_path.iterdir()} == {"plain", "hostile"}
    assert sorted(path.name for path in output.iterdir() if not path.is_dir()) == sorted(
        path.name for path in plain.iterdir() if not path.is_dir()
    )

    folders = [path.name for path in output.iterdir() if path.is_dir() and not path.name.startswith(".")]
    assert len(folders) == len(names)
    with (output / "metrics.csv").open(encoding="utf-8", newline="") as stream:
        cells = [row["clip"] for row in csv.DictReader(stream)]
    assert set(cells) == set(folders)

    result = (path.relative_to(output) for path in output.rglob("report.html"))
    pages = sorted(path.as_posix() for path in result if not path.parts[0].startswith("."))
    assert len(pages) == (1 if len(names) <= ON_ONE_PAGE else len(names) + 1)
    whole, as_plain = (Structure((root / "report.html").read_text(encoding="utf-8")) for root in (output, plain))
    assert whole.tags == as_plain.tags
    assert whole.code == as_plain.code
    for link in whole.links:
        assert link.startswith(("#", "data:")) or (output / unquote(link)).is_file(), link


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
        path.write_text(SEEDS[".csv"][0].replace("0.02", "zero", 1), encoding="utf-8")
    except (OSError, ValueError):
        pytest.xfail("this system has no files of that name")
    with pytest.raises(TrajectoryError, match="t is 'zero', not a number; correct or delete the line") as caught:
        read_trajectories(str(path))
    assert str(caught.value).isprintable()
    path.write_text(SEEDS[".csv"][0], encoding="utf-8")
    assert len(read_trajectories(str(path)).trajectories) == 1
