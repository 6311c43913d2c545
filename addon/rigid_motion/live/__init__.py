"""Live motion over a network: receives bodies, shows and records them in Blender, and sends objects. No interface.

sockets      the only module that opens sockets, for commands too
driving      moves objects and bones by the joints of bodies
recording    turns received samples into keys, in the hands that held them
ticking      the timer of the next two modules
receiving    listens, shows and records
sending      sends rigs and objects

Nothing listens or sends until an operator asks for it. Each module imports only those above it.
"""
