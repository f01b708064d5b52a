"""Verdicts: claims judged by evidence.

A claim is reproduced if its statements are true in all the environments that it needs. It is not
reproduced if they are contradicted in too many of them, and undecided otherwise. It is not tested
if all that is open depends on an exchange between populations that hardly ran, or on methods whose
fitness carried no information about genotypes. It is not judged if the thesis states the opposite
elsewhere, and decided by the world if heuristic teams differ in the same way.

- Choice: if the two tests lead to different verdicts, the claim is undecided, and both are shown.
- Choice: the effect shown is that of the statement that decides the verdict: of the contradicted
  ones, else the open ones, else all, the one furthest from the claim.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from conevo.campaigns.tables import Tables
from conevo.report.claims import wording
from conevo.report.claims.catalogue import CLAIMS
from conevo.report.claims.evidence import Evidence, read_evidence
from conevo.report.claims.outcomes import Answer, Decision, measure
from conevo.report.claims.quantities import QUANTITIES
from conevo.report.claims.statements import Claim, Compare, Part, Sample
from conevo.report.power import CAMPAIGNS, Redrawn, draw, found_alike

__all__ = ["Verdict", "judge", "verdicts"]

T = TypeVar("T")
REPRODUCED = "reproduced"
NOT_REPRODUCED = "not reproduced"
UNDECIDED = "undecided: "
UNTESTED = {
    Decision.BLIND: "not tested: no signal",
    Decision.UNTESTED: "not tested: no exchange",
}
NOT_JUDGED = "not judged: the thesis contradicts itself"
BY_WORLD = "decided by the world"


@dataclass(frozen=True)
class Verdict:
    """The verdict of the runs of one preset (and variant) on one claim.

    Attributes:
        id, claim, source: as in the catalogue.
        effect: of the statement that decides the verdict, in words; empty without runs.
        low, high: its 95 % interval, None without one.
        tests: names of the tests and intervals used.
        n: runs per sample, "20" or "3 to 20".
        budget: preset and team evaluations.
        variant: the levels of the campaign's further factors, "gst=0.1, rounds=2"; empty without.
        verdict: "reproduced", "not reproduced", "not tested: no exchange" or "no signal", "not
            judged: the thesis contradicts itself", "decided by the world", or "undecided: " and
            why.
        alone: the verdict by the runs alone, whatever else the thesis states.
        caution: a contradiction in the thesis, a limit of the verdict, or the other cause of it.
        power: the probability of finding the claim's methods alike if they were exactly alike; None
            for claims without "alike", or without runs.
        exchange: pairs of sub-populations of CONE that recombined between populations in a
            generation, and of those that could have: of the statement with the least.
        why: statements counted, contradicted and missing.
        cells: every statement with its numbers.
    """

    id: str
    claim: str
    source: str
    effect: str
    low: float | None
    high: float | None
    tests: str
    n: str
    budget: str
    variant: str
    verdict: str
    alone: str
    caution: str
    power: float | None
    exchange: tuple[float | None, float | None]
    why: str
    cells: tuple[Answer, ...]


def verdicts(tables: Tables, claims: Sequence[Claim] = CLAIMS) -> list[Verdict]:
    """Judge claims by the tables of a campaign.

    Args:
        tables: of the campaign.
        claims: which.

    Returns:
        In the order of the claims: one for every preset and variant with any run that the claim is
        about, or one without runs.
    """
    evidence = read_evidence(tables)
    judged: list[Verdict] = []
    for claim in claims:
        own = [one for one in evidence if one.world.rpartition("-v")[0] == claim.world]
        found = [judge(claim, one) for one in own if _concerns(claim, one)]
        judged += found or [judge(claim, Evidence(claim.world, "", "", lambda _: {}))]
    return judged


def judge(claim: Claim, evidence: Evidence) -> Verdict:
    """Judge one claim by the runs of one world, preset and variant."""
    cells = measure([one for part in claim.parts for one in part.statements], evidence)
    by_t = _verdict(claim, cells, [cell.by_t for cell in cells], evidence)
    by_rank = _verdict(claim, cells, [cell.by_rank for cell in cells], evidence)
    both_undecided = by_t.startswith(UNDECIDED) and by_rank.startswith(UNDECIDED)
    agree = by_t == by_rank or both_undecided
    key = next((cell for cell in sorted(cells, key=lambda c: c.weight) if cell.has_runs), None)
    budgets = sorted({budget for cell in cells for budget in cell.gathered.budgets})
    spent = budgets or [evidence.preset]
    low, high = key.interval if key else (None, None)
    power = _power(claim, cells)
    alone = by_rank if agree else f"{UNDECIDED}the tests disagree"
    elsewhere = NOT_JUDGED if claim.contradiction else BY_WORLD if claim.decided else ""
    why = [
        *wording.counts(cells),
        *([] if agree else [f"t-test: {by_t}; Mann-Whitney with Holm: {by_rank}"]),
        *wording.power(power),
        *wording.too_few(cells),
        *wording.lacking(cells, evidence),
    ]
    return Verdict(
        id=claim.id,
        claim=claim.text,
        source=claim.source,
        effect=wording.effect(key, len(cells)) if key else "",
        low=low,
        high=high,
        tests=wording.tests(cells),
        n=wording.sizes(cells),
        budget="; ".join(one for one in spent if one),
        variant=evidence.variant,
        verdict=(elsewhere or alone) if key else alone,
        alone=alone,
        caution=claim.contradiction or claim.decided or claim.caution,
        power=power,
        exchange=min(
            (cell.gathered.exchange for cell in cells if cell.gathered.exchange[0] is not None),
            default=(None, None),
        ),
        why="; ".join(why),
        cells=tuple(cells),
    )


def _concerns(claim: Claim, evidence: Evidence) -> bool:
    """Whether there is a run of any sample of a claim."""
    return any(
        _has_runs(sample, evidence)
        for part in claim.parts
        for statement in part.statements
        for sample in statement.samples
    )


def _verdict(
    claim: Claim, cells: Sequence[Answer], outcomes: Sequence[Decision], evidence: Evidence
) -> str:
    """Return the verdict by one of the two tests."""
    if not any(cell.has_runs for cell in cells):
        return f"{UNDECIDED}{_absence(cells, evidence)}"
    parts = [_part(*pair) for pair in _by_part(claim, outcomes)]
    if Decision.CONTRADICTED in parts:
        return NOT_REPRODUCED
    if all(outcome is Decision.HOLDS for outcome in parts):
        return REPRODUCED
    for outcome, verdict in UNTESTED.items():
        if outcome in parts:
            return verdict
    if Decision.OPEN in parts:
        still = [c for c, o in zip(cells, outcomes, strict=True) if o is Decision.OPEN]
        is_zero = all(cell.is_zero for cell in still)
        return f"{UNDECIDED}all values are 0" if is_zero else f"{UNDECIDED}n too small"
    places = {place for cell in cells for place in cell.statement.environments}
    lacking = {p for c in cells for p in c.statement.environments if p not in c.gathered.present}
    return f"{UNDECIDED}{len(places - lacking)} of {len(places)} environments"


def _by_part(claim: Claim, of: Sequence[T]) -> Iterator[tuple[Part, Sequence[T]]]:
    """Yield the parts of a claim, each with the elements of ``of`` for its statements."""
    rest = iter(of)
    for part in claim.parts:
        yield part, [next(rest) for _ in part.statements]


def _part(part: Part, outcomes: Sequence[Decision]) -> Decision:
    """Return whether the statements of a part are true in enough environments."""
    by_place: dict[tuple[str, ...], set[Decision]] = defaultdict(set)
    for statement, outcome in zip(part.statements, outcomes, strict=True):
        by_place[statement.environments].add(outcome)
    order = (
        Decision.CONTRADICTED,
        Decision.BLIND,
        Decision.UNTESTED,
        Decision.OPEN,
        Decision.MISSING,
        Decision.HOLDS,
    )
    settled = [next(o for o in order if o in found) for found in by_place.values()]
    need = len(settled) if part.need is None else part.need
    if settled.count(Decision.CONTRADICTED) > len(settled) - need:
        return Decision.CONTRADICTED
    if settled.count(Decision.HOLDS) >= need:
        return Decision.HOLDS
    return next(o for o in order[1:] if o in settled)


def _power(claim: Claim, cells: Sequence[Answer]) -> float | None:
    """Return the power: in how many campaigns with all alike the claim would find it."""
    alike = [
        (part, own)
        for part, own in _by_part(claim, cells)
        if all(isinstance(s, Compare) and s.expect == "alike" for s in part.statements)
    ]
    if not alike or any(cell.by_t is Decision.MISSING for _, own in alike for cell in own):
        return None
    drawn: dict[Sample, Redrawn | None] = {}
    holds = np.ones(CAMPAIGNS, dtype=bool)
    for part, own in alike:
        by_place: dict[tuple[str, ...], list[npt.NDArray[np.bool_]]] = defaultdict(list)
        for cell in own:
            for sample, values in zip(cell.statement.samples, cell.gathered.samples, strict=True):
                if sample not in drawn:
                    drawn[sample] = draw(values, len(drawn))
            a, b = (drawn[sample] for sample in cell.statement.samples)
            if a is None or b is None:
                return None
            by_place[cell.statement.environments].append(found_alike(a, b))
        found = np.sum([np.all(of, axis=0) for of in by_place.values()], axis=0)
        holds &= found >= (part.need or len(by_place))
    return float(holds.mean())


def _absence(cells: Sequence[Answer], evidence: Evidence) -> str:
    """Return why no statement has runs of all its samples."""
    for cell in cells:
        samples = cell.statement.samples
        if not all(_has_runs(sample, evidence) for sample in samples):
            continue
        for sample in samples:
            if not any(evidence.by_budget(sample, place) for place in sample.environments):
                return QUANTITIES[sample.quantity].lacks
        return "no runs of equal budgets"
    return "no such runs"


def _has_runs(sample: Sample, evidence: Evidence) -> bool:
    """Whether a sample has runs, with or without its quantity."""
    return any(evidence.has_runs(m, e) for m in sample.methods for e in sample.environments)
