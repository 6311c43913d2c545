"""Bodies that come over a network, in Blender's viewport: heard, shown, recorded as keys; and sent. No user interface.

sockets      the only module that opens one; of commands as well
driving      from bodies to objects and bones, by which joint is which
recording    from what came to keys, in the hands that held it
ticking      the timer of the two that follow
receiving    what listens, and what becomes of what comes
sending      what goes out

Nothing listens or sends until an operator asks for it. Each module imports only those above it.
"""
