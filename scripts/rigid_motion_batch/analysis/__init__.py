"""Analysis of recordings: clips, choices of keys, what each mode reconstructs from the keys, and its errors."""
