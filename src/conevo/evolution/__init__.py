"""Evolution: genotypes and fitness, no world.

Every method has the same three functions. ``init`` returns the first state, ``ask`` the teams to
evaluate, in any way you like, and ``tell`` the next state, given their scores::

    from conevo.evolution import Layout, Scores, method

    mesp = method("mesp", genotypes=20, evaluation="shared")
    state = mesp.init(Layout(n_robots=3, n_hidden=4, max_hidden=8, n_genes=6), root=1)
    while state.progress.generation < 50:
        trials = mesp.ask(state)
        state = mesp.tell(state, trials, my_scores(trials.networks()))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from conevo.evolution.methods.registry import METHODS, MethodEntry, method
    from conevo.evolution.protocol import Layout, Method, Progress, Scores, State, Trials

__all__ = [
    "METHODS",
    "Layout",
    "Method",
    "MethodEntry",
    "Progress",
    "Scores",
    "State",
    "Trials",
    "method",
]

_REGISTRY = ("METHODS", "MethodEntry", "method")


def __getattr__(name: str) -> Any:
    """Load on first use, so that reading the registry's names does not import numpy."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = "methods.registry" if name in _REGISTRY else "protocol"
    return getattr(importlib.import_module(f"{__name__}.{module}"), name)
