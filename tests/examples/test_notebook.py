"""The notebook is what its script makes, and shows what the program says today."""

import ast
import contextlib
import io
import json
import runpy
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "modes_in_python"
NOTEBOOK = FOLDER / "modes.ipynb"
CELLS = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]

LARGEST = 300_000
"""Bytes that a checkout can spare for it."""


def text(lines: str | list[str]) -> str:
    """What a notebook keeps as a list of lines."""
    return "".join(lines)


def printed(cell: dict) -> str:
    """What a cell printed when the notebook was made."""
    return "".join(text(output["text"]) for output in cell["outputs"] if output["output_type"] == "stream")


def pictures(cell: dict) -> int:
    """How many pictures a cell shows."""
    return sum("image/png" in output.get("data", {}) for output in cell["outputs"])


def test_its_cells_are_those_of_the_script():
    made = list(runpy.run_path(str(FOLDER / "make_notebook.py"))["cells"]((FOLDER / "modes.py").read_text("utf-8")))
    assert made == [(cell["cell_type"], text(cell["source"])) for cell in CELLS]


def test_it_is_small_and_has_no_errors_in_it():
    assert NOTEBOOK.stat().st_size < LARGEST
    outputs = [output for cell in CELLS for output in cell.get("outputs", ())]
    assert {output["output_type"] for output in outputs} == {"stream", "display_data"}
    assert {output["name"] for output in outputs if "name" in output} == {"stdout"}


@pytest.mark.slow
@pytest.mark.once
def test_its_code_runs_without_jupyter_and_shows_what_the_notebook_shows(monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawn = 0

    def show() -> None:
        nonlocal drawn
        for number in plt.get_fignums():
            plt.figure(number).canvas.draw()
            drawn += 1
        plt.close("all")

    monkeypatch.setattr(plt, "show", show)
    names = {"__name__": "__main__"}
    for cell in CELLS:
        if cell["cell_type"] != "code":
            continue
        drawn = 0
        code = compile(ast.parse(text(cell["source"])), "modes.ipynb", "exec")
        with contextlib.redirect_stdout(io.StringIO()) as said:
            exec(code, names)
        assert (said.getvalue(), drawn) == (printed(cell), pictures(cell))
