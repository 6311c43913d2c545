"""Keys in files, without a window: what bake.py and reduce.py do to .blend files and recordings.

sessions     inputs one after another, each wholly or not at all    jobs        what is done to a .blend file
targets      which objects and bones of it are meant                baking      keys instead of modes, and back
reducing     few keys instead of many                               recordings  few keys of a recording
blend_files  opening files safely, saving them whole                keyed_files recordings as files of their own
"""
