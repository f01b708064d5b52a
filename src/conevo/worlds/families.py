"""Tasks of other packages, "vmas:balance": the families that are known, and what is one of them."""

from __future__ import annotations

__all__ = ["FAMILIES", "is_task"]

# The module that makes the entry of each task of a family (conevo.simulators).
FAMILIES = {
    "jaxmarl": "conevo.simulators.jaxmarl.world",
    "pettingzoo": "conevo.simulators.pettingzoo.world",
    "vmas": "conevo.simulators.vmas.world",
}


def is_task(path: str) -> bool:
    """Return whether a world's path names a task of another package."""
    family, colon, _ = path.partition(":")
    return bool(colon) and family in FAMILIES
