"""How a comparison is to be shown, and which object: all that can be said of it before Blender is loaded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.places import ASSETS

ENGINES = ("workbench", "eevee", "cycles")
ANTIALIASING = ("OFF", "FXAA", "5", "8", "11", "16", "32")

MODELS_FILE = ASSETS / "models.blend"
MODELS = {"drill": "Drill", "controller": "Controller"}


@dataclass(frozen=True)
class SceneSettings:
    """How a comparison is shown."""

    engine: str = "workbench"
    """One of `ENGINES`."""

    resolution: tuple[int, int] = (960, 540)
    """Width and height in pixels, even: the codec wants that."""

    fps: int = 30

    slow_motion: float = 1.0
    """The factor by which it is slower than life."""

    subject: str = "drill"
    """The object that moves: "drill", "controller" or "file.blend:Name"."""

    antialiasing: str | None = None
    """The antialiasing of Workbench: one of `ANTIALIASING`; numbers are samples.

    Where nothing is asked for, a graphics card draws 8 samples, as far as Blender can tell that there is one (5.2 and
    later). Without one, the compositor smooths edges (SMAA), which takes a tenth of the time of FXAA.
    """

    samples: int = 16
    """The samples of EEVEE and Cycles."""

    theme: str = "dark"
    """One of `palette.THEMES`."""

    deviation: float | None = None
    """The factor by which a mode's deviation from the recording is shown larger than it is;
    None for what shows it well."""

    distinct: bool = False
    """True if modes that are one motion share a lane."""

    def __post_init__(self) -> None:
        """Refuse what no option of a command line refuses by itself."""
        if min(self.resolution) < 2 or any(size % 2 for size in self.resolution):
            raise ValueError(f"resolution {self.resolution[0]}x{self.resolution[1]}: give two even numbers of pixels")
        if self.deviation is not None and not 1.0 <= self.deviation <= 1000.0:
            raise ValueError(f"deviations {self.deviation:g} times as large: give 1 to 1000")


class SubjectError(ValueError):
    """The object to show cannot be had. The message says why, in one line."""


def place_of_subject(requested: str) -> tuple[Path, str]:
    """Return the file that an object is in, whether or not it is there, and its name in that.

    Parameters
    ----------
    requested : str
        A key of `MODELS`, or "file.blend:Name".

    Raises
    ------
    SubjectError
        Where no object is named.
    """
    if requested in MODELS:
        return MODELS_FILE, MODELS[requested]
    file, colon, name = requested.rpartition(":")
    if not colon or not file.lower().endswith(".blend"):
        raise SubjectError(f"object {requested!r}: give {', '.join(MODELS)} or file.blend:Name")
    return Path(file), name
