"""The behaviours of the robots of a group, in worlds with a study of them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Sequence

from conevo.palette import FAINT, several
from conevo.report.comparison import Cell
from conevo.report.exhibits import Column, Figure, Section, Table, number
from conevo.report.figures import tiles
from conevo.report.sections.scope import SHOWN_KEYS, Scope, key, sizes
from conevo.worlds.registry import studies
from conevo.worlds.study import StudyWords

__all__ = ["behaviours"]

MOST_BARS = 45  # that fit on a page
Counts = dict[Cell, Counter[str]]


def behaviours(scope: Scope) -> Section | None:
    """Return which collective and individual behaviours were seen; None in other worlds."""
    counts: dict[str, Counts] = defaultdict(lambda: defaultdict(Counter))
    # The team's row names its most frequent behaviour: there it is runs that are counted.
    for cell, kind, behaviour, count in scope.per_cell(
        "SELECT cell, kind, behaviour, if(kind = 'team', count(*), sum(count))"
        " FROM own JOIN behaviours USING (run) GROUP BY cell, kind, behaviour"
    ):
        counts[kind][cell][behaviour] = count
    if not counts:
        return None
    studied = dict(
        scope.per_cell(
            "SELECT cell, count(DISTINCT run) FROM own JOIN behaviours USING (run) GROUP BY cell"
        )
    )
    n = {cell: studied[cell] for cell in scope.ordered(studied)}
    names, words = _named({name for of in counts["collective"].values() for name in of})
    events = _events(scope, counts["collective"], n, names, words)
    return Section("Behaviours", (), [*events, _table(scope, counts, n, names, words)])


def _named(seen: Collection[str]) -> tuple[Sequence[str], StudyWords]:
    """Return the names of the study that collective behaviours are of, in order, and its words.

    Worlds in files inherit a study, so the behaviours identify it, not the world's name.
    """
    for study in studies().values():
        if {*seen} <= {*study.COLLECTIVES}:
            return study.COLLECTIVES, study.WORDS
    return [*sorted({*seen} - {"none"}), "none"], StudyWords()


def _events(
    scope: Scope, counts: Counts, n: dict[Cell, int], names: Sequence[str], words: StudyWords
) -> list[Figure]:
    """Draw a bar per cell with an event; nothing if they are too many for a page."""
    total = {cell: sum(counts[cell].values()) for cell in n}
    shares = {
        (
            cell.environment,
            f"{cell.treatment.title} (n = {n[cell]}, {total[cell]} {words.events})",
        ): {name: counts[cell][name] / total[cell] for name in names}
        for cell in n
        if total[cell]
    }
    if not 0 < len(shares) <= MOST_BARS:
        return []
    rows = [
        key(cell)
        | {"n": n[cell], words.events: total[cell], "behaviour": name, "count": counts[cell][name]}
        for cell in n
        for name in names
    ]
    colours = (*several(len(names) - 1), FAINT)
    figure = Figure(
        f"{scope.stem}-{words.events}",
        f"{words.events.capitalize()} by collective behaviour",
        f"Share of all {words.events} of the champions in fresh scenarios. "
        f"{sizes(n.values())} per bar; teams that {words.undone} have no bar.",
        rows=rows,
        drawing=tiles.shares(
            shares,
            dict(zip(names, colours, strict=True)),
            x_label=f"share of the {words.events}",
        ),
    )
    return [figure]


def _table(
    scope: Scope,
    counts: dict[str, Counts],
    n: dict[Cell, int],
    names: Sequence[str],
    words: StudyWords,
) -> Table:
    individual = sorted({name for of in counts["individual"].values() for name in of})
    collective = [name for name in names if any(of[name] for of in counts["team"].values())]
    rows = [
        key(cell)
        | {"n": n[cell]}
        | {f"runs {name}": counts["team"][cell][name] for name in collective}
        | {f"robots {name}": counts["individual"][cell][name] / n[cell] for name in individual}
        for cell in n
    ]
    columns = [
        *SHOWN_KEYS,
        Column("n", "n"),
        *(Column(f"runs {name}", name, number) for name in collective),
        *(Column(f"robots {name}", name, number) for name in individual),
    ]
    return Table(
        f"{scope.stem}-behaviours",
        "Behaviours of the champions",
        f"First {len(collective)} behaviours: runs whose champion {words.done} most often; last "
        f"{len(individual)}: {words.robots} of a champion that are specialized to it, mean; "
        "n: runs.",
        columns,
        rows,
    )
