"""Keying files without a window: what bake.py and reduce.py do to .blend files and recordings.

planning     lists the inputs and where results go               records     which results came from which input
sessions     runs inputs in parallel, all or nothing each        work        an input, and its outcome
jobs         acts on objects and bones of a .blend file          reductions  settings for reducing keys
baking       replaces modes with keys, and undoes it             reducing    replaces many keys with few
options      defines the options both commands share            recordings  reduces a recording to few keys
blend_files  opens files safely, saves them completely           keyed_files makes .blend files of recordings
gltf_files   reduces the keys of glTF files                     exporting   exports .blend and FBX files as GLB
views        prepares reduced glTF files for a report page
"""
