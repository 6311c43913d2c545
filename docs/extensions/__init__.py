"""Sphinx extensions of this site, one per module."""
