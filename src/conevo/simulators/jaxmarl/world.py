"""Tasks of JaxMARL, multi-agent environments in jax: "jaxmarl:MPE_simple_spread_v3".

Rutherford et al. 2024, "JaxMARL: Multi-Agent RL Environments and Algorithms in JAX". JaxMARL and
jax are loaded when a task is made, not before.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from conevo.errors import unknown_name
from conevo.simulators.jaxmarl.things import PARTICLES
from conevo.simulators.tasks import TaskEntry, TaskWorld, need
from conevo.simulators.teams import TeamParams

if TYPE_CHECKING:
    from conevo.controllers.protocol import Controller
    from conevo.simulators.jaxmarl.epochs import JaxMarlEpochs
    from conevo.simulators.jaxmarl.facts import JaxMarlFacts
    from conevo.simulators.jaxmarl.simulator import JaxMarlSimulator

__all__ = ["JaxMarlWorld", "TeamParams", "entry"]

FAMILY = "jaxmarl"
CYCLES = {"iterations": 25}  # the length of an epoch in the particle worlds
TEAMS = {
    "MPE_simple_adversary_v3": "agent",
    "MPE_simple_crypto_v3": "alice, bob",
    "MPE_simple_push_v3": "agent",
    "MPE_simple_tag_v3": "adversary",
    "MPE_simple_world_comm_v3": "adversary, leadadversary",
    "MPE_simple_facmac_v1": "adversary",
    "MPE_simple_facmac_3a_v1": "adversary",
    "MPE_simple_facmac_6a_v1": "adversary",
    "MPE_simple_facmac_9a_v1": "adversary",
}


@dataclass(frozen=True)
class JaxMarlWorld(TaskWorld):
    """A task of JaxMARL."""

    name: ClassVar[str] = FAMILY

    @cached_property
    def facts(self) -> JaxMarlFacts:
        """The facts about the task.

        Raises:
            UsageError: the task refuses its options, or cannot be played.
        """
        from conevo.simulators.jaxmarl.facts import facts_of

        return facts_of(self.environment, self.params.options, self.params.team)

    def epochs(self, n: int) -> JaxMarlEpochs:
        """Return what plays n epochs side by side, step by step."""
        from conevo.simulators.jaxmarl.epochs import JaxMarlEpochs

        return JaxMarlEpochs(self, n)

    def simulator(self, controller: Controller, n_threads: int) -> JaxMarlSimulator:
        """Return the simulator of the task, which plays whole epochs in one call."""
        from conevo.simulators.jaxmarl.simulator import JaxMarlSimulator

        return JaxMarlSimulator(self, controller, n_threads)


def entry(task: str) -> TaskEntry:
    """Return the registry entry of a task.

    Raises:
        UsageError: JaxMARL is not installed, or has no such task.
    """
    need(f"{FAMILY}:{task}", FAMILY, "jaxmarl", "jax")
    if task not in (names := _tasks()):
        raise unknown_name("task", task, names, "of JaxMARL, as in jaxmarl:MPE_simple_spread_v3")
    own: dict[str, Any] = CYCLES if task.startswith(PARTICLES) else {}
    team = {"team": TEAMS[task]} if task in TEAMS else {}
    return TaskEntry(
        name=FAMILY,
        title=f"JaxMARL {task}",
        summary=f"task {task} of JaxMARL",
        source="Rutherford et al. 2024",
        environments=(task,),
        defaults={task: own | team},
        params_name="TeamParams",
        world_name="JaxMarlWorld",
        module=__name__,
    )


def _tasks() -> list[str]:
    """Return the names of JaxMARL's tasks: those in its list, which is read and not run."""
    found = find_spec("jaxmarl")
    assert found is not None
    folders = found.submodule_search_locations or ()
    texts = [(Path(folder) / "registration.py").read_text("utf-8") for folder in folders]
    for node in ast.walk(ast.parse("\n".join(texts))):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "registered_envs":
            return sorted(ast.literal_eval(node.value))
    return []
