"""Tables of what the fittest predators of finished pursuit-evasion runs do (sections 4.5, 4.6)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import conevo
import pages
from conevo.specialization.individual import NON_SPECIALIZED
from conevo.studies.caste_tables import composition_table, lesion_table
from conevo.studies.observation import observe
from conevo.worlds.pursuit.study.behaviours import BEHAVIOURS
from conevo.worlds.pursuit.study.captures import COLLECTIVES
from pages import Row

N_SCENARIOS = 20  # per run, as the thesis'
Title = Callable[[str], str]


def tables(runs: dict[str, list[conevo.Run]], title: Title) -> tuple[dict[str, str], list[Row]]:
    """Return the tables by the names of their markers, and their numbers.

    Args:
        runs: of each method.
        title: how a method is written.
    """
    text, rows = {}, []
    lines = []
    for method, some in runs.items():
        seen = [observe(run, N_SCENARIOS, threads=1) for run in some]
        counts: Counter[str] = Counter()
        for team in seen:
            counts.update(team.seen.collectives[1])
        labels = Counter(label for team in seen for label in team.labels)
        n = counts.total()
        cells = [f"{counts[name] / n:.0%}".replace("%", " %") if n else "–" for name in COLLECTIVES]
        mix = ", ".join(f"{name} {k / len(some):.3g}" for name, k in labels.most_common())
        lines.append([title(method), len(some), n, *cells, mix])
        rows.append(
            {"table": "captures", "method": method, "runs": len(some), "captures": n}
            | {name: counts[name] for name in COLLECTIVES}
            | {label: k / len(some) for label, k in labels.items()}
        )
    head = ["method", "runs", "captures", *COLLECTIVES, "predators of a team, by behaviour"]
    text["behaviours"] = pages.table(head, lines)

    every = [run for some in runs.values() for run in some]
    named = [name for name in COLLECTIVES if name != "none"]
    found = composition_table(every, N_SCENARIOS, threads=1)
    lines = [
        [title(row["method"]), *(cell(row[name]) for name in (*named, NON_SPECIALIZED))]
        for row in found
    ]
    text["compositions"] = pages.table(["fittest team of", *named, NON_SPECIALIZED], lines)
    rows += [{"table": "composition", **plain(row)} for row in found]

    found = lesion_table(every, N_SCENARIOS, threads=1)
    lines = [
        [title(row["method"]), f"{row['capture_time']:.0f}"]
        + ["–" if row[name] is None else f"{row[name]:.1f} %" for name in BEHAVIOURS]
        for row in found
    ]
    text["lesions"] = pages.table(["fittest team of", "capture time", *BEHAVIOURS], lines)
    rows += [{"table": "lesion", **plain(row)} for row in found]
    return text, rows


def cell(value: int | None) -> str:
    """Return a number of predators, or a dash where the behaviour was never seen."""
    return "–" if value is None else str(value)


def plain(row: Row) -> Row:
    """Return a row without paths, its lists as text."""
    found: dict[str, Any] = {k: v for k, v in row.items() if k not in ("run", "task")}
    return {k: " ".join(v) if isinstance(v, list) else v for k, v in found.items()}
