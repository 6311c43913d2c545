"""The paper, reproduced: its figures, its table and its example (`python scripts/research paper`).

parts                        all parts of the reproduction: each writes docs/figures/paper_PART.json
motions                      the clips it is applied to
table                        Table 1, and why a screw wins on some clips and loses on others
sending                      streams that send only when needed, and their bytes
holding                      a tool passed between recorded hands, in the world and in the space of the hand
bodies                       the same study on whole bodies
timing                       the running time of a frame
triangle, strips, catching   the figures, in numbers and drawn

Source: Kamarianakis, Lydatakis, Papagiannakis, "Never 'Drop the Ball' in the Operating Room: an efficient hand-based VR
HMD controller interpolation algorithm for collaborative, networked virtual environments", 2021, arXiv 2107.04875.
"""
