"""What the runs say about the claims of the thesis."""

from __future__ import annotations

from collections import Counter
from typing import Any

from conevo.campaigns.tables import Tables
from conevo.report.claims import Verdict, verdicts
from conevo.report.claims.wording import place_of, what_of
from conevo.report.exhibits import Column, Section, Table, interval, number, p_value, plain
from conevo.studies.exchange import per_generation
from conevo.studies.repeatability import LEAST_RELIABILITY

__all__ = ["claims"]

INCONSISTENT = (
    "Not every statement of the thesis can be judged, for it is not consistent: its appendices A, "
    'C and D call a rejected null hypothesis "no significant difference", appendix D gives four '
    "values of P for five methods, and many numbers of its tables and figures are lost in the text "
    "that conevo was made from. Claims that it contradicts elsewhere are not judged."
)


def claims(tables: Tables) -> Section:
    """Return every claim that the runs are about, with effect, interval, tests and verdict."""
    title = "Claims of the thesis"
    every = verdicts(tables)
    found = [one for one in every if one.n not in ("", "0")]
    absent = sum(one.n in ("", "0") for one in every)
    rest = f"{absent} of the thesis' claims are about runs that this campaign does not have."
    if not found:
        return Section(title, [rest])
    kinds = Counter(one.verdict.partition(":")[0] for one in found)
    text = [
        "What the thesis claims and these runs can test, each claim judged by them alone: "
        + ", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items()))
        + "."
        + (f" {rest}" if absent else "")
    ]
    columns = [
        Column("place", "claim", plain),
        *_level(found),
        Column("claim", "claim of the thesis", plain, is_wide=True),
        Column("effect", "effect", plain, is_wide=True),
        Column("interval", "95 % interval", interval),
        Column("n", "n", plain),
        Column("exchanges", "exchange", plain),
        Column("how", "tests; budget", plain, is_wide=True),
        Column("verdict", "verdict", plain, is_wide=True),
        Column("reasons", "why", plain, is_wide=True),
    ]
    levels = "Levels: of the runs that a verdict is about. " if _level(found) else ""
    note = (
        f"{levels}n: runs per sample. Exchange: pairs of sub-populations of CONE that recombined "
        "between populations in a generation, and of those that could have; where that is next to "
        "nothing (fewer than one pair, and fewer than a tenth) statements about CONE are not "
        "tested. Nor are statements about methods without signal, where runs have a study of it: "
        f"reliability of fitness in generation 0 below {LEAST_RELIABILITY}. "
        "Significant: p < 0.05, by the t-test uncorrected as in the thesis and "
        "by Mann-Whitney with Holm's correction over the claim; alike: no significant difference, "
        "and the interval of the difference inside ±15 % of the larger mean. Power: how often "
        "methods that are exactly alike would be found so, with as many runs that scatter as much."
    )
    rows = [_row(one) for one in found]
    table = Table("claims", title, note, columns, rows, is_folded=False)
    return Section(title, [*text, INCONSISTENT], [table, _statements(found)])


def _row(one: Verdict) -> dict[str, Any]:
    """Return a claim's row."""
    reasons = [one.caution, one.why]
    if one.alone != one.verdict:
        reasons.insert(1, f"by itself: {one.alone}")
    exchanges, share = one.exchange
    return {
        "id": one.id,
        "place": f"{one.id} ({one.source})",
        "variant": one.variant or None,
        "claim": one.claim,
        "source": one.source,
        "effect": one.effect,
        "interval": (one.low, one.high),
        "n": one.n,
        "exchanges": per_generation(exchanges, share),
        "budget": one.budget,
        "tests": one.tests,
        "how": f"{one.tests}; {one.budget}",
        "verdict": one.verdict,
        "power": one.power,
        "reasons": "; ".join(reason for reason in reasons if reason),
    }


def _level(found: list[Verdict]) -> list[Column]:
    """Return the column of the levels that verdicts belong to, if the campaign has any."""
    has_any = any(one.variant for one in found)
    return [Column("variant", "levels", plain)] if has_any else []


def _statements(found: list[Verdict]) -> Table:
    """Return every comparison and share that a verdict was made of."""
    rows: list[dict[str, Any]] = []
    for one in found:
        for cell in one.cells:
            if not cell.has_runs:
                continue
            result, estimate = cell.comparison, cell.estimate
            value = result.difference if result else estimate.value if estimate else None
            rows.append(
                {
                    "id": one.id,
                    "variant": one.variant or None,
                    "environment": place_of(cell.statement),
                    "what": what_of(cell.statement),
                    "n": ", ".join(str(len(sample)) for sample in cell.gathered.samples),
                    "value": value,
                    "interval": cell.interval,
                    "p_t": result.p_t if result else None,
                    "p_mann_whitney": result.p_mann_whitney if result else None,
                    "p_holm": cell.p_holm,
                    "by_t": cell.by_t.name.lower(),
                    "by_rank": cell.by_rank.name.lower(),
                    "budget": one.budget,
                }
            )
    columns = [
        Column("id", "claim", plain),
        *_level(found),
        Column("environment", "environment", plain),
        Column("what", "what", plain, is_wide=True),
        Column("n", "n", plain),
        Column("value", "difference or share", number),
        Column("interval", "95 % interval", interval),
        Column("p_t", "p (t)", p_value),
        Column("p_holm", "p (MW, Holm)", p_value),
        Column("by_t", "by t-test", plain),
        Column("by_rank", "by Mann-Whitney", plain),
    ]
    note = "n: runs of each sample; intervals as in the claim's row."
    title = "Every statement that the verdicts are made of"
    return Table("claims-statements", title, note, columns, rows, is_folded=True)
