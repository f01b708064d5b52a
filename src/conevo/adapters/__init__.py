"""Worlds as environments of PettingZoo, Gymnasium, TorchRL and BenchMARL.

Each package has a module of its name in this folder. It is loaded on first use, as the package may
not be installed.
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
