"""Cards of runs and teams in notebooks: small HTML that inherits the notebook's colours."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from conevo.errors import ConevoError
from conevo.evolution.methods.registry import title_of
from conevo.numbers import number
from conevo.terms import S_SCALE, counted
from conevo.typing import Record

if TYPE_CHECKING:
    from conevo.runs.champions import Team
    from conevo.runs.run import Run

__all__ = ["STYLE", "bar", "card", "escape", "run_card", "table", "team_card"]

# Colours are those of the text around it, so that cards fit light and dark notebooks.
STYLE = """<style>
.conevo { line-height: 1.4; max-width: 60em; }
.conevo p { margin: 0 0 .4em; }
.conevo .faint { opacity: .7; }
.conevo svg { display: block; height: 7em; width: 100%; overflow: visible; }
.conevo polyline { fill: none; stroke: currentColor; stroke-width: 1.5;
  vector-effect: non-scaling-stroke; }
.conevo progress { accent-color: #009e73; vertical-align: middle; width: 16em; }
.conevo .bar { background: rgba(128, 128, 128, .25); display: inline-flex; height: .7em;
  min-width: 5em; vertical-align: baseline; width: 6em; }
.conevo .bar i { display: block; height: 100%; }
div.conevo table { border-collapse: collapse; margin: 0 0 .6em; }
div.conevo :is(td, th) { padding: .1em .8em .1em 0; text-align: left !important;
  white-space: nowrap; }
div.conevo th { font-weight: 600; }
</style>"""
INK = "currentColor"


def card(title: str, about: Iterable[str], parts: Callable[[], Iterable[str]]) -> str:
    """Return a card: a title, a line of facts, and the parts below them.

    Args:
        title, about: plain text.
        parts: returns HTML; if it raises because a file is damaged, the card shows the error.
    """
    try:
        below = "".join(parts())
    except ConevoError as error:
        below = f"<p>{escape(str(error))}</p>"
    facts = " · ".join(escape(one) for one in about)
    head = f'<p><strong>{escape(title)}</strong><br><span class="faint">{facts}</span></p>'
    return f'{STYLE}<div class="conevo">{head}{below}</div>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; the head is plain text, cells are HTML."""
    first = "".join(f"<th>{escape(one)}</th>" for one in head)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{first}</tr></thead><tbody>{body}</tbody></table>"


def bar(*parts: tuple[float, str]) -> str:
    """Return a bar of shares, each with its colour; the rest up to 1 stays empty."""
    inner = "".join(
        f'<i style="width:{100 * min(max(share, 0.0), 1.0):.1f}%;background:{colour}"></i>'
        for share, colour in parts
        if share > 0
    )
    return f'<span class="bar">{inner}</span>'


def run_card(run: Run) -> str:
    """Return the card of a run: its learning curve, its test and its castes."""
    outline = run.outline
    title = f"{outline.task}, {title_of(outline.method)}, preset {outline.preset}"
    about = [f"seed {outline.seed}", run.status, str(run.path)]

    def parts() -> Iterable[str]:
        records, test = run.generations(), run.test_result
        spent = records[-1]["team_evaluations"] if records else 0
        planned = counted(outline.generations, "generation")
        yield f"<p>{len(records)} of {planned}, {counted(spent, 'team evaluation')}</p>"
        if records:
            yield _curve(records)
        if test is not None:
            yield _tests(test)
            yield _castes("castes of the champion", test["champion"]["castes"])
        elif records:
            yield _castes("castes of the fittest team so far", records[-1]["castes"])

    return card(title, about, parts)


def team_card(team: Team) -> str:
    """Return the card of a team: size, fitness and S of every robot."""
    robots, slots, genes = team.genes.shape
    about = [
        counted(robots, "robot"),
        f"{counted(slots, 'slot')} of {counted(genes, 'gene')} each",
        f"mean fitness {number(team.mean_fitness)}",
        f"S: {S_SCALE}",
    ]

    def parts() -> Iterable[str]:
        best = max((f for f in team.fitness if math.isfinite(f)), default=0.0)
        yield table(
            ["robot", "parts", "fitness", "S"],
            (
                [
                    str(k),
                    str(int(team.active[k].sum())),
                    f"{_bar(fitness / best if best > 0 else 0.0)} {number(fitness)}",
                    f"{_bar(s)} {number(s)}",
                ]
                for k, (fitness, s) in enumerate(
                    zip(team.fitness, team.specialization, strict=True)
                )
            ),
        )

    return card(f"Fittest team of generation {team.generation}", about, parts)


def _curve(records: Sequence[Record]) -> str:
    """Return the main measure of every generation's fittest team as a line."""
    name = next(iter(records[0]["performance"]))
    points = [
        (one["generation"], one["performance"][name])
        for one in records
        if one["performance"].get(name) is not None
    ]
    if not points:
        return ""
    low, high = (f(value for _, value in points) for f in (min, max))
    span, last = (high - low) or 1.0, records[-1]["generation"] or 1
    drawn = " ".join(f"{100 * x / last:.2f},{40 - 38 * (y - low) / span:.2f}" for x, y in points)
    label = (
        f"{name} of the fittest team: generation {points[0][0]}: {number(points[0][1])}, "
        f"generation {points[-1][0]}: {number(points[-1][1])}, "
        f"from {number(low)} to {number(high)}"
    )
    return (
        f'<p class="faint">{escape(label)}</p>'
        f'<svg viewBox="0 0 100 42" preserveAspectRatio="none" role="img" '
        f'aria-label="{escape(label)}"><polyline points="{drawn}"/></svg>'
    )


def _tests(test: Record) -> str:
    """Return the testing phase: champion and first fittest team, mean and standard deviation."""
    names = list(test["champion"]["performance"])
    rows = []
    for key, title in (("champion", "champion"), ("generation_0", "first fittest team")):
        of = test[key]
        cells = [_spread(of["performance"][name]) for name in names]
        rows.append([title, str(of["generation"]), *cells])
    n = counted(test["champion"]["scenarios"], "fresh scenario")
    return table([f"test in {n}", "generation", *names], rows)


def _castes(title: str, sizes: Mapping[str, int]) -> str:
    most = max(sizes.values(), default=1)
    rows = ([escape(name), f"{_bar(size / most)} {size}"] for name, size in sizes.items())
    return table([title, "robots"], rows)


def _bar(share: float) -> str:
    return bar((share if math.isfinite(share) else 0.0, INK))


def _spread(found: Record) -> str:
    deviation = "" if found["sd"] is None else f" ± {number(found['sd'])}"
    return f"{number(found['mean'])}{deviation}"
