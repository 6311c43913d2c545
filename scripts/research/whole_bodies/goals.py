"""Goals: what was hoped for, met or missed."""

from __future__ import annotations


def verdict(is_met: bool) -> str:
    return "met" if is_met else "**missed**"
