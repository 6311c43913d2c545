"""Editing paths in the viewport: the tool *Edit Path*, whose handles are the keys on the paths that the overlay draws.

A key is selected here as it is in the Dope Sheet. Each operator is one step of undo.

handles   keys on the screen, and what their channels are in
tool      the tool, its keys, and the operator that takes it
picking   operators that select, insert and delete keys
dragging  operators that move, turn and retime keys
arms      tangents on the screen
tangents  handles by which their speed is set, and paths are bent

proportional  keys around those that are dragged, which follow
"""
