"""Rigid motion in NumPy: poses, modes that interpolate between them, error measures, decimation and repair.

This package does not need Blender and can be imported anywhere. Quaternions are w, x, y, z; positions and times keep
the units they come in.
"""

from .cleaning import Cleaned, clean
from .contacts import standing
from .decimation import decimate
from .fitting import fit_keys
from .measures import Errors, measure, rms, shell_error
from .modes import KEYFRAME_MODES, MODES, Mode, in_betweens, interpolate, prepare
from .poses import Poses
from .reduction import reduce_keys
from .repair import Repair, repair
from .skeleton_channels import SeparateKeys
from .skeleton_reduction import reduce_skeleton_keys
from .skeletons import Skeleton

__all__ = [
    "KEYFRAME_MODES",
    "MODES",
    "Cleaned",
    "Errors",
    "Mode",
    "Poses",
    "Repair",
    "SeparateKeys",
    "Skeleton",
    "clean",
    "decimate",
    "fit_keys",
    "in_betweens",
    "interpolate",
    "measure",
    "prepare",
    "reduce_keys",
    "reduce_skeleton_keys",
    "repair",
    "rms",
    "shell_error",
    "standing",
]
