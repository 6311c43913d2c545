"""Streaming bodies over a network: senders send only when needed, receivers play back. Needs only NumPy.

A sender knows what its receivers show, a delay behind, and sends only when a joint would leave the tolerance:

    bodies = [StreamBody.rigid("left hand"), StreamBody("performer", joints, parents, rest)]
    sender = Sender(bodies, tolerance=0.005, delay=0.1)
    for datagram in sender.add(time, poses):      # at every sample; poses (joints,), or a Poses for each body's name
        transport.send(datagram)
    if now > sender.next:                         # a sample is overdue: the sender has to go on without it
        sender.poll(now)                          # returns datagrams as well
    for datagram in transport.received():         # if receivers answer, losses cost least
        for reply in sender.take_answer(datagram, now):
            transport.send(reply)
    sender.hold("sword", "performer", "hand")     # from the next sample on, until sender.hold("sword", None)
    sender.join()                                 # names, parents and rest poses for a new receiver, by a reliable way
    sender.finish()                               # what is still needed after the last sample

A receiver takes any bytes from any source without raising an exception, including VMC from other programs:

    receiver = Receiver()
    receiver.take(datagram, arrival, source)      # `arrival` by a clock of this machine; `source` an address or key
    for source, answer in receiver.answers():     # as often as wanted; answers are optional
        transport.send(answer)
    for stream, shown in receiver.show(now).items():
        shown.moment                              # by the sender's clock
        shown.poses["performer"]                  # Poses (joints,), each joint in its parent's space
        shown.held.get("sword")                   # its holder, and its poses there; `poses` has it in world space
        shown.bodies                              # each StreamBody: name, joints, parents, rest
    receiver.complaints()                         # lines about senders with another version of the wire format
    for keys in receiver.keys():                  # received since the last call, for recording
        keys.stream, keys.moments, keys.poses     # (k,) seconds; Poses (joints, k) for each body
        keys.held.get("sword")                    # its holder at each moment, and its poses there

Held objects are sent in the space of the joint that holds them, so they do not slip in the hand, whatever is lost.

Between keys, positions move straight and rotations turn about one axis: `lerp_slerp`, from which `dq_sclerp` hardly
differs. Metres, seconds, Blender's axes, quaternions w, x, y, z. docs/wire.md documents every byte.
"""

from .bodies import StreamBody
from .playing import ReceivedKeys, Shown
from .receiver import Receiver
from .sender import Sender

__all__ = ["ReceivedKeys", "Receiver", "Sender", "Shown", "StreamBody"]
