"""The runs of a campaign, gathered into the samples that statements are about."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from conevo.campaigns.plan import levels_of
from conevo.campaigns.tables import Tables
from conevo.report.claims.quantities import QUANTITIES
from conevo.report.claims.statements import Compare, Sample, Within
from conevo.studies.exchange import is_idle
from conevo.studies.repeatability import has_signal

__all__ = ["Evidence", "Gathered", "RunOf", "read_evidence"]

Exchange = tuple[float | None, float | None]


class RunOf(NamedTuple):
    """A run of some method in some environment.

    exchanges, exchange_share: as in the table of runs; None of methods that never exchange.
    reliability: of a genotype's fitness by the method's scheme, in the first or the last
    populations, whichever is larger; 0 if all had the same fitness; None without a study of signal.
    """

    run: str
    seed: int
    budget: str
    exchanges: float | None = None
    exchange_share: float | None = None
    reliability: float | None = None


Valued = tuple[RunOf, float]  # a run, and the quantity in question


@dataclass(frozen=True)
class Gathered:
    """The samples of a statement.

    Attributes:
        samples: run values of each sample of the statement.
        present: environments that all samples have runs in.
        budgets: of these runs.
        exchange: pairs of sub-populations that recombined between populations in a generation, and
            of those that could have; of the sample with the least, None if no sample's runs could.
        reliability: mean of the sample with the least signal, None if no sample has studies of it.
    """

    samples: tuple[list[float], ...]
    present: frozenset[str]
    budgets: frozenset[str]
    exchange: Exchange = (None, None)
    reliability: float | None = None

    @property
    def is_blind(self) -> bool:
        """Whether selection by a sample's methods was nearly blind."""
        return self.reliability is not None and not has_signal(self.reliability)

    @property
    def is_idle(self) -> bool:
        """Whether a sample is of methods that exchange between populations, and hardly did."""
        return is_idle(*self.exchange)


@dataclass
class Evidence:
    """Runs of one world, preset and variant.

    Runs of different budgets are never compared in an environment. Choice: if all compared methods
    share several budgets, the one with the most runs is taken. Choice: between environments budgets
    may differ if no other runs exist, as between those evolved directly and those learned in stages
    (6.4.2). Choice: the latter are also compared in one environment if the claim is about it, each
    with its own budget.

    Attributes:
        world, preset, variant: of all its runs; the world with its version.
        read: returns a quantity by run, for all runs of the campaign.
        runs: by environment and method.
    """

    world: str
    preset: str
    variant: str
    read: Callable[[str], Mapping[str, float]]
    runs: dict[tuple[str, str], list[RunOf]] = field(default_factory=dict)

    def has_runs(self, method: str, environment: str) -> bool:
        """Whether any run exists, with or without the quantity in question."""
        return (environment, method) in self.runs

    def gather(self, statement: Compare | Within) -> Gathered:
        """Return the runs that a statement is about."""
        if isinstance(statement, Compare):
            return self._gather_two(statement.a, statement.b)
        return self._gather_one(statement.sample)

    def _gather_two(self, a: Sample, b: Sample) -> Gathered:
        taken: tuple[list[Valued], list[Valued]] = ([], [])
        present: set[str] = set()
        budgets: set[str] = set()
        are_apart = all(QUANTITIES[one.quantity].is_apart for one in (a, b))
        for here, there in zip(a.environments, b.environments, strict=True):
            of_a, of_b = self.by_budget(a, here), self.by_budget(b, there)
            common = sorted(of_a.keys() & of_b.keys())
            if common:
                chosen_a = chosen_b = max(
                    common, key=lambda budget: min(len(of_a[budget]), len(of_b[budget]))
                )
            elif (here != there or are_apart) and of_a and of_b:
                chosen_a, chosen_b = _usual(of_a), _usual(of_b)
            else:
                continue
            taken[0].extend(of_a[chosen_a])
            taken[1].extend(of_b[chosen_b])
            present |= {here, there}
            budgets |= {chosen_a, chosen_b}
        values = tuple([value for _, value in own] for own in taken)
        return _gathered((a, b), taken, values, present, budgets)

    def _gather_one(self, sample: Sample) -> Gathered:
        """Return the runs of a sample.

        Choice: a mean over environments is taken seed by seed, and the seeds are the sample: the
        stages of a team that learned the environments in turn are not independent runs. A seed
        without one of the environments is left out.
        """
        found = {place: self.by_budget(sample, place) for place in sample.environments}
        chosen = {place: _usual(of) for place, of in found.items() if of}
        taken = [one for place, budget in chosen.items() for one in found[place][budget]]
        if QUANTITIES[sample.quantity].is_share:
            flat = [value for _, value in taken]
        else:
            by_seed: dict[int, list[float]] = defaultdict(list)
            for run, value in taken:
                by_seed[run.seed].append(value)
            flat = [
                math.fsum(own) / len(own)
                for _, own in sorted(by_seed.items())
                if len(own) == len(chosen)
            ]
        return _gathered((sample,), (taken,), (flat,), chosen, chosen.values())

    def by_budget(self, sample: Sample, environment: str) -> dict[str, list[Valued]]:
        """Return the runs of a sample in one environment with their values, by budget."""
        values = self.read(sample.quantity)
        found: dict[str, list[Valued]] = defaultdict(list)
        for method in sample.methods:
            for one in self.runs.get((environment, method), ()):
                if one.run in values:
                    found[one.budget].append((one, values[one.run]))
        return dict(found)


def _gathered(
    samples: Sequence[Sample],
    taken: Sequence[Sequence[Valued]],
    values: tuple[list[float], ...],
    present: Iterable[str],
    budgets: Iterable[str],
) -> Gathered:
    """Return samples with the least that one of them exchanged, and the least of their signals."""
    runs = [[run for run, _ in own] for own in taken]
    made = [_exchange(*pair) for pair in zip(samples, runs, strict=True)]
    measured = [_reliability(*pair) for pair in zip(samples, runs, strict=True)]
    return Gathered(
        values,
        frozenset(present),
        frozenset(budgets),
        min((one for one in made if one[0] is not None), default=(None, None)),
        min((one for one in measured if one is not None), default=None),
    )


def read_evidence(tables: Tables) -> list[Evidence]:
    """Return the runs of a campaign, separated by world, preset and variant, in this order.

    Their quantities are read from the tables when they are asked for.
    """
    read: dict[str, Mapping[str, float]] = {}

    def cached(quantity: str) -> Mapping[str, float]:
        if quantity not in read:
            read[quantity] = QUANTITIES[quantity].read(tables)
        return read[quantity]

    _, rows = tables.query(
        "SELECT world, preset, variant, environment, method, run, seed, budget, exchanges,"
        " exchange_share, reliability FROM runs JOIN budgets USING (run) LEFT JOIN"
        " (SELECT run, max(coalesce(icc_of_scheme, 0)) AS reliability FROM signal"
        " GROUP BY run) USING (run) ORDER BY ALL"
    )
    variants: dict[tuple[str, str], dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for world, preset, variant, _, method, *_ in rows:
        variants[world, preset][method].add(variant)
    groups: dict[tuple[str, str, str], Evidence] = {}
    for world, preset, variant, environment, method, *about in rows:
        for whole in _joined(variant, method, variants[world, preset]):
            key = (world, preset, whole)
            group = groups.setdefault(key, Evidence(*key, cached))
            group.runs.setdefault((environment, method), []).append(RunOf(*about))
    return [groups[key] for key in sorted(groups)]


def _joined(variant: str, method: str, variants: Mapping[str, set[str]]) -> list[str]:
    """Return the variants with whose runs those of a method are judged.

    A factor may apply to some methods only; the others' runs go with each of its levels.

    Args:
        variant: of the runs.
        method: of the runs.
        variants: that each method has runs of.
    """
    own = levels_of(variant).items()
    others = set().union(*(some for name, some in variants.items() if name != method))
    longer = [one for one in others - variants[method] if own < levels_of(one).items()]
    return sorted(longer) + ([variant] if variant in others or not longer else [])


def _exchange(sample: Sample, runs: Sequence[RunOf]) -> Exchange:
    """Return what runs exchanged between populations, in the mean; nothing unless all could."""
    if not QUANTITIES[sample.quantity].needs_exchange:
        return None, None
    made = _mean_of_all([one.exchanges for one in runs])
    share = _mean_of_all([one.exchange_share for one in runs])
    return (None, None) if made is None or share is None else (made, share)


def _reliability(sample: Sample, runs: Sequence[RunOf]) -> float | None:
    """Return the mean reliability of fitness in runs; None unless all have a study of it."""
    if not QUANTITIES[sample.quantity].needs_signal:
        return None
    return _mean_of_all([one.reliability for one in runs])


def _mean_of_all(values: Sequence[float | None]) -> float | None:
    """Return the mean of values; None without any, or if one is missing."""
    known = [value for value in values if value is not None]
    return math.fsum(known) / len(known) if known and len(known) == len(values) else None


def _usual(of: Mapping[str, list[Valued]]) -> str:
    """Return the budget with the most runs; ties go to the first by name."""
    return max(sorted(of), key=lambda budget: len(of[budget]))
