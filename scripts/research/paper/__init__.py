"""The paper, reproduced: its figures, its table and its example, from this program (`python scripts/research paper`).

parts                        all of it, part by part: each writes docs/figures/paper_PART.json
motions                      the clips that it is tried on
table                        Table 1, and why a screw wins here and loses there
sending                      streams that are sent when needed, and bytes
holding                      a tool that recorded hands pass on, in the world and in the space of the hand
bodies                       the same study on whole bodies
timing                       the running time of a frame
triangle, strips, catching   the figures, in numbers and drawn

Source: Kamarianakis, Lydatakis, Papagiannakis, "Never 'Drop the Ball' in the Operating Room: an efficient hand-based VR
HMD controller interpolation algorithm for collaborative, networked virtual environments", 2021, arXiv 2107.04875.
"""
