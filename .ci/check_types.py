"""Check types: what mypy finds in each package may become less, never more.

`[tool.rigid-motion.mypy]` in pyproject.toml has how many errors packages still have; the others have none.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    """Run mypy, say which packages have other counts than what is written, and return the exit code."""
    if sys.version_info < (3, 12):
        print("NumPy's types need Python 3.12 or later", file=sys.stderr)
        return 2
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    written = project["tool"]["rigid-motion"]["mypy"]
    run = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True)
    if run.returncode not in (0, 1):
        print(run.stdout, run.stderr, sep="\n", file=sys.stderr)
        return 2
    errors = defaultdict(list)
    for line in run.stdout.splitlines():
        if ": error: " in line:
            errors[package_of(Path(line.partition(":")[0]))].append(line)
    failed = False
    for package in sorted(errors.keys() | written.keys()):
        count, most = len(errors[package]), written.get(package, 0)
        if count == most:
            continue
        failed = True
        if count > most:
            print(*errors[package], sep="\n")
            print(f"{package}: {count} errors of types, where {most} are known")
        else:
            print(f"{package}: {count} errors of types are left: write that instead of {most} into pyproject.toml")
    return int(failed)


def package_of(path: Path) -> str:
    """Return the package that a module is counted under: rigid_motion.ui of addon/rigid_motion/ui/menus.py."""
    return ".".join(path.parts[1:-1][:2])


if __name__ == "__main__":
    sys.exit(main())
