"""What the paper says, in its own numbers, to be put beside what is measured here. Updates are those of one second."""

from __future__ import annotations

PAPER = {30: 20, 20: 10, 15: 7, 12: 5}
"""The paper's table: updates under its state of the art, and those that it found to look the same with multivectors."""

UPDATES = tuple(PAPER)
"""Of the state of the art, from the most to the fewest."""

TIME_SAVED = 0.165
"""The running time saved for a generated frame, as a share."""

COLOURS = {"lerp": "#FFD60A", "slerp": "#1FA63A"}
"""Of the figure "LERP and SLERP of multivectors": yellow and green."""
