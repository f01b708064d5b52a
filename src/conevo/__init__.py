"""Collective Neuro-Evolution: evolve teams of robots that specialize.

One call evolves a team, tests it and keeps everything in one directory::

    import conevo

    run = conevo.evolve("rover/complex-1", method="cone", preset="smoke", seed=1)
    print(run.test_result["champion"]["castes"])

The pieces can be used by hand: a ``method`` asks for scores of teams, which come from a ``world``
(through ``Rollout``) or from a function of your own.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from conevo.controllers.protocol import Controller
    from conevo.controllers.registry import CONTROLLERS, controller
    from conevo.errors import ConevoError, EnvironmentFailure, UsageError
    from conevo.evolution.methods.registry import METHODS, method
    from conevo.evolution.protocol import Layout, Method, Scores, Trials
    from conevo.runs.run import Run
    from conevo.runs.start import evolve
    from conevo.worlds.protocol import World
    from conevo.worlds.registry import WORLDS, world
    from conevo.worlds.rollout import Rollout
    from conevo.worlds.stepper import Stepper

    __version__: str

__all__ = [
    "CONTROLLERS",
    "METHODS",
    "WORLDS",
    "ConevoError",
    "Controller",
    "EnvironmentFailure",
    "Layout",
    "Method",
    "Rollout",
    "Run",
    "Scores",
    "Stepper",
    "Trials",
    "UsageError",
    "World",
    "__version__",
    "controller",
    "evolve",
    "method",
    "world",
]

_HOMES = {
    "CONTROLLERS": "controllers.registry",
    "METHODS": "evolution.methods.registry",
    "WORLDS": "worlds.registry",
    "ConevoError": "errors",
    "Controller": "controllers.protocol",
    "EnvironmentFailure": "errors",
    "Layout": "evolution.protocol",
    "Method": "evolution.protocol",
    "Rollout": "worlds.rollout",
    "Run": "runs.run",
    "Scores": "evolution.protocol",
    "Stepper": "worlds.stepper",
    "Trials": "evolution.protocol",
    "UsageError": "errors",
    "World": "worlds.protocol",
    "controller": "controllers.registry",
    "evolve": "runs.start",
    "method": "evolution.methods.registry",
    "world": "worlds.registry",
}


def __getattr__(name: str) -> Any:
    """Load on first use, so that ``import conevo`` stays fast."""
    if name == "__version__":
        return import_module("conevo.runs.provenance").version("conevo")
    if name == "adapters":  # environments of other packages: conevo.adapters.pettingzoo
        return import_module("conevo.adapters")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
