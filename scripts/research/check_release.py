"""Look whether all is there that a release on extensions.blender.org needs, and say what is not.

That is: real addresses, one version with a dated entry in the changelog and no tag yet, and nothing that is not
committed. Zip, pictures and text of the page are tested with everything else. It is for a checkout, and changes nothing
in it.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

from research.pages import ROOT
from rigid_motion_batch.command_line import parser_of, program_of

SCRIPT = "research check_release"

EPILOG = """
example:
  python scripts/research check_release

CONTRIBUTING.md has the steps of a release. Exit code: 0 all is there, 1 something is not, which is printed.
"""

MANIFEST, CHANGELOG, MANUAL = "blender_manifest.toml", "CHANGELOG.md", "addon/rigid_motion/ui/manual.py"

STAND_INS = re.compile(r"(^|\.)(example(\.(org|com|net))?|test|invalid|localhost)$|^$")
"""Names of hosts that are nobody's (RFC 2606), or no names."""


def addresses(checkout: Path) -> Iterator[str]:
    """Check that website and maintainer can be reached, and the program opens what the manifest names."""
    manifest = manifest_of(checkout)
    website, mail = manifest.get("website", ""), manifest["maintainer"].rpartition("<")[2].rstrip(">")
    if STAND_INS.search(urlsplit(website).hostname or ""):
        yield f"{MANIFEST}: the website is {website or 'not there'}: set it to the project's, and WEBSITE in {MANUAL}"
    if "@" not in mail or STAND_INS.search(mail.rpartition("@")[2]):
        yield f"{MANIFEST}: the maintainer's address is {mail}: set it to one that is read"
    opened = re.search(r'^WEBSITE = "(.*)"$', (checkout / MANUAL).read_text(encoding="utf-8"), re.MULTILINE)
    if opened is None or opened[1] != website:
        yield f"{MANUAL}: WEBSITE is {opened[1] if opened else 'not there'}, in {MANIFEST} it is {website}"


def version(checkout: Path) -> Iterator[str]:
    """Check that the version has a dated entry in the changelog, and was not released before."""
    number = manifest_of(checkout)["version"]
    changelog = (checkout / CHANGELOG).read_text(encoding="utf-8")
    entry = re.search(rf"^## {re.escape(number)} - (.*)$", changelog, re.MULTILINE)
    if entry is None:
        yield f"{CHANGELOG}: there is no entry of {number}, the version of {MANIFEST}"
    elif not re.fullmatch(r"\d{4}-\d{2}-\d{2}", entry[1]):
        yield f"{CHANGELOG}: {number} is {entry[1]}: give it the day of the release"
    if f"v{number}" in _git(checkout, "tag", "--list").split():
        yield f"the tag v{number} is there already: {MANIFEST} needs the next version"


def commits(checkout: Path) -> Iterator[str]:
    """Check that what is released is committed."""
    for line in _git(checkout, "status", "--porcelain", "--untracked-files=no").splitlines():
        yield f"{line[3:]} is not committed"


CHECKS: tuple[Callable[[Path], Iterator[str]], ...] = (addresses, version, commits)


def manifest_of(checkout: Path) -> dict:
    return tomllib.loads((checkout / MANIFEST).read_text(encoding="utf-8"))


def _git(checkout: Path, *arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=checkout, capture_output=True, text=True, check=True).stdout


def main(arguments: list[str]) -> int:
    """Look at everything, and return the exit code."""
    parser_of(SCRIPT, __doc__, EPILOG).parse_args(arguments)
    missing = [finding for check in CHECKS for finding in check(ROOT)]
    for finding in missing:
        print(f"{program_of(SCRIPT)}: {finding}", file=sys.stderr)
    if not missing:
        print("All is there for a release.")
    return 1 if missing else 0
