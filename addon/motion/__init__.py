"""Rigid motion in NumPy: poses, the modes that fill in between them, measures, decimation and repair.

No Blender here: importable anywhere. Quaternions are w, x, y, z; positions and times keep the units they come in.
"""

from .modes import MODES, Mode, interpolate
from .poses import Poses

__all__ = ["MODES", "Mode", "Poses", "interpolate"]
