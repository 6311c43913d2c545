"""Build the documentation site from docs/, with Sphinx: pages that open from a folder, without a network.

Whatever Sphinx warns of is an error: a link that leads nowhere, a formula that cannot be set, a name without an entry.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from rigid_motion_batch.command_line import parser_of

ROOT = Path(__file__).resolve().parents[1]

OTHER_PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "assets/README.md", "examples")
"""Files and folders outside docs/ that pages show or link to."""

EPILOG = """
examples:
  python scripts/bootstrap.py docs
  python scripts/bootstrap.py docs --output ~/rigid-motion-site

A site that is there already is replaced, once the new one is whole; the last line printed is the path of index.html.
Another folder that is there and not empty is left alone.
Exit code: 0 done, 1 Sphinx warned of something, 2 it could not be built.
"""


class SiteError(Exception):
    """The reason why there is no site, as a message for the user."""


def build(folder: Path) -> Path:
    """Build the site in a folder, which is replaced, and return the path of its first page.

    Raises
    ------
    SiteError
        If Sphinx is missing, or the folder exists and is no site. The message says what to do.
    subprocess.CalledProcessError
        If Sphinx printed a warning. The folder does not change.
    OSError
        If the folder cannot be written.
    """
    if find_spec("sphinx") is None:
        raise SiteError("Sphinx is missing: run `python scripts/bootstrap.py docs`, which brings it")
    folder = Path(os.path.abspath(folder))
    if folder.exists() and not (folder.is_dir() and (is_site(folder) or not any(folder.iterdir()))):
        raise SiteError(f"{folder} is there already, and no site: give another folder")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as beside:
        built, kept = Path(beside) / "site", Path(beside) / "before"
        pages = stage(Path(beside) / "checkout")
        known = Path(beside) / "known"
        options = ["-q", "-W", "--keep-going", "-b", "html", "-c", ROOT / "docs", "-d", known]
        subprocess.run([sys.executable, "-m", "sphinx", *options, pages, built], check=True)
        if folder.exists():
            folder.rename(kept)
        built.rename(folder)
    return folder / "index.html"


def stage(folder: Path) -> Path:
    """Copy all sources of pages, and return the copy of docs/: Sphinx adds a page for each public name to it."""
    pages = folder / "docs"
    shutil.copytree(ROOT / "docs", pages, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    for name in OTHER_PAGES:
        (folder / name).parent.mkdir(exist_ok=True)
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    return pages


def is_site(folder: Path) -> bool:
    """Whether a folder is a site made by `build`."""
    return (folder / "index.html").is_file() and (folder / ".buildinfo").is_file()


def main(arguments: list[str]) -> int:
    """Build, and return the exit code."""
    parser = parser_of("build_site.py", __doc__, EPILOG)
    default = ROOT / "dist" / "site"
    parser.add_argument("--output", type=Path, default=default, metavar="DIR", help="folder of the site (dist/site)")
    options = parser.parse_args(arguments)
    try:
        page = build(options.output.expanduser())
    except SiteError as error:
        print(f"build_site.py: {error}", file=sys.stderr)
        return 2
    except subprocess.CalledProcessError:
        print("build_site.py: no site, because of what is above", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"build_site.py: {error.filename or options.output}: {error.strerror or error}", file=sys.stderr)
        return 2
    print(page)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
