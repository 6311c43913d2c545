"""From differences to terms, which are what Generator modifiers add to F-curves.

carriers  polynomials as the fewest products of linear factors that single precision follows
planning  the terms that the channels of sources should have; NumPy alone, as carriers
apply     terms and the modifiers that there are: what differs is written

Each module imports only those above it.
"""
