"""The modes written out in the algebra each is named after: what they mean, and what the fast forms are tested against.

Every module has poses in, poses out, for pairs of poses (n,) and the share u (n,) of the way between them, and goes the
way of the paper: encode both poses, interpolate, extract translation and rotation. Made to be read, not to be fast.

Source: Kamarianakis, Lydatakis, Papagiannakis, "Never 'Drop the Ball' in the Operating Room: an efficient hand-based VR
HMD controller interpolation algorithm for collaborative, networked virtual environments".
"""
