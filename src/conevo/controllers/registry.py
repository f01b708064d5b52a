"""The controllers by name. Reading names, titles and summaries loads neither numpy nor Warp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from conevo.errors import UsageError, unknown_name

if TYPE_CHECKING:
    from conevo.controllers.protocol import Controller, Genome

__all__ = [
    "CONTROLLERS",
    "DEFAULT",
    "ControllerEntry",
    "controller",
    "find",
    "genome_of",
    "refuse_foreign",
    "refuse_misfit",
    "suggested",
]

DEFAULT = "srn"


@dataclass(frozen=True)
class ControllerEntry:
    """One kind of controller.

    Attributes:
        name: its name in commands and files.
        title: its name as published.
        summary: a description in one line.
        source: the publication that describes it.
        target: "module:Class" below this package, loaded when needed.
        remembers_by: settings of which one must be on (not false, not 0) if a robot is to remember
            anything; none of them: it never does; None: it always does.
    """

    name: str
    title: str
    summary: str
    source: str
    target: str
    remembers_by: tuple[str, ...] | None = None

    def remembers(self, settings: Mapping[str, Any]) -> bool:
        """Return whether robots with these settings act on more than their inputs of now."""
        return self.remembers_by is None or any(settings.get(one) for one in self.remembers_by)

    @property
    def settings_class(self) -> type[Any]:
        """The frozen dataclass of its settings, which is the controller."""
        module, _, name = self.target.partition(":")
        return cast("type[Any]", getattr(import_module(f"conevo.controllers.{module}"), name))


CONTROLLERS: dict[str, ControllerEntry] = {
    entry.name: entry
    for entry in (
        ControllerEntry(
            "srn",
            "Simple recurrent network",
            "one hidden layer that sees its own activations of the previous iteration",
            "Elman 1990; Nitschke 2009, sections 3.1, 4.1, 5.2, 6.2.7",
            "srn:Srn",
            ("recurrent",),
        ),
        ControllerEntry(
            "ctrnn",
            "Continuous-time recurrent network",
            "hidden neurons, each with its own time constant",
            "Beer 1995",
            "ctrnn:Ctrnn",
        ),
        ControllerEntry(
            "gru",
            "Gated recurrent unit network",
            "hidden neurons that learn what to keep and what to forget",
            "Cho et al. 2014, section 2.3",
            "gru:Gru",
        ),
        ControllerEntry(
            "graph",
            "Network of any topology",
            "nodes with any connections, feed-forward or recurrent, for methods that evolve them",
            "Stanley and Miikkulainen 2002",
            "graph:Graph",
        ),
        ControllerEntry(
            "thresholds",
            "Response thresholds",
            "tasks, each with a stimulus and a threshold, of which the strongest response wins",
            "Bonabeau et al. 1996; Theraulaz et al. 1998; Nitschke 2009, section 2.2.2",
            "thresholds:ResponseThresholds",
            ("xi", "phi"),
        ),
        ControllerEntry(
            "rules",
            "Classifier system",
            "rules with a condition and an action, of which one acts",
            "Smith 1980; Potter et al. 1995; Nitschke 2009, section 2.2.5",
            "rules:RuleSet",
            (),
        ),
    )
}


def find(name: str) -> ControllerEntry:
    """Return the entry of a name.

    Raises:
        UsageError: no controller has this name.
    """
    if name not in CONTROLLERS:
        raise unknown_name("controller", name, CONTROLLERS)
    return CONTROLLERS[name]


def suggested(name: str, world: Any) -> dict[str, Any]:
    """Return the settings that a world suggests for its controllers, as far as this one has them.

    Args:
        name: of the controller.
        world: a world or its class; its ``controller`` contains the settings.

    Raises:
        UsageError: no such controller, or the world's ``controller`` is not a dict of settings or
            has one that belongs to no controller.
    """
    known = {field.name for field in fields(find(name).settings_class)}
    settings: Mapping[str, Any] = getattr(world, "controller", {})
    if not isinstance(settings, Mapping):
        raise UsageError(
            f"world {world.name}: controller must be a dict of settings, as in {{'n_hidden': 4}}, "
            f"not {settings!r}"
        )
    if others := settings.keys() - known:
        kinds = [entry.settings_class for entry in CONTROLLERS.values()]
        anywhere = {field.name for kind in kinds for field in fields(kind)}
        for key in sorted(others - anywhere):
            raise unknown_name("setting", key, anywhere, f"in the controller of {world.name}")
    return {key: value for key, value in settings.items() if key in known}


def controller(name: str = DEFAULT, world: Any = None, **settings: Any) -> Controller:
    """Return a controller, for example ``controller("srn", n_hidden=4)``.

    Args:
        name: one of ``CONTROLLERS``.
        world: its suggestions apply where ``settings`` has none.
        settings: fields of the controller that differ from their defaults.

    Raises:
        UsageError: an unknown name, an unknown setting or a value that is not allowed.
    """
    base = {} if world is None else suggested(name, world)
    return cast("Controller", find(name).settings_class(**base | settings))


def genome_of(controller: Controller, world: Any) -> Genome:
    """Return the parts of a world's controllers."""
    return controller.genome(len(world.inputs), len(world.outputs))


def refuse_foreign(kind: type[Any], key: str, place: str) -> None:
    """Raise UsageError for a setting that this kind of controller lacks and another one has."""
    own = [field.name for field in fields(kind)]
    if key in own:
        return
    others = [
        one.name
        for one in CONTROLLERS.values()
        if key in {field.name for field in fields(one.settings_class)}
    ]
    if others:
        known = ", ".join(f"controller.{one}" for one in sorted([*own, "name"]))
        raise UsageError(
            f"controller.{key} {place}: {kind.name} has no setting {key!r}; it is one of "
            f"{' and '.join(others)} (known: {known})"
        )


def refuse_misfit(controller: Controller, world: Any) -> None:
    """Raise UsageError if a controller does not fit a world's inputs and outputs."""
    if len(world.outputs) > controller.max_outputs:
        raise UsageError(
            f"controller {controller.name!r} has at most {controller.max_outputs} outputs, and "
            f"{world.name}/{world.environment} has {len(world.outputs)}"
        )
