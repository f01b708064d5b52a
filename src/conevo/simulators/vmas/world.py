"""Tasks of VMAS, a vectorized two-dimensional simulator in torch: "vmas:balance".

Bettini et al. 2022, "VMAS: A Vectorized Multi-Agent Simulator for Collective Robot Learning".
VMAS and torch are loaded when a task is made, not before.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from conevo.errors import unknown_name
from conevo.simulators.tasks import TaskEntry, TaskParams, TaskWorld, need

if TYPE_CHECKING:
    from conevo.simulators.vmas.epochs import VmasEpochs
    from conevo.simulators.vmas.facts import VmasFacts

__all__ = ["TaskParams", "VmasWorld", "entry"]

FAMILY = "vmas"


@dataclass(frozen=True)
class VmasWorld(TaskWorld):
    """A scenario of VMAS with continuous actions."""

    name: ClassVar[str] = FAMILY

    @cached_property
    def facts(self) -> VmasFacts:
        """The facts about the task.

        Raises:
            UsageError: the task refuses its options, or cannot be played.
        """
        from conevo.simulators.vmas.facts import facts_of

        return facts_of(self.environment, self.params.options)

    def epochs(self, n: int) -> VmasEpochs:
        """Return what plays n epochs side by side."""
        from conevo.simulators.vmas.epochs import VmasEpochs

        facts = self.facts
        return VmasEpochs(self.environment, self.params.options, facts, n, facts.is_shared)


def entry(task: str) -> TaskEntry:
    """Return the registry entry of a scenario.

    Raises:
        UsageError: VMAS is not installed, or has no such scenario.
    """
    need(f"{FAMILY}:{task}", FAMILY, "vmas", "torch")
    if task not in (names := _scenarios()):
        raise unknown_name("scenario", task, names, "of VMAS, as in vmas:balance")
    return TaskEntry(
        name=FAMILY,
        title=f"VMAS {task}",
        summary=f"scenario {task} of VMAS",
        source="Bettini et al. 2022",
        environments=(task,),
        params_name="TaskParams",
        world_name="VmasWorld",
        module=__name__,
    )


def _scenarios() -> list[str]:
    """Return the names of VMAS' scenarios: of their files, which are not loaded."""
    found = find_spec("vmas")
    assert found is not None
    folders = found.submodule_search_locations or ()
    files = (file for folder in folders for file in Path(folder, "scenarios").rglob("*.py"))
    return sorted(file.stem for file in files if not file.stem.startswith("_"))
