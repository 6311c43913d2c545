from .poses import Poses

__all__ = ["Poses"]
