"""Tasks with PettingZoo's interface, one environment at a time: "pettingzoo:mpe2.simple_tag_v3".

Terry et al. 2021, "PettingZoo: Gym for Multi-Agent Reinforcement Learning". A task is a module with
a function ``parallel_env``, or ``env`` if all of its agents act in turn. It is loaded and played in
worker processes (``workers``), not here.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib.machinery import ModuleSpec, PathFinder
from importlib.metadata import PackageNotFoundError, packages_distributions
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from conevo.errors import unknown_name
from conevo.simulators.tasks import TaskEntry, TaskWorld, need, versions
from conevo.simulators.teams import TeamFacts, TeamParams

if TYPE_CHECKING:
    from conevo.controllers.protocol import Controller
    from conevo.simulators.pettingzoo.epochs import PettingZooSimulator

__all__ = ["PettingZooWorld", "TeamParams", "entry"]

FAMILY = "pettingzoo"
EXTRAS = {"mpe2": "mpe2", "pettingzoo": "pettingzoo"}  # packages with tasks, and conevo's extras
CYCLES = {"iterations": 25}  # the length of an epoch in the particle worlds
DEFAULTS: dict[str, dict[str, Any]] = {
    "mpe2.simple_adversary_v3": CYCLES | {"team": "agent"},
    "mpe2.simple_push_v3": CYCLES | {"team": "agent"},
    "mpe2.simple_tag_v3": CYCLES | {"team": "adversary"},
    "mpe2.simple_world_comm_v3": CYCLES | {"team": "adversary, leadadversary"},
}


@dataclass(frozen=True)
class PettingZooWorld(TaskWorld):
    """A task with PettingZoo's interface."""

    name: ClassVar[str] = FAMILY

    @cached_property
    def facts(self) -> TeamFacts:
        """The facts about the task.

        Raises:
            UsageError: the task refuses its options, or cannot be played.
        """
        from conevo.simulators.pettingzoo.facts import facts_of

        task = self.environment
        return facts_of(task, self.params.options, self.params.team, versions_of(task))

    def simulator(self, controller: Controller, n_threads: int) -> PettingZooSimulator:
        """Return the simulator of the task, with a worker process for each thread."""
        from conevo.simulators.pettingzoo.epochs import PettingZooSimulator

        return PettingZooSimulator(self, controller, n_threads)


def entry(task: str) -> TaskEntry:
    """Return the registry entry of a task.

    Raises:
        UsageError: a package is not installed, or has no such task.
    """
    full = f"{FAMILY}:{task}"
    package = task.partition(".")[0]
    own = [package] if package in EXTRAS else []
    need(full, EXTRAS.get(package, FAMILY), *own, FAMILY)
    if not _is_module(task):
        known = [name for one in EXTRAS for name in _tasks_of(one)]
        lacking = [one for one in EXTRAS if find_spec(one) is None]
        missing = f" (of {', '.join(lacking)}, which is not installed, none is known)"
        where = f"of PettingZoo, nor a module on PYTHONPATH{missing * bool(lacking)}"
        raise unknown_name("task", task, known, where)
    return TaskEntry(
        name=FAMILY,
        title=f"PettingZoo {task}",
        summary=f"task {task} with PettingZoo's interface",
        source="Terry et al. 2021",
        environments=(task,),
        defaults={task: DEFAULTS.get(task, CYCLES if package == "mpe2" else {})},
        params_name="TeamParams",
        world_name="PettingZooWorld",
        module=__name__,
    )


def versions_of(task: str) -> str:
    """Return the versions of the packages of a task; a digest of its file if it has no version."""
    package = task.partition(".")[0]
    others = versions(*dict.fromkeys((FAMILY, "gymnasium")))
    if package == FAMILY:
        return others
    try:
        return f"{versions(packages_distributions().get(package, [package])[0])}, {others}"
    except PackageNotFoundError:
        found = _spec_of(task)
        assert found is not None
        text = Path(str(found.origin)).read_bytes()
        return f"{package} {hashlib.blake2b(text, digest_size=6).hexdigest()}, {others}"


def _is_module(task: str) -> bool:
    """Return whether a task names a module with a file, not a whole package of tasks."""
    is_standard = task.partition(".")[0] in sys.stdlib_module_names
    found = None if task in EXTRAS or is_standard else _spec_of(task)
    return found is not None and found.has_location


def _spec_of(module: str) -> ModuleSpec | None:
    """Return where a module is, without loading the packages that it is in."""
    parts = module.split(".")
    if not all(part.isidentifier() for part in parts):
        return None
    found = find_spec(parts[0])
    for k in range(2, len(parts) + 1):
        folders = found.submodule_search_locations if found else None
        found = PathFinder.find_spec(".".join(parts[:k]), folders) if folders else None
    return found


def _tasks_of(package: str) -> Iterator[str]:
    """Yield the tasks of a package: modules with a version, as in "simple_tag_v3"."""
    found = find_spec(package)
    for folder in found.submodule_search_locations or () if found else ():
        for file in sorted(Path(folder).rglob("*_v*.py")):
            if file.stem.rpartition("_v")[2].isdigit():
                yield ".".join((package, *file.relative_to(folder).with_suffix("").parts))
