"""Blender's side of a motion: Actions, slots, channels, keys, and the in-betweens that go into them. No user interface.

curves      F-curves as arrays, evaluated; NumPy alone
compute     sources, which are what is keyed as arrays, and from them to differences; NumPy alone
transforms  what is moved: objects and pose bones
actions     what is keyed: slots, channels, modes; read into sources
writers     where differences go: sampled F-curves of delta transforms, constraints of bones and their times
queries     what is asked of motions: keys, segments, problems
live        following edits: handlers, refresh, keys that are inserted in between
edits       what is done to motions: choosing modes, putting constraints back
baking      other keys for the same motion
properties  what is kept in files

Data flows from Blender through actions, compute and writers back to Blender. Each room imports only those above it;
`handlers` belongs to none, and imports none; `gltf_export` is for Blender's glTF exporter, and imports none.
"""

from . import properties
from .actions.channels import channelbag_of, read_poses, write_channel
from .baking.bake import bake, bake_poses, is_baked, unbake
from .baking.fewer_keys import NeedsItsKeys
from .baking.reducing import (
    Reduction,
    WholeRig,
    discard_dense_keys,
    is_reduced,
    reduce_keys_of,
    reduction_of,
    restore_keys,
    total_reduction,
)
from .compute.components import MODE_IDS
from .edits.breakdowns import Breakdowns, breakdown
from .edits.constraints import constraint_trouble, error_between_frames, restore_constraints, set_exact
from .edits.mode_keys import set_mode, set_turns
from .live import follower, rigs
from .live.follower import is_enabled, refresh, set_enabled
from .queries.keyed import key_frames, modes_of
from .queries.segments import problem_of
from .transforms import Refused
from .transforms.sizes import radius_of

__all__ = [
    "MODE_IDS",
    "Breakdowns",
    "NeedsItsKeys",
    "Reduction",
    "Refused",
    "WholeRig",
    "bake",
    "bake_poses",
    "breakdown",
    "channelbag_of",
    "constraint_trouble",
    "discard_dense_keys",
    "error_between_frames",
    "is_baked",
    "is_enabled",
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
    "restore_constraints",
    "restore_keys",
    "set_enabled",
    "set_exact",
    "set_mode",
    "set_turns",
    "total_reduction",
    "unbake",
    "unregister",
    "write_channel",
]


def register() -> None:
    properties.register()
    rigs.register()
    follower.register()


def unregister() -> None:
    follower.unregister()
    rigs.unregister()
    properties.unregister()
