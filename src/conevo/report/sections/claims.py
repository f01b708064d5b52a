"""The verdicts of the runs on the claims of the thesis."""

from __future__ import annotations

from collections import Counter

from conevo.campaigns.tables import Tables
from conevo.report.claims import Verdict, verdicts
from conevo.report.claims.outcomes import Answer
from conevo.report.claims.wording import place_of, what_of
from conevo.report.exhibits import Column, Section, Table, interval, p_value, plain
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
        "The claims of the thesis that these runs can test, each judged by them alone: "
        + ", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items()))
        + "."
        + (f" {rest}" if absent else "")
    ]
    has_levels = any(one.variant for one in found)
    levels = "Levels: of the runs that a verdict is about. " if has_levels else ""
    note = (
        f"{levels}n: runs per sample. Exchange: pairs of sub-populations of CONE that recombined "
        "between populations in a generation, and of those that could have; where that is next to "
        "nothing (fewer than one pair, and fewer than a tenth) statements about CONE are not "
        "tested. Nor are statements about methods without signal, where runs have a study of it: "
        f"reliability of fitness below {LEAST_RELIABILITY} in the first and the last populations. "
        "Significant: p < 0.05, by the t-test uncorrected as in the thesis and "
        "by Mann-Whitney with Holm's correction over the claim; alike: no significant difference, "
        "and the interval of the difference inside ±15 % of the larger mean. Power: how often "
        "methods that are exactly alike would be found so, with as many runs that scatter as much."
    )
    table = Table.of("claims", title, note, _columns(has_levels), found, is_folded=False)
    return Section(title, [*text, INCONSISTENT], [table, _statements(found, has_levels)])


def _columns(has_levels: bool) -> list[Column[Verdict]]:
    """Return the columns of a claim; levels are shown if the campaign has any."""
    return [
        Column("id"),
        Column("place", "claim", plain, of=lambda one: f"{one.id} ({one.source})"),
        Column("variant", "levels" * has_levels, plain, of=lambda one: one.variant or None),
        Column("claim", "claim of the thesis", plain, is_wide=True),
        Column("source"),
        Column("effect", "effect", plain, is_wide=True),
        Column("interval", "95 % interval", interval, of=lambda one: (one.low, one.high)),
        Column("n", "n", plain),
        Column("exchanges", "exchange", plain, of=lambda one: per_generation(*one.exchange)),
        Column("budget"),
        Column("tests"),
        Column(
            "how", "tests; budget", plain, is_wide=True, of=lambda one: f"{one.tests}; {one.budget}"
        ),
        Column("verdict", "verdict", plain, is_wide=True),
        Column("power"),
        Column("reasons", "why", plain, is_wide=True, of=_reasons),
    ]


def _reasons(one: Verdict) -> str:
    alone = "" if one.alone == one.verdict else f"by itself: {one.alone}"
    return "; ".join(reason for reason in (one.caution, alone, one.why) if reason)


def _statements(found: list[Verdict], has_levels: bool) -> Table:
    """Return every comparison and share that a verdict was made of."""
    columns: list[Column[tuple[Verdict, Answer]]] = [
        Column("id", "claim", plain, of=lambda one: one[0].id),
        Column("variant", "levels" * has_levels, plain, of=lambda one: one[0].variant or None),
        Column("environment", "environment", plain, of=lambda one: place_of(one[1].statement)),
        Column("what", "what", plain, is_wide=True, of=lambda one: what_of(one[1].statement)),
        Column("n", "n", plain, of=lambda one: one[1].sizes),
        Column("value", "difference or share", of=lambda one: one[1].value),
        Column("interval", "95 % interval", interval, of=lambda one: one[1].interval),
        Column("p_t", "p (t)", p_value, of=lambda one: one[1].comparison and one[1].comparison.p_t),
        Column(
            "p_mann_whitney",
            of=lambda one: one[1].comparison and one[1].comparison.p_mann_whitney,
        ),
        Column("p_holm", "p (MW, Holm)", p_value, of=lambda one: one[1].p_holm),
        Column("by_t", "by t-test", plain, of=lambda one: one[1].by_t.name.lower()),
        Column("by_rank", "by Mann-Whitney", plain, of=lambda one: one[1].by_rank.name.lower()),
        Column("budget", of=lambda one: one[0].budget),
    ]
    note = "n: runs of each sample; intervals as in the claim's row."
    title = "Every statement that the verdicts are made of"
    items = [(one, answer) for one in found for answer in one.cells if answer.has_runs]
    return Table.of("claims-statements", title, note, columns, items, is_folded=True)
