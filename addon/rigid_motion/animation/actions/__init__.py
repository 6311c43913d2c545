"""Actions: slots, channels, keys and modifiers, and their conversion to sources (arrays with a digest).

marks       the mode and the holder that keys store for the segments they begin
modifiers   F-curve modifiers: this extension's terms, and the animator's own
channels    reading and writing the F-curves of a slot as arrays
slots       the slots that animate objects and bones, and their F-curves
refusals    why rigid motion cannot act on something, and the way out
reading     from Blender's data to sources

Each module imports only those above it.
"""
