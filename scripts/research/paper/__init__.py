"""The paper, reproduced: its figures, its table and its example, from this program (`scripts/research paper`).

triangle, strips, catching   the figures that Blender renders, on the sheets of picture
engines                      the sequence diagram
table, bows                  Table 1, and why a screw wins here and loses there
timing                       the running time of a frame
bandwidths                   the example of the text: bytes a second
bodies, bodies_section       the same study on whole bodies, and the section on it
claims, motions              what the paper says, and the clips that it is tried on
steps, body_steps            all of it as a work plan, from files (rows) to files
results, wording, page       the page, from those files alone

Source: Kamarianakis, Lydatakis, Papagiannakis, "Never 'Drop the Ball' in the Operating Room: an efficient hand-based VR
HMD controller interpolation algorithm for collaborative, networked virtual environments", 2021, arXiv 2107.04875.
"""
