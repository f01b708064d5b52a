"""The display of a running run: live on a terminal, else a line or a JSON object per generation."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

from conevo.cli.format import bars, castes, favourites, neurons
from conevo.cli.run_text import heading_of, measures_text
from conevo.numbers import duration, number
from conevo.runs.progress import Pace
from conevo.runs.provenance import declared
from conevo.runs.run import Run
from conevo.terms import S_MEANS, SHARE_SCALE, counted
from conevo.typing import Record
from conevo.worlds.measures import Measure

__all__ = ["watching"]

PAUSE = 2.0  # seconds between two plain lines


@contextmanager
def watching(
    run: Run, style: str, stage: int = 0, n_stages: int = 0, before: int = 0
) -> Iterator[Callable[[Run, Record], None]]:
    """Yield a function that is called after each generation.

    Args:
        run: the run to show.
        style: "live", "plain", "verbose", "json" or "quiet".
        stage: the number of a shaping's stage, 0 for any other run.
        n_stages: number of stages of that shaping.
        before: number of generations in its previous stages.
    """
    heading = (f"stage {stage} of {n_stages}: " if stage else "") + heading_of(run)
    if style == "live":
        from rich.live import Live

        display = Display(run, heading)
        with Live(get_renderable=display.render, refresh_per_second=4):
            yield display.add
    elif style in ("plain", "verbose"):
        click.echo("\n".join([heading, str(run.path), *measures_text(run.provenance)]))
        yield Lines(run, pause=PAUSE if style == "plain" else 0.0).add
    else:

        def add(run: Run, record: Record) -> None:
            number, task = before + record["generation"], run.outline.task
            lead = {"number": number, "stage": stage, "task": task} if stage else {}
            click.echo(json.dumps(lead | record))

        yield add if style == "json" else lambda run, record: None


def place(pace: Pace) -> str:
    """Return the generation that a run has reached, and its budget if that will end it."""
    done, planned, budget = pace.done, pace.outline.generations, pace.outline.budget_evaluations
    if budget and done.evaluations / budget > done.generations / planned:
        return f"generation {done.generations}, {done.evaluations:,}/{budget:,} evaluations"
    return f"generation {done.generations}/{planned}"


class Lines:
    """Prints one line per generation, at most one every ``pause`` seconds, and always the first."""

    def __init__(self, run: Run, pause: float) -> None:
        self.pace, self.pause, self.next = Pace(run), pause, 0.0

    def add(self, run: Run, record: Record) -> None:
        """Print a generation, unless the last line is too recent."""
        self.pace.add(record)
        if time.monotonic() < self.next and record["generation"] + 1 < run.outline.generations:
            return
        self.next = time.monotonic() + self.pause
        measures = "  ".join(f"{k} {number(v)}" for k, v in record["performance"].items())
        click.echo(
            f"{place(self.pace)}  {measures}  "
            f"fitness best {number(record['best_fitness'])} mean {number(record['mean_fitness'])}  "
            f"S {number(record['specialization'])}  {castes(record['castes'])}  "
            f"{number(self.pace.rate)} evaluations/s  "
            f"{duration(self.pace.seconds_left)} left"
        )


class Display:
    """The live view on a terminal."""

    def __init__(self, run: Run, heading: str = "") -> None:
        self.run, self.heading, self.pace = run, heading or heading_of(run), Pace(run)
        self.records, self.started = self.pace.records, time.monotonic()
        self.measures = declared(run.provenance)

    def add(self, run: Run, record: Record) -> None:
        """Show a finished generation."""
        self.pace.add(record)

    def render(self) -> Any:
        """Return the view of this moment."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table

        bar = Table.grid()  # a bar by itself does not end its line
        bar.add_row(ProgressBar(total=1.0, completed=self.pace.share, width=60))
        grid = Table.grid(padding=(0, 2))
        for label, text in self._rows() if self.records else [("", "running the first generation")]:
            grid.add_row(f"[bold]{label}[/bold]", text)
        return Group(
            f"[bold]{self.heading}[/bold]\n{self.run.path}",
            bar,
            f"{place(self.pace)}, {duration(time.monotonic() - self.started)} so far, "
            f"{duration(self.pace.seconds_left)} left",
            grid,
        )

    def _rows(self) -> Iterator[tuple[str, str]]:
        last = self.records[-1]
        for name, value in last["performance"].items():
            measure = self.measures.get(name, Measure(name))
            series = [record["performance"][name] or 0.0 for record in self.records]
            best = f"best {number(measure.best(series))} ({measure.about})"
            yield name, f"{number(value):>8}  {bars(series, 40)}  {best}"
        yield (
            "fitness",
            f"best {number(last['best_fitness'])}, mean {number(last['mean_fitness'])}, "
            f"fittest team {number(last['team_fitness'])}",
        )
        yield "castes", castes(last["castes"])
        if "favourites" in last:  # runs of earlier versions have none
            liked = favourites(last["favourites"], last.get("favourite_share"))
            yield "settings", f"{liked}; {SHARE_SCALE}"
        yield "S", f"{number(last['specialization'])} (mean {S_MEANS})"
        if last["sst"] is not None or last["gst"] is not None:
            yield (
                "thresholds",
                f"SST {number(last['sst'])}, GST {number(last['gst'])}, "
                f"{counted(last['recombinations'], 'recombination')} between populations",
            )
        yield "neurons", neurons(last["n_hidden"])
        spent = f"{self.pace.done.evaluations:,} spent"
        yield "speed", f"{number(self.pace.rate)} team evaluations/s, {spent}"
        if last["n_nonfinite"]:
            yield "not finite", f"{counted(last['n_nonfinite'], 'score')}, ranked last"
