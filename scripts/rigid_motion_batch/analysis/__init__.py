"""From recordings to numbers: clips, choices of keys, what each mode makes of them, and how far off that is."""
