"""Other keys for the same motion, and the way back.

bake        real keys for every frame                   reducing    the few keys that a recording needs
originals   what there was before either
"""
