"""Make modes.ipynb from the cells of modes.py, and run it, so its outputs come from this checkout.

The first picture of the notebook is saved as modes.png for the README next to it.

    pip install ".[notebook]"
    python examples/modes_in_python/make_notebook.py

The same packages always make the same file, byte for byte: it has no timestamps, and its cells have numbered ids.
"""

from __future__ import annotations

import base64
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parent
CHECKOUT = HERE.parents[1]
SOURCE, NOTEBOOK, PICTURE = HERE / "modes.py", HERE / "modes.ipynb", HERE / "modes.png"

LONGEST = 300
"""Time limit of a cell, in seconds."""

PALETTE = 64
"""Number of colours in a picture: enough for smooth lines, at a third of the bytes."""


def cells(source: str) -> Iterator[tuple[str, str]]:
    """Yield the cells of a script, each starting at a `# %%` line: "markdown" or "code", and the text."""
    for cell in re.split(r"^# %%", source, flags=re.MULTILINE)[1:]:
        head, text = cell.split("\n", 1)
        if head.strip() == "[markdown]":
            yield "markdown", re.sub(r"^# ?", "", text.strip(), flags=re.MULTILINE)
        else:
            yield "code", text.strip()


def smaller(png: bytes) -> bytes:
    """Return the same picture with few colours."""
    from PIL import Image

    picture = Image.open(io.BytesIO(png)).convert("RGB").quantize(PALETTE, dither=Image.Dither.NONE)
    saved = io.BytesIO()
    picture.save(saved, "png", optimize=True)
    return saved.getvalue()


def main() -> None:
    """Write the notebook with the outputs of its cells."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.v4.new_notebook()
    new = {"markdown": nbformat.v4.new_markdown_cell, "code": nbformat.v4.new_code_cell}
    result = cells(SOURCE.read_text(encoding="utf-8"))
    notebook.cells = [new[kind](text, id=f"cell-{number}") for number, (kind, text) in enumerate(result)]
    notebook.metadata.kernelspec = {"display_name": "Python 3", "language": "python", "name": "python3"}
    # The kernel is a separate process: make it use the packages of this checkout too, not installed ones.
    packages = [str(CHECKOUT / "addon"), str(CHECKOUT / "scripts")]
    os.environ["PYTHONPATH"] = os.pathsep.join([*packages, os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    NotebookClient(notebook, timeout=LONGEST, record_timing=False).execute()
    notebook.metadata.pop("language_info", None)
    outputs = [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", ())]
    shown = [data for data in outputs if "image/png" in data]
    for data in shown:
        data["image/png"] = base64.b64encode(smaller(base64.b64decode(data["image/png"]))).decode()
    PICTURE.write_bytes(base64.b64decode(shown[0]["image/png"]))
    nbformat.validate(notebook)
    NOTEBOOK.write_text(nbformat.writes(notebook) + "\n", encoding="utf-8")
    print(f"{NOTEBOOK}: {NOTEBOOK.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
