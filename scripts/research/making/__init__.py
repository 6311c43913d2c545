"""Makers of the assets: human motions, the device that records them, and models as meshes."""
