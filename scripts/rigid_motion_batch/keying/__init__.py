"""Keys in files, without a window: what bake.py and reduce.py do to .blend files and recordings.

planning     which inputs there are, and where results go           records     what was made of what; may it be written
sessions     inputs side by side, each wholly or not at all         work        an input, and what comes of it
jobs         what is done to a .blend file, and to what of it       reductions  how few keys, of what, and how written
baking       keys instead of modes, and back                        reducing    few keys instead of many
options      those that both commands have                          recordings  few keys of a recording
blend_files  opening files safely, saving them whole                keyed_files recordings as files of their own
gltf_files   glTF files with fewer keys                             exporting   .blend and FBX files as GLB files
views        what a page shows of a glTF file that was reduced
"""
