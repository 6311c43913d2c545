"""Tests of commands whose output is unread, has no space, or cannot be shown: one line or silence, and no traceback."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion_batch.command_line import path_line
from tests.scripts.reducing import listed, write_csv

ROOT = Path(__file__).resolve().parents[2]

pytestmark = [
    pytest.mark.blender,
    pytest.mark.skipif(sys.platform == "win32", reason="shells, and devices of Unix"),
    pytest.mark.any_blender,
]

ODD = "a\nb\t\x1b[2J \u00fc\u624b.csv"
"""An odd but possible file name."""


def shell(line: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a line of Bash in which `reduce`, `compare` and `program` are commands."""
    package = f"PYTHONPATH={ROOT / 'scripts'} {sys.executable} -m rigid_motion_batch"
    reduce, compare = (f"{sys.executable} {ROOT / 'scripts'}/{name}.py" for name in ("reduce", "compare"))
    functions = f'reduce() {{ {reduce} "$@"; }}; compare() {{ {compare} "$@"; }}; program() {{ {package} "$@"; }}'
    command = ["bash", "-c", f"{functions}; {line}"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, env=os.environ | variables)


@pytest.mark.parametrize(
    ("line", "codes"),
    [
        ("reduce hand.csv | true", "0 0"),
        ("program stream --help | true", "0 0"),
        ("compare --tolerance no 2>&1 | true", "2 0"),
    ],
)
def test_who_has_read_enough_hears_nothing(tmp_path, line, codes):
    write_csv(tmp_path / "hand.csv")
    done = shell(f'{line}; echo "${{PIPESTATUS[@]}}"', tmp_path)
    assert done.stdout == f"{codes}\n", done.stderr
    assert "rror" not in done.stderr


@pytest.mark.parametrize("line", ["reduce hand.csv >/dev/full", "program >/dev/full"])
def test_a_full_disk_is_told_of(tmp_path, line):
    write_csv(tmp_path / "hand.csv")
    done = shell(line, tmp_path)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.endswith(": standard output: No space left on device; output there is lost")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("closed", ["2>/dev/full", "<&- >&- 2>&-"])
def test_closed_streams_keep_nothing_from_being_done(tmp_path, closed):
    write_csv(tmp_path / "hand.csv")
    done = shell(f"reduce hand.csv {closed}", tmp_path)
    assert done.returncode == 0, done.stderr
    assert listed(tmp_path) == ["hand-keys.csv", "hand.csv"]
    assert done.stdout == ("" if ">&-" in closed.replace("2>&-", "") else "hand-keys.csv\n")


def test_every_name_is_told_in_a_line_whatever_the_encoding(tmp_path):
    write_csv(tmp_path / ODD)
    done = shell("reduce *.csv && cp -- *keys.csv found", tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    assert (tmp_path / json.loads(line)).read_bytes() == (tmp_path / "found").read_bytes()
    assert len([told for told in done.stderr.splitlines() if "\\n" in told]) == 2
    assert "\x1b" not in done.stderr
    assert "\t" not in done.stderr


def test_paths_are_lines_that_can_be_told_from_one_another():
    plain = ["shots/shot-keys.csv", "gr\u00fc\u00dfe.csv", "\u624b\u3000.csv", "C:\\shot.blend", "it's.csv"]
    assert list(map(path_line, plain)) == plain
    odd = ["a\nb", "\x1b[2J", "a\u2028b", "\udcff", '"a"', "a\x7f"]
    for path in odd:
        (line,) = path_line(path).splitlines()
        assert line.isascii()
        assert json.loads(line) == path
