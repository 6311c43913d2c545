"""What Actions hold: slots, channels, keys, modes; read into sources, which are arrays with a digest.

marks       what keys say of the segments that they begin
modifiers   modifiers of F-curves: ours, and the animator's
channels    the F-curves of a slot, written and read as arrays
slots       what moves something, by which F-curves
refusals    why rigid motion cannot act on something, and the way out
reading     from Blender's data to sources

Each module imports only those above it.
"""
