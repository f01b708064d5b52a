"""``conevo query``: SQL over the tables of a campaign."""

from __future__ import annotations

import csv
import json
import sys

import click

__all__ = ["query"]


@click.command()
@click.argument("arguments", metavar="[CAMPAIGN] SQL", nargs=-1, required=True)
@click.option("--csv", "as_csv", is_flag=True, help="Print comma-separated values.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per row.")
def query(arguments: tuple[str, ...], as_csv: bool, as_json: bool) -> None:
    """Query the finished runs of CAMPAIGN (default: the only one in campaigns/) with SQL.

    Tables: runs, measures, scores, champions, generations, castes, robots, actions, metrics,
    behaviours; "DESCRIBE runs" lists the columns of one. A query cannot change anything.

    Try: conevo query NAME "SELECT method, count(*) FROM runs GROUP BY ALL"
    """
    from conevo.campaigns.tables import Tables
    from conevo.cli.format import table
    from conevo.cli.lookup import find_campaign, only_campaign, sealed
    from conevo.errors import UsageError
    from conevo.numbers import finite

    if as_csv and as_json:
        raise UsageError("--csv and --json are mutually exclusive: give one of them")
    if len(arguments) > 2:
        raise UsageError('query takes a campaign and one SQL text: conevo query NAME "SELECT ..."')
    found = find_campaign(arguments[0]) if len(arguments) == 2 else only_campaign()
    with sealed(found) as folder, Tables(folder) as tables:
        columns, rows = tables.ask(arguments[-1])
    if as_json:
        for row in rows:
            values = [finite(value) if isinstance(value, float) else value for value in row]
            click.echo(json.dumps(dict(zip(columns, values, strict=True)), default=str))
    elif as_csv:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)
    else:
        texts = [["-" if value is None else _text(value) for value in row] for row in rows]
        click.echo(table(columns, texts))


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
