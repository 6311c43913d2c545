"""What Actions hold: slots, channels, keys, modes; read into sources, which are arrays with a digest.

key_reading    keys of F-curves as arrays
channels       the F-curves of a slot, written and read as arrays
slots          what moves something, by which F-curves
modifiers      which modifiers can be followed, and what they add
influences     how much influence the NLA gives a slot
records        what an Action keeps: mode and digest
renaming       records of bones that were renamed
refusals       why rigid motion cannot act on something, and the way out
reading        from Blender's data to sources
duplicates     slots that were duplicated in their Action
mode_property  what an object shows of its mode

Each module imports only those above it.
"""
