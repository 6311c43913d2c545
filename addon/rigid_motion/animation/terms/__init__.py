"""Terms: the polynomials that Generator modifiers add to F-curves, planned from differences of channel values.

carriers  polynomials as few products of linear factors, accurate in single precision; NumPy alone
planning  the terms that the channels of sources should have; NumPy alone
apply     compares terms with the present modifiers and writes those that differ

Each module imports only those above it.
"""
