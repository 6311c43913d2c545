"""What Actions hold: slots, channels, keys, modes; read into sources, which are arrays with a digest.

slots       what moves something, by which F-curves     channels    the F-curves of a slot, written and read as arrays
reading     from Blender's data to sources              sources     what is keyed, as arrays
records     what an Action keeps: mode and digest       mode_property   what an object shows of that
renaming    records of bones that were renamed      duplicates  slots that were duplicated in their Action
refusals    why rigid motion cannot act on something, and the way out
"""
