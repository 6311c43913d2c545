"""What a release needs: each part is missed where it is not there."""

import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from research import check_release
from research.check_release import CHANGELOG, MANIFEST, MANUAL

ROOT = Path(__file__).resolve().parents[3]
WEBSITE = "https://motion.dev/rigid"


def git(folder: Path, *arguments: str) -> None:
    identity = ("-c", "user.name=T", "-c", "user.email=t@motion.dev", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *identity, *arguments], cwd=folder, check=True, capture_output=True)


def change(folder: Path, name: str, old: str, new: str) -> None:
    text = (folder / name).read_text(encoding="utf-8")
    assert old in text
    (folder / name).write_text(text.replace(old, new), encoding="utf-8")


@pytest.fixture
def ready(tmp_path, monkeypatch) -> Path:
    """A checkout of which nothing is missing: this one, with addresses and a day."""
    for name in (MANIFEST, CHANGELOG, MANUAL):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    manifest = tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))
    change(tmp_path, MANIFEST, manifest["website"], WEBSITE)
    change(tmp_path, MANUAL, manifest["website"], WEBSITE)
    change(tmp_path, MANIFEST, manifest["maintainer"], "Maintainer <maintainer@motion.dev>")
    change(tmp_path, MANIFEST, f'"{manifest["version"]}"\nname', '"0.1.0"\nname')
    (tmp_path / CHANGELOG).write_text("# Changelog\n\n## 0.1.0 - 2026-12-01\n", encoding="utf-8")
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "-m", "Ready")
    monkeypatch.setattr(check_release, "ROOT", tmp_path)
    return tmp_path


def missing(capsys: pytest.CaptureFixture[str]) -> str:
    """What the command complains of; it ends with 1."""
    assert check_release.main([]) == 1
    return capsys.readouterr().err


def test_where_all_is_there_it_says_so(ready, capsys):
    assert check_release.main([]) == 0
    assert capsys.readouterr() == ("All is there for a release.\n", "")


@pytest.mark.parametrize(
    ("name", "old", "new", "told"),
    [
        (MANUAL, WEBSITE, "https://motion.dev/other", f"{MANUAL}: WEBSITE is https://motion.dev/other"),
        (CHANGELOG, " - 2026-12-01", " - unreleased", "0.1.0 is unreleased: give it the day of the release"),
        (MANIFEST, 'version = "0.1.0"\nname', 'version = "9.9.9"\nname', "no entry of 9.9.9"),
        (CHANGELOG, "2026-12-01", "2026-12-02", f"{CHANGELOG} is not committed"),
    ],
)
def test_what_is_not_ready_is_told(ready, capsys, name, old, new, told):
    change(ready, name, old, new)
    assert told in missing(capsys)
