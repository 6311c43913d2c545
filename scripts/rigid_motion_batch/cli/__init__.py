"""The commands that users run, and the code that starts them."""
