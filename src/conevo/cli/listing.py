"""``conevo list``: worlds, methods and runs."""

from __future__ import annotations

import json
from pathlib import Path

import click

from conevo.errors import ConevoError, UsageError

__all__ = ["listing"]

Rows = list[dict[str, str]]


@click.command("list", short_help="List worlds, methods or runs.")
@click.argument("what", type=click.Choice(["worlds", "methods", "runs"]))
@click.argument("folder", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
def listing(what: str, folder: str | None, as_json: bool) -> None:
    """List worlds with their environments, methods, or the runs in FOLDER (default runs/)."""
    from conevo.cli.text import table

    if folder is not None and what != "runs":
        raise UsageError(f"'conevo list {what}' takes no folder")
    rows = _runs(folder) if what == "runs" else _worlds() if what == "worlds" else _methods()
    if as_json:
        click.echo(json.dumps(rows))
    elif rows:
        click.echo(table(list(rows[0]), [list(row.values()) for row in rows]))
    else:
        click.echo(f"no runs in {folder or 'runs'}/; begin with: conevo run rover/complex-1")


def _worlds() -> Rows:
    from conevo.worlds.registry import WORLDS

    return [
        {
            "world": entry.name,
            "environments": _ranges(entry.environments),
            "what": entry.summary,
            "source": entry.source,
        }
        for entry in WORLDS.values()
    ]


def _methods() -> Rows:
    from conevo.evolution.methods.registry import METHODS

    return [
        {"method": e.name, "title": e.title, "what": e.summary, "source": e.source}
        for e in METHODS.values()
    ]


def _runs(folder: str | None) -> Rows:
    from conevo.cli.find import directories, find
    from conevo.cli.stages import span
    from conevo.runs.run import RUNS, Run

    place = Path(folder) if folder else RUNS
    if folder and not place.is_dir():
        raise UsageError(f"{place} is no directory")
    rows = []
    for path in directories(place):
        try:
            found = find(str(path))
            runs = [found] if isinstance(found, Run) else found.stages
            configs = [found.config] if isinstance(found, Run) else found.configs
            done = sum(len(run.generations()) for run in runs)
            count = f"{done}/{sum(config.run.generations for config in configs)}"
            status, config = found.status, configs[-1]
            task = config.task if isinstance(found, Run) else span(found)
            about = (task, config.method, config.preset, str(config.run.seed))
        except ConevoError as error:
            count, status, about = "", f"damaged: {error}", ("", "", "", "")
        names = ("run", "world", "method", "preset", "seed", "generations", "status")
        rows.append(dict(zip(names, map(str, (path, *about, count, status)), strict=True)))
    return rows


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
