"""Blender's side of a motion: Actions, slots, channels, keys, and the in-betweens that go into them. No user interface.

slots       what moves an object, by which F-curves     refusals    why not, and the way out
reading     what is keyed, from Blender's data          sources     the same as arrays
curves      F-curves in NumPy: keys, cycles, easings, values
inbetweens  from sources to delta transforms            filling     writing those
live        refreshing after every edit                 insertion   keys that are inserted in between
mode_keys   choosing modes                              bake        real keys for every frame
reducing    the few keys that a recording needs         originals   what there was before either
"""

from . import live, properties
from .bake import bake, bake_poses, is_baked, unbake
from .channels import channelbag_of, read_poses, write_channel
from .live import problem_of, refresh, set_enabled
from .mode_keys import key_frames, modes_of, set_mode
from .reducing import Reduction, is_reduced, let_keys_go, radius_of, reduce_keys_of, reduction_of, restore_keys
from .slots import Refused
from .sources import MODE_IDS

__all__ = [
    "MODE_IDS",
    "Reduction",
    "Refused",
    "bake",
    "bake_poses",
    "channelbag_of",
    "is_baked",
    "is_reduced",
    "key_frames",
    "let_keys_go",
    "modes_of",
    "problem_of",
    "radius_of",
    "read_poses",
    "reduce_keys_of",
    "reduction_of",
    "refresh",
    "register",
    "restore_keys",
    "set_enabled",
    "set_mode",
    "unbake",
    "unregister",
    "write_channel",
]


def register() -> None:
    properties.register()
    live.register()


def unregister() -> None:
    live.unregister()
    properties.unregister()
