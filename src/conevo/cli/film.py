"""``conevo film``: an epoch of a run's team as a film."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from conevo.cli.epoch_options import epoch_options
from conevo.errors import UsageError

__all__ = ["film"]


@click.command()
@click.argument("what", metavar="RUN|FILE")
@epoch_options
@click.option("--gif", is_flag=True, help="A GIF, for pages and slides.")
@click.option("--mp4", is_flag=True, help="An MP4 (ffmpeg, or: pip install 'conevo[video]').")
@click.option("--out", metavar="FILE", help="Output file (default: a new one in replays/).")
@click.option(
    "--every", type=click.IntRange(1, 2**31 - 1), metavar="N", help="Iterations between two frames."
)
@click.option("--fps", type=click.IntRange(1, 100), help="Frames per second.")
@click.option("--size", type=click.IntRange(200, 2160), help="Side of a drawn world in pixels.")
@click.option(
    "--from", "first", type=click.IntRange(0, 2**31 - 1), metavar="T", help="First iteration."
)
@click.option(
    "--to", "last", type=click.IntRange(0, 2**31 - 1), metavar="T", help="Last iteration."
)
@click.option(
    "--poster",
    type=click.IntRange(0, 2**31 - 1),
    metavar="T",
    help="A picture (PNG) of iteration T instead of a film.",
)
@click.option("--colour", type=click.Choice(["action", "caste"]), default="action",
              show_default=True, help="Meaning of a robot's colour.")  # fmt: skip
def film(
    what: str,
    gif: bool,
    mp4: bool,
    out: str | None,
    every: int | None,
    fps: int | None,
    size: int | None,
    first: int | None,
    last: int | None,
    poster: int | None,
    colour: str,
    **which: Any,
) -> None:
    """Make a film of an epoch of RUN's fittest team, or of an epoch saved in FILE.

    It is an MP4 if ffmpeg is installed, else a GIF, unless an option selects another format.
    Existing films are never overwritten.

    Try: conevo film runs/first --gif
    """
    from conevo.cli.epoch_options import REPLAYS, bar, name_of, playbacks, trajectories
    from conevo.replay.film import SIZES, choose_format, frames_of, write_film, write_poster
    from conevo.replay.film_frame import Painter
    from conevo.runs.durable import refuse_file

    wanted = {"gif": gif, "mp4": mp4, "png": poster is not None}
    if sum(wanted.values()) > 1:
        raise UsageError("--gif, --mp4 and --poster are mutually exclusive: give one of them")
    kind = choose_format(out, next((name for name in wanted if wanted[name]), ""))
    if out:
        refuse_file(Path(out))
    seen = trajectories(what, **which)
    asked = {
        "from": first, "to": last, "every": every, "at": poster, "fps": fps, "size": size,
        "by": colour if colour != "action" else None,
    }  # fmt: skip
    name = "-".join([name_of(seen), *(f"{k}-{v}" for k, v in asked.items() if v is not None)])
    path = Path(out) if out else REPLAYS / f"{name}.{kind}"
    refuse_file(path)
    painter = Painter(playbacks(seen, what, which["beside"]), size or SIZES[kind], colour)
    if poster is not None:
        write_poster(painter, path, poster)
    else:
        frames = frames_of(seen[0].about["iterations"], kind, every, first, last)
        with bar(f"drawing {path.name}") as progress:
            write_film(painter, path, frames, fps, progress)
    click.echo(path)
