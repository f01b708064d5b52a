"""Every two treatments of a group compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from conevo.report.comparison import Cell, Pair, compare_all
from conevo.report.exhibits import (
    Column,
    Exhibit,
    Figure,
    Section,
    Table,
    interval,
    p_value,
    plain,
    rows_of,
)
from conevo.report.figures import tiles
from conevo.report.power import power_of_pair
from conevo.report.ranks import EXACT_RUNS
from conevo.report.sections.scope import Scope, place_names, sizes
from conevo.report.sections.signal import blind_cells
from conevo.report.statistics import ALPHA
from conevo.studies.exchange import is_idle, per_generation
from conevo.studies.repeatability import LEAST_RELIABILITY
from conevo.terms import counted
from conevo.worlds.measures import Measure

__all__ = ["comparisons"]

NO_EXCHANGE, NO_SIGNAL = "no exchange", "no signal"
NOTES = {
    NO_EXCHANGE: "No exchange: CONE hardly recombined between populations there.",
    NO_SIGNAL: "No signal: selection among a method's genotypes was nearly blind there.",
}
MOST_ROWS = 28  # of a drawing: eight methods

TESTS = (
    "p (t): Student's independent t-test, two-sided, uncorrected, as in the thesis; p (Welch): the "
    "same without equal variances; p (MW): Mann-Whitney, exact up to {exact} runs; p (MW, Holm): "
    "the same, corrected by Holm for all {n} pairs of this table; A12: probability that a run of "
    "the first is better than one of the second (Vargha and Delaney)."
)

COLUMNS: list[Column[Pair]] = [
    Column("environment", "environment", plain),
    Column("first", "first", plain, of=lambda pair: pair.a.title),
    Column("second", "second", plain, of=lambda pair: pair.b.title),
    Column("n_first", of=lambda pair: pair.result.n_a),
    Column("n_second", of=lambda pair: pair.result.n_b),
    Column("n", "n", plain, of=lambda pair: f"{pair.result.n_a}, {pair.result.n_b}"),
    Column("difference", "difference", of=lambda pair: pair.result.difference),
    Column("interval", "95 % interval", interval, of=lambda p: (p.result.low, p.result.high)),
    Column("p_t", "p (t)", p_value, of=lambda pair: pair.result.p_t),
    Column("p_welch", "p (Welch)", p_value, of=lambda pair: pair.result.p_welch),
    Column("p_mann_whitney", "p (MW)", p_value, of=lambda pair: pair.result.p_mann_whitney),
    Column("p_holm", "p (MW, Holm)", p_value),
    Column("a12", "A12"),
    Column("smallest_p", of=lambda pair: pair.result.smallest_p),
]


def comparisons(scope: Scope) -> Section | None:
    """Return every two treatments of each environment compared; None with one run per cell."""
    pairs = compare_all(scope.cells)
    if not pairs:
        return Section("Comparisons", ["Only one method: nothing to compare."])
    if all(pair.result.n_a < 2 or pair.result.n_b < 2 for pair in pairs):
        return None
    text = []
    few = [pair for pair in pairs if pair.too_few]
    if few:
        text.append(
            f"Too few runs: with these sizes Mann-Whitney with Holm's correction over {len(pairs)} "
            f"pairs could not fall below {ALPHA} in {len(few)} of them, whatever the runs were."
        )
    made = scope.exchanges()
    idle = {cell for cell, one in made.items() if is_idle(*one)}
    if idle:
        names = " and ".join(sorted({cell.treatment.title for cell in idle}))
        most = per_generation(*max(made[cell] for cell in idle))
        text.append(
            f"{names} exchanged next to nothing between populations in {len(idle)} of {len(made)} "
            f"cells, at most {most} in a generation: without it CONE is Multi-Agent ESP, with "
            "type C fitness where that is on. Comparisons of these cells do not test the benefit "
            "of exchange."
        )
    untested = dict.fromkeys(idle, NO_EXCHANGE)
    if blind := blind_cells(scope):
        names = " and ".join(sorted({cell.treatment.title for cell in blind}))
        text.append(
            f"Selection by {names} was nearly blind in {counted(len(blind), 'cell')}"
            f" (reliability below {LEAST_RELIABILITY} first and last, section Signal). Comparisons "
            "of these cells do not test the methods."
        )
        untested |= dict.fromkeys(blind, NO_SIGNAL)
    exhibits: list[Exhibit] = [
        *_map(scope, pairs),
        _pair_table(scope, pairs, scope.stem, scope.main, untested),
    ]
    for measure, others in scope.others.items():
        stem, of = f"{scope.stem}-{measure.name}", compare_all(others)
        exhibits.append(_pair_table(scope, of, stem, measure, untested, is_folded=True))
    return Section("Comparisons", text, exhibits)


def _map(scope: Scope, pairs: Sequence[Pair]) -> list[Figure]:
    """Draw every pair as a shaded cell, unless it is the only one or they do not fit on a page."""
    names = {pair: f"{pair.a.title} − {pair.b.title}" for pair in pairs}
    rows = list(dict.fromkeys(names.values()))
    places = dict(zip(scope.environments, place_names(scope.environments), strict=True))
    cells = {
        (names[pair], places[pair.environment]): tiles.Shade(
            (0.25 if pair.by_thesis else 0) + (0.5 if pair.by_ranks else 0), _cell_text(pair)
        )
        for pair in pairs
    }
    if not len(cells) > 1 or len(rows) > MOST_ROWS:
        return []
    legend = [
        (0, "neither test below 0.05"),
        (0.25, "t-test only (uncorrected)"),
        (0.5, "Mann-Whitney only (Holm)"),
        (0.75, "both"),
    ]
    size = sizes(n for pair in pairs for n in (pair.result.n_a, pair.result.n_b))
    figure = Figure(
        f"{scope.stem}-significance",
        f"Significant differences in task performance ({scope.unit})",
        f"+: the first is better, −: worse ({scope.main.direction}); the number is "
        f"Mann-Whitney's p after Holm's correction over {pairs[0].n_tests} pairs. {size} per "
        "sample.",
        rows=rows_of([*COLUMNS, Column("verdict")], pairs),
        drawing=tiles.heat_map(rows, list(places.values()), cells, legend, x_label=scope.axis),
    )
    return [figure]


def _cell_text(pair: Pair) -> str:
    sign = "+" if pair.gain > 0 else "−"
    p = p_value(pair.p_holm)
    return f"{sign} {p.removeprefix('0')}" if p[0] in "0" else f"{sign} {p}"


def _why_untested(pair: Pair, untested: Mapping[Cell, str]) -> list[str]:
    """Return why a comparison does not test methods; nothing if it does."""
    both = (Cell(pair.environment, one) for one in (pair.a, pair.b))
    return sorted({untested[cell] for cell in both if cell in untested})


def _pair_table(
    scope: Scope,
    pairs: Sequence[Pair],
    stem: str,
    measure: Measure,
    untested: Mapping[Cell, str],
    *,
    is_folded: bool | None = None,
) -> Table:
    tests = TESTS.format(n=pairs[0].n_tests if pairs else 0, exact=EXACT_RUNS)
    note = (
        f"{measure.direction.capitalize()}. Difference: mean of the first less that of the second; "
        f"95 % interval: Welch; {tests} "
        "Alike: no test below 0.05 and the interval inside ±15 % of the larger mean; power: "
        "probability that two exactly alike methods, with this number and spread of runs, are "
        "found alike." + "".join(f" {NOTES[why]}" for why in sorted(set(untested.values())))
    )
    columns = [
        *COLUMNS,
        Column(
            "verdict",
            "verdict",
            plain,
            of=lambda pair: ", ".join([pair.verdict, *_why_untested(pair, untested)]),
        ),
        Column("power", "power", of=lambda pair: power_of_pair(*pair.samples)),
    ]
    title = f"Every two methods compared: {measure.axis}"
    return Table.of(f"{stem}-comparisons", title, note, columns, pairs, is_folded)
