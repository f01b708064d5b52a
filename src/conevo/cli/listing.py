"""``conevo list``: worlds, controllers, methods, presets, settings and runs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conevo.cli.format import progress
from conevo.errors import ConevoError, UsageError

if TYPE_CHECKING:
    from conevo.runs.outline import Outline
    from conevo.runs.run import Run

__all__ = ["listing"]

Rows = list[dict[str, Any]]
WHAT = ("worlds", "controllers", "methods", "presets", "settings", "runs")


@click.command("list")
@click.argument("what", type=click.Choice(WHAT))
@click.argument("subject", metavar="[WORLD/ENVIRONMENT | FOLDER]", required=False)
@click.option("--method", metavar="NAME", help="Method of the settings or presets (default: cone).")
@click.option("--preset", metavar="NAME", help="Preset of the settings (default: desk).")
@click.option(
    "--controller",
    metavar="NAME",
    help="Controller of the settings (default: the method's, or srn).",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
def listing(
    what: str,
    subject: str | None,
    method: str | None,
    preset: str | None,
    controller: str | None,
    as_json: bool,
) -> None:
    """List worlds with their environments, controllers, methods, presets, settings, or runs.

    settings WORLD/ENVIRONMENT: every setting of a run there, with its value under the preset, its
    default, unit, allowed values and meaning. presets [WORLD/ENVIRONMENT]: the size of a run there
    with each preset (default: rover/complex-1). runs [FOLDER]: the runs in FOLDER (default: runs/).

    Try: conevo list settings rover/complex-1 --method cone
    """
    from conevo.cli.format import table

    if subject is not None and what in ("worlds", "controllers", "methods"):
        raise UsageError(f"'conevo list {what}' takes no further argument, got {subject!r}")
    if method is not None and what not in ("presets", "settings"):
        raise UsageError(f"'conevo list {what}' takes no --method")
    for option, given in (("--preset", preset), ("--controller", controller)):
        if given is not None and what != "settings":
            raise UsageError(f"'conevo list {what}' takes no {option}")
    if what in ("presets", "settings"):
        from conevo.cli.settings_text import preset_rows, print_settings, setting_rows

        if what == "settings":
            print_settings(setting_rows(subject, method, preset, controller), as_json)
            return
        rows = preset_rows(subject, method)
    elif what == "runs":
        rows = _runs(subject)
    else:
        rows = _worlds() if what == "worlds" else _entries(what)
    if as_json:
        click.echo(json.dumps(rows))
    elif rows:
        notes = list(_own_defaults(rows)) if what == "worlds" else []
        click.echo(table(list(rows[0]), [list(row.values()) for row in rows]))
        if what == "worlds":
            from conevo.worlds.families import FAMILIES

            families = ", ".join(f"{one}:TASK" for one in FAMILIES)
            notes.append(f"tasks of other packages: {families} (docs/neighbours.md)")
        for line in notes:
            click.echo(line)
    else:
        click.echo(f"no runs in {subject or 'runs'}/; try: conevo run rover/complex-1")


def _worlds() -> Rows:
    from conevo.worlds.registry import WORLDS

    return [
        {
            "world": entry.name,
            "environments": _ranges(entry.environments),
            "what": entry.summary,
            "source": entry.source,
            "defaults": entry.defaults,
        }
        for entry in WORLDS.values()
    ]


def _own_defaults(rows: Rows) -> Iterator[str]:
    """Remove the defaults from the rows of worlds; yield a line for each set of equal ones."""
    for row in rows:
        alike: dict[str, list[str]] = {}
        for environment, values in row.pop("defaults").items():
            text = ", ".join(f"{key}={value}" for key, value in values.items())
            alike.setdefault(text, []).append(environment)
        for text, names in alike.items():
            yield f"{row['world']}, by default in {_ranges(tuple(names))}: {text}"


def _entries(what: str) -> Rows:
    """Return a row for each of the controllers or methods."""
    from conevo.controllers.registry import CONTROLLERS
    from conevo.evolution.methods.registry import METHODS

    if what == "controllers":
        return [{"controller": entry.name} | _about(entry) for entry in CONTROLLERS.values()]
    return [
        {"method": entry.name}
        | _about(entry)
        | {"controllers": ", ".join(entry.controllers) or "any"}
        for entry in METHODS.values()
    ]


def _about(entry: Any) -> dict[str, str]:
    """Return the facts about a controller or method that its entry has."""
    return {"title": entry.title, "what": entry.summary, "source": entry.source}


def _runs(folder: str | None) -> Rows:
    from conevo.cli.lookup import directories, open_directory
    from conevo.runs.outline import span
    from conevo.runs.run import RUNS, Run

    place = Path(folder) if folder else RUNS
    if folder and not place.is_dir():
        raise UsageError(f"{place} is not a directory")
    rows = []
    for path in directories(place, "run", "shaping"):
        try:
            found = open_directory(path)
            runs = [found] if isinstance(found, Run) else found.stages
            outlines = [found.outline] if isinstance(found, Run) else found.outlines
            count = _progress(runs, outlines)
            status, last = found.status, outlines[-1]
            task = last.task if isinstance(found, Run) else span(found.tasks)
            about = (task, last.method, last.preset, str(last.seed))
        except ConevoError as error:
            count, status, about = "", f"damaged: {error}", ("", "", "", "")
        names = ("run", "world", "method", "preset", "seed", "generations", "status")
        rows.append(dict(zip(names, map(str, (path, *about, count, status)), strict=True)))
    return rows


def _progress(runs: Sequence[Run], outlines: Sequence[Outline]) -> str:
    """Return the progress of a run, or of all stages of a shaping."""
    from conevo.runs.outline import budget_of

    done = [run.done() for run in runs]
    return progress(
        sum(generations for generations, _ in done),
        sum(outline.generations for outline in outlines),
        sum(evaluations for _, evaluations in done),
        budget_of(outlines),
    )


def _ranges(names: tuple[str, ...]) -> str:
    """Shorten "simple-1, simple-2, ... simple-10" to "simple-1..10"."""
    groups: dict[str, list[str]] = {}
    for name in names:
        kind, _, number = name.rpartition("-")
        groups.setdefault(kind, []).append(number)
    return ", ".join(
        f"{kind}-{numbers[0]}..{numbers[-1]}" if len(numbers) > 1 else f"{kind}-{numbers[0]}"
        for kind, numbers in groups.items()
    )
