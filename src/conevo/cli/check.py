"""``conevo check``: whether a world meets the requirements of worlds."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from conevo.terms import counted

__all__ = ["check"]


@click.command()
@click.argument("world", metavar="FILE.py[:ENVIRONMENT]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
def check(world: str, as_json: bool) -> int:
    """Check the world in FILE.py, or one of the package, and print a line for each check.

    It checks parameters and their bounds, phases, fields, scenarios, sensors, outputs and counts;
    array indices, in a process of its own; whether robots visited in another order give the same
    bits; whether record equals evaluate; whether an epoch can be drawn; and the scores of random
    teams. Without an environment the first one is checked. The exit code is 2 if there is a
    problem, 3 if the machine failed.

    Try: conevo check examples/light.py
    """
    from conevo.worlds.checking import check as findings

    found = []
    for finding in findings(world):
        found.append(finding)
        if not as_json:
            click.echo(f"{finding.status:8} {finding.topic:13} {finding.text}")
    problems = sum(finding.status == "problem" for finding in found)
    if as_json:
        click.echo(json.dumps([asdict(finding) for finding in found]))
    else:
        click.echo(f"{counted(problems, 'problem') if problems else 'no problems'}")
    return 2 if problems else 0
