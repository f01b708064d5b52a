"""A task of another package as a world: its settings, its world and its registry entry."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from importlib.metadata import version
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from pydantic import BeforeValidator

from conevo.errors import UsageError
from conevo.parameters import parameters
from conevo.playback.drawn import Drawn
from conevo.reading import DamagedFile, parse_toml
from conevo.simulators.actions import Actions
from conevo.simulators.functions import keep
from conevo.simulators.labels import ACTIONS, OwnLabels, labels_in
from conevo.worlds.entry import WorldEntry
from conevo.worlds.measures import Measure
from conevo.worlds.protocol import Scenarios, names_of

if TYPE_CHECKING:
    from conevo.controllers.protocol import Controller
    from conevo.simulators.playing import Epochs, TaskSimulator

__all__ = ["Options", "TaskEntry", "TaskFacts", "TaskParams", "TaskWorld", "need", "versions"]


def _options_text(given: Any) -> Any:
    """Return options in one spelling, "n_agents = 4, share_reward = true"."""
    if isinstance(given, str):
        inside = given.strip().removeprefix("{").removesuffix("}")
        try:
            found = parse_toml(f"options = {{{inside}}}", "options")
        except DamagedFile:
            found = {}
        if found.keys() != {"options"}:  # "a = 1}\nb = {" is none, either
            example = "'n_agents = 4, share_reward = true'"
            raise ValueError(f"must be keyword arguments of the task, as in {example}")
        given = found["options"]
    if not isinstance(given, Mapping):
        return given
    return ", ".join(f"{key} = {_toml(given[key])}" for key in sorted(given))


def _toml(value: Any) -> str:
    """Return a value as TOML in one line."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key} = {_toml(one)}' for key, one in sorted(value.items()))}}}"
    if isinstance(value, bool | int | float | str):
        return json.dumps(value, ensure_ascii=False)
    raise ValueError(f"has a value that is neither text, number nor truth value: {value!r:.60}")


Options = Annotated[str, BeforeValidator(_options_text)]
"""Keyword arguments as the inside of a TOML table; a table is accepted, too."""


@parameters("world")
class TaskParams:
    """Settings that the tasks of all families have."""

    iterations: Annotated[int, Ge(1), Le(100_000)] = 100
    """(iterations) length of an epoch. A task that is done ends earlier."""
    options: Options = ""
    """keyword arguments of the task, as in "n_agents = 3, share_reward = true"."""
    constant_input: bool = True
    """whether robots have one more input that is always 1, so that their bias is evolved."""
    labels: str = ACTIONS
    """the labels of actions, which decide castes: "actions" (the task's actions; of continuous ones
    the largest, with its direction, or rest) or FILE.py:FUNCTION."""
    labels_digest: str = ""
    """digest of a file with labels; a run fills it in and checks it."""

    def __post_init__(self) -> None:
        keep(self, "labels", ACTIONS, labels_in)

    @property
    def keywords(self) -> dict[str, Any]:
        """The options as keyword arguments."""
        found: dict[str, Any] = parse_toml(f"options = {{{self.options}}}", "options")["options"]
        return found

    @cached_property
    def own_labels(self) -> OwnLabels | None:
        """The user's labels, None for the task's own."""
        return None if self.labels == ACTIONS else labels_in(self.labels, self.labels_digest)


@dataclass(frozen=True, eq=False)
class TaskFacts:
    """The facts about a task that are known once it has been made.

    Attributes:
        versions: of the packages that simulate it, "vmas 1.5.2, torch 2.13.0".
        n_robots: R.
        n_inputs: S, of the robot that observes most; what others lack is 0.
        actions: of its robots.
        measures: measures of performance besides the reward.
        heuristics: names of controllers that the package has for it.
        drawn: the drawing of its things, if it has any.
    """

    versions: str
    n_robots: int
    n_inputs: int
    actions: Actions
    measures: tuple[Measure, ...] = ()
    heuristics: tuple[str, ...] = ()
    drawn: Drawn | None = None


@dataclass(frozen=True)
class TaskWorld:
    """A task of another package; a family's own class adds ``facts`` and ``epochs``.

    A robot's fitness is the sum of its rewards, the performance "reward" their mean over robots.
    """

    environment: str
    params: Any = field(default_factory=TaskParams)

    name: ClassVar[str] = ""
    # Choice: weights in [-3, 3]; observations have any scale, and larger weights saturate.
    controller: ClassVar[dict[str, Any]] = {
        "n_hidden": 5,
        "max_hidden": 10,
        "weight_scale": 3.0,
    }

    @cached_property
    def facts(self) -> TaskFacts:
        """The facts about the task.

        Raises:
            UsageError: the task refuses its options, or cannot be played.
        """
        raise NotImplementedError

    def epochs(self, n: int) -> Epochs:
        """Return what plays n epochs side by side."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        _ = self.facts  # a task that cannot be made is refused now

    @property
    def n_robots(self) -> int:
        """Number of robots."""
        return self.facts.n_robots

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of inputs: "observation 0", ..., then the constant one."""
        observed = names_of(("observation",), self.facts.n_inputs)
        return (*observed, "constant") if self.params.constant_input else observed

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of outputs, those of actions."""
        return self.facts.actions.outputs

    @property
    def actions(self) -> tuple[str, ...]:
        """Labels of actions."""
        own: OwnLabels | None = self.params.own_labels
        return self.facts.actions.names if own is None else own.names

    @property
    def castes(self) -> tuple[str, ...]:
        """Labels of actions."""
        return self.actions

    @property
    def performance(self) -> tuple[Measure, ...]:
        """The reward, and other measures of the task."""
        return (Measure("reward"), *self.facts.measures)

    @property
    def heuristics(self) -> tuple[str, ...]:
        """Controllers that are not evolved: nothing, random actions, and those of the package."""
        return ("nothing", "random", *self.facts.heuristics)

    @property
    def drawn(self) -> Drawn:
        """The drawing of the task's things."""
        return self.facts.drawn or Drawn()

    def scenarios(self, keys: Sequence[int]) -> Scenarios:
        """Return one scenario per key; the task draws from the key what it needs."""
        return Scenarios(seed=np.array(keys, dtype=np.uint64))

    def simulator(self, controller: Controller, n_threads: int) -> TaskSimulator:
        """Return the simulator of the task."""
        from conevo.simulators.playing import TaskSimulator

        return TaskSimulator(self, controller, n_threads)

    @property
    def fingerprint(self) -> str:
        """Packages with versions, task, and a digest of its settings."""
        values = asdict(self.params)
        for key in values:
            if values.get(f"{key}_digest"):
                values[key] = ""  # a file counts by its digest
        text = json.dumps(values, sort_keys=True)
        digest = hashlib.blake2b(text.encode(), digest_size=6).hexdigest()
        return f"{self.facts.versions}: {self.environment} {digest}"


@dataclass(frozen=True)
class TaskEntry(WorldEntry):
    """The registry entry of one task, its only environment: "FAMILY:TASK"."""

    def address(self, environment: str) -> str:
        """Return the address of the task, for ``worlds.registry.resolve``."""
        return f"{self.name}:{environment}"


def need(task: str, extra: str, *modules: str) -> None:
    """Raise UsageError if a module is missing that plays a task.

    Args:
        task: "vmas:balance".
        extra: the extra of conevo that installs it.
        modules: that are needed.
    """
    for module in modules:
        if find_spec(module) is None:
            raise UsageError(
                f"{task} needs the package {module}, which is not installed: "
                f"pip install 'conevo[{extra}]'"
            )


def versions(*packages: str) -> str:
    """Return the versions of installed packages, "vmas 1.5.2, torch 2.13.0"."""
    return ", ".join(f"{one} {version(one).partition('+')[0]}" for one in packages)
