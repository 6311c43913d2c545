"""What the paper says, in its own numbers, to be put beside what is measured here. Updates are those of one second."""

from __future__ import annotations

from dataclasses import dataclass

UPDATES_IN_THE_PAPER = {"30": "20", "20": "10", "15": "7", "12": "5"}
"""The paper's table: updates a second under its state of the art, and those that it found to look the same."""


@dataclass(frozen=True)
class Row:
    """A row of the paper's table: a quality, and the updates a second that it takes."""

    quality: str

    state_of_the_art: int
    """Updates a second with positions and quaternions interpolated apart."""

    multivectors: int
    """Updates a second that the paper found to look the same with dual quaternions or multivectors."""

    @property
    def saved(self) -> float:
        """The bandwidth saved, as a share."""
        return 1.0 - self.multivectors / self.state_of_the_art


TABLE = tuple(
    Row(quality, int(rate), int(fewer))
    for quality, (rate, fewer) in zip(
        ("Excellent", "Good", "Mediocre", "Poor"), UPDATES_IN_THE_PAPER.items(), strict=True
    )
)

BLEND = "pga_lerp"
"""The multivectors of the paper."""

TIME_SAVED = 0.165
"""The running time saved for a generated frame, as a share."""

ENERGY_SAVED = 0.10
"""The energy saved, as a share."""

EXAMPLE = {20: 1120, 30: 1680}
"""Updates a second to bytes a second for each user: 7 doubles an update."""

COLOURS = {"lerp": "#FFD60A", "slerp": "#1FA63A"}
"""Of the figure "LERP and SLERP of multivectors": yellow and green."""
