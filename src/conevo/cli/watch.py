"""``conevo watch``: serve a page that follows runs live."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import click

from conevo.cli.browser import open_while_serving
from conevo.cli.run_to_end import device_option

__all__ = ["watch"]


@click.command()
@click.argument("what", metavar="[RUN|CAMPAIGN]", required=False)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    help="Port to serve on (default: any free port).",
)
@device_option
@click.option("--no-browser", is_flag=True, help="Print the page's address; do not open it.")
def watch(what: str | None, port: int, device: str | None, no_browser: bool) -> None:
    """Serve a page that follows RUN, CAMPAIGN, or everything in runs/ and campaigns/.

    Only this machine can reach it. It reads files and writes none; stop it with Ctrl-C.

    Try: conevo watch runs/first
    """
    from conevo.campaigns.campaign import CAMPAIGNS
    from conevo.cli.lookup import campaign_at, find
    from conevo.kernels.devices import device_here
    from conevo.runs.run import RUNS
    from conevo.watch.server import serve
    from conevo.watch.state import Watched

    if what is None:
        watched = Watched(folders=[RUNS, CAMPAIGNS])
    else:
        watched = Watched([(campaign_at(what) or find(what)).path])
    if device is not None:
        device_here(device)

    def on_ready(address: str) -> None:
        click.echo(f"{address}  (Ctrl-C stops this page; runs continue)")
        if not no_browser:
            open_while_serving(address)

    serve(watched, port, lambda label: _champion_page(*watched.champion(label), device), on_ready)


@lru_cache(maxsize=8)
def _champion_page(path: Path, generation: int, device: str | None) -> str:
    """Return the replay of a run's champion; a new ``generation`` makes a new one."""
    from conevo.replay.page import replay_page
    from conevo.replay.playback import playback_of
    from conevo.replay.recording import record
    from conevo.runs.run import Run

    return replay_page([playback_of(record(Run(path), device=device))])
