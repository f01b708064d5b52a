"""What the runs say about the claims of the thesis."""

from __future__ import annotations

from collections import Counter
from typing import Any

from conevo.analysis.claims import Verdict, verdicts
from conevo.analysis.claims.wording import place_of, what_of
from conevo.analysis.exhibits import Column, Section, Table, interval, number, p_value, plain
from conevo.analysis.frames import Tables

__all__ = ["claims"]


def claims(tables: Tables) -> Section:
    """Return every claim with effect, interval, tests, runs, budget and verdict."""
    found = verdicts(tables)
    rows = [
        {
            "id": one.id,
            "place": f"{one.id} ({one.source})",
            "claim": one.claim,
            "source": one.source,
            "effect": one.effect,
            "interval": (one.low, one.high),
            "n": one.n,
            "budget": one.budget,
            "tests": one.tests,
            "how": f"{one.tests}; {one.budget}",
            "verdict": one.verdict,
            "why": one.why,
        }
        for one in found
    ]
    about = [row for row in rows if row["n"] not in ("", "0")]
    kinds = Counter(str(row["verdict"]).partition(":")[0] for row in rows)
    text = [
        "What the thesis claims and runs can test, each claim judged by these runs alone. Of "
        f"{len(rows)} verdicts: "
        + ", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items()))
        + f"; {len(rows) - len(about)} claims are about runs that this campaign does not have."
    ]
    columns = [
        Column("place", "claim", plain),
        Column("claim", "what the thesis says", plain, is_wide=True),
        Column("effect", "effect", plain, is_wide=True),
        Column("interval", "95 % interval", interval),
        Column("n", "n", plain),
        Column("how", "tests; budget", plain, is_wide=True),
        Column("verdict", "verdict", plain, is_wide=True),
        Column("why", "why", plain, is_wide=True),
    ]
    note = (
        "n: runs per sample. Significant: p < 0.05, by the t-test uncorrected as in the thesis and "
        "by Mann-Whitney with Holm's correction over the claim; alike: no significant difference, "
        "and the interval of the difference inside ±15 % of the larger mean."
    )
    table = Table("claims", "Claims of the thesis", note, columns, rows)
    return Section("Claims of the thesis", text, [table, _statements(found)])


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
    return Table("claims-statements", title, note, columns, rows, is_open=False)
