"""``conevo report``: a campaign as pages, tables, figures and numbers."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["report"]


@click.command()
@click.argument("name", metavar="CAMPAIGN")
@click.option("--out", metavar="DIR", help="Output directory (default: report/ in the campaign).")
@click.option(
    "--foreign", "files", metavar="FILE.json", multiple=True,
    help="Results of another tool in marl-eval's form (BenchMARL: create_json), shown next to the "
    "campaign's own; may be repeated.",
)  # fmt: skip
@click.option(
    "--frames-are", "frames", metavar="team|robot",
    help="The unit of the steps in these files: of a team (BenchMARL), or of each robot.",
)  # fmt: skip
def report(name: str, out: str | None, files: tuple[str, ...], frames: str | None) -> None:
    """Write a self-contained page, LaTeX tables, PDF and SVG figures, and their numbers as CSV.

    It covers all finished runs and lists what is missing. A report that was edited by hand is not
    replaced.

    Try: conevo report rover-complex
    """
    import logging

    from conevo.cli.lookup import find_campaign, sealed
    from conevo.errors import EnvironmentFailure, UsageError
    from conevo.report.files import write_report
    from conevo.report.foreign import read_foreign

    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it caches fonts, or need not
    if bool(files) != (frames is not None):
        raise UsageError(
            "--foreign needs --frames-are team (BenchMARL) or robot: the unit of its steps"
            if files
            else "--frames-are is about files of --foreign: give both, or neither"
        )
    others = read_foreign([Path(file) for file in files], frames) if frames else []
    found = find_campaign(name)
    with sealed(found) as tables:
        try:
            place = Path(out) if out else found.paths.report
            page = write_report(found, place, tables, others)
        except EnvironmentFailure as error:
            advice = "" if out else "; choose another place with --out"
            raise EnvironmentFailure(f"{error}{advice}") from error
    click.echo(f"open in a browser: {page}")
