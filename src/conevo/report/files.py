"""The files of a report: one page, its tables as LaTeX, its figures, the numbers.

::

    index.html            one self-contained page: no script, no network
    tables/NAME.tex       every table, for LaTeX with array and booktabs
    figures/NAME.svg|pdf  every figure
    figures.tex           all of them with their captions, for LaTeX with graphicx
    all.tex               a document of all tables and figures, under the headings of the page
    numbers/NAME.csv      the numbers behind each of them, unrounded
    marl-eval.json        raw results for marl-eval
    manifest.json         digest of every file

All of it is made of the campaign's tables: the same tables give the same bytes.
"""

from __future__ import annotations

import hashlib
import html
import json
import re
import shutil
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path

from typing_extensions import TypedDict

from conevo.campaigns.campaign import Campaign
from conevo.campaigns.plan import Plan
from conevo.campaigns.tables import Tables
from conevo.errors import UsageError
from conevo.reading import DamagedFile, read_bytes, read_json
from conevo.report.exhibits import Figure, Section, Table
from conevo.report.foreign import Foreign
from conevo.report.latex import document, figures_to_latex, to_latex
from conevo.report.learning_curves import read_histories
from conevo.report.marl_eval import export
from conevo.report.sections.behaviours import behaviours
from conevo.report.sections.budgets import Spent, headings, spent_by
from conevo.report.sections.castes import castes
from conevo.report.sections.champions import champions
from conevo.report.sections.claims import claims
from conevo.report.sections.comparisons import comparisons
from conevo.report.sections.composed import composed
from conevo.report.sections.foreign import foreign
from conevo.report.sections.interventions import interventions
from conevo.report.sections.learning import learning
from conevo.report.sections.metrics import definitions, metrics
from conevo.report.sections.overview import overview, repetition
from conevo.report.sections.performance import performance
from conevo.report.sections.scope import Scope, scopes
from conevo.report.sections.signal import signal
from conevo.runs.drafts import draft_of
from conevo.runs.durable import refuse_inside_file, writing

__all__ = ["sections_of", "write_report"]

MANIFEST = "manifest.json"
TEMPLATE = "report.html.j2"


class Manifest(TypedDict):
    """``manifest.json``: the digest of every file of a report."""

    files: dict[str, str]


def write_report(
    campaign: Campaign, out: Path, tables: Path | None = None, others: Sequence[Foreign] = ()
) -> Path:
    """Write the report of a campaign and return its page.

    A report that is there already is replaced as a whole, once the new one is complete.

    Args:
        campaign: with sealed tables.
        out: directory of the report.
        tables: the folder of the sealed tables, if not the campaign's own.
        others: results of other tools, shown in a section of their own.

    Raises:
        UsageError: no tables; or ``out`` holds something else than an unchanged report.
        EnvironmentFailure: it cannot be written.
    """
    _refuse_changed(out)
    with Tables(tables or campaign.paths.tables) as opened:
        sections = sections_of(opened, campaign, others)
        files = dict(_files(campaign.plan, sections))
        files["marl-eval.json"] = _json(export(opened))
    digests = {name: _digest(content) for name, content in sorted(files.items())}
    files[MANIFEST] = _json({"files": digests})
    with writing(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        with draft_of(out) as draft:
            draft.mkdir()
            for name, content in files.items():
                path = draft / name
                path.parent.mkdir(exist_ok=True)
                path.write_bytes(content)
            shutil.rmtree(out, ignore_errors=True)
            draft.rename(out)
    return out / "index.html"


def sections_of(
    tables: Tables, campaign: Campaign, others: Sequence[Foreign] = ()
) -> list[Section]:
    """Return the sections of a report in order; ``others`` are results of other tools."""
    found = scopes(tables)
    spent = [spent_by(tables, scope.group) for scope in found]
    titles = headings([scope.group for scope in found], spent)
    groups = [_about(*one) for one in zip(found, titles, spent, strict=True)]
    from_elsewhere = foreign(found, campaign, others)
    return [
        overview(tables, campaign),
        *groups,
        *([from_elsewhere] if from_elsewhere else []),
        claims(tables),
        *([definitions()] if groups else []),
        repetition(tables, campaign),
    ]


def _about(scope: Scope, title: str, spent: Spent) -> Section:
    """Return everything about one group of runs."""
    histories = read_histories(scope.tables, scope.group)
    parts = [
        performance(scope),
        champions(scope),
        comparisons(scope),
        learning(scope, histories),
        signal(scope),
        castes(scope, histories),
        *interventions(scope),
        composed(scope),
        metrics(scope),
        behaviours(scope),
    ]
    return Section(
        title, [spent.words], (), [part for part in parts if part is not None], name=scope.stem
    )


def _files(plan: Plan, sections: list[Section]) -> Iterator[tuple[str, bytes]]:
    """Yield the name and content of every file but marl-eval's and the manifest."""
    exhibits = [one for section in sections for one in section.all_exhibits()]
    for one in exhibits:
        yield f"numbers/{one.name}.csv", one.to_csv().encode()
        if isinstance(one, Table):
            yield f"tables/{one.name}.tex", to_latex(one).encode()
        if isinstance(one, Figure):
            yield f"figures/{one.name}.svg", one.drawing.svg
            yield f"figures/{one.name}.pdf", one.drawing.pdf
    drawn = [one for one in exhibits if isinstance(one, Figure)]
    yield "figures.tex", figures_to_latex(drawn).encode()
    yield "all.tex", document(plan.title or plan.name, sections).encode()
    yield "index.html", _page(plan, sections).encode()


def _page(plan: Plan, sections: list[Section]) -> str:
    """Return the page."""
    import jinja2

    counts = {"Table": 0, "Figure": 0}
    numbers: dict[str, str] = {}  # "Table 3", "Figure 2" for every exhibit's name
    for one in (one for section in sections for one in section.all_exhibits()):
        kind = "Figure" if isinstance(one, Figure) else "Table"
        counts[kind] += 1
        numbers[one.name] = f"{kind} {counts[kind]}"
    template = resources.files("conevo.report").joinpath(TEMPLATE).read_text(encoding="utf-8")
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.tests["figure"] = lambda one: isinstance(one, Figure)
    return environment.from_string(template).render(
        plan=plan, sections=sections, drawn=_inline, rows=_body, numbers=numbers
    )


def _body(table: Table) -> str:
    """Return the rows of a table as HTML, a line above every new first cell.

    Not in the template, where a thousand rows would take most of the time.
    """
    ends = [
        ' class="w">' if column.is_wide else ' class="t">' if column.is_text else ">"
        for column in table.columns
    ]
    lines: list[str] = []
    first = ""
    for cells in table.cells():
        is_new = bool(lines) and cells[0] != first
        first = cells[0]
        inside = "".join(
            f"<td{end}{html.escape(text)}</td>" for end, text in zip(ends, cells, strict=True)
        )
        lines.append(f"<tr{' class=f' if is_new else ''}>{inside}</tr>")
    return "\n".join(lines)


def _inline(figure: Figure) -> str:
    """Return a drawing for a page with others: its names are its own, the page scales it."""
    svg = figure.drawing.svg.decode()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r'\bid="', f'id="{figure.name}.', svg)
    svg = re.sub(r'(url\(#|href="#)', rf"\g<1>{figure.name}.", svg)
    svg = re.sub(r"\s*<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    wide = float(svg.split('width="', 1)[1].split("pt", 1)[0])
    about = (
        f'role="img" aria-labelledby="{figure.name}-caption" style="max-width: {wide / 10:.1f}rem"'
    )
    return svg.replace("<svg ", f"<svg {about} ", 1)


def _refuse_changed(out: Path) -> None:
    """Refuse to replace anything but a report as it was written, or to write inside a file.

    Raises:
        UsageError: it is something else, or was changed.
    """
    refuse_inside_file(out)
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    manifest = out / MANIFEST
    if not manifest.is_file():
        raise UsageError(f"{out} is not a report, so it is not replaced; choose another --out")
    try:
        written = read_json(manifest, Manifest)["files"]
    except DamagedFile as error:
        raise UsageError(f"{manifest} was changed; move the report away first") from error
    found = {
        path.relative_to(out).as_posix(): _digest(read_bytes(path))
        for path in sorted(out.rglob("*"))
        if path.is_file() and path != manifest
    }
    for name in sorted(found.keys() | written.keys()):
        if found.get(name) != written.get(name):
            raise UsageError(
                f"{out / name} was changed since the report was written; move the report away "
                f"first, or choose another --out"
            )


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _json(value: object) -> bytes:
    return (json.dumps(value, indent=1, sort_keys=True, allow_nan=False) + "\n").encode()
