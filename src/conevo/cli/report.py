"""``conevo report``: a campaign as pages, tables, figures and numbers."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["report"]


@click.command()
@click.argument("name", metavar="CAMPAIGN")
@click.option("--out", metavar="DIR", help="Output directory (default: report/ in the campaign).")
def report(name: str, out: str | None) -> None:
    """Write a self-contained page, LaTeX tables, PDF and SVG figures, and their numbers as CSV.

    It covers all finished runs and lists what is missing. A report that was edited by hand is not
    replaced.

    Try: conevo report rover-complex
    """
    import logging

    from conevo.cli.lookup import find_campaign, sealed
    from conevo.errors import EnvironmentFailure
    from conevo.report.files import write_report

    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it caches fonts, or need not
    found = find_campaign(name)
    with sealed(found) as tables:
        try:
            page = write_report(found, Path(out) if out else found.paths.report, tables)
        except EnvironmentFailure as error:
            advice = "" if out else "; choose another place with --out"
            raise EnvironmentFailure(f"{error}{advice}") from error
    click.echo(f"open in a browser: {page}")
