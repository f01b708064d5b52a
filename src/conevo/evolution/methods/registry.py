"""The methods by name. Reading names, titles and summaries loads no numpy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError, unknown_name
from conevo.evolution.methods.entry import MethodEntry

if TYPE_CHECKING:
    from conevo.evolution.protocol import Method

__all__ = ["METHODS", "MethodEntry", "method", "name_in", "remember_title", "resolve", "title_of"]


METHODS: dict[str, MethodEntry] = {
    entry.name: entry
    for entry in (
        MethodEntry(
            name="homcne",
            title="HomCNE",
            summary="one population of whole networks, a team of clones",
            source="Nitschke 2009, sections 2.3.1, 5.3.3",
            module="conevo.evolution.methods.homcne",
            config_name="HomCneConfig",
            method_name="HomCne",
        ),
        MethodEntry(
            name="hetcne",
            title="HetCNE",
            summary="one population of whole networks, a team of different genotypes",
            source="Nitschke 2009, sections 2.3.1, 5.3.3",
            module="conevo.evolution.methods.hetcne",
            config_name="HetCneConfig",
            method_name="HetCne",
        ),
        MethodEntry(
            name="ccga",
            title="CCGA",
            summary="a population of whole networks per robot, genetically isolated",
            source="Potter and De Jong 2000; Nitschke 2009, sections 2.3.3, 5.3.3",
            module="conevo.evolution.methods.ccga",
            config_name="CcgaConfig",
            method_name="Ccga",
        ),
        MethodEntry(
            name="mesp",
            title="Multi-Agent ESP",
            summary="a population per robot, a sub-population per hidden neuron",
            source="Yong and Miikkulainen 2009; Nitschke 2009, sections 2.3.3, 5.3.3",
            module="conevo.evolution.methods.mesp",
            config_name="MespConfig",
            method_name="Mesp",
        ),
        MethodEntry(
            name="cone",
            title="CONE",
            summary="MESP with recombination between populations that behave and look alike",
            source="Nitschke 2009, chapter 3",
            module="conevo.evolution.methods.cone",
            config_name="ConeConfig",
            method_name="Cone",
        ),
        MethodEntry(
            name="cone-1",
            title="CONE-1",
            summary="CONE without the genotype difference metric",
            source="Nitschke 2009, sections 4.5.7, 5.5.5, 6.5.6",
            module="conevo.evolution.methods.cone",
            config_name="Cone1Config",
            method_name="Cone",
        ),
        MethodEntry(
            name="cone-2",
            title="CONE-2",
            summary="CONE without the specialization difference metric",
            source="Nitschke 2009, sections 4.5.7, 5.5.5, 6.5.6",
            module="conevo.evolution.methods.cone",
            config_name="Cone2Config",
            method_name="Cone",
        ),
        MethodEntry(
            name="cone-3",
            title="CONE-3",
            summary="CONE without both metrics: no recombination between populations",
            source="Nitschke 2009, sections 4.5.7, 5.5.5, 6.5.6",
            module="conevo.evolution.methods.cone",
            config_name="Cone3Config",
            method_name="Cone",
        ),
        MethodEntry(
            name="cone-es",
            title="CONE-ES",
            summary="an evolution strategy of one shared controller and of each robot's deviation",
            source="conevo's own, after Nitschke 2009, chapter 3, and Salimans et al. 2017",
            module="conevo.evolution.methods.cone_es",
            config_name="ConeEsConfig",
            method_name="ConeEs",
        ),
        MethodEntry(
            name="hom-es",
            title="HomES",
            summary="one shared controller only: an evolution strategy over teams of clones",
            source="conevo's own, after Salimans et al. 2017",
            module="conevo.evolution.methods.cone_es",
            config_name="HomEsConfig",
            method_name="ConeEs",
        ),
        MethodEntry(
            name="esp",
            title="ESP",
            summary="a sub-population per hidden neuron of one network, bursts on stagnation",
            source="Gomez and Miikkulainen 1997, 1999; Nitschke 2009, section 2.3.3",
            module="conevo.evolution.methods.esp",
            config_name="EspConfig",
            method_name="Esp",
        ),
        MethodEntry(
            name="sane",
            title="SANE",
            summary="one population of neurons and one of blueprints, which are lists of neurons",
            source="Moriarty and Miikkulainen 1996, 1997; Nitschke 2009, section 2.3.3",
            module="conevo.evolution.methods.sane",
            config_name="SaneConfig",
            method_name="Sane",
        ),
        MethodEntry(
            name="cosyne",
            title="CoSyNE",
            summary="a sub-population per connection weight of one network, permuted by fitness",
            source="Gomez, Schmidhuber and Miikkulainen 2008",
            module="conevo.evolution.methods.cosyne",
            config_name="CosyneConfig",
            method_name="Cosyne",
        ),
        MethodEntry(
            name="neat",
            title="NEAT",
            summary="networks that start minimal and grow, in species; clones or whole teams",
            source="Stanley and Miikkulainen 2002",
            module="conevo.evolution.methods.neat",
            config_name="NeatConfig",
            method_name="Neat",
            controllers=("graph",),
        ),
        MethodEntry(
            name="hyperneat",
            title="HyperNEAT",
            summary="NEAT evolves functions of geometry that give the weights of a team's networks",
            source="Stanley, D'Ambrosio and Gauci 2009; D'Ambrosio and Stanley 2008",
            module="conevo.evolution.methods.hyperneat",
            config_name="HyperNeatConfig",
            method_name="HyperNeat",
            controllers=("srn",),
        ),
        MethodEntry(
            name="openai-es",
            title="OpenAI-ES",
            summary="an evolution strategy by the gradient of ranks: clones, a whole team, robots",
            source="Salimans et al. 2017",
            module="conevo.evolution.methods.openai_es",
            config_name="OpenAiEsConfig",
            method_name="OpenAiEs",
        ),
        MethodEntry(
            name="cma-es",
            title="CMA-ES",
            summary="an evolution strategy that adapts a covariance matrix: clones or a whole team",
            source="Hansen 2016; Ros and Hansen 2008",
            module="conevo.evolution.methods.cma_es",
            config_name="CmaEsConfig",
            method_name="CmaEs",
        ),
        MethodEntry(
            name="novelty",
            title="Novelty search",
            summary="selects teams that behave as none has before, whatever their fitness",
            source="Lehman and Stanley 2011",
            module="conevo.evolution.methods.novelty",
            config_name="NoveltyConfig",
            method_name="Novelty",
        ),
        MethodEntry(
            name="map-elites",
            title="MAP-Elites",
            summary="keeps the fittest team of each behaviour, and varies these elites",
            source="Mouret and Clune 2015; Vassiliades and Mouret 2018",
            module="conevo.evolution.methods.map_elites",
            config_name="MapElitesConfig",
            method_name="MapElites",
        ),
        MethodEntry(
            name="hyb-ccea",
            title="Hyb-CCEA",
            summary="CCGA whose populations merge if their robots behave alike, and split again",
            source="Gomes, Mariano and Christensen 2015, 2018; Nitschke 2009, section 7.2",
            module="conevo.evolution.methods.hyb_ccea",
            config_name="HybCceaConfig",
            method_name="HybCcea",
        ),
    )
}


def name_in(address: str) -> str:
    """Return the name of a method: "team-es" of "FILE.py:team-es", "cone" of "cone"."""
    return address.rpartition(":")[2] if ".py:" in address else address


_TITLES: dict[str, str] = {}  # of methods in files, from the files and runs that have been read


def title_of(name: str) -> str:
    """Return a method's name as published; its plain name if its title has not been read."""
    return METHODS[name].title if name in METHODS else _TITLES.get(name, name)


def remember_title(name: str, title: str) -> None:
    """Remember the title of a method in a file."""
    _TITLES[name] = title


def resolve(name: str, digest: str = "") -> MethodEntry:
    """Return the entry of a method.

    Args:
        name: one of ``METHODS``, or "FILE.py:NAME" for a method in a file outside the package.
        digest: of that file, checked if it is given.

    Raises:
        UsageError: no such method; a file without a method, or one that has changed.
    """
    file, _, own = name.rpartition(":")
    if name.endswith(".py"):
        file, own = name, ""
    if not file.endswith(".py"):
        if file or ".py/" in name:
            raise UsageError(f"method {name!r}: a method in a file is named FILE.py:NAME")
        if name not in METHODS:
            raise unknown_name("method", name, METHODS)
        if digest:
            raise UsageError(f"run.method_digest belongs to a method in a file, not to {name!r}")
        return METHODS[name]
    from conevo.evolution.methods.outside import load

    entry = load(Path(file), digest)
    if entry.name in METHODS:
        raise UsageError(
            f"method file {file}: its name {entry.name!r} is that of a method of the package"
        )
    if own != entry.name:
        raise UsageError(f"method {name!r}: the method in this file is {file}:{entry.name}")
    remember_title(entry.name, entry.title)
    return entry


def method(name: str, **config: Any) -> Method:
    """Return a method by name, e.g. ``method("cone", genotypes=20, evaluation="shared")``.

    Args:
        name: one that ``resolve`` knows: "cone", or "FILE.py:NAME".
        config: fields of its config class that differ from their defaults.

    Raises:
        UsageError: an unknown name, an unknown parameter or a value that is not allowed.
    """
    entry = resolve(name)
    return entry.build(entry.config_class(**config))
