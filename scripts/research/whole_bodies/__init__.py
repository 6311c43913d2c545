"""What key reduction leaves of whole bodies, beside others: a section of the page of `scripts/reduction`.

rigs        bodies as Blender imports them      against_greedy      key poses beside greedy insertion
bodies      their motion, and what keys show    against_decimate    keys beside Blender's Decimate
feet        what becomes of standing feet       against_published   beside figures that others have published
optimum     the fewest key poses there can be   timing              seconds
goals       met or missed                       section             all of it, as lines of Markdown
"""
