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
from collections.abc import Iterator
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
"""Names of hosts that are reserved (RFC 2606), or no names."""


def missing(checkout: Path) -> Iterator[str]:
    """Yield what a release needs and has not."""
    manifest = tomllib.loads((checkout / MANIFEST).read_text(encoding="utf-8"))
    website, mail = manifest.get("website", ""), manifest["maintainer"].rpartition("<")[2].rstrip(">")
    if STAND_INS.search(urlsplit(website).hostname or ""):
        yield f"{MANIFEST}: the website is {website or 'not there'}: set it to the project's, and WEBSITE in {MANUAL}"
    if "@" not in mail or STAND_INS.search(mail.rpartition("@")[2]):
        yield f"{MANIFEST}: the maintainer's address is {mail}: set it to one that is read"
    opened = re.search(r'^WEBSITE = "(.*)"$', (checkout / MANUAL).read_text(encoding="utf-8"), re.MULTILINE)
    if opened is None or opened[1] != website:
        yield f"{MANUAL}: WEBSITE is {opened[1] if opened else 'not there'}, in {MANIFEST} it is {website}"

    number, changelog = manifest["version"], (checkout / CHANGELOG).read_text(encoding="utf-8")
    entry = re.search(rf"^## {re.escape(number)} - (.*)$", changelog, re.MULTILINE)
    if entry is None:
        yield f"{CHANGELOG}: there is no entry of {number}, the version of {MANIFEST}"
    elif not re.fullmatch(r"\d{4}-\d{2}-\d{2}", entry[1]):
        yield f"{CHANGELOG}: {number} is {entry[1]}: give it the day of the release"

    def git(*arguments: str) -> str:
        return subprocess.run(["git", *arguments], cwd=checkout, capture_output=True, text=True, check=True).stdout

    if f"v{number}" in git("tag", "--list").split():
        yield f"the tag v{number} is there already: {MANIFEST} needs the next version"
    for line in git("status", "--porcelain", "--untracked-files=no").splitlines():
        yield f"{line[3:]} is not committed"


def main(arguments: list[str]) -> int:
    """Look at everything, and return the exit code."""
    parser_of(SCRIPT, __doc__, EPILOG).parse_args(arguments)
    findings = list(missing(ROOT))
    for finding in findings:
        print(f"{program_of(SCRIPT)}: {finding}", file=sys.stderr)
    if not findings:
        print("All is there for a release.")
    return 1 if findings else 0
