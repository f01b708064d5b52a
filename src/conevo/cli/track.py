"""``conevo track``: send a run's generations to TensorBoard, Weights & Biases or MLflow."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from conevo.errors import UsageError
from conevo.terms import counted, quoted

__all__ = ["track"]


@click.command()
@click.argument("what", metavar="RUN|CAMPAIGN")
@click.option(
    "--to", "name", required=True, metavar="TRACKER", help="tensorboard, wandb or mlflow."
)
@click.option("--follow", is_flag=True, help="Go on until all runs are finished.")
@click.option("--out", metavar="DIR", help="Output directory (default: tracks/).")
def track(what: str, name: str, follow: bool, out: str | None) -> None:
    """Send the generations of RUN, or of all runs of CAMPAIGN, to a tracker.

    Steps are team-steps. A run may be finished or running, and is only read. Sending it again
    continues or replaces its series, and never doubles it.

    Try: conevo track runs/first --to tensorboard
    """
    from conevo.cli.lookup import campaign_at, find
    from conevo.track.trackers import kind_named
    from conevo.track.tracking import TRACKS, Tracking

    def note(line: str) -> None:
        click.echo(line)
        sys.stdout.flush()

    kind = kind_named(name)
    path = (campaign_at(what) or find(what)).path
    tracking = Tracking(path, kind, Path(out) if out else TRACKS, note)
    try:
        tracking.follow() if follow else tracking.once()
    except KeyboardInterrupt:
        again = f"conevo track {quoted(path)} --to {kind.name}"
        done = counted(tracking.generations, "generation")
        click.echo(f"interrupted after {done}; send the rest with: {again}", err=True)
        sys.exit(130)
    if tracking.failed:
        raise UsageError(f"{counted(len(tracking.failed), 'run')} left out, see above")
    for one in tracking.see:
        click.echo(f"see: {one}")
    if not tracking.see:
        click.echo(f"{path} has no finished generation yet")
