"""Bodies over a network: what is sent when it is needed, and what is shown of it. NumPy and the standard library alone.

A sender knows what its receivers show, a delay behind, and says something only when a joint would leave the tolerance:

    sender = Sender([Body.rigid("left hand"), Body("performer", joints, parents, rest)], tolerance=0.005, delay=0.1)
    for datagram in sender.add(time, poses):      # at every sample; poses (joints,), or a Poses for each body's name
        transport.send(datagram)
    if now > sender.next:                         # a sample is overdue: what there is has to be said without it
        sender.poll(now)
    for datagram in transport.received():         # where receivers answer: what is lost then costs least
        for reply in sender.hear(datagram, now):
            transport.send(reply)
    sender.hold("sword", "performer", "hand")     # from the next sample on, until sender.hold("sword", None)
    sender.join()                                 # names, parents and rest for somebody who joins, by a reliable way
    sender.finish()                               # what is still needed where no more samples are to come

A receiver takes any bytes, from anybody, without ever raising an exception, and other programs' VMC as well:

    receiver = Receiver()
    receiver.take(datagram, arrival, source)      # `arrival` by a clock of this machine; `source` an address or key
    for source, answer in receiver.answers():     # as often as one likes to answer; not at all is fine, too
        transport.send(answer)
    for stream, shown in receiver.show(now).items():
        shown.moment                              # of the sender's time
        shown.poses["performer"]                  # Poses (joints,), each joint in its parent's space
        shown.held.get("sword")                   # who holds it, and its poses there; above it is in the world
        shown.bodies                              # each Body: name, joints, parents, rest
    receiver.complaints()                         # lines on who sends another version of the wire
    for keys in receiver.keys():                  # since the last call: what was sent, to be recorded
        keys.stream, keys.moments, keys.poses     # (k,) seconds; of each body Poses (joints, k)
        keys.held.get("sword")                    # who holds it at each, and its poses there

What is held is sent in the space of the joint that holds it, and does not slip in the hand, whatever is lost.

Between keys, places go straight and turns about one axis: `lerp_slerp`, and `dq_sclerp` hardly differs. Metres,
seconds, Blender's axes, quaternions w, x, y, z. docs/wire.md has every byte.
"""

from .bodies import StreamBody
from .playing import ReceivedKeys, Shown
from .receiver import Receiver
from .sender import Sender

__all__ = ["ReceivedKeys", "Receiver", "Sender", "Shown", "StreamBody"]
