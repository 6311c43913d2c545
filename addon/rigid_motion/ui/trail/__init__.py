"""Editing of motion paths in the viewport: the tool *Edit Path*, with the keys on the overlay's paths as handles.

Keys are selected here as in the Dope Sheet. Each operator is one undo step.

handles   keys on the screen, and the space of their channels
tool      the tool, its keymap, and the operator that activates it
picking   operators that select, insert and delete keys
dragging  operators that move, rotate and retime keys
arms      tangents on the screen
tangents  tangent handles that set the speed, and bend paths

proportional  neighbours of dragged keys, which follow them
"""
