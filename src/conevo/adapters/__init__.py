"""Worlds as environments of other packages: ``pettingzoo``, ``gymnasium``, ``torchrl``, ``benchmarl``.

Each is a module of this folder that is loaded on first use, as its package may not be installed.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["benchmarl", "gymnasium", "pettingzoo", "torchrl"]


def __getattr__(name: str) -> Any:
    """Load an adapter on first use, so that its package is needed only there."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")


def __dir__() -> list[str]:
    return __all__
