"""Reference versions of the modes, each in the algebra it is named after: tests compare the fast forms with them.

Every function takes pairs of poses (n,) and the fraction u (n,) of the way between them, and returns poses. It follows
the paper: encode both poses, interpolate, extract translation and rotation. The code is written to be read, not to be
fast.

Source: Kamarianakis, Lydatakis, Papagiannakis, "Never 'Drop the Ball' in the Operating Room: an efficient hand-based VR
HMD controller interpolation algorithm for collaborative, networked virtual environments".
"""
