"""Completion in a shell: what Bash offers, and that every shell that is named gets a script."""

import shutil
import subprocess
from pathlib import Path

import pytest
import shtab

from rigid_motion_batch.cli.commands import COMMANDS
from rigid_motion_batch.cli.completion import main, whole_parser

ASK = """
source "$1"; shift
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
$(complete -p rigid-motion | sed 's/.*-F \\([^ ]*\\).*/\\1/') rigid-motion "${@: -1}" ""
printf '%s\\n' "${COMPREPLY[@]}"
"""
"""What Bash does at the tabulator key."""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("completion") / "rigid-motion.bash"
    path.write_text(shtab.complete(whole_parser(), "bash"))
    return path


@pytest.mark.skipif(not shutil.which("bash"), reason="asks Bash")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["b"], ["bake", "bundle", "build"]),
        (["compare", "--tol"], ["--tolerance"]),
        (["compare", "--axes", "uni"], ["unity"]),
        (["compare", "ha"], ["hand.csv"]),
        (["stream", "receive", "--mode", "motor_spline_"], ["motor_spline_causal"]),
        (["completion", "zs"], ["zsh"]),
    ],
)
def test_bash_offers_what_fits(script: Path, tmp_path: Path, typed: list[str], offered: list[str]) -> None:
    (tmp_path / "hand.csv").touch()
    asked = ["bash", "-c", ASK, "bash", script, "rigid-motion", *typed]
    done = subprocess.run(asked, capture_output=True, text=True, cwd=tmp_path, timeout=30)
    assert done.stdout.split() == offered, done.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_shell_gets_a_script_with_all_commands(shell: str, capsys: pytest.CaptureFixture) -> None:
    assert main([shell]) == 0
    printed = capsys.readouterr().out
    assert all(command in printed for command in COMMANDS)
    assert "tolerance" in printed
