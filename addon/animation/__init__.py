"""Blender's side of a motion: Actions, slots, channels, keys, and the in-betweens that go into them. No user interface.

transforms  what is moved, and where differences go     slots       what moves it, by which F-curves
reading     what is keyed, from Blender's data          sources     the same as arrays
curves      F-curves in NumPy                           refusals    why not, and the way out
inbetweens  from sources to differences                 filling     writing those
records     what an Action keeps: mode and digest       mode_property   what an object shows of it
live        refreshing after every edit                 insertion   keys that are inserted in between
acting      many targets at once                        mode_keys   choosing modes
bake        real keys for every frame                   reducing    the few keys that a recording needs
originals   what there was before either                describing  what there is to tell of a segment
"""

from . import live, properties
from .bake import bake, bake_poses, is_baked, unbake
from .channels import channelbag_of, read_poses, write_channel
from .live import problem_of, refresh, set_enabled
from .mode_keys import key_frames, modes_of, set_mode
from .reducing import Reduction, discard_dense_keys, is_reduced, radius_of, reduce_keys_of, reduction_of, restore_keys
from .sources import MODE_IDS
from .transforms import Refused

__all__ = [
    "MODE_IDS",
    "Reduction",
    "Refused",
    "bake",
    "bake_poses",
    "channelbag_of",
    "discard_dense_keys",
    "is_baked",
    "is_reduced",
    "key_frames",
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
