"""What the runs of a campaign say about the quantities that claims are about: one value per run."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from conevo.analysis.claims.statements import Compare, Sample, Within
from conevo.analysis.comparison import levels_of
from conevo.analysis.exchange import is_idle
from conevo.analysis.frames import Tables

__all__ = ["QUANTITIES", "Evidence", "Gathered", "Quantity", "RunOf", "read_evidence"]

PLAYED = """
    WITH played AS (
        SELECT s.run, s.team, avg(s.value) AS value
        FROM scores s JOIN runs r USING (run)
        WHERE s.study = '{study}' AND s.measure = r.measure AND s.value IS NOT NULL
        GROUP BY s.run, s.team
    )
"""
LESIONED = (
    PLAYED.format(study="lesion")
    + """
    SELECT whole.run, {value}
    FROM played whole JOIN played lesioned USING (run)
    WHERE whole.team = 'whole' AND lesioned.team <> 'whole'
    GROUP BY whole.run
"""
)
CLONED = PLAYED.format(study="clones") + "SELECT run, max(value) FROM played WHERE team NOT IN "
COMPLEMENTARY = (
    PLAYED.format(study="clones")
    + """
    SELECT run, value FROM played WHERE team = 'whole' AND run IN (
        SELECT run FROM behaviours
        WHERE kind = 'individual' AND behaviour <> 'non-specialized' AND count > 0
        GROUP BY run HAVING count(DISTINCT behaviour) >= 2
    )
"""
)
SEEN = """
    SELECT run, bool_or(kind = '{kind}' AND behaviour = '{behaviour}' AND count > 0)::INTEGER
    FROM behaviours GROUP BY run
"""
CASTES = "SELECT run, ({condition})::INTEGER FROM robots GROUP BY run"
SEVERAL_CASTES = (
    "bool_or(caste = 'non-specialized') AND "
    "count(DISTINCT caste) FILTER (WHERE caste NOT IN ('non-specialized', 'move')) >= 2"
)
LOSS = "avg((whole.value - lesioned.value) / nullif(greatest(whole.value, lesioned.value), 0))"

Exchange = tuple[float | None, float | None]
OF_ONE_ROBOT = ("clones", "clones of a specialist")  # whatever its population exchanged

Reading = Callable[[Tables], dict[str, float]]


@dataclass(frozen=True)
class Quantity:
    """Something that is known of a run.

    Attributes:
        read: returns it by run, of the runs that have it.
        lacks: what a run without it lacks, in words.
        is_share: 1 if something was seen in the run, else 0.
    """

    read: Reading
    lacks: str
    is_share: bool = False


def _performance(measure: str | None, study: str, team: str) -> Reading:
    return lambda tables: {one.run: one.value for one in tables.values(measure, study, team)}


def _query(sql: str) -> Reading:
    return lambda tables: {
        run: float(value)
        for run, value in tables.query(sql)[1]
        if value is not None and math.isfinite(value)
    }


def _tested(measure: str) -> Quantity:
    return Quantity(_performance(measure, "test", "champion"), "no testing phase")


def _share(tables: Tables) -> dict[str, float]:
    return {one.run: one.value / one.optimum for one in tables.values() if one.optimum}


def _collective(behaviour: str) -> Quantity:
    read = _query(SEEN.format(kind="collective", behaviour=behaviour))
    return Quantity(read, "no behaviours recorded", is_share=True)


QUANTITIES: dict[str, Quantity] = {
    "value": _tested("value"),
    "area": _tested("area"),
    "capture_time": _tested("capture_time"),
    "delivered": _tested("delivered"),
    "share of the optimum": Quantity(_share, "no testing phase"),
    "whole": Quantity(_query(LESIONED.format(value="avg(whole.value)")), "no castes replaced"),
    "lesioned": Quantity(
        _query(LESIONED.format(value="avg(lesioned.value)")), "no castes replaced"
    ),
    "loss": Quantity(_query(LESIONED.format(value=LOSS)), "no castes replaced"),
    "evolved": Quantity(_performance(None, "clones", "whole"), "no teams of clones"),
    "clones": Quantity(_query(CLONED + "('whole') GROUP BY run"), "no teams of clones"),
    "clones of a specialist": Quantity(
        _query(CLONED + "('whole', 'non-specialized') GROUP BY run"), "no specialist cloned"
    ),
    "complementary": Quantity(_query(COMPLEMENTARY), "no team of two behaviours"),
    "one caste": Quantity(
        _query(CASTES.format(condition="count(DISTINCT caste) = 1")),
        "no castes recorded",
        is_share=True,
    ),
    "several castes": Quantity(
        _query(CASTES.format(condition=SEVERAL_CASTES)), "no castes recorded", is_share=True
    ),
    "idle predators": Quantity(
        _query(SEEN.format(kind="individual", behaviour="idle")),
        "no behaviours recorded",
        is_share=True,
    ),
    **{
        behaviour: _collective(behaviour)
        for behaviour in ("entrapment", "pursuer-blocker", "spiders-fly", "role-switcher")
    },
}
"""Name -> what it is; ``rover``, ``pursuit`` and ``gacc`` say what claims make of them.

value, area, capture_time, delivered: of the testing phase. share of the optimum: of the world's
main measure, in [0, 1]. whole, lesioned: of the lesion study, the latter the mean over castes.
loss: (whole - lesioned) over the larger of them, mean over castes, in [-1, 1]. Choice: so it is the
share of the team's performance that is lost, as in tables 4.5, 5.7 and 6.9, and where a team gains
it cannot be beyond all bounds; a team that never achieves anything has none. evolved, clones: of
the clones study, the latter the best team of clones. complementary: evolved, of teams with at least
two behaviours. The others are 1 or 0.
"""


class RunOf(NamedTuple):
    """A run of some method in some environment.

    exchanges, exchange_share: as in the table of runs; None of methods that never exchange.
    """

    run: str
    seed: int
    budget: str
    exchanges: float | None = None
    exchange_share: float | None = None


@dataclass(frozen=True)
class Gathered:
    """The samples of a statement.

    Attributes:
        samples: run values of each sample of the statement.
        present: environments that all samples have runs in.
        budgets: of these runs.
        exchange: pairs of sub-populations that recombined between populations in a generation, and
            of those that could have; of the sample with the least, None if no sample's runs could.
    """

    samples: tuple[list[float], ...]
    present: frozenset[str]
    budgets: frozenset[str]
    exchange: Exchange = (None, None)

    @property
    def is_idle(self) -> bool:
        """Whether a sample is of methods that exchange between populations, and hardly did."""
        return is_idle(*self.exchange)


@dataclass
class Evidence:
    """Runs of one world, preset and variant.

    Runs of different budgets are never compared in an environment. Choice: of several budgets that
    all compared methods have there, the one with the most runs is taken. Choice: between
    environments budgets may differ if no other runs are there, as between those evolved directly
    and those learned in stages (6.4.2).

    Attributes:
        world, preset, variant: of all its runs; the world with its version.
        read: returns a quantity by run, of whatever runs.
        runs: by environment and method.
    """

    world: str
    preset: str
    variant: str
    read: Callable[[str], Mapping[str, float]]
    runs: dict[tuple[str, str], list[RunOf]] = field(default_factory=dict)

    def has_runs(self, method: str, environment: str) -> bool:
        """Whether there is any run, whatever is known of it."""
        return (environment, method) in self.runs

    def gather(self, statement: Compare | Within) -> Gathered:
        """Return the runs that a statement is about."""
        if isinstance(statement, Compare):
            return self._gather_two(statement.a, statement.b)
        return self._gather_one(statement.sample)

    def _gather_two(self, a: Sample, b: Sample) -> Gathered:
        first: list[float] = []
        second: list[float] = []
        runs: tuple[list[RunOf], list[RunOf]] = ([], [])
        present: set[str] = set()
        budgets: set[str] = set()
        for here, there in zip(a.environments, b.environments, strict=True):
            of_a, of_b = self.by_budget(a, here), self.by_budget(b, there)
            common = sorted(of_a.keys() & of_b.keys())
            if common:
                chosen_a = chosen_b = max(
                    common, key=lambda budget: min(len(of_a[budget]), len(of_b[budget]))
                )
            elif here != there and of_a and of_b:
                chosen_a, chosen_b = _usual(of_a), _usual(of_b)
            else:
                continue
            first += [value for _, value in of_a[chosen_a]]
            second += [value for _, value in of_b[chosen_b]]
            runs[0].extend(self._runs(a, here, chosen_a))
            runs[1].extend(self._runs(b, there, chosen_b))
            present |= {here, there}
            budgets |= {chosen_a, chosen_b}
        asked = zip((a, b), runs, strict=True)
        made = [_exchange(of) for one, of in asked if one.quantity not in OF_ONE_ROBOT]
        least = min((one for one in made if one[0] is not None), default=(None, None))
        return Gathered((first, second), frozenset(present), frozenset(budgets), least)

    def _gather_one(self, sample: Sample) -> Gathered:
        """Return the runs of a sample.

        Choice: a mean over environments is taken seed by seed, and the seeds are the sample: of a
        team that learned the environments in turn the stages are not independent runs. A seed that
        lacks an environment is left out.
        """
        found = {place: self.by_budget(sample, place) for place in sample.environments}
        chosen = {place: _usual(of) for place, of in found.items() if of}
        values = {place: found[place][budget] for place, budget in chosen.items()}
        present = frozenset(values)
        if QUANTITIES[sample.quantity].is_share:
            flat = [value for pairs in values.values() for _, value in pairs]
        else:
            by_seed: dict[int, list[float]] = defaultdict(list)
            for pairs in values.values():
                for seed, value in pairs:
                    by_seed[seed].append(value)
            flat = [
                math.fsum(own) / len(own)
                for _, own in sorted(by_seed.items())
                if len(own) == len(present)
            ]
        runs = [
            run for place, budget in chosen.items() for run in self._runs(sample, place, budget)
        ]
        return Gathered((flat,), present, frozenset(chosen.values()), _exchange(runs))

    def _runs(self, sample: Sample, environment: str, budget: str) -> list[RunOf]:
        """Return the runs of a sample in one environment at one budget."""
        values = self.read(sample.quantity)
        return [
            one
            for method in sample.methods
            for one in self.runs.get((environment, method), ())
            if one.run in values and one.budget == budget
        ]

    def by_budget(self, sample: Sample, environment: str) -> dict[str, list[tuple[int, float]]]:
        """Return seeds and values of a sample's runs in one environment, apart by budget."""
        values = self.read(sample.quantity)
        found: dict[str, list[tuple[int, float]]] = defaultdict(list)
        for method in sample.methods:
            for one in self.runs.get((environment, method), ()):
                if one.run in values:
                    found[one.budget].append((one.seed, values[one.run]))
        return dict(found)


def read_evidence(tables: Tables) -> list[Evidence]:
    """Return the runs of a campaign, apart by world, preset and variant, in this order.

    Their quantities are read from the tables when they are asked for.
    """
    read: dict[str, Mapping[str, float]] = {}

    def cached(quantity: str) -> Mapping[str, float]:
        if quantity not in read:
            read[quantity] = QUANTITIES[quantity].read(tables)
        return read[quantity]

    _, rows = tables.query(
        "SELECT world, preset, variant, environment, method, run, seed, budget, exchanges,"
        " exchange_share"
        " FROM runs JOIN budgets USING (run) ORDER BY ALL"
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


def _exchange(runs: Sequence[RunOf]) -> Exchange:
    """Return what runs exchanged between populations, in the mean; nothing unless all could."""
    made = [one.exchanges for one in runs if one.exchanges is not None]
    shares = [one.exchange_share for one in runs if one.exchange_share is not None]
    if not runs or len(made) < len(runs) or len(shares) < len(runs):
        return None, None
    return math.fsum(made) / len(runs), math.fsum(shares) / len(runs)


def _usual(of: Mapping[str, list[tuple[int, float]]]) -> str:
    """Return the budget with the most runs, the first by name of equals."""
    return max(sorted(of), key=lambda budget: len(of[budget]))
