"""``conevo replay``: an epoch of a run's team as a page for the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from conevo.cli.browser import open_page
from conevo.cli.epoch_options import epoch_options

__all__ = ["replay"]


@click.command()
@click.argument("what", metavar="RUN|FILE")
@epoch_options
@click.option("--out", metavar="FILE", help="Output file (default: a new one in replays/).")
@click.option("--keep", metavar="FILE", help="Also save the recorded epoch (.npz).")
@click.option("--no-browser", is_flag=True, help="Print the page's path; do not open it.")
def replay(what: str, out: str | None, keep: str | None, no_browser: bool, **which: Any) -> None:
    """Record an epoch of RUN's fittest team and show it in the browser.

    RUN may be finished or running; FILE is an epoch saved with --keep. The page is one file that
    needs no network. Existing files are never overwritten.

    Try: conevo replay runs/first
    """
    from conevo.cli.epoch_options import REPLAYS, name_of, playbacks, trajectories
    from conevo.replay.page import replay_page
    from conevo.runs.durable import write_new

    seen = trajectories(what, **which)
    page = replay_page(playbacks(seen, what, which["beside"])).encode()
    path = Path(out) if out else REPLAYS / f"{name_of(seen)}.html"
    files = {path: page}
    if keep is not None:
        files[Path(keep)] = seen[0].to_bytes()
    write_new(files)
    click.echo(path)
    if not no_browser:
        open_page(path.resolve().as_uri())
