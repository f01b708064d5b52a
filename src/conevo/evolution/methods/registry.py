"""The methods by name. Reading names, titles and summaries loads no numpy."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from conevo.errors import unknown_name

if TYPE_CHECKING:
    from conevo.evolution.protocol import Method

__all__ = ["METHODS", "MethodEntry", "method"]


@dataclass(frozen=True)
class MethodEntry:
    """One method.

    Attributes:
        name: how it is asked for.
        title: its name as published.
        summary: one line on what it does.
        source: where it is described.
        target: "module:Class:Config" below this package, loaded when needed.
    """

    name: str
    title: str
    summary: str
    source: str
    target: str

    @property
    def config_class(self) -> type[Any]:
        """The dataclass of its parameters; it refuses what they do not allow."""
        from conevo.parameters import checked

        return checked(self._load(2), "method")

    def build(self, config: Any) -> Method:
        """Return the method with the given parameters, an instance of ``config_class``."""
        return cast("Method", self._load(1)(config=config, name=self.name, title=self.title))

    def _load(self, part: int) -> Any:
        parts = self.target.split(":")
        module = importlib.import_module(f"conevo.evolution.methods.{parts[0]}")
        return getattr(module, parts[part])


METHODS: dict[str, MethodEntry] = {
    entry.name: entry
    for entry in (
        MethodEntry(
            "homcne",
            "HomCNE",
            "one population of whole networks, a team of clones",
            "Nitschke 2009, sections 2.3.1, 5.3.3",
            "homcne:HomCne:HomCneConfig",
        ),
        MethodEntry(
            "hetcne",
            "HetCNE",
            "one population of whole networks, a team of different genotypes",
            "Nitschke 2009, sections 2.3.1, 5.3.3",
            "hetcne:HetCne:HetCneConfig",
        ),
        MethodEntry(
            "ccga",
            "CCGA",
            "a population of whole networks per robot, genetically isolated",
            "Potter and De Jong 2000; Nitschke 2009, sections 2.3.3, 5.3.3",
            "ccga:Ccga:CcgaConfig",
        ),
        MethodEntry(
            "mesp",
            "Multi-Agent ESP",
            "a population per robot, a sub-population per hidden neuron",
            "Yong and Miikkulainen 2009; Nitschke 2009, sections 2.3.3, 5.3.3",
            "mesp:Mesp:MespConfig",
        ),
        MethodEntry(
            "cone",
            "CONE",
            "MESP with recombination between populations that behave and look alike",
            "Nitschke 2009, chapter 3",
            "cone:Cone:ConeConfig",
        ),
        MethodEntry(
            "cone-1",
            "CONE-1",
            "CONE without the genotype difference metric",
            "Nitschke 2009, sections 4.5.7, 5.5.5, 6.5.6",
            "cone:Cone:Cone1Config",
        ),
        MethodEntry(
            "cone-2",
            "CONE-2",
            "CONE without the specialization difference metric",
            "Nitschke 2009, sections 4.5.7, 5.5.5, 6.5.6",
            "cone:Cone:Cone2Config",
        ),
        MethodEntry(
            "cone-3",
            "CONE-3",
            "CONE without both metrics: no recombination between populations",
            "Nitschke 2009, sections 4.5.7, 5.5.5, 6.5.6",
            "cone:Cone:Cone3Config",
        ),
    )
}


def method(name: str, **config: Any) -> Method:
    """Return a method by name, e.g. ``method("cone", genotypes=20, evaluation="shared")``.

    Args:
        name: one of ``METHODS``.
        config: fields of its config class that differ from their defaults.

    Raises:
        UsageError: an unknown name, an unknown parameter or a value that is not allowed.
    """
    if name not in METHODS:
        raise unknown_name("method", name, METHODS)
    entry = METHODS[name]
    return entry.build(entry.config_class(**config))
