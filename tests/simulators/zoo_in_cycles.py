"""The task of ``zoo`` with agents that act one after another, each once in a cycle (AEC)."""

from __future__ import annotations

from typing import Any

from pettingzoo.utils.conversions import parallel_to_aec

from simulators.zoo import raw_env

__all__ = ["env", "raw_env"]


def env(**options: Any) -> Any:
    """Return an environment."""
    return parallel_to_aec(raw_env(**options))
