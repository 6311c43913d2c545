"""Animation in Blender: Actions, slots, channels, keys, and the in-betweens written to them. No user interface.

fcurves     F-curves as arrays, and their evaluation; NumPy alone
evaluation  computes channel values from keys, both as arrays; NumPy alone
transforms  the things that move: objects and pose bones
actions     keyed data: slots, channels, modes; read into sources
terms       values added to channels: planned, compared with the present ones, written
holds       holders of objects and bones: keyed constraints
queries     read-only questions about motions: keys, segments, problems
following   reacts to edits: handlers, refresh, keys inserted in between
edits       edits of motions: choosing modes, turns, breakdowns
baking      other keys for the same motion
properties  properties stored in files

Data flows from Blender through actions, evaluation and terms back to Blender. Each package imports only those above it.
"""

from . import properties
from .actions.channels import channelbag_of, write_channel
from .baking.bake import bake, bake_poses, bake_to_world, is_baked, unbake
from .baking.cleaning import Cleaning, clean_motion
from .baking.fewer_keys import NeedsItsKeys, WholeRig
from .baking.into_holds import HeldSegment, held_segments, reduce_into_holds
from .baking.layers import add_layer
from .baking.merging_layers import merge_layer
from .baking.native_curves import NATIVE
from .baking.reducing import (
    FEWEST,
    Reduction,
    discard_dense_keys,
    is_reduced,
    reduce_keys_of,
    reduction_of,
    restore_keys,
)
from .edits.breakdowns import Breakdowns, breakdown
from .edits.holding import HoldFacts, hold_facts, hold_in, hold_keys, match_grip, pass_frames
from .edits.mode_keys import copy_modes, repeat, set_mode, set_turns
from .edits.speed import EvenSpeed, equalise_speed
from .evaluation.components import MODE_IDS
from .following import follower
from .following.follower import is_enabled, refresh, set_enabled
from .queries.keyed import key_frames, modes_of
from .queries.segments import problem_of
from .transforms import Refused
from .transforms.sizes import radius_of

__all__ = [
    "FEWEST",
    "MODE_IDS",
    "NATIVE",
    "Breakdowns",
    "Cleaning",
    "EvenSpeed",
    "HeldSegment",
    "HoldFacts",
    "NeedsItsKeys",
    "Reduction",
    "Refused",
    "WholeRig",
    "add_layer",
    "bake",
    "bake_poses",
    "bake_to_world",
    "breakdown",
    "channelbag_of",
    "clean_motion",
    "copy_modes",
    "discard_dense_keys",
    "equalise_speed",
    "held_segments",
    "hold_facts",
    "hold_in",
    "hold_keys",
    "is_baked",
    "is_enabled",
    "is_reduced",
    "key_frames",
    "match_grip",
    "merge_layer",
    "modes_of",
    "pass_frames",
    "problem_of",
    "radius_of",
    "reduce_into_holds",
    "reduce_keys_of",
    "reduction_of",
    "refresh",
    "register",
    "repeat",
    "restore_keys",
    "set_enabled",
    "set_mode",
    "set_turns",
    "unbake",
    "unregister",
    "write_channel",
]


def register() -> None:
    properties.register()
    follower.register()


def unregister() -> None:
    follower.unregister()
    properties.unregister()
