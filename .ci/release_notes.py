"""Print the CHANGELOG.md entry of the version that a tag names; refuse a tag that does not match this checkout.

python .ci/release_notes.py v1.2.3
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def notes_of(tag: str, manifest: str, changelog: str) -> str:
    """Return the changelog entry, without its heading, for a tag: "v" followed by the manifest's version.

    Raises ValueError if the tag names another version, or if the changelog has no dated entry for the version.
    """
    version = tomllib.loads(manifest)["version"]
    if tag != f"v{version}":
        raise ValueError(f"the tag is {tag!r}, and blender_manifest.toml has version {version}: tag v{version}")
    heading = rf"^## {re.escape(version)} - \d{{4}}-\d\d-\d\d\n(.*?)(?=^## |\Z)"
    entry = re.search(heading, changelog, re.MULTILINE | re.DOTALL)
    if entry is None or not entry[1].strip():
        raise ValueError(f"CHANGELOG.md needs an entry with its day for this tag: ## {version} - YYYY-MM-DD")
    return entry[1].strip() + "\n"


def main(arguments: list[str]) -> int:
    """Print the release notes of a tag, or an error message, and return the exit code."""
    try:
        (tag,) = arguments
        files = (ROOT / "blender_manifest.toml", ROOT / "CHANGELOG.md")
        print(notes_of(tag, *(file.read_text(encoding="utf-8") for file in files)), end="")
    except ValueError as error:
        print(f"release_notes: {error}" if len(arguments) == 1 else __doc__, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
