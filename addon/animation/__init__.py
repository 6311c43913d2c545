"""Blender's side of a motion: Actions, slots, channels, keys. No user interface, and no interpolation of its own."""

from .bake import bake_poses
from .channels import channelbag_of, read_poses, write_channel

__all__ = ["bake_poses", "channelbag_of", "read_poses", "write_channel"]
