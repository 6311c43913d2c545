"""What Actions hold: slots, channels, keys, modes; read into sources, which are arrays with a digest.

channels       the F-curves of a slot, written and read as arrays
slots          what moves something, by which F-curves
records        what an Action keeps: mode and digest, also of bones that were renamed
refusals       why rigid motion cannot act on something, and the way out
reading        from Blender's data to sources
mode_property  what an object shows of its mode, and slots that were duplicated

Each module imports only those above it.
"""
