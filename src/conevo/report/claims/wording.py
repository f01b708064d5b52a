"""Cells of a claim in words."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from conevo.evolution.methods.registry import title_of
from conevo.report.claims.evidence import Evidence
from conevo.report.claims.outcomes import Answer, Decision
from conevo.report.claims.quantities import QUANTITIES
from conevo.report.claims.statements import Compare, Sample, Statement
from conevo.report.statistics import ALPHA

__all__ = [
    "counts",
    "effect",
    "lacking",
    "name_of",
    "place_of",
    "power",
    "sizes",
    "tests",
    "too_few",
    "what_of",
]

SHOWN = 4  # of a list
UNDECIDED = {
    Decision.BLIND: "not tested: no signal, fitness carries no information about genotypes",
    Decision.UNTESTED: "not tested: no exchange between populations",
    Decision.OPEN: "open",
    Decision.MISSING: "without all their runs",
}


def name_of(method: str) -> str:
    """Return a method's name as in the thesis' tables."""
    return "MESP" if method == "mesp" else title_of(method)


def place_of(statement: Statement) -> str:
    """Return the environments of a statement: one, two compared, or the first to the last."""
    places = statement.environments
    if isinstance(statement, Compare) and statement.a.environments != statement.b.environments:
        return " - ".join(places)
    return places[0] if len(places) == 1 else f"{places[0]} to {places[-1]}"


def what_of(statement: Statement) -> str:
    """Return what is compared or measured."""
    if not isinstance(statement, Compare):
        return f"{statement.sample.quantity}, {_methods(statement.sample)}"
    a, b = statement.a, statement.b
    if a.environments != b.environments:
        return f"{a.quantity}, {_methods(a)}"
    if a.quantity != b.quantity:
        return f"{a.quantity}, {_methods(a)} - {b.quantity}, {_methods(b)}"
    return f"{a.quantity}, {_methods(a)} - {_methods(b)}"


def effect(cell: Answer, n_cells: int) -> str:
    """Return the effect of a cell with runs, one of ``n_cells``."""
    statement = cell.statement
    head = f"{place_of(statement)}: {what_of(statement)} = "
    tail = f" (weakest of {n_cells})" if n_cells > 1 else ""
    if not isinstance(statement, Compare):
        value = cell.estimate.value if cell.estimate else None
        shown = "?" if value is None else f"{value:.2f}"
        return f"{head}{shown}, claimed {statement.low:.2f} to {statement.high:.2f}{tail}"
    difference = (cell.comparison.difference if cell.comparison else None) or 0.0
    relative = f" ({difference / cell.scale:+.0%})" if cell.scale else ""
    return f"{head}{difference:+.4g}{relative}{tail}"


def tests(cells: Sequence[Answer]) -> str:
    """Return the names of the tests and intervals of a claim."""
    made = sum(cell.comparison is not None for cell in cells)
    names = [f"t-test; Mann-Whitney with Holm over {made}"] if made else []
    names += sorted({f"{cell.estimate.method} interval" for cell in cells if cell.estimate})
    return "; ".join(names)


def sizes(cells: Sequence[Answer]) -> str:
    """Return the runs per sample: "20", or "3 to 20"."""
    found = {len(sample) for cell in cells if cell.has_runs for sample in cell.gathered.samples}
    if len(found) < 2:
        return str(max(found, default=0))
    return f"{min(found)} to {max(found)}"


def counts(cells: Sequence[Answer]) -> list[str]:
    """Return the number of statements that hold (by Mann-Whitney and Holm), and the others."""
    of = {outcome: [c for c in cells if c.by_rank is outcome] for outcome in Decision}
    parts = [f"{len(of[Decision.HOLDS])} of {len(cells)} hold"]
    if worst := sorted(of[Decision.CONTRADICTED], key=lambda cell: cell.weight):
        names = [f"{place_of(cell.statement)} {what_of(cell.statement)}" for cell in worst]
        parts.append(f"{len(worst)} contradicted ({'; '.join(_few(names))})")
    return parts + [f"{len(of[one])} {why}" for one, why in UNDECIDED.items() if of[one]]


def power(found: float | None) -> list[str]:
    """Return the probability of finding methods alike that are alike."""
    if found is None:
        return []
    share = "less than 1 %" if found < 0.01 else f"{found:.0%}".replace("%", " %")
    return [f"power: of campaigns like this one in which all are alike {share} show it"]


def too_few(cells: Sequence[Answer]) -> list[str]:
    """Return a warning if Mann-Whitney could not become significant with any values."""
    smallest = [cell.comparison.smallest_p for cell in cells if cell.comparison]
    least = min((p for p in smallest if p is not None), default=0.0) * len(smallest)
    if least < ALPHA:
        return []
    return [f"with so few runs none of {len(smallest)} Mann-Whitney tests can become significant"]


def lacking(cells: Sequence[Answer], evidence: Evidence) -> list[str]:
    """Return which runs are missing."""
    absent: dict[str, set[str]] = defaultdict(set)
    for cell in cells:
        causes = {
            (cause, place)
            for sample in cell.statement.samples
            for place in sample.environments
            if place not in cell.gathered.present
            for cause in _causes(sample, place, evidence)
        }
        if not causes:
            gone = set(cell.statement.environments) - cell.gathered.present
            causes = {("no runs of equal budgets", place) for place in gone}
        for cause, place in causes:
            absent[cause].add(place)
    return _few([f"{cause} in {_few_places(places)}" for cause, places in sorted(absent.items())])


def _causes(sample: Sample, place: str, evidence: Evidence) -> list[str]:
    """Return why a sample has no runs; nothing if it has."""
    if evidence.by_budget(sample, place):
        return []
    without = [method for method in sample.methods if not evidence.has_runs(method, place)]
    if without:
        return [f"no runs of {name_of(method)}" for method in without]
    return [f"{QUANTITIES[sample.quantity].lacks} ({_methods(sample)})"]


def _methods(sample: Sample) -> str:
    return name_of(sample.methods[0]) if len(sample.methods) == 1 else "all methods"


def _few(names: Sequence[str]) -> list[str]:
    return [*names[:SHOWN], "..."] if len(names) > SHOWN else list(names)


def _few_places(places: set[str]) -> str:
    return next(iter(places)) if len(places) == 1 else f"{len(places)} environments"
