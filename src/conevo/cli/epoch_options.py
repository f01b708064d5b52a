"""Options of the commands that show a team: which epoch of which team, and the file's name."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conevo.cli.run_to_end import all_of, device_option, threads_option
from conevo.errors import UsageError

if TYPE_CHECKING:
    from conevo.playback.schema import Playback
    from conevo.replay.trajectory import Trajectory

__all__ = ["REPLAYS", "bar", "epoch_options", "name_of", "playbacks", "trajectories"]

REPLAYS = Path("replays")  # default folder of pages and films
epoch_options = all_of(
    click.option(
        "--beside", metavar="RUN|FILE", help="A second team, in the same scenario, side by side."
    ),
    click.option(
        "--generation", type=click.IntRange(0, 2**31 - 1), metavar="G",
        help="Show the fittest team of generation G (default: the champion).",
    ),
    click.option(
        "--beside-generation", type=click.IntRange(0, 2**31 - 1), metavar="G",
        help="The same for the second team, which may be of the same run.",
    ),
    click.option(
        "--epoch", type=click.IntRange(0, 2**31 - 1), metavar="K",
        help="Scenario of its testing phase, counted from 0 (default: 0).",
    ),
    threads_option,
    device_option,
)  # fmt: skip
"""Options that select an epoch of a team."""


def trajectories(
    what: str,
    beside: str | None,
    generation: int | None,
    beside_generation: int | None,
    epoch: int | None,
    **how: Any,
) -> list[Trajectory]:
    """Return the trajectory that the options select, or both of two teams.

    The arguments have the options' names; ``how`` are threads and device.

    Raises:
        UsageError: no such run or file, no team in it, or two of different tasks or scenarios.
    """
    if beside is None and beside_generation is not None:
        raise UsageError("--beside-generation needs --beside RUN")
    first = _trajectory(what, generation, epoch, None, how)
    if beside is None:
        return [first]
    second = _trajectory(beside, beside_generation, None, first, how)
    for key in ("task", "scenario", "params"):
        if first.about[key] != second.about[key]:
            raise UsageError(f"{what} and {beside} cannot be shown side by side: different {key}s")
    return [first, second]


def _trajectory(
    text: str,
    generation: int | None,
    epoch: int | None,
    like: Trajectory | None,
    how: dict[str, Any],
) -> Trajectory:
    from conevo.cli.lookup import find_run
    from conevo.replay.recording import record
    from conevo.replay.trajectory import Trajectory

    if Path(text).is_file():
        for name, value in (("generation", generation), ("epoch", epoch)):
            if value is not None:
                raise UsageError(f"--{name} {value}: {text} is a recorded epoch, not a run")
        return Trajectory.load(Path(text))
    run = find_run(text)
    with bar(f"evolving {run.path.name} again") as progress:
        return record(run, generation, epoch or 0, **how, like=like, progress=progress)


def playbacks(seen: list[Trajectory], *names: str | None) -> list[Playback]:
    """Return the playbacks of trajectories.

    Args:
        seen: one or two trajectories.
        names: their runs or files as typed.

    Raises:
        UsageError: one is damaged; the message contains its name.
    """
    from conevo.replay.playback import playback_of

    found = []
    for one, name in zip(seen, names, strict=False):
        try:
            found.append(playback_of(one))
        except UsageError as error:
            raise UsageError(f"{name}: {error}") from error
    return found


def name_of(seen: list[Trajectory]) -> str:
    """Return a file name, without its ending, that identifies these trajectories."""
    names = [
        f"{t.about['label']}-generation-{t.about['generation']}-epoch-{t.about['epoch']}"
        for t in seen
    ]
    name = "-beside-".join(re.sub(r"[^\w.-]+", "-", one).strip("-.") for one in names)
    return name[:200] or "epoch"  # the label of a file from elsewhere may be anything


@contextmanager
def bar(text: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a function that shows progress and the time left.

    It prints on stderr, only if that is a terminal, and nothing before its first call.
    """
    if not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    name = TextColumn("{task.description}", markup=False)  # a file name may contain brackets
    done_of_all = TextColumn("{task.completed}/{task.total}")
    console = Console(stderr=True)
    progress = Progress(
        name, BarColumn(), done_of_all, TimeRemainingColumn(), console=console, transient=True
    )

    def show(done: int, total: int) -> None:
        if not progress.tasks:
            progress.start()
            progress.add_task(text, total=total)
        progress.update(progress.tasks[0].id, completed=done, total=total)

    try:
        yield show
    finally:
        progress.stop()
